//! Forces that are held or linear between samples, and AC coupled channels, as explanations of a residual.

use mechid_estimate::frequency_domain::equivalent_force;
use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{Discretisation, SecondOrderSystem};
use mechid_signal::Extent;
use mechid_spectra::FrequencyData;
use nalgebra::DVector;

use super::alternative::{Alternative, Cause};
use super::finding::{Channel, Finding, Quantity};
use super::limits::{
    ACQUISITION_ROUNDS, DELAY_REMAINING, HIGH_PASS_STEP, LINEARITY_NEIGHBOURS, STANDARD_ERRORS,
};
use super::spectral_residual::SpectralResidual;
use super::weighted_fit::{Weighing, after_spectral_fit};
use super::{Subject, Verdict};

/// Difference of the data from those of a band-limited force and channels that pass every frequency.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Between(Discretisation),
    /// High-pass in one response or in all of them.
    Response(Option<usize>),
    /// High-pass in one force or in all of them.
    Force(Option<usize>),
}

impl Fault {
    /// Returns the faults that can be told apart in data of `n` degrees of freedom, `driven` by some of them.
    fn all(n: usize, driven: &[usize]) -> Vec<Self> {
        let between = [Discretisation::ZeroOrderHold, Discretisation::FirstOrderHold];
        let mut faults: Vec<Self> = between.into_iter().map(Self::Between).collect();
        faults.extend([Self::Response(None), Self::Force(None)]);
        if n > 1 {
            faults.extend((0..n).map(|channel| Self::Response(Some(channel))));
        }
        if driven.len() > 1 {
            faults.extend(driven.iter().map(|channel| Self::Force(Some(*channel))));
        }
        faults
    }

    /// Returns the data without the fault, or with that of all channels alike; `amount` is the corner frequency (rad/s) of a
    /// high-pass.
    fn removed(
        self,
        data: &FrequencyData,
        system: &SecondOrderSystem,
        dt: f64,
        amount: f64,
    ) -> Option<FrequencyData> {
        let channels = |one: Option<usize>| match one {
            Some(channel) => vec![channel],
            None => (0..data.dof()).collect(),
        };
        Some(match self {
            Self::Between(between) => equivalent_force(data, system, dt, between)?,
            Self::Response(one) => data.with_high_pass_alike(&channels(one), &[], amount),
            Self::Force(one) => data.with_high_pass_alike(&[], &channels(one), amount),
        })
    }

    /// Returns whether the amount that fits best is that of the fault.
    fn is_plausible(self, amount: f64) -> bool {
        match self {
            Self::Between(_) => (amount - 1.0).abs() < 0.5,
            _ => amount > 0.0,
        }
    }

    fn cause(self, data: &FrequencyData, driven: &[usize], corner: f64) -> Cause {
        let channels = |quantity, of: Vec<usize>| -> Vec<Channel> {
            of.into_iter().map(|index| Channel { quantity, index }).collect()
        };
        let corner_hz = corner / std::f64::consts::TAU;
        match self {
            Self::Between(between) => Cause::BetweenSamples { between_samples: between },
            Self::Response(one) => {
                let of = one.map_or_else(|| (0..data.dof()).collect(), |channel| vec![channel]);
                let channels = channels(Quantity::Response(data.measured()), of);
                Cause::AcCoupling { channels, corner_hz }
            }
            Self::Force(one) => {
                let of = one.map_or_else(|| driven.to_vec(), |channel| vec![channel]);
                Cause::AcCoupling { channels: channels(Quantity::Force, of), corner_hz }
            }
        }
    }
}

/// Amount of a fault that fits the residual best, to first order, and how it is known.
struct Score {
    amount: f64,
    /// Standard error of the amount, by the size that the residuals around each line show.
    error: f64,
}

/// Records of a fit, with what is left of them.
struct Residuals<'a> {
    records: &'a [FrequencyData],
    after: &'a [SpectralResidual],
    weighing: &'a Weighing<'a>,
    system: &'a SecondOrderSystem,
    dt: f64,
    /// Number of independent parameters.
    parameters: usize,
}

