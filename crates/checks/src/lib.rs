//! Checks of the data before a fit and of the residual after it.
//!
//! Every check returns [`Finding`]s: values with named numbers, a [`Verdict`], a [`Subject`] and,
//! from a statistical test, a p-value. Their [`Display`](std::fmt::Display) is one sentence. The
//! limits of the verdicts are in [`limits`].
//!
//! ```
//! use mechid_checks::{Verdict, periodicity};
//! use mechid_signal::{Record, Sampling};
//!
//! // A parabola is not a whole period.
//! let sampling = Sampling::new(0.01, 100)?;
//! let parabola = sampling.times().map(|t| t * t).collect();
//! let finding = periodicity(&Record::from_channel(sampling, parabola)?);
//! assert_eq!(finding.verdict(), Verdict::Bad);
//! println!("{finding}");
//! # Ok::<(), mechid_signal::SignalError>(())
//! ```

mod acquisition;
mod after;
mod alternative;
mod before;
mod bias;
mod clipping;
mod coherence;
mod concentration;
mod conditioning;
mod constant_channel;
mod constant_phase;
mod cross_correlation;
mod delay;
mod digits;
mod distortion;
mod drop_out;
mod excited_lines;
mod finding;
mod fluid_inertia;
mod gain;
mod highest_mode;
mod holm_adjustment;
mod instability;
mod kinematics;
mod leakage;
pub mod limits;
mod line_correlation;
mod linearity;
mod machine;
mod mass;
mod misfit;
mod no_logarithm;
mod omitted;
mod open_fit;
mod p_value;
mod parts;
mod period;
mod period_scatter;
mod persistent_excitation;
mod power;
mod prior;
mod quantisation;
mod regressors;
mod repeated_channel;
mod response_residual;
mod seam;
mod search;
mod sensor_delay;
mod serialised;
mod spectral;
mod spectral_residual;
mod spike;
mod symmetry;
mod time_limit;
mod unequal_periods;
mod unit;
mod unmeasured_force;
mod unrelated;
mod weighted_fit;
mod whiteness;
mod work_limit;

use std::fmt;

pub use acquisition::{fault_of_acquisition, fault_of_hits, forces_between_samples};
pub use after::after_fit;
pub use alternative::{Alternative, Cause, ModelledResponses, better_model};
pub use before::{before_equation_of_motion, before_fit};
pub use bias::{Bias, Reference};
pub use clipping::{Clipping, clipped_channels};
pub use coherence::{Coherence, coherence};
pub use conditioning::Conditioning;
pub use constant_channel::{ConstantChannel, constant_channels};
pub use constant_phase::{ConstantPhase, constant_phase};
pub use cross_correlation::CrossCorrelation;
pub use delay::Delay;
pub use delay::{
    delay_at_samples, delay_between_samples, delay_of_failed_search, delay_of_lines,
    delay_of_open_records, delay_of_responses,
};
pub use distortion::Distortion;
pub use distortion::distortion_of_periods;
pub use drop_out::{DropOut, dropped_channels};
pub use excited_lines::ExcitedLines;
pub use finding::{Channel, Finding, Quantity};
pub use fluid_inertia::{FluidInertia, fluid_inertia};
pub use gain::{Gain, gain_symmetry};
pub use highest_mode::{HighestMode, ModeLimit, fitted_band, fitted_step};
pub use holm_adjustment::adjust_p_values;
pub use instability::Instability;
pub use instability::instability;
pub use kinematics::Kinematics;
pub use kinematics::kinematics;
pub use leakage::Leakage;
pub use leakage::leakage;
pub use linearity::Linearity;
pub use linearity::{linearity, linearity_of_open_record};
pub use machine::{after_machine_fit, whiteness_of_lines};
pub use mass::NegativeMass;
pub use mass::negative_mass;
pub use mechid_estimate::frequency_domain::{OmittedTerm, Power};
pub use misfit::{Concentration, Misfit, NoiseSource};
pub use no_logarithm::NoLogarithm;
pub use omitted::{ChangeByTerm, NamedChange, NonlinearTermsLeftOut, TermLeftOut, omitted_term};
pub use p_value::{CorrelationTest, PValue};
pub use parts::{DataPart, PartsAgreement, RowParts, agreement_of_parts};
pub use period::claimed_period;
pub use period::{PeriodFault, WrongPeriod};
pub use period_scatter::PeriodScatter;
pub use persistent_excitation::PersistentExcitation;
pub use power::PowerFlow;
pub use power::power;
pub use prior::PriorAgreement;
pub use quantisation::{Quantisation, quantised_channels};
pub use regressors::noise_on_response;
pub use repeated_channel::{RepeatedChannel, repeated_channels};
pub use response_residual::{after_response_fit, after_table_fit};
pub use seam::{Seam, periodicity, periodicity_across};
pub use search::SearchAgreement;
pub use sensor_delay::{SensorDelay, delay_of_sensors};
pub use spectral::{before_spectral_fit, steady_periods};
pub use spectral_residual::{SpectralResidual, is_noise};
pub use spike::{Spike, spiked_channels};
pub use symmetry::{MassSymmetry, mass_symmetry};
pub use time_limit::TimeLimit;
pub use unequal_periods::UnequalPeriods;
pub use unit::{TimeUnit, Unit};
pub use unmeasured_force::UnmeasuredForce;
pub use unrelated::{Unrelated, unrelated_response};
pub use weighted_fit::{AfterSpectralFit, after_spectral_fit, log_residual_power};
pub use whiteness::{NoiseSpan, Residual, Whiteness};
pub use work_limit::WorkLimit;

