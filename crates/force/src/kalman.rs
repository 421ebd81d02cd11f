//! Force and motion together, by Kalman filter and smoother.

use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{Record, Spectrum};
use nalgebra::DMatrix;

use crate::nelder_mead::minimise;
use crate::noise::channel_sizes;
use crate::smoother::StateSpace;
use crate::state_space::Machine;
use crate::transfer::Transfer;
use crate::unexplained::Rest;
use crate::{ForceError, IdentifiedForce, Measurement, Noise, Start};

/// Choice of the levels of noise and force.
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
#[non_exhaustive]
pub enum Tuning {
    /// Levels of maximum likelihood (innovations form of the likelihood).
    ///
    /// The noise of the channels is in proportion to their size; each force has a walk of its own.
    Likelihood,
    /// The noise of each channel is known (one standard deviation, in the channel's unit); the
    /// walks are as strong as makes the measurement most likely.
    ///
    /// Better than [`Tuning::Likelihood`] for a force that is no random walk: there noise is the
    /// only other explanation the likelihood has for what the walk does not fit.
    NoiseKnown(Vec<f64>),
    /// Levels given.
    Given {
        /// Standard deviation of the noise, one per channel, in the channel's unit.
        noise_std: Vec<f64>,
        /// Intensity of the random walk, one per forced degree of freedom, in N/√s: over a time t
        /// the force wanders by walk·√t.
        walk: Vec<f64>,
    },
}

/// Force and motion found together, and the tuning they were found with.
#[derive(Debug, Clone, PartialEq)]
pub struct KalmanForce {
    /// The force, with its standard error.
    pub force: IdentifiedForce,
    /// Displacement of every degree of freedom, in m, measured or not.
    pub displacement: Record,
    /// Velocity of every degree of freedom, in m/s, measured or not.
    pub velocity: Record,
    /// Standard deviation of the noise, one per channel, in the unit of the channel.
    pub noise_std: Vec<f64>,
    /// Intensity of the random walk, one per forced degree of freedom, in N/√s.
    pub walk: Vec<f64>,
    /// Logarithm of the likelihood of the measurement, dimensionless, constants left out.
    pub log_likelihood: f64,
}

/// The augmented Kalman filter with smoother: the force is a state of its own, a random walk.
///
/// The machine is carried exactly from sample to sample, the force linear between samples. The
/// smoother uses the whole record for every instant. The standard error is that of the model: a
/// random walk and white noise of the strengths found.
///
/// With accelerations only, the mean of the force leaves no trace: it drifts, and the standard
/// error says so. Measure a displacement as well.
///
/// Cost: linear in the record. With m = 2n + p states and c channels, a pass takes about
/// 2m³ + 2cm² operations per sample, tuning some hundred passes; memory is m² + cm numbers per
/// sample. No allocation per sample.
///
/// # Errors
/// [`ForceError::MoreForcesThanMeasurements`], [`ForceError::NoForcedDof`],
/// [`ForceError::NoSuchDof`], [`ForceError::TooShort`]; [`ForceError::Unseen`] if the channels
/// cannot tell the forces apart; [`ForceError::Silent`] if all channels are zero;
/// [`ForceError::NotPositive`] and [`ForceError::ChannelCount`] for a given tuning;
/// [`ForceError::NoLikelihood`], [`ForceError::StepTooLong`] and [`ForceError::Unstable`] where the
/// filter or a step of it overflows (an unstable machine is no hindrance, a free response that
/// grows by more than about e⁵ within a step is).
///
/// # Source
/// Lourens, Reynders, De Roeck, Degrande & Lombaert (2012), An augmented Kalman filter for force
/// identification in structural dynamics, Mechanical Systems and Signal Processing 27.
/// Likelihood: Schweppe (1965).
pub fn kalman(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    start: Start,
    tuning: &Tuning,
) -> Result<KalmanForce, ForceError> {
    measured.check(system.dof(), forced)?;
    let samples = measured.sampling().len();
    if samples < 3 {
        return Err(ForceError::TooShort { samples, needed: 3 });
    }
    if measured.record().data().iter().all(|y| *y == 0.0) {
        return Err(ForceError::Silent);
    }
    let scale = match tuning {
        Tuning::Likelihood => channel_sizes(measured.record()),
        Tuning::NoiseKnown(noise) => known(measured, noise)?,
        Tuning::Given { noise_std, walk } => {
            check_walks(forced, walk)?;
            known(measured, noise_std)?
        }
    };
    check_seen(system, measured, forced, &scale)?;
    let model = Model::new(system, measured, forced, start, &scale)?;
    let parameters = match tuning {
        Tuning::Likelihood => model.most_likely(None)?,
        Tuning::NoiseKnown(_) => model.most_likely(Some(0.0))?,
        Tuning::Given { walk, .. } => {
            let unit = model.walk_unit();
            std::iter::once(0.0).chain(walk.iter().map(|w| (w / unit).ln())).collect()
        }
    };
    let smoothed = model.solve(system, measured, forced, &scale, &parameters)?;
    let stated = (*tuning != Tuning::Likelihood).then_some(&smoothed.noise_std[..]);
    let rest = measured.exceeds(forced).then(|| {
        let motion = [&smoothed.displacement, &smoothed.velocity, smoothed.force.record()];
        Rest::of_motion(system, measured, motion, stated)
    });
    Ok(KalmanForce { force: smoothed.force.with_rest(rest), ..smoothed })
}

