//! A mode whose frequency and damping change with its amplitude.

use std::f64::consts::TAU;

use mechid_numerics::Uncertain;
use mechid_numerics::linear_algebra::svd;
use nalgebra::{Complex, DMatrix, DVector};

use super::fit::{Data, Fit};
use super::limits::{
    BACKBONE_POINTS, BACKBONE_STEPS, HIGHEST_ORDER, LOWEST_ORDER, NEIGHBOURHOOD,
    SMALLEST_AMPLITUDE, STRONG_EVIDENCE,
};
use super::poles::linear_columns;

/// Frequency and damping as functions of amplitude, for a mode that a sum of decaying oscillations
/// does not describe.
///
/// The amplitude a and the phase φ of the mode follow a slow flow, a' = −P(a) and φ' = W(a) with
/// polynomials P and W. A linear mode has P proportional to a, and W constant.
#[derive(Debug, Clone, PartialEq)]
pub struct Backbone {
    /// Modes of the linear model that the backbone replaces: their indices among all modes by
    /// rising frequency.
    pub modes: Vec<usize>,
    /// Frequency and damping, from the first amplitude down to the last amplitude above the noise.
    pub points: Vec<BackbonePoint>,
    /// Number of unknowns of the slow flow and of its amplitudes; the unknowns of other modes are
    /// not counted.
    pub unknowns: usize,
    /// Bayesian information criterion of the linear modes minus that of the slow flow, a pure
    /// number.
    pub gain: f64,
}

/// One amplitude of a backbone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BackbonePoint {
    /// Time from the first sample at which the mode has this amplitude, in s.
    pub time: f64,
    /// Amplitude in the channel in which the mode is largest, in the unit of the record.
    pub amplitude: f64,
    /// Frequency of the oscillation at this amplitude, in Hz.
    pub frequency_hz: Uncertain,
    /// Ratio of the decay rate −a'/a to the angular frequency.
    pub damping_ratio: Uncertain,
}

/// Polynomials of the slow flow: amplitude relative to its first value, time relative to the length
/// of the record.
#[derive(Debug, Clone)]
struct Flow {
    /// Coefficients of P, then of W, each from power 0 upwards.
    values: DVector<f64>,
    order: usize,
}

impl Flow {
    fn decay(&self, u: f64) -> f64 {
        horner(&self.values.as_slice()[..=self.order], u)
    }

    fn turn(&self, u: f64) -> f64 {
        horner(&self.values.as_slice()[self.order + 1..], u)
    }

    /// Returns amplitude and phase at the samples; `None` if the amplitude grows out of bounds.
    ///
    /// # Source
    /// The classical Runge–Kutta method with a step of one sample.
    fn path(&self, len: usize) -> Option<Vec<[f64; 2]>> {
        let step = 1.0 / len as f64;
        let mut path = Vec::with_capacity(len);
        let (mut u, mut phase) = (1.0_f64, 0.0);
        for _ in 0..len {
            path.push([u, phase]);
            let slope = |u: f64| if u > 0.0 { -self.decay(u) } else { 0.0 };
            let k1 = slope(u);
            let (u2, k2) = (u + 0.5 * step * k1, slope(u + 0.5 * step * k1));
            let (u3, k3) = (u + 0.5 * step * k2, slope(u + 0.5 * step * k2));
            let (u4, k4) = (u + step * k3, slope(u + step * k3));
            let turns = [u, u2, u3, u4].map(|u| self.turn(u.max(0.0)));
            phase += step / 6.0 * (turns[0] + 2.0 * (turns[1] + turns[2]) + turns[3]);
            u = (u + step / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)).max(0.0);
            if !(u <= 2.0 && phase.is_finite()) {
                return None;
            }
        }
        Some(path)
    }
}

fn horner(coefficients: &[f64], u: f64) -> f64 {
    coefficients.iter().rev().fold(0.0, |sum, c| sum * u + c)
}

/// Record minus the response of all modes that the backbone does not replace, without whitening.
struct Target<'a> {
    data: &'a Data,
    fit: &'a Fit,
    /// Samples × channels.
    samples: DMatrix<f64>,
    /// Standard deviation of the noise of each channel.
    deviations: Vec<f64>,
}

/// Slow flow with its residual.
struct Fitted {
    flow: Flow,
    /// Whitened residual of all channels, divided by the standard deviation of their noise.
    residual: DVector<f64>,
    /// Amplitudes of cosine and sine in each channel.
    amplitudes: Vec<[f64; 2]>,
}

