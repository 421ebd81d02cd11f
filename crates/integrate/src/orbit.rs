//! Periodic responses of nonlinear systems, and their stability.

use mechid_model::{InitialState, RealSchur, Response};
use nalgebra::{Complex, DMatrix, DVector};

use crate::force::ForceTable;
use crate::run::{Motion, Run};
use crate::{IntegrateError, SampledForce, Scheme, System};

/// The gap after one period at which the search ends, as a part of the largest displacement,
/// velocity or acceleration.
const CLOSED: f64 = 1e-11;

/// Tolerance where no step leads nearer.
const ROUNDING: f64 = 1e-8;

/// Largest number of Newton steps.
const MOST_STEPS: usize = 40;

/// Smallest part of a Newton step that is tried where the whole leads away.
const LEAST_PART: f64 = 1.0 / 64.0;

/// Part of the largest displacement, velocity or acceleration that the state is moved by to form a
/// derivative: central differences, whose error is its square.
const DIFFERENCE: f64 = 1e-5;

/// A periodic response, and what becomes of small disturbances of it.
#[derive(Debug, Clone, PartialEq)]
pub struct PeriodicOrbit {
    response: Response,
    multipliers: Vec<Complex<f64>>,
}

impl PeriodicOrbit {
    /// One period of the response.
    pub fn response(&self) -> &Response {
        &self.response
    }

    /// The 2n Floquet multipliers, largest first: pure numbers by which disturbances of the orbit
    /// are multiplied in each period, known to about 1e-9 of the largest. Those that belong to the
    /// memory of a scheme alone are left out as far as they are smaller.
    pub fn multipliers(&self) -> &[Complex<f64>] {
        &self.multipliers
    }

    /// Returns whether small disturbances die out: all multipliers lie within the unit circle.
    pub fn is_stable(&self) -> bool {
        self.multipliers.iter().all(|multiplier| multiplier.norm() < 1.0)
    }
}

