//! Correlation of a residual with powers of displacement and velocity.

use std::fmt::{self, Formatter};

use mechid_estimate::frequency_domain::{Power, Whitened};
use mechid_estimate::{Estimate, EstimateError, predict_periodic};
use mechid_model::{Response, ResponseQuantity};
use mechid_numerics::check_size;
use mechid_signal::{Record, Spectrum};
use mechid_spectra::SpectraError;
use mechid_spectra::{FrequencyData, Lines};
use nalgebra::{Complex, DMatrix, DVector, DVectorView};
use statrs::distribution::{ContinuousCDF, Normal};

use super::finding::{Check, Finding, Names};
use super::limits::{LINEARITY_NEIGHBOURS, LINEARITY_SENSITIVITIES};
use super::p_value::PValue;
use super::{Subject, Verdict};

/// Tests whether the residual response (samples × degrees of freedom) of an identified system under
/// a random force (N) is correlated with the square or the cube of its displacement, or with the
/// cube or the sign of its velocity, between two frequencies in Hz ([`Finding::Linearity`], for the
/// power with the strongest correlation).
///
/// Frequency responses do not show a nonlinearity: under a random force a hardening spring looks
/// like a stiffer one with more noise, and dry friction like damping. Therefore the motion is
/// predicted over the whole record, and its powers, minus their linear parts, are applied as forces
/// at each degree of freedom in turn. For a linear system the responses to these forces are
/// uncorrelated with the residual; under a Gaussian force they are also uncorrelated with errors of
/// the linear model. The residual is weighted by Hann's window, which suppresses the transients at
/// the ends of the record.
///
/// # Errors
/// As [`predict_periodic`]; [`EstimateError::Undetermined`] if the estimate is not a system,
/// [`NumericsError::Size`](mechid_numerics::NumericsError::Size) for another number of responses
/// and [`SpectraError::NoExcitedLine`](mechid_spectra::SpectraError::NoExcitedLine) if fewer than
/// three lines lie in the band.
///
/// # Source
/// Bendat, *Nonlinear System Techniques and Applications* (1998), for the powers minus their linear
/// part, and the sign of the velocity among them; Adams & Allemang (2000), Mechanical Systems and
/// Signal Processing 14, 637–656, for the nonlinearity as a force.
pub fn linearity(
    estimate: &Estimate,
    force: &Record,
    response: &Record,
    measured: ResponseQuantity,
    band_hz: [f64; 2],
) -> Result<Finding, EstimateError> {
    force.check_same_sampling(response)?;
    let inside = |line: &usize| {
        let hz = *line as f64 * force.sampling().line_spacing_hz();
        band_hz[0] <= hz && hz <= band_hz[1] && 2 * line < force.len()
    };
    let lines = Lines::new(force.sampling(), (1..force.len().div_ceil(2)).filter(inside))?;
    let data = FrequencyData::read(&lines, force, response, measured)?;
    let tested = Tested::new(estimate, &data)?;
    let count = data.len();
    if count < 3 {
        return Err(SpectraError::NoExcitedLine.into());
    }
    tested.under_hann_window().finding(estimate, force, &lines.as_slice()[1..count - 1], &HANN)
}

/// Tests the linearity as [`linearity`] does, for an open record: from its `data` on some lines,
/// without the transients, and from the measured force (N).
///
/// # Errors
/// The errors of [`linearity`]; [`NumericsError::Size`](mechid_numerics::NumericsError::Size) if
/// the data do not match the lines.
///
/// # Source
/// The source of [`linearity`].
pub fn linearity_of_open_record(
    estimate: &Estimate,
    force: &Record,
    data: &FrequencyData,
    lines: &Lines,
) -> Result<Finding, EstimateError> {
    check_size("lines of the data", lines.as_slice().len(), data.len())?;
    Tested::new(estimate, data)?.finding(estimate, force, lines.as_slice(), &[1.0])
}

/// Correlation of lines under Hann's window at distances 0, 1 and 2.
///
/// # Source
/// Harris (1978), Proceedings of the IEEE 66, 51–83.
const HANN: [f64; 3] = [1.0, -2.0 / 3.0, 1.0 / 6.0];

