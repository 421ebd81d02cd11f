//! Results of the checks as values: one struct per check, in the file of that check.
//!
//! Ratios, fractions, coherences, correlations, probabilities and numbers of samples are
//! dimensionless; so are eigenvalues of a transition. Fields with the unit of a channel or of a
//! parameter (N, m, m/s, m/s², kg, N·s/m, N/m) state it.

use std::fmt::{self, Display, Formatter};

use mechid_model::ResponseQuantity;

use super::p_value::PValue;
use super::{Subject, Verdict};

/// Common interface of the findings of all checks.
pub(crate) trait Check {
    /// Returns the subject of the check.
    fn subject(&self) -> Subject;

    /// Returns the verdict on the data or the fit.
    fn verdict(&self) -> Verdict;

    /// Returns the number that decides the verdict, in the unit of the field that has this number.
    fn value(&self) -> f64;

    /// Returns the p-value of a statistical test, to adjust it.
    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        None
    }

    /// Writes one sentence.
    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result;
}

/// Declares the findings: one variant for each check. The variant contains the struct of the same
/// name from the file of the check.
macro_rules! findings {
    ($($(#[$doc:meta])* $name:ident in $file:ident,)*) => {
        /// Result of one check, with its numbers; [`Display`](std::fmt::Display) gives one
        /// sentence.
        ///
        /// Channels, forces and degrees of freedom are counted from 0 in the fields, and from 1 in
        /// sentences and in serialised findings.
        #[derive(Debug, Clone, PartialEq)]
        #[cfg_attr(
            feature = "serde",
            derive(serde::Serialize),
            serde(tag = "kind", rename_all = "snake_case")
        )]
        #[non_exhaustive]
        pub enum Finding {
            $($(#[$doc])* $name(super::$file::$name),)*
        }

        impl Finding {
            fn check(&self) -> &dyn Check {
                match self {
                    $(Self::$name(check) => check,)*
                }
            }

            fn check_mut(&mut self) -> &mut dyn Check {
                match self {
                    $(Self::$name(check) => check,)*
                }
            }
        }
    };
}

findings! {
    /// Order of persistent excitation of a force, compared with the order that the unknowns need.
    PersistentExcitation in persistent_excitation,
    /// Number of lines with force, compared with the unknowns of an equation of motion.
    ExcitedLines in excited_lines,
    /// Condition number of the regressors.
    Conditioning in conditioning,
    /// Curvature of the response from the last sample of a period to the first.
    Seam in seam,
    /// Deviation of single periods of the response from their mean.
    PeriodScatter in period_scatter,
    /// The force differs from period to period, and so does the response.
    UnequalPeriods in unequal_periods,
    /// The force does not repeat after the claimed period.
    WrongPeriod in period,
    /// Samples per period of the highest mode.
    HighestMode in highest_mode,
    /// The transition from sample to sample has no real logarithm: the step is too long for a mode.
    NoLogarithm in no_logarithm,
    /// Multiple coherence of the responses over the lines.
    Coherence in coherence,
    /// Width of the narrowest resonance, in lines of the segments that were averaged.
    Leakage in leakage,
    /// Text in the header of a column that may be a unit.
    Unit in unit,
    /// Time column without a unit, whose numbers are probably not in seconds.
    TimeUnit in unit,
    /// An amplifier or a converter has clipped a channel.
    Clipping in clipping,
    /// A channel has the same value in all samples.
    ConstantChannel in constant_channel,
    /// A channel has the value of another channel in every sample.
    RepeatedChannel in repeated_channel,
    /// Every value of a frequency response is real and positive.
    ConstantPhase in constant_phase,
    /// A channel has only a few equally spaced values.
    Quantisation in quantisation,
    /// One sample of a channel is far outside its neighbours.
    Spike in spike,
    /// A channel keeps one value for some samples, but changes before and after them.
    DropOut in drop_out,
    /// Two measured response quantities of one degree of freedom are not derivatives of each other.
    Kinematics in kinematics,
    /// The forces extract power from the system.
    PowerFlow in power,
    /// Force and response are shifted in time.
    Delay in delay,
    /// Alternative model that explains the residual of the fit.
    Alternative in alternative,
    /// Difference between an estimate and another estimate that noise on the response does not
    /// bias.
    Bias in bias,
    /// A free response of the identified system grows.
    Instability in instability,
    /// Difference of two mirrored entries of M; the mass matrix of a kinetic energy is symmetric.
    MassSymmetry in symmetry,
    /// Inertia of the fluid in a bearing whose reported coefficients do not include it.
    FluidInertia in fluid_inertia,
    /// Negative mass.
    NegativeMass in mass,
    /// Damping and stiffness that are symmetric except for one factor between two degrees of
    /// freedom; a wrong gain has this effect.
    Gain in gain,
    /// Residual power compared with the noise power.
    Misfit in misfit,
    /// Term that the model omits and that the residual indicates.
    TermLeftOut in omitted,
    /// Nonlinear terms that are missing from a fit with other nonlinear terms.
    NonlinearTermsLeftOut in omitted,
    /// Agreement between parts of the data.
    PartsAgreement in parts,
    /// Agreement of the prior of a parameter with its estimate from the data.
    PriorAgreement in prior,
    /// Delay between the inputs and the sensors of a machine.
    SensorDelay in sensor_delay,
    /// Number of searches that ended at the highest likelihood.
    SearchAgreement in search,
    /// A search that the time limit has ended before it reached a minimum.
    TimeLimit in time_limit,
    /// A search that the limit of the work has ended before it reached a minimum.
    WorkLimit in work_limit,
    /// Residual of a fit that is attributed to unmeasured forces.
    UnmeasuredForce in unmeasured_force,
    /// The response does not follow the force.
    Unrelated in unrelated,
    /// Correlation of a residual with a power of displacement or velocity, applied as a force.
    Linearity in linearity,
    /// Nonlinear term that explains most of the residual of a linear model in whole periods.
    Distortion in distortion,
    /// Autocorrelation of a residual.
    Whiteness in whiteness,
    /// Correlation of a residual with a force.
    CrossCorrelation in cross_correlation,
}

impl Finding {
    /// Returns the subject of the check.
    pub fn subject(&self) -> Subject {
        self.check().subject()
    }

    /// Returns the verdict on the data or the fit.
    pub fn verdict(&self) -> Verdict {
        self.check().verdict()
    }

    /// Returns the number that decides the verdict, in the unit of the field that has this number.
    pub fn value(&self) -> f64 {
        self.check().value()
    }

    /// Returns the p-value of a statistical test; `None` for other checks, and if the residual is
    /// only rounding.
    pub fn p_value(&self) -> Option<PValue> {
        self.clone().p_value_mut().copied()
    }

    /// Returns the p-value of [`Finding::p_value`], to adjust it.
    pub(crate) fn p_value_mut(&mut self) -> Option<&mut PValue> {
        self.check_mut().p_value_mut()
    }

    /// Removes the list of the lines with most of the misfit (`concentration`) from the finding.
    /// Use this function if another cause explains the misfit.
    pub fn forget_lines(&mut self) {
        if let Self::Misfit(misfit) = self {
            misfit.concentration = None;
        }
    }

    /// Returns the finding as a sentence with channel names from `name`.
    pub fn sentence<'a>(&'a self, name: &'a dyn Fn(Channel) -> String) -> impl Display + 'a {
        Sentence { finding: self, names: Names { name } }
    }
}

impl Display for Finding {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.sentence(&|channel| channel.to_string()).fmt(f)
    }
}

/// Finding with names of its channels.
struct Sentence<'a> {
    finding: &'a Finding,
    names: Names<'a>,
}