/// A response of `system`, which may have nonlinear forces, that repeats with the force, whose
/// samples are one period (samples × n, in N): by shooting.
///
/// From `guess` the system is first left to itself for `settling` periods, which leads to a stable
/// orbit nearby; Newton's method on the state at the first sample then closes the orbit, stable or
/// not. A nonlinear system may have several orbits, and some that repeat only after two or more
/// periods: give several periods of the force for those. Nonlinear forces that depend on time must
/// repeat with the force.
///
/// A Newton step costs two passes over the period for each number of the state, so that this is for
/// few degrees of freedom; of linear systems [`integrate_periodic`](crate::integrate_periodic) finds
/// the response directly.
///
/// ```
/// use mechid_integrate::{Connection, Newmark, SystemWithForces, periodic_orbit};
/// use mechid_model::{InitialState, Sdof};
/// use mechid_signal::{Record, Sampling};
///
/// // ẍ + 0.1 ẋ + x + x³ = F; F is such that x = cos 2t is a response.
/// let linear = Sdof::new(1.0, 0.1, 1.0)?.system();
/// let hardening = Connection::to_ground(0).spring(&[0.0, 0.0, 1.0])?;
/// let system = SystemWithForces::new(&linear).with(hardening)?;
/// let sampling = Sampling::new(std::f64::consts::PI / 400.0, 400)?;
/// let force = |k: usize| {
///     let (s, c) = (2.0 * sampling.time(k)).sin_cos();
///     -4.0 * c - 0.2 * s + c + c.powi(3)
/// };
/// let force = Record::from_channel(sampling, (0..400).map(force).collect())?;
/// let near = InitialState::new([0.9].to_vec().into(), [0.0].to_vec().into())?;
/// let orbit = periodic_orbit(&Newmark::AVERAGE_ACCELERATION, &system, &force, &near, 0)?;
/// let start = orbit.response().displacement().channel(0)[0];
/// assert!((start - 1.0).abs() < 1e-3, "{start}");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Those of [`integrate`](crate::integrate()); [`IntegrateError::NoOrbit`] if Newton's method finds
/// none from there, and [`IntegrateError::NoPeriodicState`] if the orbits are not isolated.
///
/// # Source
/// Nayfeh & Balachandran, *Applied Nonlinear Dynamics* (1995), sections 6.3 (shooting) and 7.1
/// (Floquet theory).
pub fn periodic_orbit<'a>(
    scheme: &dyn Scheme,
    system: &dyn System,
    force: impl Into<SampledForce<'a>>,
    guess: &InitialState,
    settling: usize,
) -> Result<PeriodicOrbit, IntegrateError> {
    let table = ForceTable::periodic(scheme, system.dof(), force.into())?;
    guess.check_dof(system.dof())?;
    let dt = table.sampling().dt();
    let run = Run::new(scheme, system, dt)?;
    let mut shooting = Shooting { run, table, dof: system.dof(), scales: DVector::zeros(0) };
    let mut state = shooting.settle(guess, settling)?;
    let mut monodromy = None;
    let mut gap = shooting.gap(&state)?;
    for _ in 0..MOST_STEPS {
        let missed = shooting.missed(&gap);
        if missed <= CLOSED && monodromy.is_some() {
            break;
        }
        let derivative = shooting.monodromy(&state)?;
        let step = shooting.newton_step(&derivative, &gap)?;
        monodromy = Some(derivative);
        let Some([next, next_gap]) = shooting.nearer(&state, &step, missed)? else { break };
        (state, gap) = (next, next_gap);
    }
    let missed = shooting.missed(&gap);
    let Some(monodromy) = monodromy.filter(|_| missed <= ROUNDING) else {
        return Err(IntegrateError::NoOrbit { period: shooting.period(), missed });
    };
    let response = shooting.response(&state)?;
    let mut multipliers = RealSchur::new(monodromy)?.eigenvalues();
    multipliers.sort_by(|one, other| other.norm().total_cmp(&one.norm()));
    multipliers.truncate(2 * system.dof());
    Ok(PeriodicOrbit { response, multipliers })
}

/// The map of a scheme over one period of the force.
struct Shooting<'a> {
    run: Run,
    table: ForceTable<'a>,
    dof: usize,
    /// Sizes of the numbers of a state: the largest displacement for displacements, and so on.
    scales: DVector<f64>,
}

