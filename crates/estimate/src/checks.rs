//! Checks of the data before a fit and of the residual after it.
//!
//! Every check returns [`Finding`]s: values with named numbers, a [`Verdict`], a [`Subject`] and, from
//! a statistical test, a p-value. Their [`Display`](std::fmt::Display) is one sentence. The limits
//! that decide a verdict are in [`thresholds`].

mod after;
mod before;
mod concentration;
mod correlation;
mod delay;
mod distortion;
mod family;
mod finding;
mod instability;
mod kinematics;
mod leakage;
mod linearity;
mod mass;
mod period;
mod power;
mod range;
mod regressors;
mod response_residual;
mod sentences;
mod spectral;
mod spectral_residual;
mod symmetry;
pub mod thresholds;
mod verdict;
mod weighted_fit;

pub use after::after_fit;
pub use before::{before_equation_of_motion, before_fit, periodicity, periodicity_across};
pub use correlation::{Correlation, cross_correlation, whiteness, whiteness_beyond};
pub use delay::{delay_at_samples, delay_between_samples, delay_of_lines, delay_of_open_records};
pub use distortion::distortion_of_periods;
pub use family::adjust_p_values;
pub use finding::{
    Channel, Concentration, CorrelationTest, Finding, ModeLimit, NoiseSource, NoiseSpan, PValue,
    PeriodFault, Power, Quantity, Reference, Residual,
};
pub use instability::instability;
pub use kinematics::kinematics;
pub use leakage::leakage;
pub use linearity::{linearity, linearity_of_open_record};
pub use mass::negative_mass;
pub use period::claimed_period;
pub use power::power;
pub use range::{clipped_channels, constant_channels, quantised_channels, spiked_channels};
pub use regressors::noise_on_response;
pub use response_residual::after_response_fit;
pub use spectral::{before_spectral_fit, coherence, fitted_band, fitted_step, steady_periods};
pub use spectral_residual::SpectralResidual;
pub use symmetry::{gain_symmetry, mass_symmetry};
pub use weighted_fit::{AfterSpectralFit, after_spectral_fit};

/// Maximum number of samples used by a check that takes much time or memory per sample.
const MAX_SAMPLES: usize = 1 << 15;

/// Degree to which a finding speaks against the data or the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Verdict {
    /// The finding does not speak against them.
    Good,
    /// The fit can be done; the numbers tell how far to trust it.
    Doubtful,
    /// The fit will fail or mislead.
    Bad,
}

/// Subject of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Subject {
    /// Excitation of enough lines for the unknowns.
    Excitation,
    /// Units of the columns.
    Unit,
    /// Conditioning of the regressors.
    Conditioning,
    /// Channels that are clipped, constant, coarsely quantised, or hold a spike.
    Range,
    /// Consistency of displacement, velocity and acceleration.
    Kinematics,
    /// Power that the forces put into the machine.
    Power,
    /// Whole periods of a steady state.
    Periodicity,
    /// Sampling step against the highest mode and the discretisation.
    Step,
    /// Coherence of force and response.
    Coherence,
    /// Width of the resonances against the lines of the segments.
    Leakage,
    /// Delay between force and response.
    Delay,
    /// Bias of the estimate by noise on the response.
    Bias,
    /// Free responses of the identified system that grow.
    Instability,
    /// Sign of the masses.
    Mass,
    /// Symmetry of the mass matrix.
    Symmetry,
    /// Residual power against the noise.
    Misfit,
    /// Residual against powers of the displacement.
    Linearity,
    /// Whiteness of the residual.
    Whiteness,
    /// Correlation of the residual with the force.
    CrossCorrelation,
}
