//! Steps of one or two degrees of freedom as matrix products of fixed size.

use nalgebra::DMatrix;

use crate::limits;
use crate::stepping::stepper::Stepper;
use crate::stepping::transition::Transition;

/// The transition of a system of few degrees of freedom.
#[derive(Debug)]
pub(crate) struct FixedSize {
    one: Transition,
    /// Transition over two steps, if two steps are short compared with every natural period. Each
    /// step has to wait for the result of the step before; two steps at once halve this waiting
    /// time.
    two: Option<Transition>,
}

impl FixedSize {
    /// Returns the transition of `stepper` for a step of `dt` seconds, if its system is small
    /// enough and the step is short compared with every natural period.
    pub(crate) fn from_stepper(stepper: &mut dyn Stepper, dt: f64) -> Option<Self> {
        let n = stepper.dof();
        if n > limits::FIXED_SIZE_DOF {
            return None;
        }
        let one = Transition::from_stepper(stepper);
        if !resolves(&one, dt, n, 1.0) {
            return None;
        }
        let two = resolves(&one, dt, n, 2.0).then(|| doubled(&one));
        Some(Self { one, two })
    }

    /// The transition of one step.
    pub(crate) fn transition(&self) -> &Transition {
        &self.one
    }

    /// Takes `steps` steps from `state` under the loads of `streams` and writes the first numbers
    /// of each state into `columns`. Returns whether all states are finite. If there is no loop for
    /// this size, takes no step and returns `None`.
    pub(crate) fn advance(
        &self,
        state: &mut [f64],
        streams: &[&[f64]],
        columns: &mut [&mut [f64]],
        steps: usize,
    ) -> Option<bool> {
        let sizes = (state.len(), streams.len(), columns.len());
        Some(match sizes {
            (3, 1, 3) => self.steps::<3, 1, 3>(state, streams, columns, steps),
            (3, 2, 3) => self.steps::<3, 2, 3>(state, streams, columns, steps),
            (3, 3, 3) => self.steps::<3, 3, 3>(state, streams, columns, steps),
            (4, 1, 3) => self.steps::<4, 1, 3>(state, streams, columns, steps),
            (4, 2, 3) => self.steps::<4, 2, 3>(state, streams, columns, steps),
            (3, 1, 1) => self.steps::<3, 1, 1>(state, streams, columns, steps),
            (3, 2, 1) => self.steps::<3, 2, 1>(state, streams, columns, steps),
            (3, 3, 1) => self.steps::<3, 3, 1>(state, streams, columns, steps),
            (4, 1, 1) => self.steps::<4, 1, 1>(state, streams, columns, steps),
            (4, 2, 1) => self.steps::<4, 2, 1>(state, streams, columns, steps),
            (6, 2, 6) => self.steps::<6, 2, 6>(state, streams, columns, steps),
            (6, 4, 6) => self.steps::<6, 4, 6>(state, streams, columns, steps),
            (6, 6, 6) => self.steps::<6, 6, 6>(state, streams, columns, steps),
            (8, 2, 6) => self.steps::<8, 2, 6>(state, streams, columns, steps),
            (8, 4, 6) => self.steps::<8, 4, 6>(state, streams, columns, steps),
            (6, 2, 2) => self.steps::<6, 2, 2>(state, streams, columns, steps),
            (6, 4, 2) => self.steps::<6, 4, 2>(state, streams, columns, steps),
            (6, 6, 2) => self.steps::<6, 6, 2>(state, streams, columns, steps),
            (8, 2, 2) => self.steps::<8, 2, 2>(state, streams, columns, steps),
            (8, 4, 2) => self.steps::<8, 4, 2>(state, streams, columns, steps),
            _ => return None,
        })
    }

    /// Takes steps of a state of `S` numbers under `W` loads; the first `O` numbers of the state
    /// are stored.
    fn steps<const S: usize, const W: usize, const O: usize>(
        &self,
        state: &mut [f64],
        streams: &[&[f64]],
        columns: &mut [&mut [f64]],
        steps: usize,
    ) -> bool {
        let mut z: [f64; S] = std::array::from_fn(|i| state[i]);
        let mut streams: [&[f64]; W] = std::array::from_fn(|j| &streams[j][..steps]);
        let mut columns = columns.iter_mut();
        let mut columns: [&mut [f64]; O] =
            std::array::from_fn(|_| &mut columns.next().expect("O columns")[..steps]);
        let mut finite = true;
        if let Some(two) = &self.two {
            let even = steps - steps % 2;
            finite = pairs(&self.one, two, &mut z, &streams, &mut columns, even);
            streams = streams.map(|stream| &stream[even..]);
            columns = columns.map(|column| &mut column[even..]);
        }
        singles(&self.one, &mut z, &streams, &mut columns);
        state.copy_from_slice(&z);
        // Values that are not finite remain so in later steps.
        finite && z.iter().all(|z| z.is_finite())
    }
}

