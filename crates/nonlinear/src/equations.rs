//! Equations of motion with nonlinear regressors, line by line, for least squares.

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Matrix, Parameter, Term, Terms};
use mechid_numerics::least_squares::{LeastSquares, Solution};
use mechid_numerics::{NumericsError, check_size};
use nalgebra::{Complex, DMatrix};

use super::experiments::Columns;
use super::{ChannelPhase, SteadyExperiments};
use crate::limits::EQUATIONS_CHUNK;

/// Coefficient of the equations: an entry of M, C or K, or the coefficient of a term.
#[derive(Clone, Copy)]
enum Coefficient {
    Entry(Parameter),
    /// Index of the term and its sign in the equation.
    Term(usize, f64),
}

/// Free coefficients of every equation of motion, at the rows of a fit.
pub(super) struct Equations<'a> {
    pub(super) data: &'a SteadyExperiments,
    pub(super) unknowns: &'a Unknowns,
    pub(super) free: Vec<Parameter>,
    terms: usize,
    /// Lines of the rows; line 0 is the first if a term is a constant force.
    pub(super) rows: Vec<usize>,
    /// Coefficients of each equation and their indices among the parameters.
    coefficients: Vec<Vec<(usize, Coefficient)>>,
    /// Factors, rows × degrees of freedom, that give all rows and equations the same variance under
    /// white noise; 0 if the row is not used in the equation.
    pub(super) unit: DMatrix<f64>,
}

impl<'a> Equations<'a> {
    pub(super) fn new(
        data: &'a SteadyExperiments,
        unknowns: &'a Unknowns,
        terms: &Terms,
    ) -> Result<Self, EstimateError> {
        check_size("degrees of freedom of the unknowns", data.dof(), unknowns.dof())?;
        terms.check_dof(data.dof())?;
        unknowns.check_unrelated("a fit with nonlinear terms")?;
        let free = unknowns.free();
        if free.is_empty() && terms.is_empty() {
            return Err(NumericsError::NothingUnknown.into());
        }
        if data.count() == 0 {
            return Err(
                NumericsError::TooFewRows { rows: 0, unknowns: free.len() + terms.len() }.into()
            );
        }
        let constant = |dof: usize| {
            let here = |t: &Term| t.law().is_constant() && t.coordinate().sign(dof) != 0.0;
            terms.iter().any(here)
        };
        let with_mean: Vec<bool> = (0..data.dof()).map(constant).collect();
        let mean = with_mean.contains(&true).then_some(0);
        let rows: Vec<usize> = mean.into_iter().chain(data.lines().iter().copied()).collect();
        let unit = DMatrix::from_fn(rows.len(), data.dof(), |at, dof| match rows[at] {
            // The mean (line 0) is real. Its variance is half the variance of the real part, or of
            // the imaginary part, of another line.
            0 if with_mean[dof] => std::f64::consts::SQRT_2,
            0 => 0.0,
            _ => 1.0,
        });
        let coefficients = (0..data.dof()).map(|dof| coefficients(&free, terms, dof)).collect();
        Ok(Self { data, unknowns, free, terms: terms.len(), rows, coefficients, unit })
    }

    /// Returns the number of coefficients: of free entries and of terms.
    pub(super) fn count(&self) -> usize {
        self.free.len() + self.terms
    }

    /// Returns the number of real equations of all experiments.
    pub(super) fn equations(&self) -> usize {
        let real = |(at, factor): (usize, &f64)| match (self.rows[at % self.rows.len()], *factor) {
            (_, 0.0) => 0,
            (0, _) => 1,
            _ => 2,
        };
        self.data.count() * self.unit.iter().enumerate().map(real).sum::<usize>()
    }

    pub(super) fn columns(&self, terms: &Terms, channels: &ChannelPhase) -> Vec<Columns> {
        self.data.columns(&self.rows, terms, channels)
    }

    pub(super) fn omega(&self, row: usize) -> f64 {
        self.data.omega(self.rows[row])
    }

    /// Returns the regressor of a coefficient in its equation.
    fn entry(&self, columns: &Columns, row: usize, coefficient: Coefficient) -> Complex<f64> {
        match coefficient {
            Coefficient::Entry(parameter) => {
                columns.displacement[(row, parameter.column())]
                    * power(parameter.matrix(), self.omega(row))
            }
            Coefficient::Term(term, sign) => columns.terms[(row, term)] * sign,
        }
    }

    /// Returns the force of an equation minus the contribution of its known entries.
    fn target(&self, columns: &Columns, row: usize, dof: usize) -> Complex<f64> {
        let mut target = columns.force[(row, dof)];
        for matrix in Matrix::ALL {
            for column in 0..self.data.dof() {
                if let Some(value) = self.unknowns.fixed(matrix, dof, column) {
                    let factor = power(matrix, self.omega(row)) * value;
                    target -= columns.displacement[(row, column)] * factor;
                }
            }
        }
        target
    }

    /// Returns the residual force for given coefficients, one matrix per experiment: rows × degrees
    /// of freedom.
    pub(super) fn residuals(
        &self,
        columns: &[Columns],
        coefficients: &[f64],
    ) -> Vec<DMatrix<Complex<f64>>> {
        let residual = |columns: &Columns| {
            DMatrix::from_fn(self.rows.len(), self.data.dof(), |row, dof| {
                let model = self.coefficients[dof].iter().map(|(at, coefficient)| {
                    self.entry(columns, row, *coefficient) * coefficients[*at]
                });
                self.target(columns, row, dof) - model.sum::<Complex<f64>>()
            })
        };
        columns.iter().map(residual).collect()
    }

