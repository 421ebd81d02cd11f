//! Maximum-likelihood poles of a record for a given number of poles and a given autoregression of
//! the noise.

use std::borrow::Cow;
use std::ops::Range;

use mechid_numerics::time_limit;
use mechid_numerics::triangular::TriangularFactor;
use nalgebra::{Complex, DMatrix, DVector};
use rayon::prelude::*;

use super::autoregression::Autoregression;
use super::limits::{
    MAX_DAMPING, MAX_STEPS, POLE_CHUNK, POLE_ROUNDING, POLE_SEGMENT, PRODUCT_OPERATIONS,
};
use super::poles::{Pole, columns, linear_columns};

/// Record as samples × channels. Each channel is scaled to unit RMS about its mean; `constant`
/// states whether each channel has an unknown constant.
#[derive(Debug)]
pub(super) struct Data {
    pub samples: DMatrix<f64>,
    pub constant: bool,
}

/// Decays fitted to a record.
#[derive(Debug, Clone)]
pub(super) struct Fit {
    pub poles: Vec<Pole>,
    /// Noise of each channel.
    pub noise: Vec<Autoregression>,
    /// Fit of each channel for these poles.
    pub channels: Vec<ChannelFit>,
}

/// Linear unknowns of a channel, and its contribution to the normal equations of the poles.
#[derive(Debug, Clone)]
pub(super) struct ChannelFit {
    /// Amplitudes of cosine and sine of each pole, then the constant.
    pub linear: DVector<f64>,
    /// Sum of squares of the whitened residual.
    pub square: f64,
    /// Triangular factor R of the whitened columns whose coefficients are `linear`.
    pub factor: DMatrix<f64>,
    /// Components of the derivatives in the space of the linear columns. The derivatives are those
    /// with respect to N·`growth` and N·`turn` of each pole, for N samples.
    pub parallel: DMatrix<f64>,
    /// Components of the derivatives orthogonal to the linear columns.
    pub orthogonal: DMatrix<f64>,
    /// Components of the residual in the same orthogonal directions as the rows of `orthogonal`.
    pub projected_residual: DVector<f64>,
}

impl Data {
    pub(super) fn len(&self) -> usize {
        self.samples.nrows()
    }

    pub(super) fn channels(&self) -> usize {
        self.samples.ncols()
    }

    /// Returns the columns of poles in blocks of rows.
    pub(super) fn chunks(&self, poles: &[Pole]) -> impl Iterator<Item = DMatrix<f64>> {
        let chunk = |first: usize| {
            let end = self.len().min(first + POLE_CHUNK);
            columns(poles, self.constant, first, end, self.len())
        };
        (0..self.len()).step_by(POLE_CHUNK).map(chunk)
    }

    /// Returns the residual of each channel, samples × channels.
    pub(super) fn residual(&self, fit: &Fit) -> DMatrix<f64> {
        let mut residual = self.samples.clone();
        let linear = linear_columns(&fit.poles, self.constant);
        for (at, basis) in self.chunks(&fit.poles).enumerate() {
            for (channel, of) in fit.channels.iter().enumerate() {
                let mut rows = residual.view_mut((at * POLE_CHUNK, channel), (basis.nrows(), 1));
                rows -= basis.columns(0, linear) * &of.linear;
            }
        }
        residual
    }

    /// Returns the triangular factor of \[linear columns | columns of poles times k/N | channels\]
    /// from sample `from` on; the channels are those of `white`.
    fn triangle(
        &self,
        poles: &[Pole],
        white: &DMatrix<f64>,
        from: usize,
    ) -> Option<TriangularFactor> {
        let starts: Vec<usize> = (from..self.len()).step_by(POLE_SEGMENT).collect();
        let segment =
            |from: usize| self.segment(poles, white, from..self.len().min(from + POLE_SEGMENT));
        let segments = starts.into_par_iter().map(segment).collect::<Option<Vec<_>>>()?;
        let mut segments = segments.into_iter();
        let mut whole = segments.next()?;
        segments.all(|other| whole.push(&[other.r().as_view()])).then_some(whole)
    }