impl<'a> Target<'a> {
    fn new(data: &'a Data, fit: &'a Fit, replaced: &[usize]) -> Self {
        let mut samples = data.residual(fit);
        let linear = linear_columns(&fit.poles, data.constant);
        let mut first = 0;
        for basis in data.chunks(&fit.poles) {
            for (channel, of) in fit.channels.iter().enumerate() {
                let mut rows = samples.view_mut((first, channel), (basis.nrows(), 1));
                for mode in replaced {
                    rows += basis.columns(2 * mode, 2) * of.linear.rows(2 * mode, 2);
                }
                if data.constant {
                    rows.add_scalar_mut(of.linear[linear - 1]);
                }
            }
            first += basis.nrows();
        }
        let deviation = |square: f64| (square / data.len() as f64).sqrt();
        let deviations = fit.channels.iter().map(|of| deviation(of.square)).collect();
        Self { data, fit, samples, deviations }
    }

    /// Returns a flow with its residual, and with amplitudes and constants from least squares.
    fn fitted(&self, flow: Flow) -> Option<Fitted> {
        let len = self.data.len();
        let path = flow.path(len)?;
        let columns = 2 + usize::from(self.data.constant);
        let basis = DMatrix::from_fn(len, columns, |row, column| {
            let [u, phase] = path[row];
            match column {
                0 => u * phase.cos(),
                1 => u * phase.sin(),
                _ => 1.0,
            }
        });
        let (mut residual, mut amplitudes) = (Vec::new(), Vec::new());
        for (channel, noise) in self.fit.noise.iter().enumerate() {
            let whitened: Vec<DVector<f64>> = basis
                .column_iter()
                .map(|column| noise.whitened(column.clone_owned().as_slice(), 0, 0).into())
                .collect();
            let basis = DMatrix::from_columns(&whitened);
            let target: DVector<f64> =
                noise.whitened(self.samples.column(channel).clone_owned().as_slice(), 0, 0).into();
            let gram = basis.tr_mul(&basis);
            let solution = gram.cholesky()?.solve(&basis.tr_mul(&target));
            amplitudes.push([solution[0], solution[1]]);
            residual
                .extend((target - basis * solution).iter().map(|e| e / self.deviations[channel]));
        }
        let residual = DVector::from_vec(residual);
        residual.iter().all(|e| e.is_finite()).then_some(Fitted { flow, residual, amplitudes })
    }

    /// Returns the derivatives of the residual with respect to the coefficients, by central
    /// differences.
    fn jacobian(&self, flow: &Flow) -> Option<DMatrix<f64>> {
        // The coefficients are in radians or nepers over the record, so one step size suits all of
        // them.
        const STEP: f64 = 1e-4;
        let columns = (0..flow.values.len()).map(|at| {
            let moved = |step: f64| {
                let mut moved = flow.clone();
                moved.values[at] += step;
                self.fitted(moved)
            };
            Some((moved(STEP)?.residual - moved(-STEP)?.residual) / (2.0 * STEP))
        });
        Some(DMatrix::from_columns(&columns.collect::<Option<Vec<_>>>()?))
    }

    /// Searches for the slow flow with the smallest sum of squared residuals.
    fn settled(&self, start: Flow) -> Option<Fitted> {
        let mut best = self.fitted(start)?;
        for _ in 0..BACKBONE_STEPS {
            let power = best.residual.norm_squared();
            let step = least_squares(self.jacobian(&best.flow)?, &best.residual)?;
            let next = [1.0, 0.3, 0.1, 0.03].iter().find_map(|length| {
                let mut flow = best.flow.clone();
                flow.values -= &step * *length;
                self.fitted(flow).filter(|next| next.residual.norm_squared() < power)
            });
            let Some(next) = next else { break };
            let gained = power - next.residual.norm_squared();
            best = next;
            if gained < 1e-3 {
                break;
            }
        }
        Some(best)
    }

    /// Returns minus twice the log-likelihood, without an additive constant; the likelihood of the
    /// linear modes omits the same constant.
    fn cost(&self, fitted: &Fitted) -> f64 {
        let len = self.data.len();
        let squares = fitted.residual.as_slice().chunks(len).zip(&self.deviations);
        let cost = |(part, deviation): (&[f64], &f64)| {
            let square = part.iter().map(|e| e * e).sum::<f64>() / len as f64;
            len as f64 * (square * deviation * deviation).ln()
        };
        squares.map(cost).sum()
    }
}

/// Returns the inverse of a Gram matrix of columns with different units; `None` if the matrix is
/// singular.
pub(super) fn inverse(gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale = gram.diagonal().map(|g| if g > 0.0 { g.sqrt().recip() } else { 0.0 });
    let scaling = DMatrix::from_diagonal(&scale);
    let identity = DMatrix::identity(gram.nrows(), gram.ncols());
    let inverse = (&scaling * gram * &scaling).cholesky()?.solve(&identity);
    Some(&scaling * inverse * &scaling)
}

