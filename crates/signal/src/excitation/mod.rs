//! The excitations of a vibration test other than the [`Multisine`](crate::Multisine).
//!
//! | Excitation | Type | Use |
//! |---|---|---|
//! | one frequency | [`Harmonic`] | stepped sine, the receptance at one line |
//! | hammer | [`HalfSine`], [`Impulse`] | impact tests, impulse responses |
//! | noise | [`Random`] | white, band-limited, burst |
//! | swept sine | [`Sweep`] | linear and logarithmic, ramped ends |
//! | binary noise | [`Prbs`] | maximum-length sequences, crest factor 1 |
//!
//! Each has a constructor that checks its numbers and a method `sample`; functions of time also
//! have a `value` at any t, for integrators that need the force between samples.
//!
//! ```
//! use mechid_signal::{Sampling, excitation::{Sweep, SweepLaw}};
//!
//! // 5 to 200 Hz in four seconds, 100 N, ends ramped over 50 ms.
//! let sweep = Sweep::new(100.0, 5.0, 200.0, 4.0, SweepLaw::Logarithmic)?.with_ramps(0.05)?;
//! let force = sweep.sample(Sampling::from_rate_hz(1000.0, 5000)?)?;
//! assert!(force.column(0).amax() <= 100.0);
//! assert_eq!(force.channel(0)[4500], 0.0);
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```

mod harmonic;
mod impact;
mod prbs;
mod random;
mod sweep;

pub use harmonic::Harmonic;
pub use impact::{HalfSine, Impulse};
pub use prbs::Prbs;
pub use random::Random;
pub use sweep::{Sweep, SweepLaw};
