//! Noise spectrum from sample covariances of single lines.

mod neighbours;

use std::f64::consts::TAU;
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use mechid_numerics::time_limit;
use mechid_signal::message;
use nalgebra::{Complex, DMatrix};

use self::neighbours::Neighbours;
use crate::limits::{POOLING_MARGIN, POOLING_SPARE, SMOOTH_OPERATIONS};
use crate::noise::smooth;
use crate::noise::smooth::{Form, Smooth};

type Covariances = Vec<DMatrix<Complex<f64>>>;

/// Choice of the lines that share a noise covariance.
///
/// A covariance from few periods is uncertain, and estimates weighted with it are less accurate.
/// Noise spectra are smooth, so lines may share their covariances. As text: `auto`, `white`,
/// `smooth`, `neighbours:N` or `per-line`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "String", into = "String"))]
pub enum Pooling {
    /// Automatic choice: the variant among all others that predicts the samples best.
    #[default]
    Automatic,
    /// One covariance for all lines: white noise in the measured quantity.
    AllLines,
    /// A smooth spectrum of each channel: its logarithm is a polynomial in the logarithm of the
    /// frequency, and some bands may have another level. The correlations of channels are equal on
    /// all lines. Order and bands are chosen from the samples, so that white noise is recognised.
    Smooth,
    /// Mean of the covariances over a line and this many neighbouring lines on either side. Near an
    /// end of the band more lines are taken from the other side, so that the total number of lines
    /// is the same.
    Neighbours(usize),
    /// A separate covariance for every line; this choice needs many periods.
    PerLine,
}

impl fmt::Display for Pooling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Automatic => f.write_str("auto"),
            Self::AllLines => f.write_str("white"),
            Self::Smooth => f.write_str("smooth"),
            Self::Neighbours(lines) => write!(f, "neighbours:{lines}"),
            Self::PerLine => f.write_str("per-line"),
        }
    }
}

impl From<Pooling> for String {
    fn from(pooling: Pooling) -> Self {
        pooling.to_string()
    }
}

impl FromStr for Pooling {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let neighbours = || text.strip_prefix("neighbours:")?.parse().ok().map(Self::Neighbours);
        match text {
            "auto" => Ok(Self::Automatic),
            "white" => Ok(Self::AllLines),
            "smooth" => Ok(Self::Smooth),
            "per-line" => Ok(Self::PerLine),
            _ => neighbours().ok_or_else(|| {
                "write auto, white, smooth, neighbours:N (lines to either side) or per-line".into()
            }),
        }
    }
}