    /// Returns the triangular factor of some rows.
    ///
    /// Modes that have decayed before a block of rows have no columns in this block: most modes of
    /// a long record last for only a small part of the record.
    fn segment(
        &self,
        poles: &[Pole],
        white: &DMatrix<f64>,
        rows: Range<usize>,
    ) -> Option<TriangularFactor> {
        let width = linear_columns(poles, self.constant) + 2 * poles.len() + white.ncols();
        let mut factor = TriangularFactor::new(width);
        let mut few: Option<FewColumns> = None;
        for first in rows.clone().step_by(POLE_CHUNK) {
            let block = first..rows.end.min(first + POLE_CHUNK);
            let alive: Vec<usize> =
                (0..poles.len()).filter(|at| poles[*at].is_alive(first)).collect();
            let push = |factor: &mut TriangularFactor, poles: &[Pole]| {
                let basis = columns(poles, self.constant, block.start, block.end, self.len());
                let measured = white.rows_range(block.clone());
                factor.push(&[basis.as_view(), measured.as_view()])
            };
            if alive.len() == poles.len() {
                push(&mut factor, poles).then_some(())?;
                continue;
            }
            let mut columns = match few.take() {
                Some(columns) if columns.alive == alive => columns,
                other => {
                    if !other.is_none_or(|columns| columns.merge_into(&mut factor)) {
                        return None;
                    }
                    FewColumns::new(poles, alive, self.constant, white.ncols())
                }
            };
            push(&mut columns.factor, &columns.poles).then_some(())?;
            few = Some(columns);
        }
        few.is_none_or(|columns| columns.merge_into(&mut factor)).then_some(factor)
    }

    /// Returns the triangular factor of one channel after whitening. The common factor of all
    /// channels contains the rows from sample `from` on. The rows before this sample are whitened
    /// separately, because they have fewer preceding samples than the order of the autoregression.
    fn whitened_triangle(
        &self,
        poles: &[Pole],
        noise: &Autoregression,
        (common, white): (&DMatrix<f64>, &DMatrix<f64>),
        channel: usize,
        from: usize,
    ) -> Option<DMatrix<f64>> {
        let width = linear_columns(poles, self.constant) + 2 * poles.len();
        let basis = columns(poles, self.constant, 0, from, self.len());
        let mut first = basis.clone();
        for mut column in first.column_iter_mut() {
            let whitened = noise.whitened(column.clone_owned().as_slice(), 0, 0);
            column.copy_from_slice(&whitened);
        }
        let mut factor = TriangularFactor::new(width + 1);
        let later = common.columns(0, width) * self.whitening(poles, noise);
        let parts = [later.as_view(), common.columns(width + channel, 1)];
        let first_rows = [first.as_view(), white.view((0, channel), (from, 1))];
        (factor.push(&parts) && factor.push(&first_rows)).then(|| factor.r().clone())
    }

    /// Returns the matrix T with which the columns B of the poles are whitened: B T. A whitened
    /// exponential function is the same function times a complex number.
    fn whitening(&self, poles: &[Pole], noise: &Autoregression) -> DMatrix<f64> {
        let linear = linear_columns(poles, self.constant);
        let mut whitening = DMatrix::zeros(linear + 2 * poles.len(), linear + 2 * poles.len());
        let mut write = |row: usize, column: usize, factor: Complex<f64>| {
            whitening[(row, column)] = factor.re;
            whitening[(row, column + 1)] = factor.im;
            whitening[(row + 1, column)] = -factor.im;
            whitening[(row + 1, column + 1)] = factor.re;
        };
        for (at, pole) in poles.iter().enumerate() {
            let [value, slope] = noise.response(Complex::new(pole.growth, pole.turn));
            write(2 * at, 2 * at, value);
            write(linear + 2 * at, linear + 2 * at, value);
            write(2 * at, linear + 2 * at, slope / self.len() as f64);
        }
        if self.constant {
            whitening[(linear - 1, linear - 1)] = noise.response(Complex::default())[0].re;
        }
        whitening
    }

