//! Maximum likelihood from averaged frequency responses that are corrected for the window of the
//! segments.

use mechid_model::SecondOrderSystem;
use mechid_spectra::SpectraError;
use mechid_spectra::frf::Frf;
use mechid_spectra::{FrequencyData, NoiseSpectrum};
use nalgebra::{Complex, DMatrix, DVector};

use crate::frequency_domain::{OutputErrorFit, Whitened, orthonormal, output_error};
use crate::limits::{MAX_SENSITIVITIES, SHARPENING_ROUNDS, SHARPENING_SETTLED};
use crate::relations::Relations;
use crate::{Estimate, EstimateError, Unknowns};

/// An estimate from averaged frequency responses.
#[derive(Debug, Clone)]
pub struct ResponseEstimate {
    /// The fit; its covariance includes the correlation of the errors of neighbouring lines.
    pub fit: OutputErrorFit,
    /// Fitted responses of each record: the measured responses, corrected for the bias of the
    /// window.
    pub responses: Vec<Frf>,
    /// Largest change of a parameter due to the correction of the window bias, in standard errors
    /// of this parameter (pure number); zero if the window causes no bias.
    pub blunted: f64,
    /// True if the alternation between the correction and the parameters converged, or if the
    /// window causes no bias.
    pub settled: bool,
}

/// Fits the frequency responses of one or several records of a machine. The second entry of a
/// record is the list of the degrees of freedom of its forces, counted from 0.
///
/// An average over segments smooths a response with |W|², the squared magnitude of the spectrum of
/// the window. The bias is computed from the identified system and subtracted from the data, and
/// the fit is repeated, until bias and system no longer change. The covariance includes three
/// effects: the window correlates the errors of neighbouring lines, responses and forces have
/// errors in common, and the weights are estimated from few segments.
///
/// # Errors
/// As [`output_error`] and [`Frf::data`];
/// [`SpectraError::NoExcitedLine`](mechid_spectra::SpectraError::NoExcitedLine) without a record.
///
/// # Source
/// Welch (1967), IEEE Trans. Audio Electroacoustics 15, 70–73, for the correlation of lines; Bendat
/// & Piersol, *Random Data*, 4th ed. (2010), section 8.5, for the bias by a window; White (1980),
/// Econometrica 48, 817–838, for the covariance; Satterthwaite (1946), Biometrics Bulletin 2,
/// 110–114.
pub fn output_error_of_responses(
    records: &[(Frf, Vec<usize>)],
    unknowns: &Unknowns,
) -> Result<ResponseEstimate, EstimateError> {
    let raw: Vec<Frf> = records.iter().map(|(frf, _)| frf.clone()).collect();
    let data = joined(records, &raw)?;
    let fit = output_error(&data, unknowns)?;
    let noise = data.noise().cloned().ok_or(SpectraError::NoExcitedLine)?;
    let count = unknowns.independent();
    let is_exact = !raw.iter().any(Frf::is_smoothed);
    let plain =
        |fit| ResponseEstimate { fit, responses: raw.clone(), blunted: 0.0, settled: is_exact };
    if records.iter().any(|(frf, _)| !frf.has_error_covariance())
        || 2 * data.dof() * data.len() * count > MAX_SENSITIVITIES
    {
        return Ok(plain(fit));
    }
    let relations = Relations::from_unknowns(unknowns);
    let model = Sharpening { records, unknowns, noise: &noise, relations: relations.as_ref() };
    let values: Vec<f64> = fit.estimate.parameters().map(|p| p.value).collect();
    let theta = match &relations {
        None => DVector::from_column_slice(&values),
        Some(relations) => relations.unknowns(&values),
    };
    let Some(errors) = model.errors(&raw, &theta) else { return Ok(plain(fit)) };
    let start =
        Sharpened { theta, responses: raw.clone(), errors, blunted: 0.0, settled: is_exact };
    let sharpened = if start.settled { start } else { model.sharpen(start)? };
    let Sharpened { theta, responses, errors, blunted, settled } = sharpened;
    let (covariance, degrees_of_freedom) = errors.covariance(records);
    let covariance = match &relations {
        None => covariance,
        Some(relations) => {
            let tangent = relations.tangent(theta.as_slice());
            &tangent * covariance * tangent.transpose()
        }
    };
    let values = model.entries(&theta).as_slice().to_vec();
    let estimate: Estimate = fit.estimate.moved(values, covariance, degrees_of_freedom)?;
    let power = 0.5 * errors.white.residual.norm_squared() / (data.dof() * data.len()) as f64;
    let misfit_ratio = if blunted > 0.0 { power } else { fit.misfit_ratio };
    let fit = OutputErrorFit { estimate, misfit_ratio, ..fit };
    Ok(ResponseEstimate { fit, responses, blunted, settled })
}