impl Residuals<'_> {
    /// Returns the faults whose amounts are plausible and larger than noise makes them.
    fn significant(&self, faults: Vec<Fault>) -> Vec<(Fault, Score)> {
        let is_significant = |score: &Score| score.amount.abs() > STANDARD_ERRORS * score.error;
        let scored = faults.into_iter().filter_map(|fault| {
            let score = self.score(fault, 0.0)?;
            let is_likely = fault.is_plausible(score.amount) && is_significant(&score);
            is_likely.then_some((fault, score))
        });
        scored.collect()
    }

    /// Scores a fault whose `amount` has been removed already.
    ///
    /// # Source
    /// Rao's score test.
    fn score(&self, fault: Fault, amount: f64) -> Option<Score> {
        let mut directions = Vec::new();
        for (at, data) in self.records.iter().enumerate() {
            let lowest = data.omega().iter().copied().fold(f64::INFINITY, f64::min);
            let step = match fault {
                Fault::Between(_) => 1.0,
                _ => HIGH_PASS_STEP * lowest,
            };
            let residual = |amount: f64| {
                let removed = match fault {
                    Fault::Between(_) if amount == 0.0 => data.clone(),
                    _ => fault.removed(data, self.system, self.dt, amount)?,
                };
                self.weighing.residual_of(at, &removed)
            };
            directions.push((residual(amount + step)? - residual(amount)?) / step);
        }
        let fewest = self.after.iter().map(|after| after.explained().ncols()).min()?;
        let parameters = fewest.min(self.parameters);
        let directions = without_explained(directions, self.after, parameters);
        let (mut product, mut square, mut variance) = (0.0, 0.0, 0.0);
        for (direction, after) in directions.iter().zip(self.after) {
            product += direction.dot(after.values());
            square += direction.norm_squared();
            let spread = local_variance(after.deviations(), self.records[0].dof());
            variance += direction.map(|c| c * c).dot(&spread);
        }
        (square > 0.0).then(|| Score { amount: -product / square, error: variance.sqrt() / square })
    }
}

/// Returns the variance of each residual as the mean square of those of its channel on the lines around it: a fault that
/// shows on a few lines of a resonance would hide behind their own size.
fn local_variance(deviations: &DVector<f64>, dof: usize) -> DVector<f64> {
    let lines = deviations.len() / (2 * dof);
    let power = |line: usize, channel: usize| deviations[2 * (dof * line + channel)].powi(2);
    let mut variance = DVector::zeros(deviations.len());
    for channel in 0..dof {
        for line in 0..lines {
            let first = line.saturating_sub(LINEARITY_NEIGHBOURS);
            let last = (line + LINEARITY_NEIGHBOURS).min(lines - 1);
            let sum: f64 = (first..=last).map(|line| power(line, channel)).sum();
            let row = 2 * (dof * line + channel);
            variance[row] = sum / (last + 1 - first) as f64;
            variance[row + 1] = variance[row];
        }
    }
    variance
}

/// Subtracts from the directions of all records what the parameters, and what is known of each record, explain.
fn without_explained(
    mut directions: Vec<DVector<f64>>,
    after: &[SpectralResidual],
    parameters: usize,
) -> Vec<DVector<f64>> {
    let products = directions.iter().zip(after);
    let products = products.map(|(c, after)| after.explained().columns(0, parameters).tr_mul(c));
    let sum = products.fold(DVector::zeros(parameters), |sum, product| sum + product);
    for (direction, after) in directions.iter_mut().zip(after) {
        // Columns of one record alone come behind those of the parameters.
        let (all, own) = (after.explained(), after.explained().ncols() - parameters);
        *direction -= all.columns(0, parameters) * &sum;
        let product = all.columns(parameters, own).tr_mul(&*direction);
        *direction -= all.columns(parameters, own) * product;
    }
    directions
}

