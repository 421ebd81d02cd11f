//! Random inputs and output noise for line data. The exact outputs come from dense elimination.

use mechid_signal::{Sampling, noise};
use mechid_spectra::{LineData, LineNoise, Transient};
use nalgebra::{Complex, DMatrix, DVector};

/// Returns complex circular random numbers of unit variance, rows × columns.
pub fn complex_noise(rows: usize, columns: usize, seed: u64) -> DMatrix<Complex<f64>> {
    let sampling = Sampling::new(1.0, rows).unwrap();
    let drawn = noise::white(sampling, 2 * columns, 0.5_f64.sqrt(), seed).unwrap();
    DMatrix::from_fn(rows, columns, |row, column| {
        Complex::new(drawn.data()[(row, 2 * column)], drawn.data()[(row, 2 * column + 1)])
    })
}

/// Inputs of unit size with random phases, lines × q.
pub fn random_phases(lines: usize, inputs: usize, seed: u64) -> DMatrix<Complex<f64>> {
    complex_noise(lines, inputs, seed).map(|z| z / z.norm())
}

/// Returns the inputs and the noisy outputs, with the stated covariance of the noise. The RMS of
/// the noise on each output is a fraction `share` of the RMS of this output.
pub fn measured(
    omega: &[f64],
    inputs: DMatrix<Complex<f64>>,
    mut outputs: DMatrix<Complex<f64>>,
    share: f64,
    seed: u64,
) -> LineData {
    let (lines, p) = outputs.shape();
    let q = inputs.ncols();
    let level = |at: usize| share * outputs.column(at).norm() / (lines as f64).sqrt();
    let levels: Vec<f64> = (0..p).map(level).collect();
    let drawn = complex_noise(lines, p, seed);
    for (at, level) in levels.iter().enumerate() {
        let by = drawn.column(at) * Complex::from(*level);
        let sum = outputs.column(at) + by;
        outputs.column_mut(at).copy_from(&sum);
    }
    let variances = DVector::from_fn(p + q, |at, _| {
        Complex::from(if at < p { levels[at] * levels[at] } else { 0.0 })
    });
    let covariance = vec![DMatrix::from_diagonal(&variances); lines];
    let data = LineData::new(omega.to_vec(), inputs, outputs, Transient::None).unwrap();
    data.with_noise(LineNoise::new(covariance).unwrap()).unwrap()
}
