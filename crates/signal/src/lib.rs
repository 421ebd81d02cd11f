//! Sampling, records, spectra and test excitations for vibration measurement.
//!
//! ```
//! use mechid_signal::{CrestSearch, Multisine, NoiseLevel, Phases, Sampling, Spectrum};
//! use mechid_signal::{lines, measures, noise};
//!
//! // One second at 1 kHz: odd lines up to 200 Hz, as much force as a 100 N shaker allows.
//! let sampling = Sampling::from_rate_hz(1000.0, 1000)?;
//! let schroeder = Multisine::flat(lines::odd(200), 1.0, Phases::Schroeder)?.with_peak(100.0)?;
//! let searched = CrestSearch { starts: 4, seed: 1 }.minimise(&schroeder)?.with_peak(100.0)?;
//! assert!(searched.rms() > 1.15 * schroeder.rms());
//!
//! // What is sampled is what was asked for, line by line.
//! let force = searched.sample(sampling)?;
//! let spectrum = Spectrum::from_record(&force);
//! assert!((spectrum.line(199, 0).norm() - searched.amplitudes()[99]).abs() < 1e-12);
//! assert_eq!(measures::persistent_excitation_order(&spectrum, 0, 1e-9)?, 200);
//!
//! // A sensor adds noise 40 dB below.
//! let measured = noise::add_white(&force, NoiseLevel::SnrDb(40.0), 7)?;
//! let error = measures::rms((measured.data() - force.data()).as_slice());
//! assert!((error / searched.rms() - 0.01).abs() < 0.001);
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```
//!
//! Sampled signals are [`Record`]s on a [`Sampling`]; their complex amplitudes are a [`Spectrum`],
//! whose scaling is defined once, in [`spectrum`].
//!
//! | Wanted | Where |
//! |---|---|
//! | a multisine: lines, phases, level | [`Multisine`], [`lines`], [`Phases`] |
//! | phases of least crest factor | [`CrestSearch`] |
//! | uncorrelated inputs | [`multi_input`] |
//! | impact, noise, sweep, binary sequence | [`excitation`] |
//! | crest factor, flatness, order of excitation | [`measures`] |
//! | mean, level and extremes of samples that arrive in blocks | [`RunningStatistics`] |
//! | the period of a record that repeats | [`repetition()`] |
//! | the level at which a channel is clipped | [`clipping()`] |
//! | the steps of the values of a channel | [`quantisation_step()`] |
//! | the hits of a hammer, good and bad | [`hits()`] |
//! | disturbances at a stated level | [`noise`] |
//! | values between samples | [`resample`] |
//! | transforms planned once for many records | [`transform`] |
//! | weights of the samples of a segment | [`Window`] |
//! | numbers and counts in sentences | [`message`] |

mod clipping;
pub mod correlation;
pub mod crest;
mod driven;
mod error;
pub mod excitation;
mod extent;
mod floor;
mod hits;
mod limits;
pub mod lines;
pub mod measures;
pub mod message;
pub mod multi_input;
mod multisine;
pub mod noise;
pub mod phases;
mod quantisation;
mod record;
mod repetition;
pub mod resample;
mod sampling;
pub mod spectrum;
mod statistics;
pub mod transform;
mod window;

pub use clipping::{Clipping, clipping};
pub use crest::CrestSearch;
pub use driven::driven_lines;
pub use error::SignalError;
pub use extent::Extent;
pub use floor::noise_above_band;
pub use hits::{Hit, HitFault, HitRule, Hits, hits};
pub use multisine::Multisine;
pub use noise::NoiseLevel;
pub use phases::Phases;
pub use quantisation::quantisation_step;
pub use record::Record;
pub use repetition::{Repetition, repetition};
pub use resample::{Interpolation, Interpolator};
pub use sampling::Sampling;
pub use spectrum::Spectrum;
pub use statistics::RunningStatistics;
pub use window::Window;
