//! Steps of one or two degrees of freedom with nonlinear forces on one of them, with arrays of
//! fixed size.
//!
//! ```text
//! z(t+Δt) = z + D z + B F + Σ E_s g_s,   g_s = g(x_s, ẋ_s, t_s)
//! [x_s ẋ_s] = X_s [z F] + Σ P_sr g_r,    r ≤ s
//! ```
//!
//! at the collocations s of a step. These maps are read from the stepping code with unit states,
//! unit loads and unit forces. Each collocation has one equation in one unknown; an explicit scheme
//! has no equation.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::limits;
use crate::nonlinear::force::{NonlinearForce, Tangents};
use crate::nonlinear::system_with_forces::SystemWithForces;
use crate::schemes::scheme::Scheme;
use crate::stepping::fixed_size::resolves;
use crate::stepping::stepper::Loads;
use crate::stepping::transition::Transition;
use crate::system::System;

/// Largest number of collocations of a step.
const MOST: usize = 4;

/// The maps of a step with its collocations, and the nonlinear forces.
#[derive(Debug)]
pub(crate) struct Collocations {
    transition: Transition,
    collocations: Vec<Collocation>,
    forces: Vec<Arc<dyn NonlinearForce>>,
    /// Degree of freedom of the forces.
    dof: usize,
    dt: f64,
}

/// One collocation: an instant of a step at which the nonlinear force is evaluated.
#[derive(Debug)]
struct Collocation {
    /// Time from the beginning of the step to this collocation, in s.
    after: f64,
    /// Displacement and velocity at this collocation per unit of each number of the state and of
    /// each load.
    motion_map: [Vec<f64>; 2],
    /// Displacement and velocity at every collocation due to a force of 1 N at this collocation.
    moves: [[f64; MOST]; 2],
    /// Change E of the state due to a force of 1 N at this collocation.
    change: Vec<f64>,
    /// Force, in N, equivalent to an acceleration of 1 m/s²; infinite if the scheme is explicit.
    per_acceleration: f64,
}

/// Forces at a collocation in the previous steps, and the ratio of the last correction of the force
/// to the residual.
#[derive(Debug, Clone, Copy)]
struct ForceHistory {
    /// The forces, latest first, in N.
    forces: [f64; 3],
    /// Ratio of the last correction of the force to the residual.
    correction: f64,
}

impl Collocations {
    /// Creates the maps of `scheme` for a step of `dt` seconds, if the system is small enough, all
    /// nonlinear forces act on the same degree of freedom, and the step is short compared with
    /// every natural period.
    pub(crate) fn from_scheme(scheme: &dyn Scheme, system: &dyn System, dt: f64) -> Option<Self> {
        let forces = system.nonlinear_forces();
        let &[dof] = forces.first()?.dofs() else { return None };
        let n = system.dof();
        if n > limits::FIXED_SIZE_DOF || forces.iter().any(|force| force.dofs() != [dof]) {
            return None;
        }
        let probe = Probe { dof: [dof], state: Arc::default() };
        let linear = system.matrices();
        let probed = SystemWithForces::new(&linear).with(probe.clone()).ok()?;
        let mut stepper = scheme.prepare_unchecked(&probed, dt).ok()?;
        let mut columns = Vec::new();
        let transition =
            Transition::read(stepper.as_mut(), || columns.push(probe.take_evaluations()));
        let count = columns.iter().map(Vec::len).max()?;
        if ![1, 2, MOST].contains(&count)
            || columns.iter().any(|asked| asked.len() != count)
            || !resolves(&transition, dt, n, 1.0)
        {
            return None;
        }
        let mut collocations: Vec<Collocation> = (0..count)
            .map(|s| Collocation {
                after: columns[0][s].time,
                motion_map: [0, 1]
                    .map(|part| columns.iter().map(|asked| asked[s].motion[part]).collect()),
                moves: [[0.0; MOST]; 2],
                change: vec![0.0; stepper.state_len()],
                per_acceleration: 0.0,
            })
            .collect();
        let (rest, zeros) = (vec![0.0; stepper.state_len()], vec![0.0; n]);
        for r in 0..count {
            probe.set_unit_force(r);
            stepper.change(&rest, &Loads::none(&zeros), &mut collocations[r].change).ok()?;
            for (s, Asked { motion, .. }) in probe.take_evaluations().iter().enumerate() {
                (0..2).for_each(|part| collocations[r].moves[part][s] = motion[part]);
            }
            let [x, v] = collocations[r].moves.map(|moved| moved[r].abs());
            collocations[r].per_acceleration = 0.25 * dt * dt / (x + dt * v);
        }
        Some(Self { transition, collocations, forces: forces.to_vec(), dof, dt })
    }

    /// Returns the transition of one step without the nonlinear forces.
    pub(crate) fn transition(&self) -> &Transition {
        &self.transition
    }