/// The stated noise levels, if they can be any.
fn known(measured: &Measurement, noise: &[f64]) -> Result<Vec<f64>, ForceError> {
    let spectrum = Spectrum::of(measured.record());
    let level = Noise::PerChannel(noise.to_vec()).resolve(measured, &spectrum, &[])?;
    Ok(level.unwrap_or_default())
}

fn check_walks(forced: &[usize], walk: &[f64]) -> Result<(), ForceError> {
    if walk.len() != forced.len() {
        return Err(ForceError::WalkCount { walks: walk.len(), forces: forced.len() });
    }
    match walk.iter().find(|value| !(**value > 0.0 && value.is_finite())) {
        Some(&value) => Err(ForceError::NotPositive { what: "random-walk intensity", value }),
        None => Ok(()),
    }
}

/// Forces that cannot be told apart at an arbitrary frequency cannot be at any.
pub(crate) fn check_seen(
    system: &SecondOrderSystem,
    measured: &Measurement,
    forced: &[usize],
    scale: &[f64],
) -> Result<(), ForceError> {
    let transfer = Transfer { system, channels: measured.channels(), forced, scale };
    let omega = 0.3 / measured.sampling().dt();
    match transfer.inverse(0, omega) {
        Err(ForceError::NotTransmitted { dof, .. }) => Err(ForceError::Unseen { dof }),
        _ => Ok(()),
    }
}

/// The augmented state space; parameters are the logarithms of the noise's standard deviation (in
/// channel scales) and of each force's walk (in walk units).
struct Model {
    space: StateSpace,
    /// Samples, channels side by side, divided by their scale.
    data: Vec<f64>,
    /// Effect of each force's walk on the state over a step, m × p, column after column.
    drives: Vec<Vec<f64>>,
    force_size: f64,
    dt: f64,
    samples: usize,
}