    /// Returns the channels after whitening.
    fn whitened(&self, noise: &[Autoregression]) -> DMatrix<f64> {
        let mut white = self.samples.clone();
        for (mut column, noise) in white.column_iter_mut().zip(noise) {
            if noise.order() > 0 {
                let whitened = noise.whitened(column.clone_owned().as_slice(), 0, 0);
                column.copy_from_slice(&whitened);
            }
        }
        white
    }

    /// Solves for the linear unknowns; `None` if the record cannot determine a pole, or if two
    /// poles are too close. `white` are the channels after whitening with the noise.
    fn at(&self, poles: &[Pole], noise: &[Autoregression], white: &DMatrix<f64>) -> Option<Fit> {
        if !poles.iter().all(|pole| pole.is_possible(self.len())) {
            return None;
        }
        let (linear, nonlinear) = (linear_columns(poles, self.constant), 2 * poles.len());
        let columns = linear + nonlinear;
        let products = columns * (columns + 2 * self.channels());
        time_limit::spend(PRODUCT_OPERATIONS * (self.len() * products) as f64);
        // One factorisation serves all channels.
        let from = noise.iter().map(Autoregression::order).max().unwrap_or(0);
        let common = self.triangle(poles, white, from)?;
        let common = common.r();
        let channel = |channel: usize| {
            let noise = &noise[channel];
            let (upper, right) = match from {
                0 => (Cow::Borrowed(common), linear + nonlinear + channel),
                _ => {
                    let both = (common, white);
                    let upper = self.whitened_triangle(poles, noise, both, channel, from)?;
                    (Cow::Owned(upper), linear + nonlinear)
                }
            };
            let factor = upper.view((0, 0), (linear, linear)).into_owned();
            let column = upper.column(right);
            let right = column.rows(0, linear).into_owned();
            let solved = factor.solve_upper_triangular(&right)?;
            if solved.iter().any(|v| !v.is_finite()) {
                return None;
            }
            let combination = slopes(&solved, nonlinear);
            let floor = (POLE_ROUNDING * POLE_ROUNDING) * self.len() as f64;
            Some(ChannelFit {
                square: column.rows_range(linear..).norm_squared() + floor,
                parallel: upper.view((0, linear), (linear, nonlinear)) * &combination,
                orthogonal: upper.view((linear, linear), (nonlinear, nonlinear)) * &combination,
                projected_residual: column.rows(linear, nonlinear).into_owned(),
                linear: solved,
                factor,
            })
        };
        let channels = (0..self.channels()).map(channel).collect::<Option<Vec<_>>>()?;
        Some(Fit { poles: poles.to_vec(), noise: noise.to_vec(), channels })
    }

    /// Searches for the maximum-likelihood poles for given noise, from initial poles. The search
    /// ends when a step decreases minus twice the log-likelihood by less than `tolerance`, or the
    /// time limit is over.
    ///
    /// # Source
    /// Golub & Pereyra (1973), SIAM Journal on Numerical Analysis 10, 413–432, with the Jacobian of
    /// Kaufman (1975), BIT 15, 49–57; damping after Levenberg and Marquardt.
    pub(super) fn refined(
        &self,
        poles: &[Pole],
        noise: &[Autoregression],
        tolerance: f64,
    ) -> Option<Fit> {
        let white = self.whitened(noise);
        let mut fit = self.at(poles, noise, &white)?;
        let mut cost = fit.cost(self.len());
        let mut damping = 0.0;
        for _ in 0..MAX_STEPS {
            if time_limit::is_over() {
                break;
            }
            let (jacobian, projected_residual) = fit.weighted(self.len());
            let scale: Vec<f64> =
                jacobian.column_iter().map(|c| c.norm().max(f64::MIN_POSITIVE)).collect();
            let scaled = DMatrix::from_fn(jacobian.nrows(), jacobian.ncols(), |i, j| {
                jacobian[(i, j)] / scale[j]
            });
            loop {
                let (step, expected) = damped_step(&scaled, &projected_residual, damping)?;
                if expected < tolerance || damping > MAX_DAMPING {
                    return Some(fit);
                }
                let moved = fit.poles.iter().enumerate().map(|(at, pole)| Pole {
                    growth: pole.growth + step[2 * at] / (scale[2 * at] * self.len() as f64),
                    turn: pole.turn + step[2 * at + 1] / (scale[2 * at + 1] * self.len() as f64),
                });
                let moved: Vec<Pole> = moved.collect();
                let trial = self.at(&moved, noise, &white);
                let trial = trial.map(|trial| (trial.cost(self.len()), trial));
                if let Some((less, trial)) = trial.filter(|(less, _)| *less < cost) {
                    let gained = cost - less;
                    (fit, cost) = (trial, less);
                    damping = if damping < 1e-4 { 0.0 } else { damping / 10.0 };
                    if gained < tolerance {
                        return Some(fit);
                    }
                    break;
                }
                damping = f64::max(10.0 * damping, 1e-3);
            }
        }
        Some(fit)
    }
}

