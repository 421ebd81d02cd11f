//! Transients of records whose response is predicted from the modes.

use nalgebra::{Complex, DMatrix};

use crate::dense::{Triangle, triangularise};
use crate::lines::{Lines, Load};
use crate::mode::IdentifiedMode;
use crate::model::{growth, kernels};

type C = Complex<f64>;

/// Adds to `predicted` the transients of open records, fitted to the difference between the outputs
/// and the initial `predicted`: one complex load of each mode for each record, and real residual
/// terms of each output.
pub(crate) fn add_transients(
    lines: &Lines,
    modes: &[&IdentifiedMode],
    powers: &[i32],
    predicted: &mut DMatrix<C>,
) {
    for (load, kind) in lines.loads.iter().enumerate() {
        if let Load::Transient(_) = kind {
            add_transient(lines, modes, powers, load, predicted);
        }
    }
}

/// Fits and adds the transient of one record.
fn add_transient(
    lines: &Lines,
    modes: &[&IdentifiedMode],
    powers: &[i32],
    load: usize,
    predicted: &mut DMatrix<C>,
) {
    let outputs = lines.outputs.len();
    let mut rows: Vec<(usize, Vec<(C, C)>)> = Vec::new();
    for block in lines.blocks.iter().filter(|block| block.active.contains(&load)) {
        let growths: Vec<C> = modes.iter().map(|mode| growth(mode.pole, block)).collect();
        for line in 0..block.len() {
            let kernel = |(mode, growth): (&&IdentifiedMode, &C)| {
                let (_, transient) = kernels(mode.pole, lines, block, line, *growth);
                (transient.value, transient.mirror)
            };
            let row = block.rows.start + line;
            rows.push((row, modes.iter().zip(&growths).map(kernel).collect()));
        }
    }
    let record = Record { rows, modes, powers, reference: lines.band().1 };
    let mut normal = Accumulator::new(2 * modes.len());
    let mut triangles = Vec::with_capacity(outputs);
    for output in 0..outputs {
        let remainder = |row: usize| lines.outputs[output][row] - predicted[(row, output)];
        let (columns, height) = record.reduced(lines, output, remainder);
        normal.add(&columns, height, powers.len());
        triangles.push(Triangle::new(&columns, height, powers.len() + 2 * modes.len() + 1));
    }
    let loads = normal.solve();
    for (output, triangle) in triangles.iter().enumerate() {
        let terms = residual_terms(triangle, powers.len(), &loads);
        for (row, kernels) in &record.rows {
            let mut sum = C::default();
            for (mode, (value, mirror)) in kernels.iter().enumerate() {
                let part = modes[mode].shape[output] * C::new(loads[2 * mode], loads[2 * mode + 1]);
                sum += part * value + part.conj() * mirror;
            }
            for (power, value) in powers.iter().zip(&terms) {
                sum += record.residual(lines.omega[*row], *power) * *value;
            }
            predicted[(*row, output)] += sum;
        }
    }
}

/// Rows of one record with the transient kernels of all modes.
struct Record<'a> {
    rows: Vec<(usize, Vec<(C, C)>)>,
    modes: &'a [&'a IdentifiedMode],
    powers: &'a [i32],
    reference: f64,
}

impl Record<'_> {
    /// Returns (jω)ⁿ, scaled.
    fn residual(&self, omega: f64, power: i32) -> C {
        C::i().powi(power) * (omega / self.reference).powi(power)
    }

    /// Returns the columns of one output, reduced to a triangular factor, and the number of rows of
    /// these columns. The columns of the residual terms come first, so that these terms can be
    /// projected out; the loads, which all outputs share, remain.
    fn reduced(
        &self,
        lines: &Lines,
        output: usize,
        remainder: impl Fn(usize) -> C,
    ) -> (Vec<f64>, usize) {
        let (first, height) = (self.powers.len(), 2 * self.rows.len());
        let count = first + 2 * self.modes.len() + 1;
        let mut columns = vec![0.0; height * count];
        for (k, (row, kernels)) in self.rows.iter().enumerate() {
            let mut put = |column: usize, value: C| {
                columns[column * height + 2 * k] = value.re;
                columns[column * height + 2 * k + 1] = value.im;
            };
            for (index, power) in self.powers.iter().enumerate() {
                put(index, self.residual(lines.omega[*row], *power));
            }
            for (mode, (value, mirror)) in kernels.iter().enumerate() {
                let shape = self.modes[mode].shape[output];
                let (a, b) = (shape * value, shape.conj() * mirror);
                put(first + 2 * mode, a + b);
                put(first + 2 * mode + 1, C::i() * (a - b));
            }
            put(count - 1, remainder(*row));
        }
        triangularise(&mut columns, height, count);
        (columns, height)
    }
}

/// Solves for the residual terms of one output at given loads.
fn residual_terms(triangle: &Triangle, powers: usize, loads: &[f64]) -> Vec<f64> {
    let size = triangle.size;
    let entry = |row: usize, column: usize| triangle.entries[column * size + row];
    let mut terms = vec![0.0; powers];
    for row in (0..powers).rev() {
        let mut right = entry(row, size - 1);
        for (k, load) in loads.iter().enumerate() {
            right -= entry(row, powers + k) * load;
        }
        let solved = terms.iter().enumerate().skip(row + 1);
        right -= solved.map(|(column, term)| entry(row, column) * term).sum::<f64>();
        terms[row] = right / entry(row, row);
    }
    terms
}

/// Rows of a least-squares problem that all outputs share.
struct Accumulator {
    width: usize,
    rows: Vec<Vec<f64>>,
}

impl Accumulator {
    fn new(width: usize) -> Self {
        Self { width, rows: Vec::new() }
    }

    /// Adds the rows of a triangular factor below its first `skip` rows.
    fn add(&mut self, columns: &[f64], height: usize, skip: usize) {
        let last = (skip + self.width).min(height);
        for row in skip..last {
            let entry = |column: usize| {
                if column >= row { columns[column * height + row] } else { 0.0 }
            };
            self.rows.push((skip..=skip + self.width).map(entry).collect());
        }
    }

    fn solve(&self) -> Vec<f64> {
        let height = self.rows.len().max(self.width + 1);
        let mut columns = vec![0.0; height * (self.width + 1)];
        for (row, values) in self.rows.iter().enumerate() {
            for (column, value) in values.iter().enumerate() {
                columns[column * height + row] = *value;
            }
        }
        triangularise(&mut columns, height, self.width);
        let triangle = Triangle::new(&columns, height, self.width);
        let start = self.width * height;
        let mut solution = columns[start..start + self.width].to_vec();
        triangle.solve(&mut solution);
        solution
    }
}