impl Shooting<'_> {
    fn samples(&self) -> usize {
        self.table.sampling().len()
    }

    fn period(&self) -> f64 {
        self.table.sampling().duration()
    }

    /// The state after the start from `guess` and `settling` periods; the scales come from the last
    /// of them.
    fn settle(
        &mut self,
        guess: &InitialState,
        settling: usize,
    ) -> Result<DVector<f64>, IntegrateError> {
        let first = self.run.stepper().first();
        let mut motions = vec![vec![0.0; 3 * self.dof]; first + 1];
        self.run.start(guess, &self.table.early(first), &mut motions)?;
        self.scales = self.sizes(&[]);
        let mut state = DVector::from_column_slice(&self.run.state);
        // What remains of the first period leads to the first sample of the next.
        if first > 0 {
            state = self.pass(&state, first % self.samples())?;
        }
        for _ in 0..settling {
            state = self.pass(&state, 0)?;
        }
        let mut seen = vec![];
        self.run.restart(state.as_slice());
        for k in 0..self.samples() {
            self.run.step(&self.table, k)?;
            seen.push(self.run.state.clone());
        }
        self.scales = self.sizes(&seen);
        Ok(state)
    }

    /// The largest displacement, velocity and acceleration (and what the scheme remembers) of
    /// `states`, for each number of a state; 1 where nothing moves.
    fn sizes(&mut self, states: &[Vec<f64>]) -> DVector<f64> {
        let (dof, len) = (self.dof, self.run.stepper().state_len());
        let size = |part: usize| {
            let of = |state: &Vec<f64>| {
                state.iter().skip(part * dof).take(dof).fold(0.0, |m: f64, z| m.max(z.abs()))
            };
            let most = states.iter().map(of).fold(0.0, f64::max);
            if most > 0.0 { most } else { 1.0 }
        };
        DVector::from_fn(len, |i, _| size(i / dof))
    }

    /// The state at the end of the period, from `state` at sample `from`.
    fn pass(&mut self, state: &DVector<f64>, from: usize) -> Result<DVector<f64>, IntegrateError> {
        self.run.restart(state.as_slice());
        for k in from..self.samples() {
            self.run.step(&self.table, k)?;
        }
        Ok(DVector::from_column_slice(&self.run.state))
    }

    /// Change of the state in a period, in parts of the scales.
    fn gap(&mut self, state: &DVector<f64>) -> Result<DVector<f64>, IntegrateError> {
        let end = self.pass(state, 0)?;
        Ok((end - state).component_div(&self.scales))
    }

    fn missed(&self, gap: &DVector<f64>) -> f64 {
        // Not `amax`, which passes over NaN.
        gap.iter().fold(0.0, |most, r| if r.abs() <= most { most } else { r.abs() })
    }

    /// Derivative of the state at the end of the period by that at its beginning, both in parts of
    /// the scales.
    fn monodromy(&mut self, state: &DVector<f64>) -> Result<DMatrix<f64>, IntegrateError> {
        let len = state.len();
        let mut derivative = DMatrix::zeros(len, len);
        for j in 0..len {
            let mut moved = |by: f64| {
                let mut moved = state.clone();
                moved[j] += by * self.scales[j];
                self.pass(&moved, 0)
            };
            let difference = moved(DIFFERENCE)? - moved(-DIFFERENCE)?;
            let column = difference.component_div(&self.scales) / (2.0 * DIFFERENCE);
            derivative.set_column(j, &column);
        }
        Ok(derivative)
    }

    /// The step that closes the orbit of the linearised map, in parts of the scales.
    fn newton_step(
        &self,
        derivative: &DMatrix<f64>,
        gap: &DVector<f64>,
    ) -> Result<DVector<f64>, IntegrateError> {
        let len = gap.len();
        let factored = (DMatrix::identity(len, len) - derivative).lu();
        let smallest = factored.u().diagonal().abs().min();
        let rounding = DIFFERENCE * DIFFERENCE;
        if smallest.is_nan() || smallest <= rounding {
            let size = derivative.norm().max(1.0);
            return Err(IntegrateError::NoPeriodicState {
                period: self.period(),
                reciprocal_condition: smallest / size,
                rounding: rounding / size,
            });
        }
        // Cannot fail: the pivots were just looked at.
        Ok(factored.solve(gap).unwrap_or_else(|| DVector::zeros(len)))
    }

    /// The state after the largest part of `step` that leaves a smaller gap, and that gap.
    fn nearer(
        &mut self,
        state: &DVector<f64>,
        step: &DVector<f64>,
        missed: f64,
    ) -> Result<Option<[DVector<f64>; 2]>, IntegrateError> {
        let mut part = 1.0;
        while part >= LEAST_PART {
            let next = state + step.component_mul(&self.scales) * part;
            match self.gap(&next) {
                Ok(gap) if self.missed(&gap) < missed => return Ok(Some([next, gap])),
                // Too far away for the equation of a step to have a solution.
                Ok(_) | Err(IntegrateError::NotSolved { .. }) => part *= 0.5,
                Err(other) => return Err(other),
            }
        }
        Ok(None)
    }

    fn response(mut self, state: &DVector<f64>) -> Result<Response, IntegrateError> {
        let mut motion = Motion::zeros(self.samples(), self.dof);
        self.run.restart(state.as_slice());
        motion.set(0, state.as_slice());
        self.run.advance(&self.table, 0, self.samples(), &mut motion)?;
        motion.into_response(&self.table)
    }
}
