//! Spectral lines of measured inputs and outputs: the data of all frequency-domain estimators.
//!
//! | Content | Module |
//! |---|---|
//! | inputs and outputs line by line, for any number of sensors and forces | [`line_data`] |
//! | forces and displacements of every degree of freedom | [`FrequencyData`] |
//! | chosen lines, with the transform prepared once | [`Lines`] |
//! | repeated periods, whose scatter determines the noise | [`RepeatedPeriods`] |
//! | the transient of an open record | [`transient`] |
//! | sinusoids of unknown frequency | [`sinusoids`] |
//! | noise: spectrum, pooling, smooth spectra, level, pulses | [`noise`] |
//! | frequency responses and coherence from averages | [`frf`] |
//!
//! ```
//! use mechid_signal::{Record, Sampling};
//! use mechid_spectra::Lines;
//!
//! // cos(3 ω₀ t) has the amplitude 1 on line 3.
//! let sampling = Sampling::new(0.01, 64)?;
//! let samples = sampling.times().map(|t| (3.0 * sampling.omega0() * t).cos()).collect();
//! let record = Record::from_channel(sampling, samples)?;
//! let amplitudes = Lines::new(sampling, [2, 3])?.read(&record)?;
//! assert!((amplitudes[(1, 0)].re - 1.0).abs() < 1e-12 && amplitudes[(0, 0)].norm() < 1e-12);
//! # Ok::<(), mechid_spectra::SpectraError>(())
//! ```

mod error;
pub mod frequency_data;
pub mod frf;
mod limits;
pub mod line_data;
mod line_noise;
mod lines;
pub mod noise;
pub mod open_record;
mod periods;
pub mod sinusoids;
pub mod thinning;
pub mod transient;

pub use error::SpectraError;
pub use frequency_data::FrequencyData;
pub use line_data::{LineData, Transient};
pub use line_noise::LineNoise;
pub use lines::{Lines, check_sampling};
pub use noise::pooling::{NoiseModel, Pooling};
pub use noise::spectrum::NoiseSpectrum;
pub use periods::RepeatedPeriods;
pub use sinusoids::Sinusoid;
