//! Response of the machine at nominal values of its unknowns, line by line, at the degrees of
//! freedom with sensors, inputs or unknown terms.

use std::collections::HashMap;

use mechid_model::elements::{Assembly, Pattern, Power, Term};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

use super::banded::{Banded, half_band, order};
use super::{LikelihoodError, MeasuredPart};

/// Loss factor of the unknown terms of the nominal machine: it limits the response at resonances.
/// The change of the unknown terms relative to the nominal machine removes this loss factor from
/// the result.
const NOMINAL_LOSS: f64 = 0.05;

/// Response of the nominal machine at one frequency, for the degrees of freedom of [`Places`].
#[derive(Debug, Clone)]
pub(super) struct NominalLine {
    /// Transposed receptance H₀ᵀ from the joints to all degrees of freedom of [`Places`], j × r.
    pub(super) from_joints: DMatrix<Complex<f64>>,
    /// Response of the degrees of freedom of [`Places`] to a unit of each load, r × loads: inputs,
    /// loads of the machine, state loads.
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
    /// Collects the degrees of freedom of joints, sensors and a measured part. Joints are the
    /// degrees of freedom of the unknown terms and of the terms that are connected to a measured
    /// part.
    pub(super) fn new(assembly: &Assembly, measured: Option<&MeasuredPart>) -> Self {
        let n = assembly.dof();
        let mut dofs: Vec<usize> = Vec::new();
        let mut add = |at: usize| {
            if at < n && !dofs.contains(&at) {
                dofs.push(at);
            }
        };
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

    /// Returns the index of a degree of freedom in [`Places`]; `None` if [`Places`] does not
    /// contain it.
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

/// Returns whether a term is coupled at the joints; the other terms belong to the known machine.
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

/// The nominal machine, for the responses at any line.
pub(super) struct Nominal<'a> {
    assembly: &'a Assembly,
    measured: Option<&'a MeasuredPart>,
    places: &'a Places,
    /// Row of each degree of freedom in the band matrix.
    row: Vec<usize>,
    half: usize,
    coefficients: Vec<Complex<f64>>,
}

impl<'a> Nominal<'a> {
    /// Creates the nominal machine, with the initial values of its unknowns.
    pub(super) fn new(
        assembly: &'a Assembly,
        measured: Option<&'a MeasuredPart>,
        places: &'a Places,
    ) -> Self {
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
        Self { assembly, measured, places, row, half, coefficients }
    }

    /// Returns the nominal responses at the distinct frequencies of `omega`, and the index of the
    /// response of each row; the columns of `states` are state loads, n × s.
    pub(super) fn lines(
        &self,
        omega: &[f64],
        states: &DMatrix<f64>,
    ) -> Result<(Vec<NominalLine>, Vec<usize>), LikelihoodError> {
        // Rows of equal frequency share a line.
        let mut distinct: HashMap<u64, usize> = HashMap::new();
        let mut lines: Vec<usize> = Vec::new();
        let mut first_rows: Vec<usize> = Vec::new();
        for (at, omega) in omega.iter().enumerate() {
            let fresh = first_rows.len();
            let line = *distinct.entry(omega.to_bits()).or_insert(fresh);
            if line == fresh {
                first_rows.push(at);
            }
            lines.push(line);
        }
        let line = |row: &usize| self.line(omega[*row], *row, states);
        let solved: Option<Vec<NominalLine>> = first_rows.par_iter().map(line).collect();
        let failed = || LikelihoodError::NoResponse { at: "the initial values" };
        Ok((solved.ok_or_else(failed)?, lines))
    }

    fn is_measured(&self, dof: usize) -> bool {
        self.measured.is_some_and(|part| part.dofs.contains(&dof))
    }