/// Data and model of the window correction.
struct Sharpening<'a> {
    records: &'a [(Frf, Vec<usize>)],
    unknowns: &'a Unknowns,
    noise: &'a NoiseSpectrum,
    relations: Option<&'a Relations>,
}

/// Parameters, and the responses corrected for the window bias of the system with these parameters.
struct Sharpened {
    theta: DVector<f64>,
    responses: Vec<Frf>,
    errors: Errors,
    blunted: f64,
    settled: bool,
}

impl Sharpening<'_> {
    /// Returns the free entries of M, C and K.
    fn entries(&self, theta: &DVector<f64>) -> DVector<f64> {
        match self.relations {
            None => theta.clone(),
            Some(relations) => relations.entries(theta.as_slice()),
        }
    }

    fn errors(&self, responses: &[Frf], theta: &DVector<f64>) -> Option<Errors> {
        Errors::new(self.records, responses, self.unknowns, &self.entries(theta), self.noise)
    }

    /// Alternates between the correction of the responses and the estimation of the system.
    fn sharpen(&self, start: Sharpened) -> Result<Sharpened, EstimateError> {
        let first = start.theta.clone();
        let mut at = start;
        for _ in 0..SHARPENING_ROUNDS {
            let [m, c, k] = self.unknowns.assemble(self.entries(&at.theta).as_slice());
            let system = SecondOrderSystem::new(m, c, k)?;
            let sharp: Vec<Frf> =
                self.records.iter().map(|(frf, dofs)| frf.sharpened(&system, dofs)).collect();
            let Some(next) = self.errors(&sharp, &at.theta) else { break };
            let step = next.step();
            (at.errors, at.responses) = (next, sharp);
            let deviations = at.errors.deviations();
            let in_errors = |step: &DVector<f64>| step.component_div(&deviations).amax();
            let (length, so_far) = (in_errors(&step), &at.theta + &step - &first);
            if !length.is_finite() {
                break;
            }
            at.theta += step;
            at.blunted = in_errors(&so_far);
            if length <= SHARPENING_SETTLED {
                at.settled = true;
                break;
            }
        }
        Ok(at)
    }
}

/// Concatenates the responses of all records into the data of one fit.
fn joined(
    records: &[(Frf, Vec<usize>)],
    responses: &[Frf],
) -> Result<FrequencyData, EstimateError> {
    let mut joined: Option<FrequencyData> = None;
    for ((_, dofs), frf) in records.iter().zip(responses) {
        let data = frf.data(dofs)?;
        joined = Some(match joined {
            None => data,
            Some(before) => before.and(&data)?,
        });
    }
    Ok(joined.ok_or(SpectraError::NoExcitedLine)?)
}

/// Weighted residuals at given parameter values, with the sensitivities J = Q R of the residuals.
struct Errors {
    white: Whitened,
    dof: usize,
    q: DMatrix<f64>,
    /// Inverse R⁻¹ of the triangular factor.
    root: DMatrix<f64>,
}

