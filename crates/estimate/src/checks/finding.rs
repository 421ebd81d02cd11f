//! Results of the checks as values.
//!
//! Ratios, fractions, coherences, correlations, probabilities and numbers of samples are dimensionless;
//! an eigenvalue of a transition is, too. What has the unit of a channel or of a parameter (N, m, m/s,
//! m/s², kg, N·s/m, N/m) says so.

use mechid_model::{Parameter, ResponseQuantity};

use super::Subject;
use super::thresholds::SIGNIFICANCE;

/// Result of one check, with its numbers; [`Display`](std::fmt::Display) gives one sentence.
///
/// Channels, forces and degrees of freedom are counted from 0; in sentences and serialised from 1.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "kind", rename_all = "snake_case")
)]
#[non_exhaustive]
pub enum Finding {
    /// Order of persistent excitation of a force, against the order that the unknowns need.
    PersistentExcitation {
        /// Channel of the force.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        force: usize,
        /// Order of persistent excitation; 0 for a channel of zeros.
        order: usize,
        /// Order needed.
        needed: usize,
    },
    /// Number of lines that carry force, against the unknowns of an equation of motion.
    ExcitedLines {
        /// Number of lines with force; each makes two real equations.
        lines: usize,
        /// Number of unknowns in the equation of motion that has most.
        unknowns: usize,
    },
    /// Condition number of the regressors.
    Conditioning {
        /// Condition number with columns scaled to unit length.
        condition_number: f64,
        /// Number of combinations of regressors that do not vary.
        undetermined: usize,
    },
    /// Curvature of the response from the last sample of a period to the first.
    Seam {
        /// Curvature there over the RMS curvature inside, largest channel (pure number).
        ratio: f64,
    },
    /// Deviation of single periods of the response from their mean.
    PeriodScatter {
        /// Largest RMS deviation of a period over the RMS of the response (pure number).
        fraction: f64,
    },
    /// The force differs from period to period, and the response with it.
    UnequalPeriods {
        /// Largest RMS deviation of a period over the RMS of the force (pure number).
        fraction: f64,
    },
    /// The force does not repeat after the claimed period.
    WrongPeriod {
        /// Period claimed, in samples.
        claimed: usize,
        /// Contradiction by the force.
        #[cfg_attr(feature = "serde", serde(flatten))]
        fault: PeriodFault,
    },
    /// Samples per period of the highest mode.
    HighestMode {
        /// Natural frequency, in Hz.
        frequency_hz: f64,
        /// Samples per period of that mode (pure number).
        samples_per_period: f64,
        /// Motion that the step or the band must suit.
        #[cfg_attr(feature = "serde", serde(flatten))]
        limit: ModeLimit,
    },
    /// The transition from sample to sample has no real logarithm: the step is too long for a mode.
    NoLogarithm {
        /// Eigenvalue of the transition matrix, zero or negative (pure number).
        eigenvalue: f64,
    },
    /// Multiple coherence of the responses over the lines.
    Coherence {
        /// Median over lines and responses (pure number).
        median: f64,
        /// Minimum (pure number).
        minimum: f64,
        /// Number of independent averages (pure number).
        averages: f64,
    },
    /// Width of the narrowest resonance, in lines of the segments that were averaged.
    Leakage {
        /// The mode, by rising natural frequency.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        mode: usize,
        /// Natural frequency, in Hz.
        frequency_hz: f64,
        /// Half-power bandwidth 2ζf over the distance of the lines (pure number).
        lines: f64,
        /// Number of samples of a segment that would have as many lines in it as are needed.
        samples_needed: usize,
        /// True if what the window blunts could be told from the resonance.
        settled: bool,
    },
    /// Text in the header of a column that may be a unit.
    Unit {
        /// The column, in words.
        column: String,
        /// The text, as it is written.
        text: String,
        /// Factor that it makes or would make, in SI units per unit of the column; `None` if it is not understood.
        factor: Option<f64>,
        /// Whether the numbers are multiplied by the factor.
        used: bool,
        /// SI unit in which the numbers are needed.
        si: &'static str,
    },
    /// Time column without a unit whose numbers are hardly seconds.
    TimeUnit {
        /// The column, in words.
        column: String,
        /// Sampling rate of instants in seconds, in Hz.
        rate_hz: f64,
        /// Duration of the record in seconds, in s.
        duration_s: f64,
        /// Unit that may be meant.
        unit: &'static str,
        /// Size of that unit, in s.
        factor: f64,
    },
    /// A channel was cut off by an amplifier or a converter.
    Clipping {
        /// The channel.
        #[cfg_attr(feature = "serde", serde(flatten))]
        channel: Channel,
        /// Level at which it is cut off, in the unit of the channel.
        level: f64,
        /// Number of samples at that level.
        samples: usize,
    },
    /// A channel has the same value in all samples.
    ConstantChannel {
        /// The channel.
        #[cfg_attr(feature = "serde", serde(flatten))]
        channel: Channel,
        /// The value, in the unit of the channel.
        level: f64,
        /// Number of samples.
        samples: usize,
    },
    /// A channel has a few equally spaced values only.
    Quantisation {
        /// The channel.
        #[cfg_attr(feature = "serde", serde(flatten))]
        channel: Channel,
        /// Number of distinct values.
        levels: usize,
        /// Step between them, in the unit of the channel.
        step: f64,
    },
    /// One sample of a channel stands far outside its neighbours.
    Spike {
        /// The channel.
        #[cfg_attr(feature = "serde", serde(flatten))]
        channel: Channel,
        /// The sample, counted from 0 in the window.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        sample: usize,
        /// Second difference at the sample over the largest of the others (pure number).
        ratio: f64,
    },
    /// Two measured response quantities of one degree of freedom are not derivatives of each other.
    Kinematics {
        /// Degree of freedom.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        dof: usize,
        /// The lower derivative.
        quantity: ResponseQuantity,
        /// The higher derivative.
        derivative: ResponseQuantity,
        /// Change of `quantity` over the change that `derivative` predicts; 1 if they agree (pure number).
        gain: f64,
    },
    /// The forces take power out of the machine.
    PowerFlow {
        /// Mean power into the machine over the apparent power, negative (pure number).
        fraction: f64,
    },
    /// Force and response are shifted in time.
    Delay {
        /// Delay of the response, in samples (pure number).
        samples: f64,
        /// Delay of the response, in s.
        seconds: f64,
        /// Fraction of the residual's power that is left when the delay is removed.
        remaining: f64,
    },
    /// Difference of an estimate from another that noise on the response does not bias.
    Bias {
        /// Probability that noise alone makes them differ as much if neither is biased.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
        /// The parameter that changes most, in standard errors.
        #[cfg_attr(feature = "serde", serde(serialize_with = "as_text"))]
        parameter: Parameter,
        /// Value, in the unit of the parameter.
        estimate: f64,
        /// Value by the other estimator (unit of the parameter).
        unbiased: f64,
        /// Standard error of `estimate` (unit of the parameter).
        standard_error: f64,
        /// The other estimator.
        reference: Reference,
    },
    /// A free response of the identified system grows.
    Instability {
        /// The mode, by rising natural frequency.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        mode: usize,
        /// Damped frequency of the mode, in Hz; 0 for a growth without oscillation.
        frequency_hz: f64,
        /// Real part of its eigenvalue, in 1/s.
        growth_rate: f64,
        /// Standard error of the growth rate, in 1/s.
        standard_error: f64,
        /// Probability that noise alone makes the estimate of a system that does not grow do so as much.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
    },
    /// Difference of two masses that the kinetic energy makes equal.
    MassSymmetry {
        /// Degree of freedom of the row of the one, and of the column of the other.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        row: usize,
        /// Degree of freedom of the column of the one, and of the row of the other.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        column: usize,
        /// Entry (`row`, `column`) of M, in kg.
        above: f64,
        /// Entry (`column`, `row`) of M, in kg.
        below: f64,
        /// Standard error of their difference, in kg.
        standard_error: f64,
        /// Probability that noise alone makes any two such entries differ as much.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
    },
    /// Mass that is negative.
    NegativeMass {
        /// Degree of freedom.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        row: usize,
        /// Entry of the diagonal of M, in kg.
        mass: f64,
        /// Standard error of it, in kg.
        standard_error: f64,
        /// Probability that noise alone makes any such mass of zero as negative.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
    },
    /// Damping and stiffness that are symmetric but for one factor between two degrees of freedom, as gains make them.
    Gain {
        /// Degree of freedom whose responses (or forces) are so much larger.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        row: usize,
        /// The other degree of freedom.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        column: usize,
        /// The factor (pure number).
        ratio: f64,
        /// Standard error of its logarithm (pure number).
        standard_error: f64,
    },
    /// Residual power against the power of the noise.
    Misfit {
        /// Residual power over its expectation for noise alone (pure number).
        ratio: f64,
        /// Probability that noise alone deviates as much, to either side against periods, above
        /// against coherence, below against the noise of the force.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
        /// Source of the noise power.
        source: NoiseSource,
        /// The few lines that hold the power beyond the noise; `None` where it is no such lines.
        #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
        concentration: Option<Concentration>,
    },
    /// Motion that a fit leaves and takes for the response to forces that were not measured.
    UnmeasuredForce {
        /// Part of the motion (ratio of RMS values).
        fraction: f64,
    },
    /// Correlation of a residual with the square or the cube of a displacement as a force.
    Linearity {
        /// The power that correlates most.
        power: Power,
        /// Degree of freedom of the motion.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        dof: usize,
        /// Probability that the noise of a linear machine correlates as much.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
    },
    /// Nonlinear term that explains most of what a linear model leaves of whole periods.
    Distortion {
        /// The term, in words.
        term: String,
        /// Part of the power that a linear model leaves, a ratio.
        explained: f64,
        /// Level of the response on even lines without force, where odd ones alone are driven, against that on the
        /// driven ones, in dB; `None` where others are driven or there is no more than noise.
        even_db: Option<f64>,
        /// The same of odd lines without force, in dB.
        odd_db: Option<f64>,
        /// Probability that noise alone makes one of the terms explain as much.
        #[cfg_attr(feature = "serde", serde(flatten))]
        p_value: PValue,
    },
    /// Autocorrelation of a residual.
    Whiteness {
        /// The residual.
        #[cfg_attr(feature = "serde", serde(flatten))]
        residual: Residual,
        /// Numbers of the test.
        #[cfg_attr(feature = "serde", serde(flatten))]
        test: CorrelationTest,
        /// The residual is correlated as far as noise on the response does it, and no further.
        span: Option<NoiseSpan>,
    },
    /// Correlation of a residual with a force.
    CrossCorrelation {
        /// Channel of the residual.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        residual: usize,
        /// Channel of the force.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        force: usize,
        /// Numbers of the test.
        #[cfg_attr(feature = "serde", serde(flatten))]
        test: CorrelationTest,
    },
}

