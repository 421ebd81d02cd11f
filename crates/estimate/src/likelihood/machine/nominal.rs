//! Response of the machine at nominal values of its unknowns, line by line, at the degrees of
//! freedom with sensors, inputs or unknown terms.

use std::collections::HashMap;

use mechid_model::elements::{Assembly, Pattern, Power, Term};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::banded::{Banded, half_band, order};
use super::{LikelihoodError, MeasuredPart};

/// Loss factor of the unknown terms of the nominal machine: it keeps the response finite at
/// resonances, and the change of the unknown terms removes it again.
const NOMINAL_LOSS: f64 = 0.05;

/// Response of the nominal machine at one frequency, for the degrees of freedom of [`Places`].
#[derive(Debug, Clone)]
pub(super) struct NominalLine {
    /// Transposed receptance H₀ᵀ from the joints to all degrees of freedom of [`Places`], j × r.
    pub(super) from_joints: DMatrix<Complex<f64>>,
    /// Response of the degrees of freedom of [`Places`] to a unit of each load, r × loads.
    pub(super) loads: DMatrix<Complex<f64>>,
    /// Motion of the support per unit of each load.
    pub(super) support: Vec<Complex<f64>>,
}

/// Degrees of freedom with unknown terms (joints), sensors or measured parts; the joints come
/// first.
#[derive(Debug, Clone)]
pub(super) struct Places {
    pub(super) dofs: Vec<usize>,
    pub(super) joints: usize,
}

impl Places {
    /// Collects the degrees of freedom. Joints are all of them if `all`, otherwise those of unknown
    /// terms and of a measured part.
    pub(super) fn new(assembly: &Assembly, measured: Option<&MeasuredPart>, all: bool) -> Self {
        let n = assembly.dof();
        let mut dofs: Vec<usize> = Vec::new();
        let mut add = |at: usize| {
            if at < n && !dofs.contains(&at) {
                dofs.push(at);
            }
        };
        if all {
            (0..n).for_each(&mut add);
        }
        for term in assembly.terms().iter().filter(|term| is_coupled(term, measured)) {
            touched(term).for_each(&mut add);
        }
        let joints = dofs.len();
        let mut add = |at: usize| {
            if at < n && !dofs.contains(&at) {
                dofs.push(at);
            }
        };
        for sensor in assembly.sensors() {
            sensor.entries.iter().for_each(|(at, _)| add(*at));
        }
        // The errors of a measured receptance act at all degrees of freedom of its part.
        measured.iter().flat_map(|part| &part.dofs).for_each(|at| add(*at));
        Self { dofs, joints }
    }

    /// Returns the index of a degree of freedom.
    pub(super) fn index(&self, dof: usize) -> Option<usize> {
        self.dofs.iter().position(|at| *at == dof)
    }
}

/// Returns the degrees of freedom that a term couples; n is the support.
pub(super) fn touched(term: &Term) -> impl Iterator<Item = usize> + '_ {
    let (left, right, block): (&[_], &[_], &[usize]) = match &term.pattern {
        Pattern::Dyad { left, right } => (left, right, &[]),
        Pattern::Block { dofs, .. } => (&[], &[], dofs),
    };
    left.iter().chain(right).map(|(at, _)| *at).chain(block.iter().copied())
}

/// Returns whether a term is coupled at the joints, and not a part of the known machine.
pub(super) fn is_coupled(term: &Term, measured: Option<&MeasuredPart>) -> bool {
    let of_part = |at: usize| measured.is_some_and(|part| part.dofs.contains(&at));
    !term.is_known() || touched(term).any(of_part)
}

/// Returns the coefficient of a term in the nominal machine at the values `start`; 0 if it is
/// connected to a measured part.
pub(super) fn nominal_coefficient(
    term: &Term,
    start: &[f64],
    measured: Option<&MeasuredPart>,
) -> Complex<f64> {
    let of_part = |at: usize| measured.is_some_and(|part| part.dofs.contains(&at));
    if touched(term).any(of_part) {
        return Complex::default();
    }
    let loss = match (term.is_known(), term.power) {
        (false, Power::Stiffness) => NOMINAL_LOSS,
        (false, Power::Mass) => -NOMINAL_LOSS,
        _ => 0.0,
    };
    Complex::new(1.0, loss) * term.value(start)
}

/// Data that all lines share.
struct Plan<'a> {
    assembly: &'a Assembly,
    measured: Option<&'a MeasuredPart>,
    places: &'a Places,
    /// Row of each degree of freedom in the band.
    row: Vec<usize>,
    half: usize,
    coefficients: Vec<Complex<f64>>,
}

