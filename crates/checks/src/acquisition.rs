//! Forces held or linear between samples, and AC coupled channels, as explanations of a residual.

use mechid_estimate::frequency_domain::{ChangedRecords, OutputErrorFit, equivalent_force};
use mechid_estimate::{Estimate, EstimateError};
use mechid_model::{Discretisation, SecondOrderSystem};
use mechid_signal::Extent;
use mechid_spectra::FrequencyData;
use nalgebra::DVector;
use rayon::prelude::*;

use super::alternative::{Alternative, Cause};
use super::finding::{Channel, Finding, Quantity};
use super::limits::{
    ACQUISITION_ROUNDS, CORNER_WIDTHS, DELAY_REMAINING, HIGH_PASS_STEP, LINEARITY_NEIGHBOURS,
    STANDARD_ERRORS,
};
use super::open_fit::{joined, minimum_near, residuals_of_fit};
use super::spectral_residual::{SpectralResidual, is_noise, is_uncorrelated};
use super::weighted_fit::{Weighing, after_spectral_fit};

/// Deviation of the acquisition from an assumption of the fit. The fit assumes a band-limited
/// force, and channels that pass all frequencies.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Fault {
    Between(Discretisation),
    /// High-pass in one response, given by its index, or in all responses (`None`).
    Response(Option<usize>),
    /// High-pass in one force, given by its index, or in all forces (`None`).
    Force(Option<usize>),
}

impl Fault {
    /// Returns the faults that can be distinguished in data of `n` degrees of freedom with forces
    /// on `driven`.
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

    /// Returns data in which the fault has no effect. A force that is held or linear between
    /// samples is replaced by the equivalent band-limited force. If some channels have a high-pass,
    /// the other channels get the same high-pass; `amount` is its corner frequency (rad/s).
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