impl TryFrom<String> for Pooling {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

/// Form of a noise spectrum that was estimated from samples.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[cfg_attr(feature = "serde", serde(tag = "kind", rename_all = "snake_case"))]
pub enum NoiseModel {
    /// One level for all lines.
    White,
    /// A smooth spectrum.
    Smooth {
        /// Order of the polynomial of log power in log frequency.
        order: usize,
        /// Bands with other levels, for example due to a disturbance: lowest and highest line, in
        /// Hz.
        bands_hz: Vec<[f64; 2]>,
    },
    /// Response of the system to unmeasured forces at all degrees of freedom; all forces have the
    /// same smooth spectrum.
    UnmeasuredForce {
        /// Order of the polynomial of log power of the forces in log frequency.
        order: usize,
        /// Bands in which the forces have other levels: lowest and highest line, in Hz.
        bands_hz: Vec<[f64; 2]>,
    },
    /// Noise whose standard deviation is proportional to the magnitude of the response.
    Proportional {
        /// `true` if white noise is added.
        with_white: bool,
    },
    /// Means over neighbouring lines.
    Neighbours {
        /// Number of neighbouring lines on either side of a line.
        half_width: usize,
    },
    /// A separate level at every line.
    PerLine,
}

impl NoiseModel {
    /// Returns the number of parameters (a pure number) of the spectrum of one channel on this
    /// number of `lines`: coefficients, the level and both ends of every band, or independent
    /// means.
    ///
    /// # Source
    /// Ours.
    pub fn parameters(&self, lines: usize) -> f64 {
        match self {
            Self::White => 1.0,
            Self::Smooth { order, bands_hz } | Self::UnmeasuredForce { order, bands_hz } => {
                (1 + order + 3 * bands_hz.len()) as f64
            }
            Self::Proportional { with_white } => 1.0 + f64::from(*with_white),
            Self::Neighbours { half_width } => lines as f64 / (2 * half_width + 1) as f64,
            Self::PerLine => lines as f64,
        }
    }
}

impl fmt::Display for NoiseModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::White => f.write_str("white"),
            Self::Smooth { order, bands_hz } | Self::UnmeasuredForce { order, bands_hz } => {
                if matches!(self, Self::UnmeasuredForce { .. }) {
                    f.write_str("like the response to an unmeasured force, ")?;
                }
                match order {
                    0 => f.write_str("white")?,
                    order => write!(f, "smooth (order {order})")?,
                }
                const SHOWN: usize = 3;
                for (at, [low, high]) in bands_hz.iter().take(SHOWN).enumerate() {
                    let before = if at == 0 { ", other levels at" } else { "," };
                    write!(f, "{before} {low:.4} to {high:.4} Hz")?;
                }
                match bands_hz.len().saturating_sub(SHOWN) {
                    0 => Ok(()),
                    more => write!(f, " and in {}", message::count(more, "more band")),
                }
            }
            Self::Proportional { with_white } => {
                f.write_str("in proportion to the response")?;
                f.write_str(if *with_white { ", plus white noise" } else { "" })
            }
            Self::Neighbours { half_width } => {
                write!(f, "averaged over {}", message::count(2 * half_width + 1, "line"))
            }
            Self::PerLine => f.write_str("line by line"),
        }
    }
}

/// Noise spectrum estimated from samples.
pub(crate) struct Pooled {
    pub(crate) covariance: Covariances,
    pub(crate) model: NoiseModel,
    /// Number of complex deviations of each covariance.
    pub(crate) freedom: f64,
    /// Orthonormal columns that span the log powers of a smooth spectrum, lines × terms.
    pub(crate) basis: Option<DMatrix<f64>>,
}

/// Pools sample covariances at `omega` (rad/s), each of `nu` complex deviations. If `relative`
/// powers (lines × channels) are given, a smooth spectrum may be a smooth factor times these
/// powers.
pub(crate) fn pooled(
    omega: &[f64],
    covariance: Covariances,
    nu: f64,
    pooling: Pooling,
    relative: Option<&DMatrix<f64>>,
) -> Pooled {
    let lines = covariance.len();
    match pooling {
        Pooling::PerLine => {
            Pooled { covariance, model: NoiseModel::PerLine, freedom: nu, basis: None }
        }
        Pooling::AllLines => {
            let mean_covariance = mean(&covariance, 0..lines);
            white(mean_covariance, nu, lines)
        }
        Pooling::Neighbours(half_width) => {
            let places = FrequencyOrder::new(omega);
            let means = Neighbours::new(&places.sorted(&covariance)).means(half_width);
            let model = NoiseModel::Neighbours { half_width: half_width.min(lines) };
            let freedom = nu * window(0, half_width, lines).len() as f64;
            Pooled { covariance: places.unsorted(means), model, freedom, basis: None }
        }
        Pooling::Smooth => Candidate::new(omega, covariance, nu, relative).smooth(),
        Pooling::Automatic => Candidate::new(omega, covariance, nu, relative).best(),
    }
}

/// Returns one covariance for all lines.
fn white(covariance: DMatrix<Complex<f64>>, nu: f64, lines: usize) -> Pooled {
    let level = DMatrix::from_element(lines, 1, (lines as f64).sqrt().recip());
    Pooled {
        covariance: vec![covariance; lines],
        model: NoiseModel::White,
        freedom: nu * lines as f64,
        basis: Some(level),
    }
}

