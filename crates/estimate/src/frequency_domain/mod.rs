//! Estimators that work line by line on the spectra of whole periods.
//!
//! [`FrequencyData`](mechid_spectra::FrequencyData) has the forces and motions at chosen
//! [`Lines`](mechid_spectra::Lines), from one record or from
//! [`RepeatedPeriods`](mechid_spectra::RepeatedPeriods), whose scatter shows the noise. There are
//! three estimators:
//!
//! | Estimator | Noise | Cost |
//! |---|---|---|
//! | [`equation_error`] | biases it | one small least-squares problem |
//! | [`instrumental_variables`] | no bias, but more scatter | two such problems |
//! | [`output_error`] | no bias, least scatter, valid intervals | some Gauss–Newton steps |
//!
//! ```
//! use mechid_model::ResponseQuantity;
//! use mechid_estimate::Unknowns;
//! use mechid_spectra::{Lines, Pooling, RepeatedPeriods};
//! use mechid_estimate::frequency_domain::output_error;
//! use mechid_signal::{NoiseLevel, Record, Sampling, noise};
//!
//! // Eight periods of 10 ẍ + 180 ẋ + 5000 x = F under five cosines, x measured with 1 % noise.
//! let period = Sampling::new(0.02, 64)?;
//! let whole = period.with_len(8 * 64)?;
//! let (mut force, mut x) = (vec![0.0; 512], vec![0.0; 512]);
//! for n in [1.0, 3.0, 5.0, 7.0, 9.0] {
//!     let w = n * period.omega0();
//!     let (re, im) = (5000.0 - 10.0 * w * w, 180.0 * w);
//!     for (k, t) in whole.times().enumerate() {
//!         let (sin, cos) = (w * t + n * n).sin_cos();
//!         force[k] += 50.0 * cos;
//!         x[k] += 50.0 * (re * cos + im * sin) / (re * re + im * im);
//!     }
//! }
//! let force = Record::from_channel(whole, force)?;
//! let x = noise::add_white(&Record::from_channel(whole, x)?, NoiseLevel::FractionOfRms(0.01), 1)?;
//!
//! let lines = Lines::new(period, [1, 3, 5, 7, 9])?;
//! let periods = RepeatedPeriods::new(&lines, &force, &x, ResponseQuantity::Displacement)?;
//! let data = periods.mean_with_noise(Pooling::Automatic)?;
//! let fit = output_error(&data, &Unknowns::unknown_mass(1)?)?;
//! let stiffness = fit.estimate.parameter("k")?;
//! assert!((stiffness.value - 5000.0).abs() < 4.0 * stiffness.standard_error);
//! assert!(stiffness.standard_error < 50.0);
//! # Ok::<(), mechid_estimate::EstimateError>(())
//! ```

mod changed_records;
mod delayed_force;
mod equation_error;
mod force_noise;
mod force_responses;
mod initial_estimates;
mod instrumental;
mod likelihood_ratio;
mod line;
mod line_block;
mod line_correlation;
mod misfit;
mod multi_start;
mod normal_equations;
mod output_error;
mod output_error_fit;
mod parts;
mod pulse_fit;
mod sampled_force;
mod search;
mod structural_damping;
mod unknown_noise;
mod weight_uncertainty;
mod whitened;

pub use changed_records::ChangedRecords;
pub use delayed_force::DelayedForce;
pub use equation_error::{equation_error, equation_rows};
pub use force_noise::{force_noise_factor, force_noise_of_residual};
pub use instrumental::instrumental_variables;
pub use likelihood_ratio::{LikelihoodRatio, likelihood_ratio};
pub use multi_start::thin_step;
pub use output_error::in_units_of_noise;
pub use output_error::{
    Refit, output_error, output_error_from, output_error_near, output_error_of_table,
    output_error_pooling, with_noise_of,
};
pub use output_error_fit::{EndLoads, OutputErrorFit};
pub use parts::{
    Difference, OmittedTerm, OmittedTerms, Part, PartsComparison, PartsOfFit, Power, SampledRows,
    Split,
};
pub(crate) use parts::{Level, Scores, equal_bands};
pub use sampled_force::equivalent_force;
pub use structural_damping::{StructuralDamping, structural_damping};
pub use whitened::Whitened;
pub(crate) use whitened::orthonormal;