    /// Returns whether the best-fitting amount is plausible for the fault. `highest` is the highest
    /// angular frequency of the lines, in rad/s: a high-pass whose corner frequency is higher is a
    /// derivative, not AC coupling.
    fn is_plausible(self, amount: f64, highest: f64) -> bool {
        match self {
            Self::Between(_) => (amount - 1.0).abs() < 0.5,
            _ => amount > 0.0 && amount < highest,
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

/// Amount of a fault that fits the residual best, to first order, with its standard error.
struct Score {
    amount: f64,
    /// Standard error of `amount`. The variance of a residual is estimated from the residuals on
    /// the surrounding lines.
    error: f64,
}

/// Records of a fit with their residuals.
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
    /// Returns the faults with plausible and significant amounts.
    fn significant(&self, faults: Vec<Fault>) -> Vec<(Fault, Score)> {
        let Some(unchanged) = self.weighted(None) else { return Vec::new() };
        let is_significant = |score: &Score| score.amount.abs() > STANDARD_ERRORS * score.error;
        let scored = faults.into_par_iter().filter_map(|fault| {
            let score = self.score(fault, 0.0, &unchanged)?;
            // The first step may be too large.
            let is_likely =
                fault.is_plausible(score.amount, f64::INFINITY) && is_significant(&score);
            is_likely.then_some((fault, score))
        });
        scored.collect()
    }

    /// Returns the weighted residuals of all records. If a fault and its amount are given, this
    /// amount is removed from the records first.
    fn weighted(&self, without: Option<(Fault, f64)>) -> Option<Vec<DVector<f64>>> {
        let of_record = |at: usize| match without {
            None => self.weighing.residual_of(at, &self.records[at]),
            Some((fault, amount)) => self.without(fault, amount, at),
        };
        (0..self.records.len()).map(of_record).collect()
    }

    /// Returns the weighted residuals of a record after this `amount` of a fault is removed from
    /// the record.
    fn without(&self, fault: Fault, amount: f64, at: usize) -> Option<DVector<f64>> {
        let removed = fault.removed(&self.records[at], self.system, self.dt, amount)?;
        self.weighing.residual_of(at, &removed)
    }

    /// Returns the score of a fault after `amount` of this fault is removed from the records;
    /// `residuals` are the residuals of these corrected records.
    ///
    /// # Source
    /// Rao's score test.
    fn score(&self, fault: Fault, amount: f64, residuals: &[DVector<f64>]) -> Option<Score> {
        let mut directions = Vec::new();
        for (at, (data, before)) in self.records.iter().zip(residuals).enumerate() {
            let lowest = data.omega().iter().copied().fold(f64::INFINITY, f64::min);
            let step = match fault {
                Fault::Between(_) => 1.0,
                _ => HIGH_PASS_STEP * lowest,
            };
            let after = self.without(fault, amount + step, at)?;
            directions.push((after - before) / step);
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

/// Returns the variance of each residual: the mean square of the residuals of its channel on the
/// surrounding lines. Without this mean, a fault that affects only a few lines of a resonance would
/// increase the variance of these lines.
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

/// Removes from the vectors `directions`, one for each record, the components that the parameters
/// and the additional columns of the same record explain.
fn without_explained(
    mut directions: Vec<DVector<f64>>,
    after: &[SpectralResidual],
    parameters: usize,
) -> Vec<DVector<f64>> {
    let products = directions.iter().zip(after);
    let products = products.map(|(c, after)| after.explained().columns(0, parameters).tr_mul(c));
    let sum = products.fold(DVector::zeros(parameters), |sum, product| sum + product);
    for (direction, after) in directions.iter_mut().zip(after) {
        // The first columns of `explained` belong to the parameters, which all records share; the
        // remaining columns belong to this record only.
        let (explained, own_columns) = (after.explained(), after.explained().ncols() - parameters);
        *direction -= explained.columns(0, parameters) * &sum;
        let product = explained.columns(parameters, own_columns).tr_mul(&*direction);
        *direction -= explained.columns(parameters, own_columns) * product;
    }
    directions
}

/// Finds a fault of the acquisition that explains the residual of an `estimate`
/// ([`Finding::Alternative`]): a force held or linear between samples `dt` (s) apart, or channels
/// with a first-order high-pass. `after` has the residuals of the fit. The fault must be
/// significant. After its removal, the residual of a fit must be uncorrelated with the forces or
/// have less than a quarter of the power. Otherwise `None`.
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
    let driven = driven(records, first.dof());
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
        let residuals_without = after_spectral_fit(&without, estimate, extent)?.records;
        // Correlation from line to line is allowed: the transients were estimated from the
        // uncorrected data, which contain the fault.
        if remaining <= DELAY_REMAINING || is_noise(after) || is_uncorrelated(&residuals_without) {
            let cause = fault.cause(first, &driven, corner);
            best = Some((remaining, Finding::Alternative(Alternative { cause, remaining })));
        }
    }
    Ok(best.map(|(_, finding)| finding))
}

/// Returns the assumptions on the force between samples `dt` (s) apart, held or linear, that change
/// the residual of an `estimate` significantly; a new fit must show which assumption explains the
/// residual. `records` are open records without their transients, and `after` are the residuals.
///
/// # Source
/// Rao's score test.
pub fn forces_between_samples(
    records: &[FrequencyData],
    dt: f64,
    estimate: &Estimate,
    after: &[SpectralResidual],
) -> Vec<Discretisation> {
    let (Some(weighing), Ok(system)) =
        (Weighing::new(records, estimate, Extent::Open), estimate.system())
    else {
        return Vec::new();
    };
    if after.len() != records.len() || after.iter().any(SpectralResidual::is_rounding) {
        return Vec::new();
    }
    let (weighing, system) = (&weighing, &system);
    let parameters = estimate.unknowns().independent();
    let residuals = Residuals { records, after, weighing, system, dt, parameters };
    let Some(unchanged) = residuals.weighted(None) else { return Vec::new() };
    let is_significant = |between: &Discretisation| {
        let score = residuals.score(Fault::Between(*between), 0.0, &unchanged);
        score.is_some_and(|score| score.amount.abs() > STANDARD_ERRORS * score.error)
    };
    let kinds = [Discretisation::ZeroOrderHold, Discretisation::FirstOrderHold];
    kinds.into_par_iter().filter(is_significant).collect()
}

/// Finds AC coupling that explains the residual of a maximum-likelihood `fit` to hits
/// ([`Finding::Alternative`]). `records` are the data of the fit, sampled every `dt` (s), `closed`
/// are the data without the transients, and `after` are the residuals. The tests of the residual
/// must warn. After the AC coupling is removed from the data, these tests must pass, or at most a
/// quarter of the residual power may remain. Otherwise `None`. It is not sufficient that the
/// residual is uncorrelated with the force, because a short force hardly shows a correlation.
///
/// # Source
/// Rao's score test; maximum likelihood with new transients for the corner frequency.
pub fn fault_of_hits(
    records: &[FrequencyData],
    closed: &[FrequencyData],
    dt: f64,
    fit: &OutputErrorFit,
    after: &[SpectralResidual],
) -> Option<Finding> {
    let estimate = &fit.estimate;
    let system = estimate.system().ok()?;
    let first = closed.first().filter(|_| after.len() == closed.len())?;
    if is_noise(after) || after.iter().any(SpectralResidual::is_rounding) {
        return None;
    }
    let weighing = Weighing::new(closed, estimate, Extent::Open)?;
    let unknowns = estimate.unknowns();
    let parameters = unknowns.independent();
    let of_fit =
        Residuals { records: closed, after, weighing: &weighing, system: &system, dt, parameters };
    let driven = driven(closed, first.dof());
    let mut faults = Fault::all(first.dof(), &driven);
    faults.retain(|fault| !matches!(fault, Fault::Between(_)));
    let joint = joined(records)?;
    let significant = of_fit.significant(faults);
    if significant.is_empty() {
        return None;
    }
    let mut unchanged = ChangedRecords::from_fit(&joint, unknowns, fit)?;
    let undisturbed = unchanged.cost(&joint)?;
    let explained = significant.into_iter().filter_map(|(fault, score)| {
        let mut likelihood = unchanged.clone();
        let cost = |corner: f64| likelihood.cost(&fault.removed(&joint, &system, dt, corner)?);
        let widths = CORNER_WIDTHS.map(|width| width * score.amount);
        let (corner, least) =
            minimum_near(score.amount, widths, cost, |cost, _| cost < undisturbed)?;
        fault.is_plausible(corner, highest(records)).then_some(())?;
        let without: Option<Vec<FrequencyData>> =
            records.iter().map(|data| fault.removed(data, &system, dt, corner)).collect();
        let remaining = least / undisturbed;
        let becomes_noise = || Some(is_noise(&residuals_of_fit(&without?, &likelihood)?));
        (remaining <= DELAY_REMAINING || becomes_noise()?)
            .then(|| (remaining, fault.cause(first, &driven, corner)))
    });
    let (remaining, cause) = explained.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(Finding::Alternative(Alternative { cause, remaining }))
}

/// Returns the degrees of freedom on which a force acts.
fn driven(records: &[FrequencyData], dof: usize) -> Vec<usize> {
    let acts = |dof: &usize| records.iter().any(|data| data.force().column(*dof).norm() > 0.0);
    (0..dof).filter(acts).collect()
}

/// Returns the highest angular frequency of the lines of all records, in rad/s.
fn highest(records: &[FrequencyData]) -> f64 {
    records.iter().flat_map(FrequencyData::omega).copied().fold(0.0, f64::max)
}

/// Returns the amount of a fault after some refinements, and the records without this fault.
fn removed(
    fault: Fault,
    score: Score,
    residuals: &Residuals<'_>,
    estimate: &Estimate,
    extent: Extent,
) -> Result<Option<(f64, Vec<FrequencyData>)>, EstimateError> {
    let Residuals { records, system, dt, parameters, .. } = *residuals;
    let without_fault = |amount: f64| -> Option<Vec<FrequencyData>> {
        records.iter().map(|data| fault.removed(data, system, dt, amount)).collect()
    };
    if matches!(fault, Fault::Between(_)) {
        return Ok(without_fault(1.0).map(|records| (1.0, records)));
    }
    let mut amount = score.amount;
    for _ in 0..ACQUISITION_ROUNDS {
        let Some(without) = without_fault(amount) else { return Ok(None) };
        let after = after_spectral_fit(&without, estimate, extent)?.records;
        let Some(weighing) = Weighing::new(&without, estimate, extent) else { return Ok(None) };
        if after.len() != records.len() {
            return Ok(None);
        }
        let weighing = &weighing;
        let now = Residuals { after: &after, records, system, dt, weighing, parameters };
        let residuals = now.weighted(Some((fault, amount)));
        let Some(step) = residuals.and_then(|of| now.score(fault, amount, &of)) else {
            return Ok(None);
        };
        amount += step.amount;
        if step.amount.abs() < 0.1 * step.error {
            break;
        }
    }
    Ok(without_fault(amount)
        .filter(|_| fault.is_plausible(amount, highest(records)))
        .map(|records| (amount, records)))
}