impl Fit {
    /// Returns minus twice the log-likelihood, without constants, at the maximum-likelihood noise
    /// levels.
    pub(super) fn cost(&self, len: usize) -> f64 {
        let level = |of: &ChannelFit| len as f64 * (of.square / len as f64).ln();
        self.channels.iter().map(level).sum::<f64>()
            + self.noise.iter().map(Autoregression::log_volume).sum::<f64>()
    }

    /// Returns, for all channels, the derivatives with respect to the poles, and the residual. Both
    /// are divided by the standard deviation of the noise.
    fn weighted(&self, len: usize) -> (DMatrix<f64>, DVector<f64>) {
        let columns = 2 * self.poles.len();
        let mut jacobian = DMatrix::zeros(columns * self.channels.len(), columns);
        let mut projected_residual = DVector::zeros(columns * self.channels.len());
        for (at, of) in self.channels.iter().enumerate() {
            let deviation = (of.square / len as f64).sqrt();
            jacobian.rows_mut(at * columns, columns).copy_from(&(&of.orthogonal / deviation));
            projected_residual
                .rows_mut(at * columns, columns)
                .copy_from(&(&of.projected_residual / deviation));
        }
        (jacobian, projected_residual)
    }
}

/// Triangular factor of rows in which some poles have decayed; decayed poles have no columns.
struct FewColumns {
    /// Indices, among all poles, of the poles that have not decayed.
    alive: Vec<usize>,
    poles: Vec<Pole>,
    /// Index of each column of `factor` among the columns of all poles and channels.
    columns: Vec<usize>,
    width: usize,
    factor: TriangularFactor,
}

impl FewColumns {
    fn new(all: &[Pole], alive: Vec<usize>, constant: bool, channels: usize) -> Self {
        let linear = linear_columns(all, constant);
        let both = |at: &usize| [2 * at, 2 * at + 1];
        let mut columns: Vec<usize> = alive.iter().flat_map(both).collect();
        columns.extend(2 * all.len()..linear);
        columns.extend(alive.iter().flat_map(both).map(|column| linear + column));
        let width = linear + 2 * all.len() + channels;
        columns.extend(width - channels..width);
        let factor = TriangularFactor::new(columns.len());
        let poles = alive.iter().map(|at| all[*at]).collect();
        Self { alive, poles, columns, width, factor }
    }

    /// Adds the rows of `factor` to the triangular factor of all poles; returns `false` if a square
    /// overflows.
    fn merge_into(self, whole: &mut TriangularFactor) -> bool {
        let r = self.factor.r();
        let mut rows = DMatrix::zeros(r.nrows(), self.width);
        for (column, &at) in r.column_iter().zip(&self.columns) {
            rows.column_mut(at).copy_from(&column);
        }
        whole.push(&[rows.as_view()])
    }
}