/// Residual, and receptances from forces to the residual.
struct Tested {
    /// Residual of the measured quantity, channels × lines.
    residual: DMatrix<Complex<f64>>,
    receptances: Vec<DMatrix<Complex<f64>>>,
    /// Derivatives of the response with respect to each parameter, channels × lines.
    sensitivities: Vec<DMatrix<Complex<f64>>>,
}

impl Tested {
    fn new(estimate: &Estimate, data: &FrequencyData) -> Result<Self, EstimateError> {
        let (system, n) = (estimate.system()?, data.dof());
        check_size("channels of the response", system.dof(), n)?;
        let mut receptances = Vec::with_capacity(data.len());
        let mut residual = DMatrix::zeros(n, data.len());
        for (row, omega) in data.omega().iter().enumerate() {
            let unit = data.measured().per_displacement(*omega);
            let receptance = system.receptance(*omega)? * unit;
            let [f, x] =
                [data.force(), data.displacement()].map(|record| record.row(row).transpose());
            residual.set_column(row, &(x * unit - &receptance * f));
            receptances.push(receptance);
        }
        let sensitivities = sensitivities(estimate, data).unwrap_or_default();
        Ok(Self { residual, receptances, sensitivities })
    }

    /// Returns residual, receptances and sensitivities under Hann's window, without the first and
    /// the last line.
    fn under_hann_window(&self) -> Self {
        let last = self.residual.ncols() - 1;
        let windowed = |lines: &DMatrix<Complex<f64>>| {
            DMatrix::from_fn(lines.nrows(), last - 1, |channel, at| {
                let sides = lines[(channel, at)] + lines[(channel, at + 2)];
                lines[(channel, at + 1)] * 0.5 - sides * 0.25
            })
        };
        Self {
            residual: windowed(&self.residual),
            receptances: self.receptances[1..last].to_vec(),
            sensitivities: self.sensitivities.iter().map(windowed).collect(),
        }
    }

    /// Returns orthonormal columns that span the sensitivities, weighted with `residual_spectrum`
    /// as in [`weighted`].
    fn explained(&self, residual_spectrum: &[Vec<f64>]) -> DMatrix<f64> {
        let columns: Vec<DVector<f64>> = self
            .sensitivities
            .iter()
            .map(|sensitivity| {
                let column = weighted(sensitivity, residual_spectrum);
                let length = column.norm();
                if length > 0.0 { column / length } else { column }
            })
            .collect();
        if columns.is_empty() {
            DMatrix::zeros(2 * self.residual.len(), 0)
        } else {
            DMatrix::from_columns(&columns).qr().q()
        }
    }

    /// Applies each power (square, cube or sign) of displacement and velocity as a force, and
    /// returns the finding for the power whose response has the strongest correlation with the
    /// residual. Entry k of `correlation` is the correlation between two lines of the noise at a
    /// distance of k lines.
    fn finding(
        &self,
        estimate: &Estimate,
        force: &Record,
        lines: &[usize],
        correlation: &[f64],
    ) -> Result<Finding, EstimateError> {
        let system = estimate.system()?;
        let (n, predicted) = (system.dof(), predict_periodic(&system, force)?);
        let residual_spectrum: Vec<Vec<f64>> = self
            .residual
            .row_iter()
            .map(|e| around(&e.iter().map(|e| e.norm_sqr()).collect::<Vec<_>>()))
            .collect();
        // Errors of the estimate also cause a residual that follows the force: this part is
        // projected out.
        let explained = self.explained(&residual_spectrum);
        let mut least = (1.0, Power::ALL[0], 0);
        for dof in 0..n {
            for power in Power::ALL {
                let forces = Spectrum::from_record(&without_linear_part(&predicted, dof, power)?);
                let response =
                    |at: usize| self.receptances[at].column(dof) * forces.line(lines[at], 0);
                let responses: Vec<_> = (0..lines.len()).map(response).collect();
                let responses = DMatrix::from_columns(&responses);
                let mut remainder = weighted(&responses, &residual_spectrum);
                remainder -= &explained * explained.tr_mul(&remainder);
                let responses = unweighted(&remainder, &residual_spectrum);
                let p_value = p_value(&self.residual, &residual_spectrum, &responses, correlation);
                if p_value < least.0 {
                    least = (p_value, power, dof);
                }
            }
        }
        // Bonferroni's bound: the smallest p-value times the number of tests.
        let (p_value, power, dof) = least;
        let p_value = PValue::new(((n * Power::ALL.len()) as f64 * p_value).min(1.0));
        Ok(Finding::Linearity(Linearity { power, dof, p_value }))
    }
}