/// Returns the nominal responses at the distinct frequencies of `omega`, and the index of the
/// response of each row.
pub(super) fn prepare(
    assembly: &Assembly,
    measured: Option<&MeasuredPart>,
    places: &Places,
    omega: &[f64],
) -> Result<(Vec<NominalLine>, Vec<usize>), LikelihoodError> {
    let n = assembly.dof();
    let mut neighbours = vec![Vec::new(); n];
    for term in assembly.terms() {
        term.for_each_entry(n, |row, column, _| {
            if column < n && row != column {
                neighbours[row].push(column);
                neighbours[column].push(row);
            }
        });
    }
    neighbours.iter_mut().for_each(|columns| {
        columns.sort_unstable();
        columns.dedup();
    });
    let order = order(&neighbours);
    let mut row = vec![0; n];
    order.iter().enumerate().for_each(|(at, dof)| row[*dof] = at);
    let half = half_band(&neighbours, &order);
    let start = assembly.start();
    let nominal = |term: &Term| nominal_coefficient(term, &start, measured);
    let coefficients = assembly.terms().iter().map(nominal).collect();
    let plan = Plan { assembly, measured, places, row, half, coefficients };
    // Rows of equal frequency share a line.
    let (mut distinct, mut lines): (HashMap<u64, usize>, Vec<usize>) = (HashMap::new(), Vec::new());
    let mut first_rows: Vec<usize> = Vec::new();
    for (at, omega) in omega.iter().enumerate() {
        let fresh = first_rows.len();
        let line = *distinct.entry(omega.to_bits()).or_insert(fresh);
        if line == fresh {
            first_rows.push(at);
        }
        lines.push(line);
    }
    let solved: Option<Vec<NominalLine>> =
        first_rows.par_iter().map(|row| plan.line(omega[*row], *row)).collect();
    let failed = || LikelihoodError::NoResponse { at: "the initial values" };
    Ok((solved.ok_or_else(failed)?, lines))
}

impl Plan<'_> {
    fn line(&self, omega: f64, data_row: usize) -> Option<NominalLine> {
        let (assembly, n) = (self.assembly, self.assembly.dof());
        let speed = assembly.speed();
        let is_measured = |dof: usize| self.measured.is_some_and(|part| part.dofs.contains(&dof));
        let mut band = Banded::zeros(n, self.half);
        let mut support = vec![Complex::<f64>::default(); n];
        for (term, coefficient) in assembly.terms().iter().zip(&self.coefficients) {
            if *coefficient == Complex::default() {
                continue;
            }
            let factor = term.power.factor(omega, speed.at(omega)) * coefficient;
            term.for_each_entry(n, |row, column, value| {
                if column < n {
                    band.add(self.row[row], self.row[column], factor * value);
                } else {
                    support[row] -= factor * value;
                }
            });
        }
        // The rows of a measured part are replaced by its receptance in `fill_measured`.
        (0..n).filter(|dof| is_measured(*dof)).for_each(|dof| {
            band.add(self.row[dof], self.row[dof], Complex::new(1.0, 0.0));
        });
        let loads = self.load_columns(omega);
        let joints = self.places.joints;
        let mut sides = DMatrix::zeros(n, joints + loads.len());
        for (column, dof) in self.places.dofs[..joints].iter().enumerate() {
            if !is_measured(*dof) {
                sides[(self.row[*dof], column)] = Complex::new(1.0, 0.0);
            }
        }
        let mut moved = Vec::with_capacity(loads.len());
        for (column, load) in loads.iter().enumerate() {
            let mut motion = Complex::<f64>::default();
            for (at, value) in load.iter().filter(|(at, _)| !is_measured(*at)) {
                if *at < n {
                    sides[(self.row[*at], joints + column)] += value;
                } else {
                    motion = *value;
                    for (dof, by) in support.iter().enumerate() {
                        sides[(self.row[dof], joints + column)] += by * value;
                    }
                }
            }
            moved.push(motion);
        }
        band.solve(&mut sides).then_some(())?;
        let mut response = DMatrix::from_fn(self.places.dofs.len(), sides.ncols(), |at, column| {
            sides[(self.row[self.places.dofs[at]], column)]
        });
        self.fill_measured(data_row, &loads, &mut response);
        Some(NominalLine {
            from_joints: response.columns(0, joints).transpose(),
            loads: response.columns(joints, loads.len()).into_owned(),
            support: moved,
        })
    }

    /// Returns the loads of the inputs, then the loads of the machine.
    fn load_columns(&self, omega: f64) -> Vec<Vec<(usize, Complex<f64>)>> {
        let (n, speed) = (self.assembly.dof(), self.assembly.speed());
        let inputs = self.assembly.inputs().iter().map(|input| input.load(n, omega, speed));
        inputs.chain(self.assembly.own_loads(omega).into_iter().map(|(_, load)| load)).collect()
    }

    /// Writes the rows of a measured part from its receptance.
    fn fill_measured(
        &self,
        data_row: usize,
        loads: &[Vec<(usize, Complex<f64>)>],
        response: &mut DMatrix<Complex<f64>>,
    ) {
        let Some(part) = self.measured else { return };
        let receptance = &part.receptance[data_row];
        let index = |dof: usize| part.dofs.iter().position(|at| *at == dof);
        for (at, dof) in self.places.dofs.iter().enumerate() {
            let Some(row) = index(*dof) else { continue };
            for (column, joint) in self.places.dofs[..self.places.joints].iter().enumerate() {
                response[(at, column)] =
                    index(*joint).map_or(Complex::default(), |joint| receptance[(row, joint)]);
            }
            for (column, load) in loads.iter().enumerate() {
                let forced = load.iter().filter_map(|(dof, value)| Some((index(*dof)?, value)));
                response[(at, self.places.joints + column)] =
                    forced.map(|(dof, value)| receptance[(row, dof)] * value).sum();
            }
        }
    }
}
