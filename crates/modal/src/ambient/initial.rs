//! Initial parameters from poles and shapes of the subspace models.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Complex, DVector};

use super::likelihood::{noise, positive_factor};
use super::limits::{COARSE_POOLING, MIN_DECAY_TIMES, NOISE_TERMS};
use super::lines::{BandLines, PooledLines};
use super::parameters::{Kernel, Layout, Parameters, Span};
use super::search::{Effort, Fit, SearchLines, search, search_pooled};
use super::spectrum::Coefficients;
use crate::indicators::mean_phase;
use crate::stabilisation::Pole;

/// Quantile of the periodogram values of a sensor; this quantile is the initial estimate of the
/// noise of the sensor.
const NOISE_QUANTILE: f64 = 0.1;

/// Number of corrections of the amplitudes; one correction is not enough, because modes overlap.
const AMPLITUDE_STEPS: usize = 3;

/// Half width, in decay rates, of the lines that determine an amplitude.
const AMPLITUDE_HALF_WIDTH: f64 = 2.0;

/// Possible quantities of the outputs: for each one its kernel, and the phase of ψ, in rad, for a
/// real mode shape.
const QUANTITIES: [(Kernel, f64); 5] = [
    (Kernel::Static, -FRAC_PI_2),
    (Kernel::Static, 0.0),
    (Kernel::Sampled, -FRAC_PI_2),
    (Kernel::Sampled, 0.0),
    (Kernel::Vanishing, FRAC_PI_2),
];

/// Returns the fit at the maximum of the likelihood, with the quantity (displacement, velocity or
/// acceleration, filtered or not) that explains the lines best; `None` if the likelihood does not
/// exist for any quantity.
///
/// The quantities are compared at the poles of the subspace models. Their spectra differ in the
/// tails of the resonances. With free poles, a wrong quantity could have a larger maximum at other
/// poles, with damping ratios near zero.
pub(super) fn initial_fit(modes: &[Pole], band: &BandLines) -> Option<Fit> {
    let poles: Vec<_> = modes.iter().map(|mode| mode.pole).collect();
    let pooled = band.pooled(&poles, COARSE_POOLING, NOISE_TERMS);
    let lines = SearchLines { pooled: &pooled, coarse: &pooled, span: band.span };
    let fits = QUANTITIES.iter().filter_map(|&(kernel, phase)| {
        let initial = initial_parameters(modes, band.outputs(), &pooled, band, kernel, phase);
        search(initial, lines, Effort::FIXED_POLES)
    });
    let best = fits.min_by(|a, b| a.cost.total_cmp(&b.cost))?;
    let rough = search(best.parameters, lines, Effort::SHORT)?;
    search_pooled(rough.parameters, band, Effort::TEST)
}

fn initial_parameters(
    modes: &[Pole],
    outputs: usize,
    pooled: &[PooledLines],
    band: &BandLines,
    kernel: Kernel,
    phase: f64,
) -> Parameters {
    let layout = Layout::new(modes.len(), outputs, NOISE_TERMS);
    let values = DVector::zeros(layout.len());
    let mut parameters = Parameters { kernel, layout, values };
    for output in 0..outputs {
        let mut powers: Vec<f64> =
            pooled.iter().map(|line| line.periodogram[(output, output)].re).collect();
        powers.sort_by(f64::total_cmp);
        let quantile = powers[(NOISE_QUANTILE * powers.len() as f64) as usize];
        let index = parameters.layout.noise(0, output);
        parameters.values[index] = quantile.max(f64::MIN_POSITIVE).ln().max(-25.0);
    }
    for (r, mode) in modes.iter().enumerate() {
        let (frequency, damping) = (parameters.layout.frequency(r), parameters.layout.damping(r));
        parameters.values[frequency] = mode.pole.norm().ln();
        // A search cannot leave a resonance that is as narrow as a line, such as the peak of a
        // sinusoid. The initial damping is therefore not smaller than this limit.
        let narrowest = MIN_DECAY_TIMES / (mode.pole.norm() * band.span.duration);
        parameters.values[damping] = mode.damping_ratio().max(narrowest).ln();
        let turn = Complex::cis(phase - mean_phase(&mode.vector));
        parameters.set_shape(r, &(&mode.vector * (turn * -mode.pole.re)));
    }
    for _ in 0..AMPLITUDE_STEPS {
        match_amplitudes(&mut parameters, pooled, band.span, band.spacing());
    }
    parameters
}