/// Returns a matrix of coefficients. The columns of the poles, times k/N at sample k, and
/// multiplied by this matrix, are the derivatives of a channel with respect to N·`growth` and
/// N·`turn` of each pole.
fn slopes(linear: &DVector<f64>, nonlinear: usize) -> DMatrix<f64> {
    let mut slopes = DMatrix::zeros(nonlinear, nonlinear);
    for at in (0..nonlinear).step_by(2) {
        let (cos, sin) = (linear[at], linear[at + 1]);
        slopes[(at, at)] = cos;
        slopes[(at + 1, at)] = sin;
        slopes[(at, at + 1)] = sin;
        slopes[(at + 1, at + 1)] = -cos;
    }
    slopes
}

/// Returns the minimiser y of ‖J y − r‖² + damping·‖y‖², and the predicted decrease of ‖J y − r‖².
fn damped_step(
    jacobian: &DMatrix<f64>,
    projected_residual: &DVector<f64>,
    damping: f64,
) -> Option<(DVector<f64>, f64)> {
    let (rows, columns) = jacobian.shape();
    let mut stacked = DMatrix::zeros(rows + columns, columns + 1);
    stacked.view_mut((0, 0), (rows, columns)).copy_from(jacobian);
    stacked.view_mut((0, columns), (rows, 1)).copy_from(projected_residual);
    // A minimum Levenberg–Marquardt damping keeps the diagonal of the factor away from zero.
    for j in 0..columns {
        stacked[(rows + j, j)] = damping.max(1e-14).sqrt();
    }
    let upper = stacked.qr().unpack_r();
    let right = upper.column(columns).rows(0, columns).into_owned();
    let step = upper.view((0, 0), (columns, columns)).solve_upper_triangular(&right)?;
    let expected =
        projected_residual.norm_squared() - (projected_residual - jacobian * &step).norm_squared();
    step.iter().all(|v| v.is_finite()).then_some((step, expected))
}

#[cfg(test)]
mod tests {
    use mechid_signal::{Sampling, noise};

    use super::*;

    /// Returns a record of two channels with noise of different colours; it is longer than one
    /// segment.
    fn record(len: usize) -> DMatrix<f64> {
        let white = noise::white(Sampling::new(1.0, len).unwrap(), 2, 1.0, 3).unwrap();
        let mut samples = white.data().clone();
        for (channel, share) in [(0, 0.8), (1, -0.5)] {
            for row in 1..len {
                samples[(row, channel)] += share * samples[(row - 1, channel)];
            }
        }
        samples
    }

    /// Reference: the linear unknowns and the residual of every channel from a QR decomposition of
    /// all whitened columns. One of the poles has decayed long before the end of the record.
    #[test]
    fn coloured_channels_are_fitted_as_by_all_whitened_columns() {
        let len = 2 * POLE_SEGMENT + 500;
        let data = Data { samples: record(len), constant: true };
        let poles = [Pole { growth: -1e-4, turn: 0.3 }, Pole { growth: -0.02, turn: 1.1 }];
        let noise: Vec<Autoregression> = data
            .samples
            .column_iter()
            .map(|column| Autoregression::from_noise(column.as_slice()))
            .collect();
        assert!(noise.iter().all(|noise| noise.order() > 0));
        let fit = data.at(&poles, &noise, &data.whitened(&noise)).unwrap();
        let basis = columns(&poles, true, 0, len, len);
        for (channel, noise) in noise.iter().enumerate() {
            let white = |values: DVector<f64>| -> DVector<f64> {
                noise.whitened(values.as_slice(), 0, 0).into()
            };
            let whitened: Vec<DVector<f64>> =
                (0..5).map(|column| white(basis.column(column).into_owned())).collect();
            let (regressors, right) = (
                DMatrix::from_columns(&whitened),
                white(data.samples.column(channel).into_owned()),
            );
            let (q, r) = regressors.clone().qr().unpack();
            let linear = r.solve_upper_triangular(&q.tr_mul(&right)).unwrap();
            let square = (&right - regressors * &linear).norm_squared();
            let fitted = &fit.channels[channel];
            assert!((&fitted.linear - &linear).norm() < 1e-9 * linear.norm(), "{channel}");
            assert!((fitted.square / square - 1.0).abs() < 1e-9, "{} {square}", fitted.square);
        }
    }
}
