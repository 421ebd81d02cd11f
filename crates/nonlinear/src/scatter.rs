//! Standard errors and test of the residual from the scatter of the periods of a record.

use nalgebra::{Complex, DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::estimate::StandardErrors;
use crate::limits::{SCATTER_ROUNDING, SIGNIFICANT};

/// Comparison of the residual power of the mean period with the noise power from the scatter of the
/// periods.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Misfit {
    /// Ratio of residual power to noise power: 1 if the model is correct.
    pub ratio: f64,
    /// Probability that noise alone gives a ratio at least as large as this one.
    pub p_value: f64,
}

impl Misfit {
    /// Returns whether the residual exceeds the noise significantly.
    pub(super) fn is_significant(self) -> bool {
        self.p_value < SIGNIFICANT
    }
}

/// Deviations of the periods of an experiment from their mean on one line, each complex or real.
pub(super) struct Line<'a> {
    /// Deviations, channels × periods.
    pub(super) deviations: &'a DMatrix<Complex<f64>>,
    /// Weight of this line. With these weights, a sum of products over lines equals the sum over
    /// samples.
    pub(super) weight: f64,
    /// `true` if the values are real: on line 0 and at half the sampling rate.
    pub(super) is_real: bool,
}

/// Covariance of parameters from the scatter of the periods, line by line.
///
/// Noise e on the mean periods changes an estimate by G Σ Re(ḡ e), summed over lines and channels,
/// with the sensitivities g of the residuals (ḡ their conjugates) and G = (AᵀA)⁻¹ for the
/// regressors A. The deviations of the periods from the mean period show this noise for any
/// spectrum and any correlation of the channels. Lines of stationary noise are independent, so that
/// each line adds degrees of freedom.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// chapters 2 (sample covariances of periods) and 9 (covariance of estimates); Satterthwaite
/// (1946), Biometrics Bulletin 2, 110–114, for the degrees of freedom.
pub(super) struct PeriodScatter {
    covariance: DMatrix<f64>,
    sums: DVector<f64>,
    /// Sum over the lines, for each parameter: the squared variance that a line contributes,
    /// divided by the degrees of freedom of this line.
    squares: DVector<f64>,
    periods: usize,
}

impl PeriodScatter {
    pub(super) fn new(parameters: usize) -> Self {
        Self {
            covariance: DMatrix::zeros(parameters, parameters),
            sums: DVector::zeros(parameters),
            squares: DVector::zeros(parameters),
            periods: 0,
        }
    }

    /// Adds the number of periods of an experiment.
    pub(super) fn count(&mut self, periods: usize) {
        self.periods += periods;
    }

    /// Adds a line; the arguments include the sensitivities of its residuals, channels ×
    /// parameters, and the matrix G.
    pub(super) fn push(
        &mut self,
        inverse: &DMatrix<f64>,
        sensitivities: &DMatrix<Complex<f64>>,
        line: &Line<'_>,
    ) {
        let periods = line.deviations.ncols() as f64;
        // The estimate depends on the real and the imaginary part of a complex value separately;
        // each part has half of the variance of the value.
        let part = if line.is_real { 1.0 } else { 0.5 };
        let scale = line.weight.powi(2) * part / (periods * (periods - 1.0));
        let freedom = (periods - 1.0) * if line.is_real { 1.0 } else { 2.0 };
        let products = sensitivities.adjoint() * line.deviations;
        let mut variances = DVector::zeros(self.sums.len());
        for part in [inverse * products.map(|z| z.re), inverse * products.map(|z| z.im)] {
            self.covariance.gemm(scale, &part, &part.transpose(), 1.0);
            for (variance, row) in variances.iter_mut().zip(part.row_iter()) {
                *variance += scale * row.norm_squared();
            }
        }
        self.squares += variances.component_mul(&variances) / freedom;
        self.sums += variances;
    }

    /// Returns the covariance, its origin, and the smallest number of degrees of freedom of the
    /// first `wanted` parameters.
    pub(super) fn finish(self, wanted: usize) -> (DMatrix<f64>, StandardErrors, usize) {
        let ratio = |(sum, square): (&f64, &f64)| sum * sum / square;
        let freedoms = self.sums.iter().zip(self.squares.iter()).take(wanted).map(ratio);
        let least = freedoms.filter(|freedom| freedom.is_finite()).fold(f64::INFINITY, f64::min);
        let freedom = if least.is_finite() { (least as usize).max(1) } else { 1 };
        (self.covariance, StandardErrors::Periods(self.periods), freedom)
    }
}

/// Powers of the mean residual and of the scatter of the periods, line by line.
#[derive(Default)]
pub(super) struct Powers {
    residual: f64,
    noise: f64,
    signal: f64,
    /// Two sums over the lines: the squared noise power divided by the degrees of freedom of the
    /// residual, and divided by the degrees of freedom of the scatter.
    squares: [f64; 2],
}

impl Powers {
    /// Adds a line: the squared magnitude of the residual of the mean period, the variance of the
    /// mean of `periods` periods, and the power of the signal, all weighted.
    pub(super) fn push(
        &mut self,
        [residual, noise, signal]: [f64; 3],
        periods: usize,
        is_real: bool,
    ) {
        let parts = if is_real { 1.0 } else { 2.0 };
        self.residual += residual;
        self.noise += noise;
        self.signal += signal;
        self.squares[0] += noise * noise / parts;
        self.squares[1] += noise * noise / (parts * (periods - 1) as f64);
    }

    /// Tests whether the residual has more power than the noise; `None` if the periods differ only
    /// by rounding.
    ///
    /// # Source
    /// Satterthwaite (1946), as for the standard errors: sums of squares of unequal variance.
    pub(super) fn misfit(&self) -> Option<Misfit> {
        if self.noise <= SCATTER_ROUNDING.powi(2) * self.signal {
            return None;
        }
        let ratio = self.residual / self.noise;
        let [of_residual, of_noise] = self.squares.map(|square| self.noise * self.noise / square);
        let by_chance = FisherSnedecor::new(of_residual, of_noise).ok()?;
        ratio.is_finite().then(|| Misfit { ratio, p_value: by_chance.sf(ratio) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: a mean of P values on L lines has the variance of the values divided by P, with 2
    /// L (P − 1) degrees of freedom, or fewer if the variances of the lines differ.
    #[test]
    fn a_mean_has_the_variance_of_its_values() {
        let (lines, periods) = (50, 4);
        let value = |line: usize, period: usize| {
            let at = (line * periods + period) as f64;
            Complex::from_polar(1.0, 12.9898 * at * at)
        };
        let inverse = DMatrix::from_element(1, 1, 1.0 / lines as f64);
        let mut scatter = PeriodScatter::new(1);
        let mut squares = 0.0;
        for line in 0..lines {
            let all: Vec<_> = (0..periods).map(|period| value(line, period)).collect();
            let mean = all.iter().sum::<Complex<f64>>() / periods as f64;
            let deviations = DMatrix::from_fn(1, periods, |_, period| all[period] - mean);
            squares += deviations.norm_squared();
            let sensitivities = DMatrix::from_element(1, 1, Complex::from(1.0));
            let line = Line { deviations: &deviations, weight: 1.0, is_real: false };
            scatter.push(&inverse, &sensitivities, &line);
        }
        let (covariance, _, freedom) = scatter.finish(1);
        let (p, l) = (periods as f64, lines as f64);
        let expected = 0.5 * squares / (p * (p - 1.0)) / (l * l);
        assert!((covariance[(0, 0)] / expected - 1.0).abs() < 1e-12);
        assert!((150..=300).contains(&freedom), "{freedom}");
    }
}