impl Display for Sentence<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.finding.check().sentence(&self.names, f)
    }
}

/// Names of channels.
pub(crate) struct Names<'a> {
    name: &'a dyn Fn(Channel) -> String,
}

impl Names<'_> {
    /// Returns the name of a channel.
    pub(crate) fn channel(&self, channel: Channel) -> String {
        (self.name)(channel)
    }

    /// Returns the name of a force, counted from 0.
    pub(crate) fn force(&self, index: usize) -> String {
        (self.name)(Channel { quantity: Quantity::Force, index })
    }

    /// Returns the name of a response, counted from 0.
    pub(crate) fn response(&self, kind: ResponseQuantity, index: usize) -> String {
        (self.name)(Channel { quantity: Quantity::Response(kind), index })
    }
}

/// Measured channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Channel {
    /// Quantity measured.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::as_text"))]
    pub quantity: Quantity,
    /// Index of the channel among the channels of `quantity`.
    #[cfg_attr(
        feature = "serde",
        serde(rename = "channel", serialize_with = "crate::serialised::from_one")
    )]
    pub index: usize,
}

/// Quantity that a channel measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Force, in N.
    Force,
    /// A response quantity.
    Response(ResponseQuantity),
}

impl Display for Quantity {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        match self {
            Quantity::Force => f.write_str("force"),
            Quantity::Response(motion) => motion.fmt(f),
        }
    }
}

impl Display for Channel {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.quantity, self.index + 1)
    }
}
