//! Sampling, records, spectra and test excitations for vibration measurement.
//!
//! Everything in `mechid` that has a time axis is a [`Record`] on a [`Sampling`],
//! and everything that has a frequency axis is a [`Spectrum`], whose scaling is
//! stated once, in [`spectrum`].
//!
//! ```
//! use mechid_signal::{Record, Sampling, Spectrum};
//!
//! // One period of 3 cos(2·ω0·t), eight samples.
//! let sampling = Sampling::new(0.5, 8)?;
//! let force: Vec<f64> = sampling.times().map(|t| 3.0 * (2.0 * sampling.omega0() * t).cos()).collect();
//! let spectrum = Spectrum::of(&Record::from_channel(sampling, force)?);
//! assert!((spectrum.line(2, 0).re - 3.0).abs() < 1e-14);
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```

pub mod crest;
mod error;
pub mod excitation;
pub mod lines;
pub mod measures;
pub mod multi_input;
mod multisine;
pub mod noise;
pub mod phases;
mod record;
pub mod resample;
mod sampling;
pub mod spectrum;

pub use crest::CrestSearch;
pub use error::SignalError;
pub use multisine::Multisine;
pub use noise::NoiseLevel;
pub use phases::Phases;
pub use record::Record;
pub use resample::{Interpolation, Interpolator};
pub use sampling::Sampling;
pub use spectrum::Spectrum;