/// Few lines that hold most of a misfit.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Concentration {
    /// Frequencies of the lines, in Hz, a list of them rising.
    pub frequencies_hz: Vec<f64>,
    /// Fraction of the residual power beyond the noise that goes with them.
    pub share: f64,
}

/// Probability that noise alone gives a statistic at least as large as the one found.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PValue {
    /// Probability of this test alone (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "p_value"))]
    pub raw: f64,
    /// Adjusted for the number of tests made on the same fit; as `raw` before that (pure number).
    #[cfg_attr(feature = "serde", serde(rename = "adjusted_p_value"))]
    pub adjusted: f64,
}

/// Contradiction of a claimed period by the force.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "fault", rename_all = "snake_case")
)]
pub enum PeriodFault {
    /// The force returns to itself better after one or two samples more or less.
    Neighbour {
        /// Number of samples after which it repeats best.
        period: usize,
        /// RMS difference from one such period to the next, over the RMS of the force (pure number).
        mismatch: f64,
        /// The same after the claimed period (pure number).
        claimed_mismatch: f64,
    },
    /// The force returns after the claimed period except in one place: samples are missing or too many.
    Interruption {
        /// The sample that does not follow, counted from 0 in the window.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        sample: usize,
        /// RMS difference elsewhere, over the RMS of the force (pure number).
        mismatch: f64,
    },
    /// The force repeats after a number of samples of which the claimed one is no multiple.
    Other {
        /// Number of samples after which it repeats.
        period: usize,
        /// RMS difference from one such period to the next, over the RMS of the force (pure number).
        mismatch: f64,
        /// Number of samples of the force.
        samples: usize,
    },
}