/// Returns whether `factor` steps of `dt` are short compared with every natural period: (ωΔt)² is
/// below about 1.
///
/// The entries of D are rounded once and are of the order of (ωΔt)². Above this limit their
/// rounding would make an undamped motion grow or decay by up to ε in every step. The stepper
/// itself has a different rounding error in each step, and preserves the energy.
pub(crate) fn resolves(transition: &Transition, dt: f64, n: usize, factor: f64) -> bool {
    let change = |i: usize| (factor * factor * dt * transition.change[(n + i, i)]).abs();
    (0..n).all(|i| change(i) <= 1.0)
}

/// Returns the transition z(t+2Δt) = z + (2D + D²) z + (B + DB) F(t) + B F(t+Δt) of two steps. It
/// stores 2D + D² and B + DB, the matrix of the loads of the first step; the loads of the second
/// step have the matrix B of one step.
fn doubled(one: &Transition) -> Transition {
    let d = &one.change;
    let later = |b: &DMatrix<f64>| b + d * b;
    Transition {
        change: d * 2.0 + d * d,
        loads: one.loads.iter().map(|(instant, b)| (*instant, later(b))).collect(),
    }
}

/// Returns D and B of a transition, by columns.
fn by_columns<const S: usize, const W: usize>(
    transition: &Transition,
) -> ([[f64; S]; S], [[f64; S]; W]) {
    let n = W / transition.loads.len();
    let change = &transition.change;
    (
        std::array::from_fn(|j| std::array::from_fn(|i| change[(i, j)])),
        std::array::from_fn(|j| std::array::from_fn(|i| transition.loads[j / n].1[(i, j % n)])),
    )
}

/// Takes steps z += D z + B w, one at a time.
fn singles<const S: usize, const W: usize, const O: usize>(
    transition: &Transition,
    z: &mut [f64; S],
    streams: &[&[f64]; W],
    columns: &mut [&mut [f64]; O],
) {
    let (d, b) = by_columns::<S, W>(transition);
    let steps = columns[0].len();
    let streams: [&[f64]; W] = std::array::from_fn(|j| &streams[j][..steps]);
    for k in 0..steps {
        let mut even = [0.0; S];
        let mut odd = *z;
        for (b, w) in b.iter().zip(&streams) {
            let w = w[k];
            (0..S).for_each(|i| even[i] += b[i] * w);
        }
        for j in (0..S).step_by(2) {
            (0..S).for_each(|i| even[i] += d[j][i] * z[j]);
        }
        for j in (1..S).step_by(2) {
            (0..S).for_each(|i| odd[i] += d[j][i] * z[j]);
        }
        (0..S).for_each(|i| z[i] = odd[i] + even[i]);
        for (column, value) in columns.iter_mut().zip(&*z) {
            column[k] = *value;
        }
    }
}

/// Takes an even number of steps, two at a time; returns whether the intermediate states are
/// finite.
fn pairs<const S: usize, const W: usize, const O: usize>(
    one: &Transition,
    two: &Transition,
    z: &mut [f64; S],
    streams: &[&[f64]; W],
    columns: &mut [&mut [f64]; O],
    steps: usize,
) -> bool {
    let (d, b) = by_columns::<S, W>(one);
    let (d_two, b_two) = by_columns::<S, W>(two);
    let mut streams: [_; W] =
        std::array::from_fn(|j| streams[j][..steps].as_chunks::<2>().0.iter());
    let mut columns =
        columns.each_mut().map(|column| column[..steps].as_chunks_mut::<2>().0.iter_mut());
    // The product 0 · v is 0 if v is finite and NaN otherwise.
    let mut watched = [0.0; O];
    for _ in 0..steps / 2 {
        let mut middle = [0.0; O];
        let [mut even, mut odd] = [[0.0; S]; 2];
        for j in 0..W {
            let Some([first, second]) = streams[j].next() else { break };
            (0..O).for_each(|i| middle[i] += b[j][i] * first);
            (0..S).for_each(|i| even[i] += b_two[j][i] * first + b[j][i] * second);
        }
        for j in 0..S {
            (0..O).for_each(|i| middle[i] += d[j][i] * z[j]);
        }
        for j in (1..S).step_by(2) {
            (0..S).for_each(|i| odd[i] += d_two[j][i] * z[j]);
        }
        for j in (0..S).step_by(2) {
            (0..S).for_each(|i| even[i] += d_two[j][i] * z[j]);
        }
        for i in 0..O {
            middle[i] += z[i];
            watched[i] += 0.0 * middle[i];
        }
        (0..S).for_each(|i| z[i] += even[i] + odd[i]);
        for i in 0..O {
            if let Some(pair) = columns[i].next() {
                *pair = [middle[i], z[i]];
            }
        }
    }
    watched == [0.0; O]
}