/// Returns the derivatives of the response, in the measured quantity, with respect to each free
/// parameter, channels × lines; `None` for large fits.
fn sensitivities(estimate: &Estimate, data: &FrequencyData) -> Option<Vec<DMatrix<Complex<f64>>>> {
    let (n, unknowns) = (data.dof(), estimate.unknowns());
    if 2 * n * data.len() * unknowns.independent() > LINEARITY_SENSITIVITIES {
        return None;
    }
    let values = DVector::from_iterator(
        estimate.parameters().count(),
        estimate.parameters().map(|p| p.value),
    );
    let units: Vec<Complex<f64>> =
        data.omega().iter().map(|omega| data.measured().per_displacement(*omega)).collect();
    let of_unit = |row: usize| {
        let mut covariance = DMatrix::zeros(2 * n, 2 * n);
        (0..n).for_each(|at| covariance[(at, at)] = Complex::from(units[row].norm_sqr().recip()));
        covariance
    };
    let white = Whitened::new(data, unknowns, &values, of_unit)?;
    let column = |column: DVectorView<'_, f64>| {
        DMatrix::from_fn(n, data.len(), |channel, row| {
            let at = 2 * (n * row + channel);
            // The weights convert only the magnitude of a displacement into the measured quantity;
            // this factor adds the phase.
            Complex::new(column[at], column[at + 1]) * (units[row] / units[row].norm())
        })
    };
    Some(white.sensitivity.column_iter().map(|one| column(one.as_view())).collect())
}

/// Returns real and imaginary parts of values, channels × lines, each divided by the square root of
/// the entry of `residual_spectrum` for its channel and line.
fn weighted(values: &DMatrix<Complex<f64>>, residual_spectrum: &[Vec<f64>]) -> DVector<f64> {
    let mut parts = DVector::zeros(2 * values.len());
    for ((channel, at), pair) in
        places(values.shape()).zip(parts.as_mut_slice().chunks_exact_mut(2))
    {
        let size = residual_spectrum[channel][at];
        let value = values[(channel, at)] * if size > 0.0 { size.sqrt().recip() } else { 0.0 };
        (pair[0], pair[1]) = (value.re, value.im);
    }
    parts
}

/// Returns the values, channels × lines, from the result of [`weighted`].
fn unweighted(parts: &DVector<f64>, residual_spectrum: &[Vec<f64>]) -> DMatrix<Complex<f64>> {
    let mut values = DMatrix::zeros(residual_spectrum.len(), residual_spectrum[0].len());
    for ((channel, at), pair) in places(values.shape()).zip(parts.as_slice().chunks_exact(2)) {
        values[(channel, at)] =
            Complex::new(pair[0], pair[1]) * residual_spectrum[channel][at].sqrt();
    }
    values
}

fn places((channels, lines): (usize, usize)) -> impl Iterator<Item = (usize, usize)> {
    (0..lines).flat_map(move |at| (0..channels).map(move |channel| (channel, at)))
}

/// Returns a power of the motion of a degree of freedom, minus the mean and the linear part of this
/// power.
fn without_linear_part(
    predicted: &Response,
    dof: usize,
    power: Power,
) -> Result<Record, EstimateError> {
    let (motion, power_of): (&Record, fn(f64) -> f64) = match power {
        Power::Square => (predicted.displacement(), |x| x * x),
        Power::Cube => (predicted.displacement(), |x| x.powi(3)),
        Power::VelocityCube => (predicted.velocity(), |x| x.powi(3)),
        Power::VelocitySign => (predicted.velocity(), f64::signum),
    };
    let x = motion.without_mean().channel(dof).to_vec();
    let size = (x.iter().map(|x| x * x).sum::<f64>() / x.len() as f64).sqrt();
    let x: Vec<f64> = x.iter().map(|x| if size > 0.0 { x / size } else { 0.0 }).collect();
    let linear = x.iter().map(|x| power_of(*x) * x).sum::<f64>() / x.len() as f64;
    let values = x.iter().map(|x| power_of(*x) - linear * x).collect();
    Ok(Record::from_channel(motion.sampling(), values)?.without_mean())
}