    /// Takes up to `steps` steps from `state` under the loads of `streams` and writes the first
    /// numbers of each state into `columns`. Step number `from` is the first. Returns the number of
    /// steps taken; the function stops before a step whose equation it cannot solve.
    pub(crate) fn advance(
        &self,
        state: &mut [f64],
        streams: &[&[f64]],
        columns: &mut [&mut [f64]],
        [from, steps]: [usize; 2],
    ) -> usize {
        match self.collocations.len() {
            1 => self.collocated::<1>(state, streams, columns, [from, steps]),
            2 => self.collocated::<2>(state, streams, columns, [from, steps]),
            4 => self.collocated::<4>(state, streams, columns, [from, steps]),
            _ => 0,
        }
    }

    /// Takes steps of `Q` collocations.
    fn collocated<const Q: usize>(
        &self,
        state: &mut [f64],
        streams: &[&[f64]],
        columns: &mut [&mut [f64]],
        steps: [usize; 2],
    ) -> usize {
        match (state.len(), streams.len()) {
            (3, 1) => self.steps::<3, 1, Q>(state, streams, columns, steps),
            (3, 2) => self.steps::<3, 2, Q>(state, streams, columns, steps),
            (3, 3) => self.steps::<3, 3, Q>(state, streams, columns, steps),
            (4, 1) => self.steps::<4, 1, Q>(state, streams, columns, steps),
            (4, 2) => self.steps::<4, 2, Q>(state, streams, columns, steps),
            (6, 2) => self.steps::<6, 2, Q>(state, streams, columns, steps),
            (6, 4) => self.steps::<6, 4, Q>(state, streams, columns, steps),
            (6, 6) => self.steps::<6, 6, Q>(state, streams, columns, steps),
            (8, 2) => self.steps::<8, 2, Q>(state, streams, columns, steps),
            (8, 4) => self.steps::<8, 4, Q>(state, streams, columns, steps),
            _ => 0,
        }
    }

    /// Takes steps of a state of `S` numbers under `W` loads, with `Q` collocations.
    fn steps<const S: usize, const W: usize, const Q: usize>(
        &self,
        state: &mut [f64],
        streams: &[&[f64]],
        columns: &mut [&mut [f64]],
        [from, steps]: [usize; 2],
    ) -> usize {
        let mut z: [f64; S] = std::array::from_fn(|i| state[i]);
        let mut streams: [_; W] = std::array::from_fn(|j| streams[j][..steps].iter());
        let linear = Rows::<S, W, S>::from_fn(|i, j| self.transition.entry(i, j));
        let [map_x, map_v] = [0, 1]
            .map(|part| Rows::<S, W, Q>::from_fn(|s, j| self.collocations[s].motion_map[part][j]));
        let mut collocations: [FixedCollocation<S, Q>; Q] =
            std::array::from_fn(|s| FixedCollocation::new(s, &self.collocations[s]));
        let acceleration = 2 * self.transition.loads[0].1.ncols() + self.dof;
        let mut done = 0;
        'steps: while done < steps {
            let (time, size) = ((from + done) as f64 * self.dt, z[acceleration].abs());
            let w = streams.each_mut().map(|stream| stream.next().copied().unwrap_or(f64::NAN));
            let (mut x, mut v) = (map_x.times(&z, &w), map_v.times(&z, &w));
            let mut next = linear.times(&z, &w);
            (0..S).for_each(|i| next[i] += z[i]);
            for s in 0..Q {
                let one = &mut collocations[s];
                let (time, [by_x, by_v]) = (time + one.after, one.own);
                let force = |g: f64| self.force(time, x[s] + by_x * g, v[s] + by_v * g);
                let g = if one.is_explicit {
                    force(0.0)
                } else {
                    match one.before.solved(force, size * one.tolerance) {
                        Some(force) => force,
                        None => break 'steps,
                    }
                };
                (0..Q).for_each(|r| x[r] += one.moves[0][r] * g);
                (0..Q).for_each(|r| v[r] += one.moves[1][r] * g);
                (0..S).for_each(|i| next[i] += one.change[i] * g);
            }
            z = next;
            columns.iter_mut().zip(&z).for_each(|(column, value)| column[done] = *value);
            done += 1;
        }
        state.copy_from_slice(&z);
        done
    }

    /// Returns the sum of the forces, in N.
    fn force(&self, time: f64, x: f64, v: f64) -> f64 {
        let mut sum = 0.0;
        for force in &self.forces {
            let mut g = [0.0];
            force.force(time, &[x], &[v], &mut g);
            sum += g[0];
        }
        sum
    }
}

impl ForceHistory {
    /// Returns the solution of g = `force(g)`; `None` if the search does not converge. The
    /// tolerance is the larger of `enough` and [`limits::STEP_RESIDUAL`] times |g|.
    ///
    /// # Source
    /// The secant method: Ostrowski, *Solution of Equations and Systems of Equations* (1960),
    /// chapter 3.
    fn solved(&mut self, force: impl Fn(f64) -> f64, enough: f64) -> Option<f64> {
        // The initial estimate continues the parabola through the last three forces.
        let [last, second, third] = self.forces;
        let mut g = 3.0 * (last - second) + third;
        let mut missed = force(g) - g;
        for _ in 0..limits::SECANT_STEPS {
            let enough = enough.max(limits::STEP_RESIDUAL * g.abs());
            if missed.abs() <= enough {
                self.forces = [g, last, second];
                return Some(g);
            }
            let next = g + missed * self.correction;
            let remaining = force(next) - next;
            if missed.abs() > limits::SECANT_UPDATE * enough {
                let correction = (next - g) / (missed - remaining);
                self.correction = if correction.is_finite() { correction } else { self.correction };
            }
            (g, missed) = (next, remaining);
        }
        None
    }
}