/// Motion in the highest mode that the sampling step or the band fitted must suit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "limit", rename_all = "snake_case")
)]
pub enum ModeLimit {
    /// The equation of motion holds at each sample.
    AtSamples,
    /// Exact transition from sample to sample, with an assumption on the force between them.
    BetweenSamples,
    /// Transition by Euler's rule.
    Euler {
        /// Relative error of the state matrix by that rule (pure number).
        bias: f64,
    },
    /// Lines of the spectrum.
    Lines {
        /// Frequency of the highest line fitted, in Hz.
        last_hz: f64,
    },
}

/// A measured channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Channel {
    /// Quantity measured.
    #[cfg_attr(feature = "serde", serde(serialize_with = "as_text"))]
    pub quantity: Quantity,
    /// Number among the channels of that quantity.
    #[cfg_attr(feature = "serde", serde(rename = "channel", serialize_with = "from_one"))]
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

/// Source of the noise power that a residual is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum NoiseSource {
    /// Scatter of repeated periods.
    Periods,
    /// Coherence of averaged frequency responses.
    Coherence,
    /// Noise of the force on the lines on which it decides, stated or read above the band that it drives.
    Force,
}

/// Estimator that noise on the response does not bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Reference {
    /// Instrumental variables: the samples before and after.
    NeighbouringSamples,
    /// Maximum likelihood, one Gauss–Newton step from the estimate.
    MaximumLikelihood,
}