/// Returns the probability that noise with the spectra of the residual (channels × lines,
/// `residual_spectrum` averaged over neighbouring lines) has at least as much correlation with the
/// responses as the residual has; `correlation` is the correlation of neighbouring lines.
///
/// For given magnitudes the phases of the noise are random from line to line. The sum over the
/// channels of a line has one phase, because noise on a force, or an unmeasured force, affects all
/// channels: channels do not count as independent observations.
///
/// # Source
/// White (1980), Econometrica 48, 817–838, for the variance.
fn p_value(
    residual: &DMatrix<Complex<f64>>,
    residual_spectrum: &[Vec<f64>],
    responses: &DMatrix<Complex<f64>>,
    correlation: &[f64],
) -> f64 {
    let weighted = DMatrix::from_fn(responses.nrows(), responses.ncols(), |channel, at| {
        let size = residual_spectrum[channel][at];
        if size > 0.0 { responses[(channel, at)] / size } else { Complex::ZERO }
    });
    let product = |e: usize, g: usize| residual.column(e).dotc(&weighted.column(g));
    let (mut sum, mut variance) = (0.0, 0.0);
    for at in 0..residual.ncols() {
        sum += product(at, at).re;
        for (apart, c) in correlation.iter().enumerate().take(residual.ncols() - at) {
            let (other, times) = (at + apart, if apart == 0 { 0.5 } else { 1.0 });
            // The variance is computed from the residuals of these two lines, because at a narrow
            // resonance they are larger than the average of neighbouring lines.
            let common = product(at, at).conj() * product(at, other)
                + product(other, at).conj() * product(other, other);
            variance += times * c * 0.5 * common.re;
        }
    }
    if variance > 0.0 {
        let normal = Normal::standard();
        2.0 * normal.sf(sum.abs() / variance.sqrt())
    } else {
        1.0
    }
}

/// Returns, for each value, the mean of this value and its neighbours on either side.
fn around(values: &[f64]) -> Vec<f64> {
    let count = values.len();
    let window = |at: usize| {
        at.saturating_sub(LINEARITY_NEIGHBOURS)..(at + LINEARITY_NEIGHBOURS + 1).min(count)
    };
    let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
    (0..count).map(|at| mean(&values[window(at)])).collect()
}

/// Correlation of a residual with a power of displacement or velocity, applied as a force.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Linearity {
    /// Power (or sign) of displacement or velocity that has the strongest correlation.
    pub power: Power,
    /// Degree of freedom of the motion.
    #[cfg_attr(feature = "serde", serde(serialize_with = "crate::serialised::from_one"))]
    pub dof: usize,
    /// Probability that a linear system has at least as strong a correlation.
    #[cfg_attr(feature = "serde", serde(flatten))]
    pub p_value: PValue,
}

impl Check for Linearity {
    fn subject(&self) -> Subject {
        Subject::Linearity
    }

    fn verdict(&self) -> Verdict {
        self.p_value.verdict()
    }

    fn value(&self) -> f64 {
        self.p_value.adjusted
    }

    fn p_value_mut(&mut self) -> Option<&mut PValue> {
        Some(&mut self.p_value)
    }

    fn sentence(&self, names: &Names<'_>, f: &mut Formatter<'_>) -> fmt::Result {
        let (power, p_value) = (self.power, self.p_value);
        if self.verdict() == Verdict::Good {
            return write!(
                f,
                "the residual is uncorrelated with forces proportional to the square and the cube of the displacement \
                 and to the cube and the sign of the velocity ({p_value})"
            );
        }
        let displacement = names.response(ResponseQuantity::Displacement, self.dof);
        write!(
            f,
            "the residual is correlated with a force proportional to the {power} {displacement} ({p_value}): \
             the machine is nonlinear at this level of the force, and its parameters hold at this level only"
        )
    }
}