/// Returns the minimiser of ‖J x − r‖, with columns scaled to unit length and without directions
/// that only rounding determines.
fn least_squares(jacobian: DMatrix<f64>, residual: &DVector<f64>) -> Option<DVector<f64>> {
    let lengths: Vec<f64> =
        jacobian.column_iter().map(|column| column.norm().max(f64::MIN_POSITIVE)).collect();
    let mut scaled = jacobian;
    for (mut column, length) in scaled.column_iter_mut().zip(&lengths) {
        column /= *length;
    }
    let triangle = scaled.clone().qr();
    let right = triangle.q().tr_mul(residual);
    let svd = svd(triangle.r()).ok()?;
    let mut step = svd.solve(&right, 1e-10 * svd.singular_values.max()).ok()?;
    step.iter_mut().zip(&lengths).for_each(|(step, length)| *step /= length);
    Some(step)
}

/// Returns the channel in which the sum of some modes is largest and, for each of these modes, its
/// amplitude in this channel and its pole per sample.
fn reference_response(
    data: &Data,
    fit: &Fit,
    modes: &[usize],
    scale: &[f64],
) -> (usize, Vec<[Complex<f64>; 2]>) {
    let complex = |channel: usize, mode: usize| {
        let (linear, pole) = (&fit.channels[channel].linear, &fit.poles[mode]);
        let amplitude = Complex::new(linear[2 * mode], -linear[2 * mode + 1]);
        // This factor refers the amplitude to the first sample.
        let back = (-pole.growth * pole.origin(data.len()) as f64).exp();
        [amplitude * back, Complex::new(pole.growth, pole.turn)]
    };
    let size = |channel: &usize| {
        let amplitudes = modes.iter().map(|mode| complex(*channel, *mode)[0]);
        amplitudes.sum::<Complex<f64>>().norm() * scale[*channel]
    };
    let reference = (0..fit.channels.len()).max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
    (reference, modes.iter().map(|mode| complex(reference, *mode)).collect())
}

/// Returns the initial flow: polynomials of the given order that best fit the amplitude and phase
/// rates of the linear modes.
fn initial_flow(modes: &[[Complex<f64>; 2]], len: usize, order: usize) -> Option<Flow> {
    const SAMPLES: usize = 400;
    let at = |k: f64| {
        let (mut value, mut slope) = (Complex::new(0.0, 0.0), Complex::new(0.0, 0.0));
        for [amplitude, pole] in modes {
            let part = amplitude * (pole * k).exp();
            value += part;
            slope += part * pole;
        }
        (value.norm(), slope / value * len as f64)
    };
    let (first, _) = at(0.0);
    let samples: Vec<(f64, Complex<f64>)> = (0..SAMPLES)
        .map(|index| at(index as f64 / SAMPLES as f64 * len as f64))
        .map(|(size, rate)| (size / first, rate))
        .filter(|(u, rate)| *u > SMALLEST_AMPLITUDE && rate.is_finite())
        .collect();
    let powers = |u: f64, count: usize| (0..count).map(move |power| u.powi(power as i32));
    let polynomial = |count: usize, value: &dyn Fn(f64, Complex<f64>) -> f64| {
        let rows = samples.iter().flat_map(|(u, _)| powers(*u, count).map(move |x| x * *u));
        let matrix = DMatrix::from_row_iterator(samples.len(), count, rows);
        let right = DVector::from_iterator(
            samples.len(),
            samples.iter().map(|(u, rate)| value(*u, *rate) * *u),
        );
        (samples.len() > count).then(|| least_squares(matrix, &right)).flatten()
    };
    let decay = polynomial(order + 1, &|u, rate| -rate.re * u)?;
    let turn = polynomial(order, &|_, rate| rate.im)?;
    let values = decay.iter().chain(turn.iter()).copied().collect::<Vec<f64>>();
    Some(Flow { values: values.into(), order })
}