impl Errors {
    fn new(
        records: &[(Frf, Vec<usize>)],
        responses: &[Frf],
        unknowns: &Unknowns,
        entries: &DVector<f64>,
        noise: &NoiseSpectrum,
    ) -> Option<Self> {
        let data = joined(records, responses).ok()?;
        let white = Whitened::new(&data, unknowns, entries, |row| noise.covariance(row).clone())?;
        let (q, root) = orthonormal(white.sensitivity.clone())?;
        root.iter().all(|v| v.is_finite()).then_some(Self { white, dof: data.dof(), q, root })
    }

    /// Returns the Gauss–Newton step.
    fn step(&self) -> DVector<f64> {
        &self.root * self.q.tr_mul(&self.white.residual)
    }

    /// Returns the standard errors that the parameters would have if the lines had independent
    /// errors.
    fn deviations(&self) -> DVector<f64> {
        DVector::from_iterator(self.root.nrows(), self.root.row_iter().map(|row| row.norm()))
    }

    /// Returns the covariance of the parameters, and the smallest number of degrees of freedom of
    /// their variances.
    fn covariance(&self, records: &[(Frf, Vec<usize>)]) -> (DMatrix<f64>, usize) {
        covariance_of_errors(records, self.dof, &(&self.q * self.root.transpose()))
    }
}

/// Returns the covariance of the sums Σ b e, one for each column b of `influence`, and the smallest
/// number of degrees of freedom of the variances of these sums. The errors e are the weighted
/// errors of averaged responses with `dof` outputs.
pub(crate) fn covariance_of_errors(
    records: &[(Frf, Vec<usize>)],
    dof: usize,
    influence: &DMatrix<f64>,
) -> (DMatrix<f64>, usize) {
    let count = influence.ncols();
    let mut covariance = DMatrix::<f64>::zeros(count, count);
    let (mut spread, mut inflation) = (DVector::<f64>::zeros(count), 1.0_f64);
    let mut first = 0;
    for (frf, dofs) in records {
        let lines = frf.omega().len();
        if !frf.has_error_covariance() {
            continue;
        }
        let pairs: Vec<(usize, usize)> =
            (0..dofs.len()).flat_map(|i| (0..dof).map(move |o| (o, i))).collect();
        // Row of the real part of the response at a line from an input to an output.
        let row_of = |line: usize, (output, input): (usize, usize)| {
            2 * (dof * (first + input * lines + line) + output)
        };
        let weight = |line: usize, pair: (usize, usize), parameter: usize| {
            let row = row_of(line, pair);
            Complex::new(influence[(row, parameter)], influence[(row + 1, parameter)])
        };
        let line_freedom = (frf.averages() - dofs.len() as f64).max(1.0);
        let mut shares = DMatrix::<f64>::zeros(lines, count);
        for line in 0..lines {
            let local = DMatrix::from_fn(pairs.len(), pairs.len(), |a, b| {
                frf.error_covariance(line, [pairs[a], pairs[b]]).unwrap_or_default()
            });
            let here = DMatrix::from_fn(pairs.len(), count, |a, p| weight(line, pairs[a], p));
            let mut around = DMatrix::zeros(pairs.len(), count);
            for (other, c) in frf.correlated_lines(line) {
                around += DMatrix::from_fn(pairs.len(), count, |a, p| {
                    weight(other, pairs[a], p) * Complex::from(c)
                });
            }
            let part = (here.adjoint() * local * around).map(|z| z.re);
            shares.row_mut(line).copy_from(&part.diagonal().transpose());
            covariance += (&part + part.transpose()) * 0.5;
        }
        for line in 0..lines {
            for (other, c) in frf.correlated_lines(line) {
                for parameter in 0..count {
                    spread[parameter] +=
                        c * shares[(line, parameter)] * shares[(other, parameter)] / line_freedom;
                }
            }
        }
        let freedom = frf.deviations().max(3.0);
        inflation = inflation.max(freedom / (freedom - 2.0));
        first += lines * dofs.len();
    }
    let variances = covariance.diagonal();
    let freedom = variances.iter().zip(spread.iter()).map(|(v, s)| 2.0 * v * v / s.max(0.0));
    let fewest = freedom.fold(f64::INFINITY, f64::min).clamp(1.0, 1e6);
    (covariance * inflation, fewest as usize)
}
