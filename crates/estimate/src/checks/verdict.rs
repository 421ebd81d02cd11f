//! Verdicts of the checks: the number of a finding that decides, and the limits it is held against.

use super::Verdict;
use super::finding::{Finding, ModeLimit, PValue, PeriodFault};
use super::thresholds::*;

impl Finding {
    /// Degree to which the finding speaks against the data or the fit.
    pub fn verdict(&self) -> Verdict {
        if let Some(p_value) = self.p_value() {
            return if p_value.is_significant() { Verdict::Doubtful } else { Verdict::Good };
        }
        match *self {
            Finding::PersistentExcitation { order: 0, .. } => Verdict::Doubtful,
            Finding::PersistentExcitation { order, needed, .. } if order < needed => Verdict::Bad,
            Finding::ExcitedLines { lines, unknowns } => match 2 * lines {
                few if few < unknowns => Verdict::Bad,
                few if few == unknowns => Verdict::Doubtful,
                _ => Verdict::Good,
            },
            Finding::Conditioning { undetermined: 1.., .. } => Verdict::Bad,
            Finding::Conditioning { condition_number, .. }
                if condition_number > CONDITION_NUMBER =>
            {
                Verdict::Doubtful
            }
            Finding::Seam { ratio } => grade(ratio, SEAM_DOUBTFUL, SEAM_BAD),
            Finding::Gain { .. } | Finding::Unit { .. } | Finding::TimeUnit { .. } => {
                Verdict::Doubtful
            }
            Finding::UnmeasuredForce { fraction } if fraction >= UNMEASURED_FORCE => {
                Verdict::Doubtful
            }
            Finding::PeriodScatter { fraction } => {
                grade(fraction, PERIOD_SCATTER_DOUBTFUL, PERIOD_SCATTER_BAD)
            }
            Finding::HighestMode { frequency_hz, samples_per_period, limit } => {
                limit.verdict(frequency_hz, samples_per_period)
            }
            Finding::Leakage { lines, settled, .. } => match settled {
                true if lines >= RESONANCE_LINES => Verdict::Good,
                _ => Verdict::Doubtful,
            },
            Finding::Coherence { median, .. } => {
                grade(1.0 - median, INCOHERENCE_DOUBTFUL, INCOHERENCE_BAD)
            }
            Finding::UnequalPeriods { .. }
            | Finding::WrongPeriod { .. }
            | Finding::NoLogarithm { .. }
            | Finding::Clipping { .. }
            | Finding::ConstantChannel { .. }
            | Finding::Quantisation { .. }
            | Finding::Spike { .. }
            | Finding::Kinematics { .. }
            | Finding::PowerFlow { .. }
            | Finding::Delay { .. } => Verdict::Bad,
            _ => Verdict::Good,
        }
    }

    /// The number that decides the verdict, in the unit of its field.
    pub fn value(&self) -> f64 {
        match *self {
            Finding::PersistentExcitation { order, .. } => order as f64,
            Finding::ExcitedLines { lines, .. } => lines as f64,
            Finding::Conditioning { condition_number, .. } => condition_number,
            Finding::Seam { ratio }
            | Finding::Misfit { ratio, .. }
            | Finding::Gain { ratio, .. } => ratio,
            Finding::PeriodScatter { fraction }
            | Finding::UnequalPeriods { fraction }
            | Finding::UnmeasuredForce { fraction }
            | Finding::PowerFlow { fraction } => fraction,
            Finding::WrongPeriod { claimed, fault } => match fault {
                PeriodFault::Neighbour { period, .. } | PeriodFault::Other { period, .. } => {
                    period as f64
                }
                PeriodFault::Interruption { .. } => claimed as f64,
            },
            Finding::HighestMode { limit: ModeLimit::Euler { bias }, .. } => bias,
            Finding::HighestMode { samples_per_period, .. } => samples_per_period,
            Finding::NoLogarithm { eigenvalue } => eigenvalue,
            Finding::Coherence { median, .. } => median,
            Finding::Leakage { lines, .. } => lines,
            Finding::Clipping { samples, .. } => samples as f64,
            Finding::ConstantChannel { level, .. } => level,
            Finding::Unit { factor, .. } => factor.unwrap_or(1.0),
            Finding::TimeUnit { rate_hz, .. } => rate_hz,
            Finding::Quantisation { levels, .. } => levels as f64,
            Finding::Spike { ratio, .. } => ratio,
            Finding::Kinematics { gain, .. } => gain,
            Finding::Delay { samples, .. } => samples,
            Finding::Bias { p_value, .. }
            | Finding::Instability { p_value, .. }
            | Finding::NegativeMass { p_value, .. }
            | Finding::MassSymmetry { p_value, .. }
            | Finding::Linearity { p_value, .. }
            | Finding::Distortion { p_value, .. } => p_value.adjusted,
            Finding::Whiteness { test, .. } | Finding::CrossCorrelation { test, .. } => {
                test.p_value.adjusted
            }
        }
    }

    /// The p-value of a statistical test; `None` for other checks, and where only rounding is left.
    pub fn p_value(&self) -> Option<PValue> {
        self.clone().p_value_mut().copied()
    }

    /// The p-value of [`Finding::p_value`], to adjust it.
    pub(super) fn p_value_mut(&mut self) -> Option<&mut PValue> {
        match self {
            Finding::Bias { p_value, .. }
            | Finding::Instability { p_value, .. }
            | Finding::NegativeMass { p_value, .. }
            | Finding::MassSymmetry { p_value, .. }
            | Finding::Misfit { p_value, .. }
            | Finding::Linearity { p_value, .. }
            | Finding::Distortion { p_value, .. } => Some(p_value),
            Finding::Whiteness { test, .. } | Finding::CrossCorrelation { test, .. } => {
                (!test.rounding).then_some(&mut test.p_value)
            }
            _ => None,
        }
    }
}

impl ModeLimit {
    fn verdict(self, frequency_hz: f64, samples_per_period: f64) -> Verdict {
        let few = |doubtful: f64, bad: f64| match samples_per_period {
            samples if samples > doubtful => Verdict::Good,
            samples if samples > bad => Verdict::Doubtful,
            _ => Verdict::Bad,
        };
        match self {
            ModeLimit::AtSamples => few(SAMPLES_PER_PERIOD_AT_SAMPLES, SAMPLES_PER_PERIOD_NYQUIST),
            ModeLimit::BetweenSamples => few(SAMPLES_PER_PERIOD_DOUBTFUL, SAMPLES_PER_PERIOD_BAD),
            ModeLimit::Euler { bias } => grade(bias, EULER_BIAS_DOUBTFUL, EULER_BIAS_BAD),
            ModeLimit::Lines { last_hz } => match samples_per_period {
                samples if samples <= SAMPLES_PER_PERIOD_NYQUIST => Verdict::Bad,
                _ if frequency_hz > last_hz => Verdict::Doubtful,
                _ => Verdict::Good,
            },
        }
    }
}

fn grade(value: f64, doubtful: f64, bad: f64) -> Verdict {
    match value {
        v if v < doubtful => Verdict::Good,
        v if v < bad => Verdict::Doubtful,
        _ => Verdict::Bad,
    }
}