    /// Solves for the coefficients. The first right-hand side is the force. Each matrix in `extra`
    /// (rows × degrees of freedom) is a further right-hand side; every experiment has the same
    /// number of these matrices.
    pub(super) fn solve(
        &self,
        columns: &[Columns],
        weights: &DMatrix<f64>,
        extra: &[Vec<DMatrix<Complex<f64>>>],
    ) -> Result<Solution, EstimateError> {
        let more = extra.first().map_or(0, Vec::len);
        let mut rows = LeastSquares::new(self.count(), 1 + more);
        for (at, columns) in columns.iter().enumerate() {
            let extra = extra.get(at).map_or(&[][..], Vec::as_slice);
            self.push(&mut rows, columns, weights, extra)?;
        }
        Ok(rows.solve()?)
    }

    /// Adds the weighted rows of one experiment: real and imaginary part of each line and equation.
    pub(super) fn push(
        &self,
        rows: &mut LeastSquares,
        columns: &Columns,
        weights: &DMatrix<f64>,
        extra: &[DMatrix<Complex<f64>>],
    ) -> Result<(), EstimateError> {
        let n = self.data.dof();
        for start in (0..self.rows.len()).step_by(EQUATIONS_CHUNK) {
            let len = EQUATIONS_CHUNK.min(self.rows.len() - start);
            let mut regressors = DMatrix::zeros(2 * len * n, self.count());
            let mut targets = DMatrix::zeros(2 * len * n, 1 + extra.len());
            for (dof, coefficients) in self.coefficients.iter().enumerate() {
                for row in 0..len {
                    let (line, real_row) = (start + row, 2 * (dof * len + row));
                    let weight = weights[(line, dof)];
                    if weight == 0.0 {
                        continue;
                    }
                    for (at, coefficient) in coefficients {
                        let value = self.entry(columns, line, *coefficient) * weight;
                        (regressors[(real_row, *at)], regressors[(real_row + 1, *at)]) =
                            (value.re, value.im);
                    }
                    let target = self.target(columns, line, dof);
                    let targets_of_row =
                        std::iter::once(target).chain(extra.iter().map(|e| e[(line, dof)]));
                    for (at, value) in targets_of_row.enumerate() {
                        let value = value * weight;
                        (targets[(real_row, at)], targets[(real_row + 1, at)]) =
                            (value.re, value.im);
                    }
                }
            }
            rows.push_rows(regressors.as_view(), targets.as_view())?;
        }
        Ok(())
    }

    /// Returns the weighted columns of one equation of one experiment, each with the index of its
    /// coefficient.
    pub(super) fn weighted<'b>(
        &'b self,
        columns: &'b Columns,
        weights: &'b DMatrix<f64>,
        dof: usize,
    ) -> impl Iterator<Item = (usize, Vec<Complex<f64>>)> + 'b {
        self.coefficients[dof].iter().map(move |(at, coefficient)| {
            let value = |row| self.entry(columns, row, *coefficient) * weights[(row, dof)];
            (*at, (0..self.rows.len()).map(value).collect())
        })
    }

    /// Returns the regressors of one equation for one row, each with the index of its coefficient.
    pub(super) fn regressors<'b>(
        &'b self,
        columns: &'b Columns,
        row: usize,
        dof: usize,
    ) -> impl Iterator<Item = (usize, Complex<f64>)> + 'b {
        let entry = move |(at, coefficient): &(usize, Coefficient)| {
            (*at, self.entry(columns, row, *coefficient))
        };
        self.coefficients[dof].iter().map(entry)
    }

    /// Returns whether the equation of this degree of freedom has a free coefficient.
    pub(super) fn concerns(&self, dof: usize) -> bool {
        !self.coefficients[dof].is_empty()
    }

    /// Returns an error for an equation that has no force and no known entry, because such an
    /// equation determines only the ratios of its coefficients.
    pub(super) fn check_forces(&self, columns: &[Columns]) -> Result<(), EstimateError> {
        for dof in 0..self.data.dof() {
            let without_force = |columns: &Columns| {
                (0..self.rows.len()).all(|row| self.target(columns, row, dof) == Complex::ZERO)
            };
            if self.concerns(dof) && columns.iter().all(without_force) {
                return Err(mechid_estimate::only_ratios(self.unknowns, dof));
            }
        }
        Ok(())
    }
}

fn coefficients(free: &[Parameter], terms: &Terms, dof: usize) -> Vec<(usize, Coefficient)> {
    let entries = free.iter().enumerate().filter(|(_, parameter)| parameter.row() == dof);
    let entries = entries.map(|(at, parameter)| (at, Coefficient::Entry(*parameter)));
    let forces = terms.iter().enumerate().filter_map(|(at, term)| {
        let sign = term.coordinate().sign(dof);
        (sign != 0.0).then_some((free.len() + at, Coefficient::Term(at, sign)))
    });
    entries.chain(forces).collect()
}

/// Returns the factor of a matrix in the dynamic stiffness: (iω)², iω or 1.
pub(super) fn power(matrix: Matrix, omega: f64) -> Complex<f64> {
    match matrix {
        Matrix::Mass => Complex::from(-omega * omega),
        Matrix::Damping => Complex::new(0.0, omega),
        Matrix::Stiffness => Complex::from(1.0),
    }
}