/// Scales each shape so that, near the resonance, the power of the model along the shape is equal
/// to the power of the lines.
pub(super) fn match_amplitudes(
    parameters: &mut Parameters,
    pooled: &[PooledLines],
    span: Span,
    spacing: f64,
) {
    let coefficients = Coefficients::new(parameters);
    let factors: Vec<f64> = (0..parameters.layout.modes)
        .map(|r| {
            let pole = parameters.pole(r);
            let reach = (AMPLITUDE_HALF_WIDTH * -pole.re).max(2.0 * spacing);
            let direction = parameters.shape(r);
            let mut powers = [0.0; 2];
            for line in pooled.iter().filter(|line| (line.omega - pole.im).abs() < reach) {
                let kernels = coefficients.kernels(line.omega, span);
                let model = coefficients.spectrum(&kernels, &noise(parameters, &line.terms));
                for (power, matrix) in powers.iter_mut().zip([&line.periodogram, &model]) {
                    *power += line.count * direction.dotc(&(matrix * &direction)).re;
                }
            }
            let ratio = powers[0] / powers[1];
            if ratio.is_finite() && ratio > 0.0 { ratio.sqrt() } else { 1.0 }
        })
        .collect();
    for (r, factor) in factors.into_iter().enumerate() {
        let shape = parameters.shape(r) * Complex::from(factor);
        parameters.set_shape(r, &shape);
    }
}

/// Candidate for a further mode, found in the whitened lines.
pub(super) struct Candidate {
    pub pole: Pole,
    /// Expected increase of 2 ln L due to a mode at this pole.
    pub gain: f64,
}

/// Damping ratios of the grid that is scanned for further modes.
const SCANNED_DAMPING: [f64; 5] = [0.002, 0.005, 0.01, 0.02, 0.05];

/// Half width, in decay rates, of the lines that one grid point of the scan uses.
const SCAN_HALF_WIDTH: f64 = 8.0;

/// Returns a candidate for a further mode at each pole of a grid, in falling order of gain. The
/// gain follows from the largest eigenvalue of Σ |h|² (e eᴴ − I), with the whitened lines e and the
/// resonance h.
pub(super) fn scan(parameters: &Parameters, band: &BandLines) -> Option<Vec<Candidate>> {
    let coefficients = Coefficients::new(parameters);
    let outputs = band.outputs();
    let mut whitened = Vec::with_capacity(band.omega.len());
    for (k, omega) in band.omega.iter().enumerate() {
        let terms = band.noise_terms(*omega, parameters.layout.noise_terms);
        let kernels = coefficients.kernels(*omega, band.span);
        let factor = positive_factor(coefficients.spectrum(&kernels, &noise(parameters, &terms)))?;
        let lower = factor.l();
        let line = lower.solve_lower_triangular(&band.amplitudes.row(k).transpose())?;
        whitened.push((line, lower));
    }
    let first = band.omega.first()?;
    let last = band.omega.last()?;
    let mut candidates = Vec::new();
    for zeta in SCANNED_DAMPING {
        let mut centre = *first;
        while centre < *last {
            let rate = (zeta * centre).max(0.5 * band.spacing());
            let reach = SCAN_HALF_WIDTH * rate;
            let from = band.omega.partition_point(|w| *w < centre - reach);
            let to = band.omega.partition_point(|w| *w <= centre + reach);
            let mut sum = nalgebra::DMatrix::zeros(outputs, outputs);
            let (mut total, mut squares) = (0.0, 0.0);
            for (omega, (line, _)) in band.omega[from..to].iter().zip(&whitened[from..to]) {
                let weight = rate * rate / (rate * rate + (omega - centre).powi(2));
                sum.gerc(weight.into(), line, line, Complex::from(1.0));
                for i in 0..outputs {
                    sum[(i, i)] -= Complex::from(weight);
                }
                total += weight;
                squares += weight * weight;
            }
            let eigen = crate::decomposition::hermitian_eigen(sum)?;
            let best = eigen.eigenvalues.imax();
            // The gain is the likelihood-ratio statistic of a power of 1 + excess along one
            // direction against a power of 1.
            let excess: f64 = eigen.eigenvalues[best] / total;
            let gain = 2.0 * (excess - excess.ln_1p()) * total * total / squares;
            let near = band.omega.partition_point(|w| *w < centre).min(band.omega.len() - 1);
            let shape = &whitened[near].1 * eigen.eigenvectors.column(best);
            let pole = Pole { pole: Complex::new(-rate, centre), vector: shape.normalize() };
            candidates.push(Candidate { pole, gain });
            centre += 0.5 * rate;
        }
    }
    candidates.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some(candidates)
}