/// Returns the backbone of the strongest mode if it describes the record better than the linear
/// modes near it, by the Bayesian information criterion; `energies` are the energies of the modes,
/// `scale` is the unit of each channel of the data.
///
/// The linear modes nearest in frequency to the strongest mode are replaced: first one mode, next
/// two, and so on. The order of the polynomials rises from two.
///
/// # Source
/// Londoño, Neild & Cooper (2015), Journal of Sound and Vibration 339, 205–223 (backbones from
/// resonant decays); Nayfeh & Mook, *Nonlinear Oscillations* (1979), chapter 2 (the slow flow);
/// Schwarz (1978), Annals of Statistics 6, 461–464.
pub(super) fn backbone(
    data: &Data,
    fit: &Fit,
    energies: &[f64],
    scale: &[f64],
    dt: f64,
) -> Option<Backbone> {
    let strongest = (0..energies.len()).max_by(|a, b| energies[*a].total_cmp(&energies[*b]))?;
    let turn = |mode: usize| fit.poles[mode].turn;
    let distance = |mode: &usize| (turn(*mode) - turn(strongest)).abs();
    let mut near: Vec<usize> =
        (0..fit.poles.len()).filter(|m| distance(m) < NEIGHBOURHOOD * turn(strongest)).collect();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    let (len, channels) = (data.len() as f64, data.channels());
    let linear_cost: f64 = fit.channels.iter().map(|of| len * (of.square / len).ln()).sum();
    let mut best: Option<(f64, Backbone)> = None;
    for count in 1..=near.len() {
        let replaced = &near[..count];
        let target = Target::new(data, fit, replaced);
        let unknowns = (count * (2 + 2 * channels)) as f64;
        let (reference, modes) = reference_response(data, fit, replaced, scale);
        let mut last = f64::INFINITY;
        for order in LOWEST_ORDER..=HIGHEST_ORDER {
            let Some(start) = initial_flow(&modes, data.len(), order) else { break };
            if count == 1 && !is_promising(&target, &start) {
                break;
            }
            let Some(fitted) = target.settled(start) else { break };
            let flow_unknowns = fitted.flow.values.len() + 2 * channels;
            let gain =
                linear_cost - target.cost(&fitted) + (unknowns - flow_unknowns as f64) * len.ln();
            if -gain >= last {
                break;
            }
            last = -gain;
            if gain > STRONG_EVIDENCE
                && best.as_ref().is_none_or(|(most, _)| gain > *most)
                && let Some(points) = points(&target, &fitted, (reference, scale[reference]), dt)
            {
                let candidate =
                    Backbone { modes: replaced.to_vec(), points, unknowns: flow_unknowns, gain };
                best = Some((gain, candidate));
            }
        }
    }
    best.map(|(_, backbone)| backbone)
}

/// Returns whether the first step from a linear mode is expected to lower the criterion; the
/// residual after the step is predicted linearly.
fn is_promising(target: &Target<'_>, start: &Flow) -> bool {
    let expected_gain = || {
        let (fitted, jacobian) = (target.fitted(start.clone())?, target.jacobian(start)?);
        let step = least_squares(jacobian.clone(), &fitted.residual)?;
        let remaining = (&fitted.residual - jacobian * step).norm_squared();
        Some(fitted.residual.norm_squared() - remaining)
    };
    let penalty = (start.values.len() - 2) as f64 * (target.data.len() as f64).ln();
    expected_gain().is_some_and(|gain: f64| gain > penalty)
}

/// Returns frequency and damping from the first amplitude down to the noise of the channel or to
/// the amplitude at the end of the record, whichever is larger.
fn points(
    target: &Target<'_>,
    fitted: &Fitted,
    (reference, scale): (usize, f64),
    dt: f64,
) -> Option<Vec<BackbonePoint>> {
    let len = target.data.len();
    let jacobian = target.jacobian(&fitted.flow)?;
    let unknowns = fitted.flow.values.len() + 2 * target.data.channels();
    let freedom = fitted.residual.len().checked_sub(unknowns).filter(|left| *left > 0)?;
    let variance = fitted.residual.norm_squared() / freedom as f64;
    let covariance = inverse(&jacobian.tr_mul(&jacobian))? * variance;
    let [cos, sin] = fitted.amplitudes[reference];
    let size = cos.hypot(sin);
    let path = fitted.flow.path(len)?;
    let smallest = path.last()?[0].max(target.deviations[reference] / size);
    let ratio = smallest.min(0.99).powf(1.0 / (BACKBONE_POINTS - 1) as f64);
    let points = (0..BACKBONE_POINTS).map(|at| {
        let u = ratio.powi(at as i32);
        let values = |flow: &Flow| {
            let turn = flow.turn(u);
            [turn / (len as f64 * dt * TAU), flow.decay(u) / (u * turn)]
        };
        let slope = |which: usize| {
            DVector::from_fn(fitted.flow.values.len(), |at, _| {
                let step = 1e-6 * (1.0 + fitted.flow.values[at].abs());
                let moved = |step: f64| {
                    let mut flow = fitted.flow.clone();
                    flow.values[at] += step;
                    values(&flow)[which]
                };
                (moved(step) - moved(-step)) / (2.0 * step)
            })
        };
        let uncertain = |which: usize| {
            let slope = slope(which);
            let variance = slope.dot(&(&covariance * &slope));
            let (value, standard_error) = (values(&fitted.flow)[which], variance.max(0.0).sqrt());
            Uncertain { value, standard_error, degrees_of_freedom: freedom }
        };
        let sample = path.iter().position(|[size, _]| *size <= u).unwrap_or(len - 1);
        BackbonePoint {
            time: sample as f64 * dt,
            amplitude: size * scale * u,
            frequency_hz: uncertain(0),
            damping_ratio: uncertain(1),
        }
    });
    Some(points.collect())
}