/// Indices of lines in rising order of frequency.
struct FrequencyOrder(Vec<usize>);

impl FrequencyOrder {
    fn new(omega: &[f64]) -> Self {
        let mut places: Vec<usize> = (0..omega.len()).collect();
        places.sort_by(|a, b| omega[*a].total_cmp(&omega[*b]));
        Self(places)
    }

    fn sorted<T: Clone>(&self, all: &[T]) -> Vec<T> {
        self.0.iter().map(|at| all[*at].clone()).collect()
    }

    fn unsorted<T: Clone>(&self, sorted: Vec<T>) -> Vec<T> {
        let mut unsorted = sorted.clone();
        for (value, at) in sorted.into_iter().zip(&self.0) {
            unsorted[*at] = value;
        }
        unsorted
    }
}

/// Sample covariances in rising order of frequency, and the smooth spectrum fitted to them.
struct Candidate {
    places: FrequencyOrder,
    omega: Vec<f64>,
    covariance: Covariances,
    nu: f64,
    /// Channels with noise.
    noisy: Vec<usize>,
    smooth: Option<Smooth>,
    /// `true` if the smooth quantity is the ratio of the power to the relative powers; `false` if
    /// it is the power.
    is_relative: bool,
}

impl Candidate {
    fn new(
        omega: &[f64],
        covariance: Covariances,
        nu: f64,
        relative: Option<&DMatrix<f64>>,
    ) -> Self {
        let places = FrequencyOrder::new(omega);
        let (omega, covariance) = (places.sorted(omega), places.sorted(&covariance));
        let channels = 0..covariance.first().map_or(0, DMatrix::nrows);
        let power = |channel: usize| covariance.iter().map(move |c| c[(channel, channel)].re);
        let noisy: Vec<usize> = channels
            .filter(|channel| {
                let sum = power(*channel).sum::<f64>();
                // The fit uses the logarithm of the power, so a channel with an infinite or almost
                // zero power counts as a channel without noise.
                sum.is_finite() && sum > f64::MIN_POSITIVE / f64::EPSILON
            })
            .collect();
        let chosen = (!noisy.is_empty()).then(|| {
            let variances = DMatrix::from_fn(omega.len(), noisy.len(), |line, at| {
                covariance[line][(noisy[at], noisy[at])].re
            });
            time_limit::spend(SMOOTH_OPERATIONS * (omega.len() * noisy.len()) as f64);
            match relative {
                None => (smooth::choose(&omega, &variances, nu), false),
                Some(relative) => {
                    let relative = DMatrix::from_fn(omega.len(), noisy.len(), |line, at| {
                        relative[(places.0[line], noisy[at])]
                    });
                    smooth::choose_beside(&omega, &variances, nu, &relative)
                }
            }
        });
        let is_relative = matches!(chosen, Some((_, true)));
        let smooth = chosen.map(|(smooth, _)| smooth);
        Self { places, omega, covariance, nu, noisy, smooth, is_relative }
    }

    /// Returns the smooth spectrum, with the mean correlation of the channels.
    fn smooth(&self) -> Pooled {
        let lines = self.covariance.len();
        let Some(smooth) =
            self.smooth.as_ref().filter(|smooth| self.is_relative || smooth.form.terms() > 1)
        else {
            return white(mean(&self.covariance, 0..lines), self.nu, lines);
        };
        let deviations = self.deviations(smooth);
        let level = mean(&scaled(&self.covariance, &deviations, |value, by| value / by), 0..lines);
        let covariance = scaled(&vec![level; lines], &deviations, |value, by| value * by);
        let model = match model_of(&smooth.form, &self.omega) {
            NoiseModel::Smooth { order, bands_hz } if self.is_relative => {
                NoiseModel::UnmeasuredForce { order, bands_hz }
            }
            NoiseModel::White if self.is_relative => {
                NoiseModel::UnmeasuredForce { order: 0, bands_hz: Vec::new() }
            }
            other => other,
        };
        let freedom = freedom(&smooth.form, self.nu, lines, self.covariance[0].nrows() / 2);
        let mut basis = smooth.basis.clone();
        for (sorted, row) in smooth.basis.row_iter().zip(&self.places.0) {
            basis.row_mut(*row).copy_from(&sorted);
        }
        let covariance = self.places.unsorted(covariance);
        Pooled { covariance, model, freedom, basis: Some(basis) }
    }