impl Model {
    fn new(
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        start: Start,
        scale: &[f64],
    ) -> Result<Self, ForceError> {
        let sampling = measured.sampling();
        let (n, p, channels) = (system.dof(), forced.len(), scale.len());
        let (m, dt) = (2 * n + p, sampling.dt());
        let machine = Machine::new(system, measured, forced, scale)?;
        let (held, ramp) =
            (&machine.transition.held * &machine.input, &machine.transition.ramp * &machine.input);
        let transition = DMatrix::from_fn(m, m, |j, i| match (i < 2 * n, j < 2 * n) {
            (true, true) => machine.transition.state[(i, j)],
            (true, false) => held[(i, j - 2 * n)],
            _ => f64::from(i == j),
        });
        let output = DMatrix::from_fn(m, channels, |j, c| {
            if j < 2 * n { machine.out[(c, j)] } else { machine.through[(c, j - 2 * n)] }
        });
        let drives = (0..p)
            .map(|f| {
                let column = ramp.column(f);
                column.iter().copied().chain((0..p).map(|g| f64::from(f == g))).collect()
            })
            .collect();
        let sizes = Sizes::of(measured);
        let force_size = sizes.force(system, forced);
        // Ten times what was seen is no constraint, and leaves the filter its digits.
        let spread = |size: f64| (10.0 * size).powi(2);
        let mut covariance = vec![0.0; m * m];
        for i in 0..m {
            covariance[i * m + i] = match (i < 2 * n, start) {
                (true, Start::FromRest) => 0.0,
                (true, Start::InMotion) if i < n => spread(sizes.displacement),
                (true, Start::InMotion) => spread(sizes.velocity * dt),
                (false, _) => spread(force_size),
            };
        }
        let data = (0..sampling.len() * channels)
            .map(|at| {
                measured.record().data()[(at / channels, at % channels)] / scale[at % channels]
            })
            .collect();
        let space = StateSpace {
            states: m,
            channels,
            transition: transition.as_slice().to_vec(),
            process: vec![0.0; m * m],
            output: output.as_slice().to_vec(),
            noise_variance: 1.0,
            start_mean: vec![0.0; m],
            start: covariance,
        };
        Ok(Self { space, data, drives, force_size, dt, samples: sampling.len() })
    }

    /// A walk of this many N/√s crosses the force's size within the record.
    fn walk_unit(&self) -> f64 {
        self.force_size / (self.samples as f64 * self.dt).sqrt()
    }

    /// The state space at these parameters.
    fn at(&self, parameters: &[f64]) -> StateSpace {
        let m = self.space.states;
        let mut process = vec![0.0; m * m];
        for (drive, log_walk) in self.drives.iter().zip(&parameters[1..]) {
            let variance = (log_walk.exp() * self.walk_unit()).powi(2) * self.dt;
            for (i, a) in drive.iter().enumerate() {
                for (j, b) in drive.iter().enumerate() {
                    process[i * m + j] += variance * a * b;
                }
            }
        }
        StateSpace {
            process,
            noise_variance: (2.0 * parameters[0]).exp(),
            transition: self.space.transition.clone(),
            output: self.space.output.clone(),
            start_mean: self.space.start_mean.clone(),
            start: self.space.start.clone(),
            ..self.space
        }
    }

    /// The parameters of greatest likelihood, that of the noise kept if it is given: a coarse grid
    /// with one walk for all forces, then downhill from its best point.
    fn most_likely(&self, noise: Option<f64>) -> Result<Vec<f64>, ForceError> {
        let all = |free: &[f64]| -> Vec<f64> { noise.iter().chain(free).copied().collect() };
        // Beyond these the noise has no digits left or is all there is.
        let (least, most) = (1e-8_f64.ln(), 3_f64.ln());
        let cost = |free: &[f64]| {
            let parameters = all(free);
            if (least..most).contains(&parameters[0]) {
                -self.at(&parameters).log_likelihood(&self.data)
            } else {
                f64::INFINITY
            }
        };
        let free = self.drives.len() + usize::from(noise.is_none());
        let levels: &[f64] = if noise.is_none() { &[1e-4, 1e-3, 1e-2, 1e-1] } else { &[1.0] };
        let mut best = (f64::INFINITY, Vec::new());
        for level in levels {
            for walk in [0.1_f64, 1.0, 10.0, 100.0] {
                let mut point = vec![walk.ln(); free];
                if noise.is_none() {
                    point[0] = level.ln();
                }
                let value = cost(&point);
                if value < best.0 {
                    best = (value, point);
                }
            }
        }
        if best.0 == f64::INFINITY {
            return Err(ForceError::NoLikelihood);
        }
        // A hundredth in the log-likelihood moves no parameter by a tenth of its own uncertainty.
        Ok(all(&minimise(cost, &best.1, 1.0, 0.01, 60 * free)))
    }