    /// Returns two results at a line: the dynamic stiffness (or its transpose) without the rows of
    /// a measured part, and the forces per unit motion of the support.
    fn dynamic_stiffness(&self, omega: f64, transposed: bool) -> (Banded, Vec<Complex<f64>>) {
        let (n, speed) = (self.assembly.dof(), self.assembly.speed());
        let mut band = Banded::zeros(n, self.half);
        let mut support = vec![Complex::<f64>::default(); n];
        for (term, coefficient) in self.assembly.terms().iter().zip(&self.coefficients) {
            if *coefficient == Complex::default() {
                continue;
            }
            let factor = term.power.factor(omega, speed.at(omega)) * coefficient;
            term.for_each_entry(n, |row, column, value| {
                if column == n {
                    support[row] -= factor * value;
                    return;
                }
                let (row, column) = if transposed { (column, row) } else { (row, column) };
                band.add(self.row[row], self.row[column], factor * value);
            });
        }
        // The rows of a measured part are replaced by its receptance in `fill_measured`.
        (0..n).filter(|dof| self.is_measured(*dof)).for_each(|dof| {
            band.add(self.row[dof], self.row[dof], Complex::new(1.0, 0.0));
        });
        (band, support)
    }

    /// Returns the value of each reading per unit force at each degree of freedom, n × readings. A
    /// reading is a weighted sum of motions, given as a list of degrees of freedom with their
    /// weights. `None` for a singular machine.
    pub(super) fn motions_per_force(
        &self,
        omega: f64,
        readings: &[Vec<(usize, f64)>],
    ) -> Option<DMatrix<Complex<f64>>> {
        let n = self.assembly.dof();
        let mut sides = DMatrix::zeros(n, readings.len());
        for (column, reading) in readings.iter().enumerate() {
            for (dof, weight) in reading.iter().filter(|(dof, _)| *dof < n) {
                sides[(self.row[*dof], column)] += Complex::from(*weight);
            }
        }
        self.dynamic_stiffness(omega, true).0.solve(&mut sides).then_some(())?;
        Some(DMatrix::from_fn(n, readings.len(), |dof, column| sides[(self.row[dof], column)]))
    }

    /// Returns the diagonal of the dynamic stiffness at a line.
    pub(super) fn diagonal(&self, omega: f64) -> Vec<Complex<f64>> {
        let n = self.assembly.dof();
        let mut diagonal = vec![Complex::<f64>::default(); n];
        for (term, coefficient) in self.assembly.terms().iter().zip(&self.coefficients) {
            let factor = term.power.factor(omega, self.assembly.speed().at(omega)) * coefficient;
            term.for_each_entry(n, |row, column, value| {
                if row == column {
                    diagonal[row] += factor * value;
                }
            });
        }
        diagonal
    }

    fn line(&self, omega: f64, data_row: usize, states: &DMatrix<f64>) -> Option<NominalLine> {
        let n = self.assembly.dof();
        let (mut band, support) = self.dynamic_stiffness(omega, false);
        let loads = self.load_columns(omega, states);
        let joints = self.places.joints;
        let mut sides = DMatrix::zeros(n, joints + loads.len());
        for (column, dof) in self.places.dofs[..joints].iter().enumerate() {
            if !self.is_measured(*dof) {
                sides[(self.row[*dof], column)] = Complex::new(1.0, 0.0);
            }
        }
        let mut moved = Vec::with_capacity(loads.len());
        for (column, load) in loads.iter().enumerate() {
            let mut motion = Complex::<f64>::default();
            for (at, value) in load.iter().filter(|(at, _)| !self.is_measured(*at)) {
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

    /// Returns the loads of the inputs, the loads of the machine, and the state loads.
    fn load_columns(&self, omega: f64, states: &DMatrix<f64>) -> Vec<Vec<(usize, Complex<f64>)>> {
        let (n, speed) = (self.assembly.dof(), self.assembly.speed());
        let inputs = self.assembly.inputs().iter().map(|input| input.load(n, omega, speed));
        let of_machine = self.assembly.own_loads(omega).into_iter().map(|(_, load)| load);
        let states = states.column_iter().map(|column| {
            let loads = column.iter().enumerate().filter(|(_, load)| **load != 0.0);
            loads.map(|(dof, load)| (dof, Complex::from(*load))).collect()
        });
        inputs.chain(of_machine).chain(states).collect()
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