    /// Returns the smooth spectrum, or the means over lines if they predict better.
    fn best(self) -> Pooled {
        let smooth = self.smooth();
        let channels = self.noisy.len() as f64;
        let Some(Smooth { form, .. }) = &self.smooth else { return smooth };
        let covariance = self.noisy_part(&self.covariance);
        let modelled = self.noisy_part(&self.places.sorted(&smooth.covariance));
        let costs = modelled.iter().zip(&covariance).map(|(s, sample)| sample_cost(s, sample));
        let Some(smooth_cost) = costs.sum::<Option<f64>>() else { return smooth };
        let unknowns = channels * form.terms() as f64 + channels * (channels - 1.0);
        let to_beat = smooth_cost + (unknowns - POOLING_MARGIN) / self.nu;
        let half_widths = (0..usize::BITS).map(|power| (1usize << power) - 1);
        let half_widths = half_widths.take_while(|half| 4 * half + 2 <= covariance.len());
        let enough = half_widths.filter(|half| {
            (2 * half + 1) as f64 * self.nu >= (2.0 * channels).max(channels + POOLING_SPARE)
        });
        let neighbours = Neighbours::new(&covariance);
        let scored = enough.filter_map(|half_width| {
            let score = match half_width {
                0 => single_line_cost(&covariance, self.nu),
                _ => neighbours.cost(half_width),
            };
            Some((score?, half_width))
        });
        let best = scored.min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, half_width)) = best.filter(|(score, _)| *score < to_beat) else {
            return smooth;
        };
        let pooling = match half_width {
            0 => Pooling::PerLine,
            wide => Pooling::Neighbours(wide),
        };
        let Self { places, omega, covariance, nu, .. } = self;
        let means = pooled(&omega, covariance, nu, pooling, None);
        Pooled { covariance: places.unsorted(means.covariance), ..means }
    }

    /// Returns the standard deviations of a smooth spectrum, lines × all channels; 1 for channels
    /// without noise.
    fn deviations(&self, smooth: &Smooth) -> DMatrix<f64> {
        let mut all_deviations =
            DMatrix::from_element(self.omega.len(), self.covariance[0].nrows(), 1.0);
        for (at, channel) in self.noisy.iter().enumerate() {
            let deviations = smooth.log_power.column(at).map(|log| (0.5 * log).exp());
            all_deviations.set_column(*channel, &deviations);
        }
        all_deviations
    }

    fn noisy_part(&self, all: &[DMatrix<Complex<f64>>]) -> Covariances {
        all.iter().map(|c| c.select_rows(&self.noisy).select_columns(&self.noisy)).collect()
    }
}

/// Returns the number of complex deviations at which a sample covariance of n displacements has the
/// same relative uncertainty as a smooth spectrum, on average over the lines.
///
/// A level that has `terms` unknowns and is fitted to `lines` lines has the leverage `terms/lines`;
/// correlations are estimated from all lines.
pub(crate) fn freedom(form: &Form, nu: f64, lines: usize, n: usize) -> f64 {
    (n * lines) as f64 * nu / (form.terms() + n - 1) as f64
}

/// Returns the noise model with this form.
pub(crate) fn model_of(form: &Form, omega: &[f64]) -> NoiseModel {
    if form.terms() == 1 {
        return NoiseModel::White;
    }
    let hz = |place: usize| omega[place] / TAU;
    let bands = form.bands(omega.len());
    let bands_hz = bands.into_iter().map(|band| [hz(band.start), hz(band.end - 1)]).collect();
    NoiseModel::Smooth { order: form.order, bands_hz }
}

