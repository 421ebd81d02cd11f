//! Initial poles of a search.

use std::f64::consts::{PI, TAU};

use mechid_numerics::RealSchur;
use mechid_numerics::linear_algebra::hermitian_eigen;
use mechid_signal::transform;
use nalgebra::{Complex, DMatrix};

use super::limits::{
    FASTEST_DECAY, FIRST_DECAY, HANKEL_ROWS, INITIAL_ALIASED, INITIAL_FASTER, INITIAL_GROWTH,
};
use super::poles::{Pole, turns};

/// Returns the strongest decay in a residual of unit variance (samples × channels): the peak of
/// matched filters with several decay rates.
pub(super) fn strongest(residual: &DMatrix<f64>) -> Option<Pole> {
    let len = residual.nrows();
    let padded = 2 * len.next_power_of_two();
    let plan = transform::forward(padded);
    let (mut samples, mut lines) = (plan.make_input_vec(), plan.make_output_vec());
    let [low, high] = turns(len);
    let decays = std::iter::successors(Some(FIRST_DECAY), |decay| Some(decay * INITIAL_FASTER))
        .map(|decay| -decay / len as f64)
        .take_while(|growth| -growth < 0.5 * FASTEST_DECAY);
    let mut best: Option<(f64, Pole)> = None;
    for growth in [INITIAL_GROWTH / len as f64, 0.0].into_iter().chain(decays) {
        let origin = if growth > 0.0 { len - 1 } else { 0 } as f64;
        let weights: Vec<f64> = (0..len).map(|k| (growth * (k as f64 - origin)).exp()).collect();
        let energy = 0.5 * weights.iter().map(|w| w * w).sum::<f64>();
        let mut power = vec![0.0; lines.len()];
        for channel in residual.column_iter() {
            samples.fill(0.0);
            for ((sample, value), weight) in samples.iter_mut().zip(channel).zip(&weights) {
                *sample = value * weight;
            }
            plan.process(&mut samples, &mut lines).ok()?;
            power.iter_mut().zip(&lines).for_each(|(p, x)| *p += x.norm_sqr() / energy);
        }
        for (line, power) in power.into_iter().enumerate() {
            let pole = Pole { growth, turn: TAU * line as f64 / padded as f64 };
            if (low..=high).contains(&pole.turn) && best.as_ref().is_none_or(|(p, _)| power > *p) {
                best = Some((power, pole));
            }
        }
    }
    best.map(|(_, pole)| pole.possible(len))
}

/// Principal directions of the Hankel matrix of a record, the strongest first. The poles of any
/// number of decays follow from them.
#[derive(Debug)]
pub(super) struct Subspace {
    vectors: DMatrix<f64>,
    channels: usize,
    /// Number of samples between neighbouring rows of a channel.
    stride: usize,
    len: usize,
}

impl Subspace {
    /// Decomposes the Hankel matrix of `samples` (samples × channels); the noise must have about
    /// the same level in all channels. `None` if the record is too short or has too many channels.
    ///
    /// The matrix has at most [`HANKEL_ROWS`] rows, and only its products are stored. A record with
    /// only low frequencies is decimated.
    pub(super) fn new(samples: &DMatrix<f64>) -> Option<Self> {
        let (len, channels) = samples.shape();
        let rows = (HANKEL_ROWS / channels).min(len / 3);
        let stride = stride(samples)?.min(len / (3 * rows.max(1))).max(1);
        if rows < 3 {
            return None;
        }
        let columns = len - (rows - 1) * stride;
        let mut products = DMatrix::zeros(rows * channels, rows * channels);
        for c in 0..channels {
            for d in 0..=c {
                let (x, y) = (samples.column(c), samples.column(d));
                let sum = |i: usize, j: usize, from: usize, count: usize| {
                    x.rows(i * stride + from, count).dot(&y.rows(j * stride + from, count))
                };
                // The samples of the sum move by one stride from one entry of a diagonal to the
                // next. Therefore, two short sums suffice to update the sum.
                for diagonal in 0..rows {
                    for (i0, j0) in [(diagonal, 0), (0, diagonal)] {
                        let mut value = sum(i0, j0, 0, columns);
                        for step in 0..rows - diagonal {
                            let (i, j) = (i0 + step, j0 + step);
                            products[(c * rows + i, d * rows + j)] = value;
                            products[(d * rows + j, c * rows + i)] = value;
                            if step + 1 < rows - diagonal {
                                value += sum(i, j, columns, stride) - sum(i, j, 0, stride);
                            }
                        }
                    }
                }
            }
        }
        let eigen = hermitian_eigen(products).ok()?;
        let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let vectors = eigen.eigenvectors.select_columns(&order);
        Some(Self { vectors, channels, stride, len })
    }

    /// Returns the poles of a number of decays; there are fewer if some eigenvalues are real.
    ///
    /// # Source
    /// Juang & Pappa (1985), Journal of Guidance, Control, and Dynamics 8, 620–627; Roy & Kailath
    /// (1989), IEEE Transactions on Acoustics, Speech, and Signal Processing 37, 984–995.
    pub(super) fn poles(&self, decays: usize) -> Vec<Pole> {
        let rows = self.vectors.nrows() / self.channels;
        let order = 2 * decays;
        if order > self.channels * (rows - 1) || order > self.vectors.ncols() {
            return Vec::new();
        }
        let part = |from: usize| {
            DMatrix::from_fn(self.channels * (rows - 1), order, |row, column| {
                let (channel, at) = (row / (rows - 1), row % (rows - 1));
                self.vectors[(channel * rows + at + from, column)]
            })
        };
        let qr = part(0).qr();
        let Some(shift) = qr.r().solve_upper_triangular(&(qr.q().transpose() * part(1))) else {
            return Vec::new();
        };
        let Ok(schur) = RealSchur::new(shift) else { return Vec::new() };
        let pole = |z: &Complex<f64>| {
            let log = z.ln() / self.stride as f64;
            Pole { growth: log.re, turn: log.im }.possible(self.len)
        };
        schur.eigenvalues().iter().filter(|z| z.im > 0.0).map(pole).collect()
    }
}

/// Returns the stride of a decimation, a power of two, for which hardly any power of the record is
/// above half the decimated sampling rate.
fn stride(samples: &DMatrix<f64>) -> Option<usize> {
    let len = samples.nrows();
    let plan = transform::forward(len);
    let (mut input, mut lines) = (plan.make_input_vec(), plan.make_output_vec());
    let mut power = vec![0.0; lines.len()];
    for channel in samples.column_iter() {
        input.copy_from_slice(channel.as_slice());
        plan.process(&mut input, &mut lines).ok()?;
        power.iter_mut().zip(&lines).for_each(|(p, x)| *p += x.norm_sqr());
    }
    let total: f64 = power.iter().sum();
    let mut stride = 1;
    loop {
        let turn = PI / (2 * stride) as f64;
        let first = (turn * len as f64 / TAU) as usize;
        let above: f64 = power[first.min(power.len())..].iter().sum();
        if above > INITIAL_ALIASED * total || 8 * stride > len {
            return Some(stride);
        }
        stride *= 2;
    }
}
