//! Newmark's scheme on dense and sparse systems.

use mechid::integrate::{AllowUnstable, Newmark, Scheme, SelectedDofs, System, integrate_selected};
use mechid::model::{InitialState, SecondOrderSystem, SparseSystem, band, triplets};
use mechid::signal::{Record, Sampling};
use nalgebra::DMatrix;

use super::measure::{Growth, shortest};

const DT: f64 = 1e-3;

/// Measures the time of a step and the time to prepare the scheme. The force acts on one degree of
/// freedom; the responses of two degrees of freedom are kept.
pub fn measured(seconds: f64) -> Result<Vec<Growth>, String> {
    let dense: Vec<usize> = vec![2, 5, 10, 20, 50, 100, 200, 500];
    let chain = vec![100, 300, 1000, 3000, 10_000, 30_000, 100_000];
    let grid = vec![10, 20, 30, 50, 70, 100, 150];
    let full = |n: usize| {
        let stiffness = DMatrix::from_fn(n, n, |i, j| match i.abs_diff(j) {
            0 => 2000.0,
            1 => -900.0,
            gap => -1.0 / gap as f64,
        });
        SecondOrderSystem::new(DMatrix::identity(n, n), &stiffness * 1e-4, stiffness)
    };
    let of_chain = |n: usize| sparse(band(n, &[(-1, -900.0), (0, 2000.0), (1, -900.0)]));
    let mut growths = Vec::new();
    growths.extend(both(["step, dense", "preparation, dense"], &dense, seconds, full)?);
    growths.extend(both(["step, chain", "preparation, chain"], &chain, seconds, of_chain)?);
    growths.extend(both(["step, grid", "preparation, grid"], &grid, seconds, grid_system)?);
    Ok(growths)
}

fn sparse(
    stiffness: nalgebra_sparse::CsrMatrix<f64>,
) -> Result<SparseSystem, mechid::model::ModelError> {
    let mass = band(stiffness.nrows(), &[(0, 1.0)]);
    SparseSystem::new(mass, &stiffness * 1e-4, stiffness)
}

fn grid_system(side: usize) -> Result<SparseSystem, mechid::model::ModelError> {
    let at = |i: usize, j: usize| i * side + j;
    let mut entries = vec![];
    for (i, j) in (0..side).flat_map(|i| (0..side).map(move |j| (i, j))) {
        entries.push((at(i, j), at(i, j), 3800.0));
        let next = [(i + 1 < side).then(|| at(i + 1, j)), (j + 1 < side).then(|| at(i, j + 1))];
        for next in next.into_iter().flatten() {
            entries.extend([(at(i, j), next, -900.0), (next, at(i, j), -900.0)]);
        }
    }
    sparse(triplets(side * side, entries)?)
}

fn both<S: System, E: std::fmt::Display>(
    names: [&'static str; 2],
    sizes: &[usize],
    seconds: f64,
    system: impl Fn(usize) -> Result<S, E>,
) -> Result<[Growth; 2], String> {
    let [mut step, mut prepare] = names.map(Growth::new);
    for &size in sizes {
        let system = system(size).map_err(|e| e.to_string())?;
        let n = system.dof();
        step.push(n, per_step(&system, seconds)?);
        let newmark = Newmark::AVERAGE_ACCELERATION;
        let prepared = newmark.prepare(&system, DT).map_err(|e| e.to_string())?;
        drop(prepared);
        prepare.push(n, shortest(seconds, || newmark.prepare(&system, DT).is_ok()));
    }
    Ok([step, prepare])
}

/// Returns the time per step, in s: the difference between the times of a long and a short record,
/// divided by the difference in steps.
fn per_step(system: &dyn System, seconds: f64) -> Result<f64, String> {
    let n = system.dof();
    let steps = (20_000_000 / (n * n.min(100))).clamp(20, 200_000);
    let force = |len: usize| {
        let values = (0..len).map(|k| (k as f64).sin()).collect();
        let sampling = Sampling::new(DT, len).map_err(|e| e.to_string())?;
        Record::from_channel(sampling, values).map_err(|e| e.to_string())
    };
    let (short, long) = (force(2)?, force(steps + 2)?);
    let dofs = SelectedDofs { forced: &[0], observed: &[0, n - 1] };
    let initial = InitialState::rest(n);
    let scheme = AllowUnstable(&Newmark::AVERAGE_ACCELERATION);
    let time = |force: &Record| {
        shortest(seconds, || integrate_selected(&scheme, system, dofs, force, &initial).is_ok())
    };
    let begin = time(&short);
    Ok((time(&long) - begin) / steps as f64)
}