/// Maximum number of samples used by a check that takes much time or memory per sample.
const MAX_SAMPLES: usize = 1 << 15;

/// Degree to which a finding speaks against the data or the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Verdict {
    /// No objection.
    Good,
    /// The fit is possible; the numbers show its reliability.
    Doubtful,
    /// The fit will fail or mislead.
    Bad,
}

impl Verdict {
    /// Returns the verdict on a value: good below `doubtful`, bad at `bad` or above.
    fn graded(value: f64, doubtful: f64, bad: f64) -> Self {
        match value {
            v if v < doubtful => Self::Good,
            v if v < bad => Self::Doubtful,
            _ => Self::Bad,
        }
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Verdict::Good => "good",
            Verdict::Doubtful => "doubtful",
            Verdict::Bad => "bad",
        })
    }
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
    /// Channels that are clipped, constant, repeated, coarsely quantised, or have a spike.
    Range,
    /// Consistency of displacement, velocity and acceleration.
    Kinematics,
    /// Power that the forces put into the machine.
    Power,
    /// Whole periods of a steady state.
    Periodicity,
    /// Sampling interval, compared with the highest mode and the discretisation.
    Step,
    /// Coherence of force and response.
    Coherence,
    /// Width of the resonances, compared with the line spacing of the segments.
    Leakage,
    /// Delay between force and response.
    Delay,
    /// Alternative model that explains the residual of the fit.
    Alternative,
    /// Bias of the estimate by noise on the response.
    Bias,
    /// Free responses of the identified system that grow.
    Instability,
    /// Sign of the masses.
    Mass,
    /// Symmetry of the mass matrix.
    Symmetry,
    /// Residual power, compared with the noise.
    Misfit,
    /// Agreement between parts of the data.
    Parts,
    /// Agreement of priors and data.
    Prior,
    /// Searches from several initial values.
    Search,
    /// Correlation of the residual with powers of displacement and velocity.
    Linearity,
    /// Whiteness of the residual.
    Whiteness,
    /// Correlation of the residual with the force.
    CrossCorrelation,
}

impl fmt::Display for Subject {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Subject::Excitation => "excitation",
            Subject::Unit => "unit",
            Subject::Conditioning => "conditioning",
            Subject::Range => "range",
            Subject::Kinematics => "kinematics",
            Subject::Power => "power",
            Subject::Periodicity => "periodicity",
            Subject::Step => "step",
            Subject::Coherence => "coherence",
            Subject::Leakage => "leakage",
            Subject::Delay => "delay",
            Subject::Alternative => "alternative",
            Subject::Bias => "bias",
            Subject::Instability => "instability",
            Subject::Mass => "mass",
            Subject::Symmetry => "symmetry",
            Subject::Misfit => "misfit",
            Subject::Parts => "parts",
            Subject::Prior => "prior",
            Subject::Search => "search",
            Subject::Linearity => "linearity",
            Subject::Whiteness => "whiteness",
            Subject::CrossCorrelation => "cross-correlation",
        })
    }
}