/// A collocation with sizes known at compile time, and the results of its last steps.
struct FixedCollocation<const S: usize, const Q: usize> {
    after: f64,
    /// Displacement and velocity at this collocation due to a force of 1 N.
    own: [f64; 2],
    /// Displacement and velocity at every collocation due to a force of 1 N at this collocation.
    moves: [[f64; Q]; 2],
    change: [f64; S],
    is_explicit: bool,
    /// Tolerance of the nonlinear force, in N per m/s² of acceleration; it follows from the
    /// relative tolerance of the accelerations.
    tolerance: f64,
    before: ForceHistory,
}

impl<const S: usize, const Q: usize> FixedCollocation<S, Q> {
    fn new(s: usize, one: &Collocation) -> Self {
        Self {
            after: one.after,
            own: one.moves.map(|moved| moved[s]),
            moves: one.moves.map(|moved| std::array::from_fn(|r| moved[r])),
            change: std::array::from_fn(|i| one.change[i]),
            is_explicit: !one.per_acceleration.is_finite(),
            tolerance: limits::STEP_RESIDUAL * one.per_acceleration,
            before: ForceHistory { forces: [0.0; 3], correction: 1.0 },
        }
    }
}

/// R rows of a map from S numbers of the state and W loads, by columns.
struct Rows<const S: usize, const W: usize, const R: usize> {
    state: [[f64; R]; S],
    loads: [[f64; R]; W],
}

impl<const S: usize, const W: usize, const R: usize> Rows<S, W, R> {
    /// Creates the map from its entries; columns from S on belong to the loads.
    fn from_fn(entry: impl Fn(usize, usize) -> f64) -> Self {
        Self {
            state: std::array::from_fn(|j| std::array::from_fn(|i| entry(i, j))),
            loads: std::array::from_fn(|j| std::array::from_fn(|i| entry(i, S + j))),
        }
    }

    /// Returns the product of these rows with `z` and `w`. Two independent sums, computed at the
    /// same time, take half the time of a single sum.
    fn times(&self, z: &[f64; S], w: &[f64; W]) -> [f64; R] {
        let [mut even, mut odd] = [[0.0; R]; 2];
        for j in (0..S).step_by(2) {
            (0..R).for_each(|i| even[i] += self.state[j][i] * z[j]);
        }
        for j in (1..S).step_by(2) {
            (0..R).for_each(|i| odd[i] += self.state[j][i] * z[j]);
        }
        for (column, w) in self.loads.iter().zip(w) {
            (0..R).for_each(|i| odd[i] += column[i] * w);
        }
        std::array::from_fn(|i| even[i] + odd[i])
    }
}

/// A force of given values that records the motions at which it was evaluated.
#[derive(Debug, Clone)]
struct Probe {
    dof: [usize; 1],
    state: Arc<Mutex<ProbeState>>,
}

#[derive(Debug, Default)]
struct ProbeState {
    /// Collocation at which the force is 1 N; at all other collocations the force is 0.
    unit: Option<usize>,
    asked: Vec<Asked>,
    /// True while Newton's method continues at the last collocation.
    continues_at_last: bool,
}

/// Instant (s), displacement and velocity of the last evaluation at a collocation.
#[derive(Debug, Clone, Copy)]
struct Asked {
    time: f64,
    motion: [f64; 2],
}

impl Probe {
    fn state(&self) -> MutexGuard<'_, ProbeState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the force 1 N at one collocation.
    fn set_unit_force(&self, unit: usize) {
        self.state().unit = Some(unit);
    }

    /// Returns the instant and the motion of each evaluation of the force since the last call, one
    /// entry per collocation.
    fn take_evaluations(&self) -> Vec<Asked> {
        std::mem::take(&mut self.state().asked)
    }
}

impl NonlinearForce for Probe {
    fn dofs(&self) -> &[usize] {
        &self.dof
    }

    fn force(&self, time: f64, x: &[f64], v: &[f64], g: &mut [f64]) {
        let mut state = self.state();
        // After Newton's method has read the tangent of a constant force, it evaluates the force
        // exactly once more.
        if std::mem::take(&mut state.continues_at_last) {
            state.asked.pop();
        }
        let at = state.asked.len();
        state.asked.push(Asked { time, motion: [x[0], v[0]] });
        g[0] = if state.unit == Some(at) { 1.0 } else { 0.0 };
    }

    fn tangents(&self, _: f64, _: &[f64], _: &[f64], tangents: &mut Tangents) -> bool {
        self.state().continues_at_last = true;
        tangents.stiffness.fill(0.0);
        tangents.damping.fill(0.0);
        true
    }
}