/// Finds what the acquisition of some records did to them where that explains the residual of an `estimate`
/// ([`Finding::Alternative`]): a force that is held or linear between samples `dt` (s) apart, or channels that a
/// first-order high-pass couples. `after` is what the fit left of the records. `None` unless one of them is
/// significant, and no force explains anything of what a fit without it leaves, or that is less than a quarter of the
/// residual power.
///
/// # Errors
/// As [`after_spectral_fit`].
///
/// # Source
/// Rao's score test, and the likelihood of the fits without each fault.
pub fn fault_of_acquisition(
    records: &[FrequencyData],
    after: &[SpectralResidual],
    dt: f64,
    estimate: &Estimate,
    extent: Extent,
) -> Result<Option<Finding>, EstimateError> {
    let (Some(weighing), Ok(system)) =
        (Weighing::new(records, estimate, extent), estimate.system())
    else {
        return Ok(None);
    };
    let Some(first) = records.first().filter(|_| after.len() == records.len()) else {
        return Ok(None);
    };
    if after.iter().any(SpectralResidual::is_rounding) {
        return Ok(None);
    }
    let (weighing, system) = (&weighing, &system);
    let parameters = estimate.unknowns().independent();
    let residuals = Residuals { records, after, weighing, system, dt, parameters };
    let acts = |dof: &usize| records.iter().any(|data| data.force().column(*dof).norm() > 0.0);
    let driven: Vec<usize> = (0..first.dof()).filter(acts).collect();
    let significant = residuals.significant(Fault::all(first.dof(), &driven));
    if significant.is_empty() {
        return Ok(None);
    }
    let Some(undisturbed) = weighing.least_power(records) else { return Ok(None) };
    let mut best: Option<(f64, Finding)> = None;
    for (fault, score) in significant {
        let Some((corner, without)) = removed(fault, score, &residuals, estimate, extent)? else {
            continue;
        };
        let Some(power) = weighing.least_power(&without) else { continue };
        let remaining = power / undisturbed;
        let is_best = best.as_ref().is_none_or(|(least, _)| remaining < *least);
        if !is_best || remaining >= 1.0 {
            continue;
        }
        let left = after_spectral_fit(&without, estimate, extent)?.records;
        if remaining <= DELAY_REMAINING || is_noise(after) || is_unexplained(&left) {
            let cause = fault.cause(first, &driven, corner);
            best = Some((remaining, Finding::Alternative(Alternative { cause, remaining })));
        }
    }
    Ok(best.map(|(_, finding)| finding))
}

/// Returns whether no test of the residuals warns.
fn is_noise(after: &[SpectralResidual]) -> bool {
    let mut findings = after.iter().flat_map(SpectralResidual::findings);
    findings.all(|finding| finding.verdict() == Verdict::Good)
}

/// Returns whether no force explains anything of the residuals. Lines at the ends of a resonance may go together: their
/// loads were found with the fault.
fn is_unexplained(after: &[SpectralResidual]) -> bool {
    let findings = after.iter().flat_map(SpectralResidual::findings);
    let mut correlations = findings.filter(|f| f.subject() == Subject::CrossCorrelation);
    correlations.all(|finding| finding.verdict() == Verdict::Good)
}

/// Returns the records without a fault, and its amount after some rounds.
fn removed(
    fault: Fault,
    score: Score,
    residuals: &Residuals<'_>,
    estimate: &Estimate,
    extent: Extent,
) -> Result<Option<(f64, Vec<FrequencyData>)>, EstimateError> {
    let Residuals { records, system, dt, parameters, .. } = *residuals;
    let all = |amount: f64| -> Option<Vec<FrequencyData>> {
        records.iter().map(|data| fault.removed(data, system, dt, amount)).collect()
    };
    if matches!(fault, Fault::Between(_)) {
        return Ok(all(1.0).map(|records| (1.0, records)));
    }
    let mut amount = score.amount;
    for _ in 0..ACQUISITION_ROUNDS {
        let Some(without) = all(amount) else { return Ok(None) };
        let after = after_spectral_fit(&without, estimate, extent)?.records;
        let Some(weighing) = Weighing::new(&without, estimate, extent) else { return Ok(None) };
        if after.len() != records.len() {
            return Ok(None);
        }
        let weighing = &weighing;
        let now = Residuals { after: &after, records, system, dt, weighing, parameters };
        let Some(step) = now.score(fault, amount) else { return Ok(None) };
        amount += step.amount;
        if step.amount.abs() < 0.1 * step.error {
            break;
        }
    }
    Ok(all(amount).filter(|_| fault.is_plausible(amount)).map(|records| (amount, records)))
}
