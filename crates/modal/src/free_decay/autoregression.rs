//! Coloured noise as an autoregression: each sample depends on the samples before it, and the
//! prediction errors are white.

use nalgebra::Complex;

use super::limits::{MOST_ORDER, SAMPLES_PER_ORDER};

/// Noise of one channel as an autoregression; order 0 is white noise.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Autoregression {
    /// Coefficients of the best prediction from p preceding samples, one list for each order p = 0,
    /// 1, …; each list begins with the coefficient of the latest sample.
    predictors: Vec<Vec<f64>>,
    /// Standard deviation of the prediction error for each order p = 0, 1, …, relative to the
    /// standard deviation for the highest order.
    deviations: Vec<f64>,
}

impl Autoregression {
    /// Estimates the autoregression with the lowest Bayesian information criterion.
    ///
    /// # Source
    /// Burg (1975), *Maximum Entropy Spectral Analysis*, thesis, Stanford; Schwarz (1978), Annals
    /// of Statistics 6, 461–464.
    pub(super) fn from_noise(noise: &[f64]) -> Self {
        let len = noise.len();
        let most = MOST_ORDER.min(len / SAMPLES_PER_ORDER);
        let (mut forward, mut backward) = (noise.to_vec(), noise.to_vec());
        let mut variances = vec![noise.iter().map(|e| e * e).sum::<f64>() / len as f64];
        let mut predictors: Vec<Vec<f64>> = vec![Vec::new()];
        for order in 1..=most {
            let pairs = || forward[order..].iter().zip(&backward[order - 1..len - 1]);
            let product: f64 = pairs().map(|(f, b)| f * b).sum();
            let power: f64 = pairs().map(|(f, b)| f * f + b * b).sum();
            let reflection = 2.0 * product / power;
            let variance = variances[order - 1] * (1.0 - reflection * reflection);
            if !(variance > 0.0 && variance.is_finite()) {
                break;
            }
            let last = &predictors[order - 1];
            let turned = last.iter().zip(last.iter().rev()).map(|(a, r)| a - reflection * r);
            predictors.push(turned.chain([reflection]).collect());
            variances.push(variance);
            for k in (order..len).rev() {
                let (f, b) = (forward[k], backward[k - 1]);
                forward[k] = f - reflection * b;
                backward[k] = b - reflection * f;
            }
        }
        let per_order = (len as f64).ln();
        let cost = |order: usize| {
            len as f64 * variances[order].max(f64::MIN_POSITIVE).ln() + order as f64 * per_order
        };
        let orders = 0..variances.len();
        let order = orders.min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(0);
        predictors.truncate(order + 1);
        let deviation = |variance: &f64| (variance / variances[order]).sqrt();
        let deviations = variances[..=order].iter().map(deviation).collect();
        Self { predictors, deviations }
    }

    /// Returns the order: the number of preceding samples on which each sample depends.
    pub(super) fn order(&self) -> usize {
        self.predictors.len().saturating_sub(1)
    }

    /// Returns minus twice the log determinant of the whitening transformation.
    pub(super) fn log_volume(&self) -> f64 {
        2.0 * self.deviations.iter().map(|d| d.ln()).sum::<f64>()
    }

    /// Returns the complex numbers A and B of the prediction errors of exponential functions, with
    /// the pole λ per sample: the errors of e^{λk} are A e^{λk}, those of k e^{λk} are (A k + B)
    /// e^{λk}. This is exact for samples with as many predecessors as the order.
    pub(super) fn response(&self, pole: Complex<f64>) -> [Complex<f64>; 2] {
        let (mut value, mut slope) = (Complex::new(1.0, 0.0), Complex::default());
        for (lag, a) in (1..).zip(self.predictors.last().into_iter().flatten()) {
            let lag = f64::from(lag);
            let term = a * (-lag * pole).exp();
            value -= term;
            slope += lag * term;
        }
        [value, slope]
    }

    /// Returns the prediction errors of `values`, beginning with index `before`, scaled to equal
    /// variance. The first of the values is sample `first` of the record.
    pub(super) fn whitened(&self, values: &[f64], first: usize, before: usize) -> Vec<f64> {
        let mut errors = values[before..].to_vec();
        let order = self.order();
        // The first samples have fewer previous samples than the order.
        let ramp = order.saturating_sub(first + before).min(errors.len());
        for (at, error) in errors.iter_mut().enumerate().take(ramp) {
            let of = first + before + at;
            let past = values[..before + at].iter().rev();
            let predicted: f64 = self.predictors[of].iter().zip(past).map(|(a, v)| a * v).sum();
            *error = (*error - predicted) / self.deviations[of];
        }
        for (lag, a) in (1..).zip(self.predictors.last().into_iter().flatten()) {
            let past = &values[before + ramp - lag..];
            errors[ramp..].iter_mut().zip(past).for_each(|(e, v)| *e -= a * v);
        }
        errors
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::*;

    fn first_order(len: usize, seed: u64) -> Vec<f64> {
        let white = noise::white(Sampling::new(1.0, len + 200).unwrap(), 1, 1.0, seed).unwrap();
        let mut x = white.channel(0).to_vec();
        for k in 1..x.len() {
            x[k] += 0.9 * x[k - 1];
        }
        x[200..].to_vec()
    }

    #[test]
    fn the_order_and_the_coefficient_are_found() {
        let found = Autoregression::from_noise(&first_order(4000, 1));
        assert_eq!(found.order(), 1);
        assert!((found.predictors[1][0] - 0.9).abs() < 0.03);
        let white = noise::white(Sampling::new(1.0, 4000).unwrap(), 1, 1.0, 2).unwrap();
        assert_eq!(Autoregression::from_noise(white.channel(0)).order(), 0);
    }

    /// Reference: the prediction errors of the sequences e^{λk} and k e^{λk}, computed sample by
    /// sample.
    #[test]
    fn whitened_exponential_functions_are_exponential_functions() {
        let noise = Autoregression::from_noise(&first_order(4000, 5));
        let pole = Complex::new(-0.02, 0.7);
        let [value, slope] = noise.response(pole);
        let of = |k: usize| (pole * k as f64).exp();
        for (with_k, part) in [(false, 0), (false, 1), (true, 0), (true, 1)] {
            let pick = |z: Complex<f64>| if part == 0 { z.re } else { z.im };
            let factor = |k: usize| if with_k { k as f64 } else { 1.0 };
            let samples: Vec<f64> = (0..60).map(|k| pick(factor(k) * of(k))).collect();
            let white = noise.whitened(&samples, 0, 0);
            for (k, white) in white.iter().enumerate().skip(noise.order()) {
                let slope = if with_k { slope } else { Complex::default() };
                let expected = pick((factor(k) * value + slope) * of(k));
                assert!((white - expected).abs() < 1e-12, "{k}: {white} {expected}");
            }
        }
    }

    #[test]
    fn whitening_in_pieces_is_whitening_at_once() {
        let x = first_order(300, 3);
        let noise = Autoregression::from_noise(&x);
        let whole = noise.whitened(&x, 0, 0);
        let later = noise.whitened(&x[100 - noise.order()..], 100 - noise.order(), noise.order());
        assert_eq!(whole[100..], later);
        assert!(noise.order() > 0);
        // The first sample has the variance of the noise, 1/(1 − 0.9²), the other samples have the
        // variance of the prediction errors.
        assert!((whole[0] / x[0] - (1.0f64 - 0.81).sqrt()).abs() < 0.05);
    }
}