    /// The same, started from what a first pass says of the first sample, within a hundred times
    /// what the filter knows once it has settled.
    ///
    /// The wide start of the first pass costs the variances of the first samples their digits;
    /// this one does not, and moves the estimates by a ten-thousandth of their standard error.
    fn started(&self, mut space: StateSpace) -> StateSpace {
        let m = space.states;
        let first = space.filter(&self.data);
        let settled = (3 * m).min(self.samples - 1);
        let variances: Vec<f64> = first.variances(settled, m).collect();
        let (mean, _) = space.smooth(first);
        for (i, variance) in variances.iter().enumerate() {
            let start = &mut space.start[i * m + i];
            if *start > 0.0 {
                *start = start.min(1e4 * variance);
                space.start_mean[i] = mean[i];
            }
        }
        space
    }

    fn solve(
        &self,
        system: &SecondOrderSystem,
        measured: &Measurement,
        forced: &[usize],
        scale: &[f64],
        parameters: &[f64],
    ) -> Result<KalmanForce, ForceError> {
        let space = self.started(self.at(parameters));
        let (n, m, sampling) = (system.dof(), space.states, measured.sampling());
        let (mean, variance) = space.smooth(space.filter(&self.data));
        if mean.iter().chain(&variance).any(|value| !value.is_finite()) {
            return Err(ForceError::NoLikelihood);
        }
        let mut force = DMatrix::zeros(sampling.len(), n);
        let mut error = DMatrix::zeros(sampling.len(), n);
        for (f, &dof) in forced.iter().enumerate() {
            for k in 0..sampling.len() {
                force[(k, dof)] = mean[k * m + 2 * n + f];
                error[(k, dof)] = variance[k * m + 2 * n + f].sqrt();
            }
        }
        let motion = |first: usize, unit: f64| {
            let data = DMatrix::from_fn(sampling.len(), n, |k, i| mean[k * m + first + i] / unit);
            Record::new(sampling, data)
        };
        let force = IdentifiedForce::of(Record::new(sampling, force)?);
        let level = parameters[0].exp();
        let scaling: f64 = scale.iter().map(|s| s.ln()).sum();
        Ok(KalmanForce {
            force: force.with_standard_error(Some(Record::new(sampling, error)?)),
            displacement: motion(0, 1.0)?,
            velocity: motion(n, self.dt)?,
            noise_std: scale.iter().map(|s| s * level).collect(),
            walk: parameters[1..].iter().map(|log| log.exp() * self.walk_unit()).collect(),
            log_likelihood: self.at(parameters).log_likelihood(&self.data)
                - sampling.len() as f64 * scaling,
        })
    }
}

/// Upper sizes of the motion, from what was measured: velocities and accelerations by differences
/// of the samples (noise included), displacements as if all motion were one period long.
#[derive(Default)]
struct Sizes {
    displacement: f64,
    velocity: f64,
    acceleration: f64,
}

impl Sizes {
    fn of(measured: &Measurement) -> Self {
        let sampling = measured.sampling();
        let (fast, slow) = (1.0 / sampling.dt(), 1.0 / sampling.omega0());
        let mut largest = Self::default();
        for (channel, column) in
            measured.channels().iter().zip(measured.record().data().column_iter())
        {
            let size = column.amax();
            let step =
                column.as_slice().windows(2).map(|w| (w[1] - w[0]).abs()).fold(0.0, f64::max);
            let [x, v, a] = match channel.quantity {
                ResponseQuantity::Displacement => [size, step * fast, step * fast * fast],
                ResponseQuantity::Velocity => [size * slow, size, step * fast],
                ResponseQuantity::Acceleration => [size * slow * slow, size * slow, size],
            };
            largest.displacement = largest.displacement.max(x);
            largest.velocity = largest.velocity.max(v);
            largest.acceleration = largest.acceleration.max(a);
        }
        largest
    }

    /// The force on the forced degrees of freedom that such a motion may need.
    fn force(&self, system: &SecondOrderSystem, forced: &[usize]) -> f64 {
        let row = |matrix: &DMatrix<f64>, dof: usize| matrix.row(dof).iter().map(|v| v.abs()).sum();
        let force = |dof: &usize| -> f64 {
            let (m, c, k): (f64, f64, f64) = (
                row(system.mass(), *dof),
                row(system.damping(), *dof),
                row(system.stiffness(), *dof),
            );
            m * self.acceleration + c * self.velocity + k * self.displacement
        };
        forced.iter().map(force).fold(0.0, f64::max)
    }
}
