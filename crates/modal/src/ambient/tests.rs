//! Tests of ambient analysis: derivatives are compared with finite differences, and the expected
//! periodogram with a direct sum.

use nalgebra::{Complex, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::information::information;
use super::likelihood::{cost, gradient, noise, positive_factor};
use super::lines::{BandLines, PooledLines};
use super::parameters::{Kernel, Layout, Parameters, Span};
use super::search::Fit;
use super::spectrum::Coefficients;
use super::transient::TransientResponse;

const DURATION: f64 = 60.0;

const SPAN: Span = Span { duration: DURATION, sample_interval: 0.05 };

/// Returns parameters of three modes, two of them close together, for a number of outputs.
fn parameters(kernel: Kernel, outputs: usize) -> Parameters {
    let layout = Layout::new(3, outputs, 3);
    let mut random = ChaCha8Rng::seed_from_u64(8);
    let mut values = DVector::from_fn(layout.len(), |_, _| random.random_range(-0.5..0.5));
    for (mode, (f, zeta)) in [(2.0f64, 0.02f64), (2.1, 0.03), (4.0, 0.01)].into_iter().enumerate() {
        values[layout.frequency(mode)] = (f * std::f64::consts::TAU).ln();
        values[layout.damping(mode)] = zeta.ln();
    }
    for output in 0..outputs {
        values[layout.noise(0, output)] = -3.0;
    }
    Parameters { kernel, layout, values }
}

/// Returns lines whose periodogram is the expected periodogram times a factor.
fn expected_lines(parameters: &Parameters, factor: f64) -> Vec<PooledLines> {
    let omega: Vec<f64> =
        (40..400).map(|k| std::f64::consts::TAU * f64::from(k) / DURATION).collect();
    let amplitudes = DMatrix::zeros(omega.len(), parameters.layout.outputs);
    let scale = vec![1.0; parameters.layout.outputs];
    let band = BandLines { omega, amplitudes, scale, span: SPAN, transient: None };
    let coefficients = Coefficients::new(parameters);
    let mut pooled = band.pooled(&[], 0.1, 3);
    pooled = (0..360)
        .map(|k| PooledLines { omega: band.omega[k], count: 1.0, ..pooled[0].clone() })
        .collect();
    for line in &mut pooled {
        line.terms = band.noise_terms(line.omega, 3);
        let kernels = coefficients.kernels(line.omega, SPAN);
        let spectrum = coefficients.spectrum(&kernels, &noise(parameters, &line.terms));
        line.periodogram = spectrum * Complex::from(factor);
    }
    pooled
}

#[test]
fn gradients_are_the_differences_of_the_cost() {
    for kernel in [Kernel::Static, Kernel::Sampled, Kernel::Vanishing] {
        let parameters = parameters(kernel, 3);
        let lines = expected_lines(&parameters, 1.3);
        let exact = gradient(&parameters, &lines, SPAN).unwrap();
        let size = exact.amax();
        for index in 0..parameters.layout.len() {
            let side = |sign: f64| {
                let mut moved = parameters.clone();
                moved.values[index] += sign * 1e-5;
                cost(&moved, &lines, SPAN)
            };
            let difference = (side(1.0) - side(-1.0)) / 2e-5;
            let gap = (difference - exact[index]).abs();
            assert!(gap < 1e-6 * size, "{kernel:?} {index}: {difference} {}", exact[index]);
        }
    }
}

/// If the periodogram equals its expected value, the information is the derivative of the gradient.
#[test]
fn the_information_is_the_curvature_at_the_expectation() {
    for kernel in [Kernel::Static, Kernel::Sampled, Kernel::Vanishing] {
        let parameters = parameters(kernel, 2);
        let lines = expected_lines(&parameters, 1.0);
        let exact = information(&parameters, &lines, SPAN).unwrap();
        let scale = exact.diagonal().map(|d| d.sqrt());
        for index in 0..parameters.layout.len() {
            let side = |sign: f64| {
                let mut moved = parameters.clone();
                moved.values[index] += sign * 1e-5;
                gradient(&moved, &lines, SPAN).unwrap()
            };
            let difference = (side(1.0) - side(-1.0)) / 2e-5;
            for other in 0..parameters.layout.len() {
                let gap = (difference[other] - exact[(index, other)]).abs();
                let size = scale[index] * scale[other];
                assert!(gap < 1e-5 * size, "{kernel:?} {index} {other}: {gap} {size}");
            }
        }
    }
}

/// The reference is Σ (1 − |τ|/T) R(τ) exp(−jωτ) with the finely sampled covariance function R of
/// the state equations.
#[test]
fn the_expected_periodogram_is_the_sum_of_the_covariances() {
    let mut parameters = parameters(Kernel::Static, 2);
    for output in 0..2 {
        parameters.values[parameters.layout.noise(0, output)] = -60.0;
    }
    let poles = parameters.poles();
    let factor = parameters.factor();
    let correlation = &factor * factor.transpose();
    // Stationary covariance of the modal states (z, z*) under unit white forces: −Q/(λ_a + λ_b*).
    let all: Vec<_> =
        poles.iter().map(|l| (*l, false)).chain(poles.iter().map(|l| (l.conj(), true))).collect();
    let shape = |a: usize| {
        let shape = parameters.shape(a % 3);
        if all[a].1 { shape.conjugate() } else { shape }
    };
    let covariance = |tau: f64| {
        let mut sum = DMatrix::<Complex<f64>>::zeros(2, 2);
        for a in 0..6 {
            for b in 0..6 {
                let state =
                    -Complex::from(correlation[(a % 3, b % 3)]) / (all[a].0 + all[b].0.conj());
                sum += shape(a) * shape(b).adjoint() * (state * (all[a].0 * tau).exp());
            }
        }
        sum
    };
    let steps = 60_000;
    let dt = DURATION / f64::from(steps);
    let coefficients = Coefficients::new(&parameters);
    let duration_lines = [100, 120, 126, 240, 300];
    let mut sums = vec![DMatrix::<Complex<f64>>::zeros(2, 2); duration_lines.len()];
    for k in 0..steps {
        let tau = f64::from(k) * dt;
        let weight = (1.0 - tau / DURATION) * dt * if k == 0 { 0.5 } else { 1.0 };
        let matrix = covariance(tau) * Complex::from(weight);
        for (sum, line) in sums.iter_mut().zip(duration_lines) {
            let omega = std::f64::consts::TAU * f64::from(line) / DURATION;
            let turned = &matrix * Complex::cis(-omega * tau);
            *sum += &turned + turned.adjoint();
        }
    }
    for (sum, line) in sums.iter().zip(duration_lines) {
        let omega = std::f64::consts::TAU * f64::from(line) / DURATION;
        let kernels = coefficients.kernels(omega, SPAN);
        let spectrum = coefficients.spectrum(&kernels, &[0.0; 2]);
        let gap = (sum - &spectrum).norm() / spectrum.norm();
        assert!(gap < 1e-4, "line {line}: {gap:.1e}");
    }
}

#[test]
fn without_poles_every_line_stands_alone() {
    let omega: Vec<f64> = (40..400).map(f64::from).collect();
    let amplitudes = DMatrix::zeros(omega.len(), 1);
    let band = BandLines { omega, amplitudes, scale: vec![1.0], span: SPAN, transient: None };
    assert_eq!(band.pooled(&[], 0.0, 1).len(), 360);
}

/// Returns the maximum, over all groups, of the mean of tr(S⁻¹ S_k)/outputs − 1 over the lines k of
/// a group: S is the spectral matrix of the group, S_k that of line k.
fn largest_excess(pooled: &[PooledLines], band: &BandLines, parameters: &Parameters) -> f64 {
    let coefficients = Coefficients::new(parameters);
    let spectrum = |omega: f64, terms: &[f64]| {
        coefficients.spectrum(&coefficients.kernels(omega, band.span), &noise(parameters, terms))
    };
    let mut first = 0;
    let mut largest: f64 = 0.0;
    for line in pooled {
        let inverse = positive_factor(spectrum(line.omega, &line.terms)).unwrap().inverse();
        let lines = &band.omega[first..first + line.count as usize];
        first += lines.len();
        let powers = lines.iter().map(|omega| {
            let power = spectrum(*omega, &band.noise_terms(*omega, 3));
            (&inverse * power).trace().re / parameters.layout.outputs as f64
        });
        largest = largest.max(powers.sum::<f64>() / line.count - 1.0);
    }
    largest
}

/// One force drives three modes: the outputs move in one direction, which changes from line to
/// line, and all other directions contain only noise. The power of the lines of a group is divided
/// by the spectral matrix of the group and averaged over all directions. With even pooling, this
/// mean exceeds 1 by less than 1 %; with pooling by the distance from the poles, by more than 20 %.
#[test]
fn pooled_lines_are_even_also_in_the_noise() {
    let mut parameters = parameters(Kernel::Static, 4);
    for output in 0..4 {
        parameters.values[parameters.layout.noise(0, output)] = f64::ln(1e-6);
        parameters.values[parameters.layout.noise(1, output)] = 0.0;
        parameters.values[parameters.layout.noise(2, output)] = 0.0;
    }
    for (pair, correlation) in [1e6, 1e6, 0.0].into_iter().enumerate() {
        parameters.values[parameters.layout.correlation(pair)] = correlation;
    }
    let omega: Vec<f64> =
        (40..400).map(|k| std::f64::consts::TAU * f64::from(k) / DURATION).collect();
    let amplitudes = DMatrix::zeros(omega.len(), 4);
    // The leakage of a short record would fill all directions.
    let span = Span { duration: f64::INFINITY, ..SPAN };
    let band = BandLines { omega, amplitudes, scale: vec![1.0; 4], span, transient: None };
    let even = band.pooled_evenly(&parameters, 0.1);
    assert!(even.len() < band.omega.len(), "{}", even.len());
    let excess = largest_excess(&even, &band, &parameters);
    assert!(excess < 0.01, "{excess}");
    let by_distance = band.pooled(&parameters.poles(), 0.1, 3);
    let excess = largest_excess(&by_distance, &band, &parameters);
    assert!(excess > 0.2, "{excess} {} {}", even.len(), by_distance.len());
}

#[test]
fn modes_keep_their_values_when_others_come_and_go() {
    let parameters = parameters(Kernel::Vanishing, 2);
    let pole = Complex::new(-0.3, 18.0);
    let shape = DVector::from_element(2, Complex::new(0.1, 0.2));
    let more = parameters.with_mode(pole, &shape);
    assert!((more.pole(3) - pole).norm() < 1e-12);
    let back = more.reordered(&[0, 1, 2]);
    assert!((&back.values - &parameters.values).amax() < 1e-9);
}

/// A new order of the modes keeps the correlations of all modal forces, also of modes whose
/// frequencies are far apart: one force may drive both modes.
#[test]
fn reordered_modes_keep_the_correlation_of_their_forces() {
    let layout = Layout::new(8, 2, 3);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let values = DVector::from_fn(layout.len(), |_, _| random.random_range(-0.5..0.5));
    let parameters = Parameters { kernel: Kernel::Static, layout, values };
    let correlation = |p: &Parameters| p.factor() * p.factor().transpose();
    let order = [7, 2, 5, 0, 3, 6, 1, 4];
    let expected = {
        let before = correlation(&parameters);
        DMatrix::from_fn(8, 8, |r, s| before[(order[r], order[s])])
    };
    let gap = correlation(&parameters.reordered(&order)) - expected;
    assert!(gap.amax() < 1e-12, "{gap}");
}

/// The reference is the logarithm of the average of n squared magnitudes of unit variance. Its
/// expected value is −1/(2n) + O(1/n²).
#[test]
fn the_bias_of_a_noise_level_is_that_of_a_logarithm() {
    let layout = Layout::new(0, 1, 1);
    let values = DVector::from_element(layout.len(), 0.7);
    let parameters = Parameters { kernel: Kernel::Static, layout, values };
    let line = |count: f64| PooledLines {
        omega: 10.0,
        count,
        terms: vec![1.0],
        periodogram: DMatrix::from_element(1, 1, Complex::from(1.0)),
    };
    let lines = [line(12.0), line(38.0)];
    let information = information(&parameters, &lines, SPAN).unwrap();
    let fit = Fit { parameters, cost: 0.0, information };
    let bias = fit.bias(&lines, SPAN).unwrap()[0];
    assert!((bias + 0.01).abs() < 1e-5, "{bias}");
}

/// The reference is a complex Ornstein–Uhlenbeck process with zero mean. To first order, the mean
/// estimate of its decay rate α is too high by 1/T, as for a complex autoregression of order one. A
/// lightly damped mode with little noise is such a process.
#[test]
fn the_bias_of_a_damping_ratio_is_that_of_an_autoregression() {
    let layout = Layout::new(1, 1, 1);
    let (omega, zeta) = (4.0 * std::f64::consts::TAU, 0.02);
    let values = DVector::from_vec(vec![omega.ln(), f64::ln(zeta), 1.0, 0.0, -18.0]);
    let parameters = Parameters { kernel: Kernel::Static, layout, values };
    let line = |k: i32| PooledLines {
        omega: std::f64::consts::TAU * f64::from(k) / DURATION,
        count: 1.0,
        terms: vec![1.0],
        periodogram: DMatrix::zeros(1, 1),
    };
    let lines: Vec<_> = (20..460).map(line).collect();
    let endless = Span { duration: f64::INFINITY, ..SPAN };
    let information = information(&parameters, &lines, endless).unwrap();
    let index = parameters.layout.damping(0);
    let fit = Fit { parameters, cost: 0.0, information };
    let bias = fit.bias(&lines, SPAN).unwrap()[index];
    let decay_times = zeta * omega * DURATION;
    assert!((bias * decay_times - 1.0).abs() < 0.1, "{}", bias * decay_times);
}

/// The reference is half the sum, over all pairs of parameters, of the second difference of the
/// spectrum times the covariance of the pair.
#[test]
fn the_mean_excess_is_half_the_second_derivative_times_the_covariance() {
    let parameters = parameters(Kernel::Vanishing, 2);
    let size = parameters.layout.len();
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let root = DMatrix::from_fn(size, size, |i, j| {
        random.random_range(-0.2..0.2) + if i == j { 1.0 } else { 0.0 }
    });
    let information = &root * root.transpose() * 1e6;
    let covariance = information.clone().cholesky().unwrap().inverse();
    let line = expected_lines(&parameters, 1.0).swap_remove(80);
    let spectrum = |steps: [(usize, f64); 2]| {
        let mut moved = parameters.clone();
        steps.iter().for_each(|(index, step)| moved.values[*index] += step);
        let coefficients = Coefficients::new(&moved);
        let kernels = coefficients.kernels(line.omega, SPAN);
        coefficients.spectrum(&kernels, &noise(&moved, &line.terms))
    };
    let h = 1e-4;
    let mut exact = DMatrix::<Complex<f64>>::zeros(2, 2);
    for a in 0..size {
        for b in 0..size {
            let equal = spectrum([(a, h), (b, h)]) + spectrum([(a, -h), (b, -h)]);
            let opposite = spectrum([(a, h), (b, -h)]) + spectrum([(a, -h), (b, h)]);
            exact += (equal - opposite) * Complex::from(covariance[(a, b)] / (8.0 * h * h));
        }
    }
    let variances = noise(&parameters, &line.terms);
    let fit = Fit { parameters: parameters.clone(), cost: 0.0, information };
    let excess = fit.excess().unwrap().at(&line, &variances, SPAN);
    let gap = (&excess - &exact).norm() / exact.norm();
    assert!(gap < 1e-3, "{gap:.1e} {excess} {exact}");
}

/// The reference is the covariance of two lines, computed as the double sum of the covariance
/// function of the state equations over all pairs of samples. Away from a resonance, only the
/// transient causes this covariance.
#[test]
fn the_transient_correlates_the_lines() {
    let omega: [f64; 2] = [2.0, 2.1].map(|hz| hz * std::f64::consts::TAU);
    let zeta: f64 = 0.02;
    let log = [omega[0].ln(), omega[1].ln(), zeta.ln(), zeta.ln()];
    // The forces on the two modes have a correlation of 2/√5.
    let rest = [0.8, 0.3, 0.7, -0.4, 2.0, -60.0];
    let values = DVector::from_iterator(10, log.into_iter().chain(rest));
    let parameters = Parameters { kernel: Kernel::Sampled, layout: Layout::new(2, 1, 1), values };
    let coefficients = Coefficients::new(&parameters);
    let covariance = |tau: f64| {
        let mode = |r: usize| {
            let residue = coefficients.shapes[(0, r)] * coefficients.covariances[(0, r)];
            2.0 * (residue * (coefficients.poles[r] * tau.abs()).exp()).re
        };
        mode(0) + mode(1)
    };
    let dt = SPAN.sample_interval;
    let steps = (DURATION / dt).round() as i32;
    let of_lag: Vec<f64> = (0..steps).map(|k| covariance(f64::from(k) * dt)).collect();
    let duration_lines = [100, 106, 138, 160];
    let lines = duration_lines.map(|line| std::f64::consts::TAU * f64::from(line) / DURATION);
    let turned = lines.map(|omega| {
        let turns: Vec<_> = (0..steps).map(|s| Complex::cis(-omega * f64::from(s) * dt)).collect();
        let filtered = |t: usize| {
            let terms = turns.iter().enumerate().map(|(s, turn)| turn * of_lag[t.abs_diff(s)]);
            terms.sum::<Complex<f64>>()
        };
        (0..turns.len()).map(filtered).collect::<Vec<_>>()
    });
    let response = TransientResponse::new(coefficients.clone(), SPAN).unwrap();
    let prior = response.prior.map(Complex::from);
    for (j, first) in turned.iter().enumerate() {
        for (k, second) in lines.iter().enumerate().filter(|(k, _)| *k != j) {
            let terms = first.iter().enumerate();
            let terms = terms.map(|(t, z)| z * Complex::cis(second * t as f64 * dt));
            let exact = terms.sum::<Complex<f64>>() * (dt * dt / DURATION);
            let [one, other] = [lines[j], *second].map(|w| response.gains(w));
            let [[_, force], [_, other_force]] = [lines[j], *second].map(|w| response.parts(w));
            // Forces at two lines are independent. For a given transient, which depends on both
            // forces, they are correlated.
            let remaining = force * &prior * other_force.adjoint();
            let modelled = (one * &prior * other.adjoint() - remaining)[(0, 0)];
            let gap = (exact - modelled).norm() / exact.norm();
            assert!(gap < 0.003, "{j} {k}: {gap} {exact} {modelled}");
        }
    }
}