/// Power of a motion that a force is looked for in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(rename_all = "snake_case"))]
pub enum Power {
    /// x².
    Square,
    /// x³.
    Cube,
    /// ẋ³.
    VelocityCube,
    /// Sign of ẋ: dry friction.
    VelocitySign,
}

/// A residual that is tested for whiteness.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize),
    serde(tag = "residual_of", rename_all = "snake_case")
)]
pub enum Residual {
    /// Samples of a channel.
    Samples {
        /// Channel of the residual.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        residual: usize,
    },
    /// Lines of a spectrum, weighted by the noise.
    Lines {
        /// Channel of the residual.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        residual: usize,
    },
    /// Lines of a frequency response.
    FrequencyResponse {
        /// Degree of freedom of the response.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        response: usize,
        /// Degree of freedom of the force.
        #[cfg_attr(feature = "serde", serde(serialize_with = "from_one"))]
        force: usize,
        /// Smallest distance of the lines correlated.
        distance: usize,
    },
}

/// Numbers of a test for correlation.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct CorrelationTest {
    /// Number of coefficients.
    pub coefficients: usize,
    /// Number of coefficients beyond the bound.
    pub outside: usize,
    /// Bound that 95 % of the coefficients of noise keep.
    pub bound: f64,
    /// Probability that noise alone is correlated as much.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
    /// Returns whether the residual is rounding, of which correlations mean nothing.
    pub rounding: bool,
}

/// Lags over which noise on the response correlates a residual.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct NoiseSpan {
    /// Number of lags.
    pub lags: usize,
    /// Autocorrelation at lag 1 (pure number).
    pub first_coefficient: f64,
    /// Numbers of the test beyond those lags.
    pub beyond: CorrelationTest,
}

impl PValue {
    /// The p-value of a single test.
    pub fn of(raw: f64) -> Self {
        Self { raw, adjusted: raw }
    }

    /// Returns whether noise alone hardly gives such a statistic in any of the tests.
    pub fn is_significant(self) -> bool {
        self.adjusted < SIGNIFICANCE
    }
}

impl CorrelationTest {
    /// Returns whether the residual is more than rounding, and correlated more than noise is.
    pub fn is_significant(&self) -> bool {
        !self.rounding && self.p_value.is_significant()
    }
}

impl Finding {
    /// Leaves out the lines that hold a misfit ([`Concentration`]), where something else explains them.
    pub fn forget_lines(&mut self) {
        if let Self::Misfit { concentration, .. } = self {
            *concentration = None;
        }
    }

    /// Subject of the check.
    pub fn subject(&self) -> Subject {
        match self {
            Finding::PersistentExcitation { .. } | Finding::ExcitedLines { .. } => {
                Subject::Excitation
            }
            Finding::Conditioning { .. } => Subject::Conditioning,
            Finding::Seam { .. }
            | Finding::PeriodScatter { .. }
            | Finding::UnequalPeriods { .. }
            | Finding::WrongPeriod { .. } => Subject::Periodicity,
            Finding::HighestMode { .. } | Finding::NoLogarithm { .. } => Subject::Step,
            Finding::Coherence { .. } => Subject::Coherence,
            Finding::Leakage { .. } => Subject::Leakage,
            Finding::Clipping { .. }
            | Finding::ConstantChannel { .. }
            | Finding::Quantisation { .. }
            | Finding::Spike { .. } => Subject::Range,
            Finding::Unit { .. } | Finding::TimeUnit { .. } => Subject::Unit,
            Finding::Kinematics { .. } => Subject::Kinematics,
            Finding::PowerFlow { .. } => Subject::Power,
            Finding::Delay { .. } => Subject::Delay,
            Finding::Bias { .. } => Subject::Bias,
            Finding::Instability { .. } => Subject::Instability,
            Finding::NegativeMass { .. } => Subject::Mass,
            Finding::MassSymmetry { .. } | Finding::Gain { .. } => Subject::Symmetry,
            Finding::Misfit { .. } | Finding::UnmeasuredForce { .. } => Subject::Misfit,
            Finding::Linearity { .. } | Finding::Distortion { .. } => Subject::Linearity,
            Finding::Whiteness { .. } => Subject::Whiteness,
            Finding::CrossCorrelation { .. } => Subject::CrossCorrelation,
        }
    }
}

#[cfg(feature = "serde")]
fn from_one<S: serde::Serializer>(index: &usize, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(*index as u64 + 1)
}

#[cfg(feature = "serde")]
fn as_text<T: std::fmt::Display, S: serde::Serializer>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}