fn mean(covariance: &[DMatrix<Complex<f64>>], range: Range<usize>) -> DMatrix<Complex<f64>> {
    let count = range.len() as f64;
    let mut sum = covariance[range.start].clone();
    covariance[range.start + 1..range.end].iter().for_each(|c| sum += c);
    sum.unscale(count)
}

/// Returns the `2 half_width + 1` lines around a line, or all lines if there are fewer. The width
/// is the same for all lines, so that all averages have the same number of degrees of freedom.
fn window(line: usize, half_width: usize, lines: usize) -> Range<usize> {
    let width = half_width.saturating_mul(2).saturating_add(1).min(lines);
    let first = line.saturating_sub(half_width).min(lines - width);
    first..first + width
}

/// Multiplies or divides (`put`) each entry of the covariances by the standard deviations of its
/// two channels. The `deviations` are lines × channels.
fn scaled(
    covariance: &[DMatrix<Complex<f64>>],
    deviations: &DMatrix<f64>,
    put: impl Fn(Complex<f64>, f64) -> Complex<f64>,
) -> Covariances {
    let one = |(line, c): (usize, &DMatrix<Complex<f64>>)| {
        DMatrix::from_fn(c.nrows(), c.ncols(), |i, j| {
            put(c[(i, j)], deviations[(line, i)] * deviations[(line, j)])
        })
    };
    covariance.iter().enumerate().map(one).collect()
}

/// Returns log det S + tr(S⁻¹Ŝ): minus the log-likelihood of the covariance S, per complex
/// deviation, for a sample covariance Ŝ. `None` for a singular S.
fn sample_cost(s: &DMatrix<Complex<f64>>, sample: &DMatrix<Complex<f64>>) -> Option<f64> {
    if is_diagonal(s) {
        let variances = (0..s.nrows()).map(|at| (s[(at, at)].re, sample[(at, at)].re));
        return independent_cost(variances);
    }
    let factor = s.clone().cholesky()?;
    Some(log_determinant(factor.l_dirty())? + factor.solve(sample).trace().re)
}

/// Returns the [`sample_cost`] of independent channels, from pairs of a modelled variance and a
/// sample variance.
fn independent_cost(variances: impl Iterator<Item = (f64, f64)>) -> Option<f64> {
    let cost = |(variance, sample): (f64, f64)| {
        (variance > 0.0).then(|| variance.ln() + sample / variance)
    };
    variances.map(cost).sum()
}

fn is_diagonal(c: &DMatrix<Complex<f64>>) -> bool {
    let off_diagonal = |column: usize| (0..c.nrows()).filter(move |row| *row != column);
    let is_zero =
        |column: usize| off_diagonal(column).all(|row| c[(row, column)].norm_sqr() == 0.0);
    (0..c.ncols()).all(is_zero)
}

/// Returns twice the sum of the logarithms of the diagonal of a triangular matrix; `None` unless
/// all of them are positive.
fn log_determinant(lower: &DMatrix<Complex<f64>>) -> Option<f64> {
    let positive = |z: &Complex<f64>| z.re > 0.0 && z.im.abs() <= 1e-8 * z.re;
    let diagonal = lower.diagonal();
    diagonal.iter().all(positive).then(|| diagonal.iter().map(|z| 2.0 * z.re.ln()).sum())
}

/// Returns the sum over lines of the mean [`sample_cost`] if each sample covariance predicts other
/// samples of the same line. The sum uses the means of the logarithm and of the inverse of a sample
/// covariance of `nu` complex deviations.
///
/// # Source
/// Goodman (1963), Annals of Mathematical Statistics 34, 152–177 (complex Wishart distribution).
fn single_line_cost(covariance: &[DMatrix<Complex<f64>>], nu: f64) -> Option<f64> {
    let channels = covariance.first()?.nrows() as f64;
    if nu <= channels {
        return None;
    }
    let inverse = channels * nu / (nu - channels);
    let samples = covariance.iter();
    samples.map(|c| Some(log_determinant(c.clone().cholesky()?.l_dirty())? + inverse)).sum()
}
