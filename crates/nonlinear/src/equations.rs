//! The equations of motion with nonlinear columns, line by line, ready for least squares.

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Matrix, Parameter, Term, Terms};
use mechid_numerics::least_squares::{LeastSquares, Solution};
use mechid_numerics::{NumericsError, check_size};
use nalgebra::{Complex, DMatrix};

use super::experiments::Columns;
use super::{ChannelPhase, SteadyExperiments};
use crate::limits::EQUATIONS_CHUNK;

/// A coefficient of the equations: an entry of M, C or K, or that of a term.
#[derive(Clone, Copy)]
enum Coefficient {
    Entry(Parameter),
    /// Number of the term and its sign in the equation.
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
    /// Coefficients of each equation and their places among the parameters.
    coefficients: Vec<Vec<(usize, Coefficient)>>,
    /// Factor of each row and equation that makes all of one variance under white noise, 0 where the
    /// equation does not hold: rows × degrees of freedom.
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
            // A mean is real, and has half the variance of each part of a line.
            0 if with_mean[dof] => std::f64::consts::SQRT_2,
            0 => 0.0,
            _ => 1.0,
        });
        let coefficients = (0..data.dof()).map(|dof| coefficients(&free, terms, dof)).collect();
        Ok(Self { data, unknowns, free, terms: terms.len(), rows, coefficients, unit })
    }

    /// Number of coefficients: free entries, then terms.
    pub(super) fn count(&self) -> usize {
        self.free.len() + self.terms
    }

    /// Real equations of all experiments.
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

    /// Returns the quantity that a coefficient multiplies in the equation it belongs to.
    fn entry(&self, columns: &Columns, row: usize, coefficient: Coefficient) -> Complex<f64> {
        match coefficient {
            Coefficient::Entry(parameter) => {
                columns.displacement[(row, parameter.column())]
                    * power(parameter.matrix(), self.omega(row))
            }
            Coefficient::Term(term, sign) => columns.terms[(row, term)] * sign,
        }
    }

    /// Force of an equation less what its known entries account for.
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

    /// Force less what the coefficients account for, one matrix an experiment: rows × degrees of
    /// freedom.
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

    /// Least squares for the coefficients: the force and then `extra` as right-hand sides (of each
    /// experiment some matrices of rows × degrees of freedom).
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

    /// Weighted rows of one experiment, each line and equation by its real and imaginary part.
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
                    let (line, place) = (start + row, 2 * (dof * len + row));
                    let weight = weights[(line, dof)];
                    if weight == 0.0 {
                        continue;
                    }
                    for (at, coefficient) in coefficients {
                        let value = self.entry(columns, line, *coefficient) * weight;
                        (regressors[(place, *at)], regressors[(place + 1, *at)]) =
                            (value.re, value.im);
                    }
                    let target = self.target(columns, line, dof);
                    let all = std::iter::once(target).chain(extra.iter().map(|e| e[(line, dof)]));
                    for (at, value) in all.enumerate() {
                        let value = value * weight;
                        (targets[(place, at)], targets[(place + 1, at)]) = (value.re, value.im);
                    }
                }
            }
            rows.push_rows(regressors.as_view(), targets.as_view())?;
        }
        Ok(())
    }

    /// Weighted columns of one equation of one experiment, each with the place of its coefficient.
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

    /// Regressors of one equation in a row, each with the place of its coefficient.
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

    /// Returns whether a coefficient stands in the equation of this degree of freedom.
    pub(super) fn concerns(&self, dof: usize) -> bool {
        !self.coefficients[dof].is_empty()
    }

    /// An error for an equation with neither force nor known entry, which fixes ratios only.
    pub(super) fn check_forces(&self, columns: &[Columns]) -> Result<(), EstimateError> {
        for dof in 0..self.data.dof() {
            let still = |columns: &Columns| {
                (0..self.rows.len()).all(|row| self.target(columns, row, dof) == Complex::ZERO)
            };
            if self.concerns(dof) && columns.iter().all(still) {
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

/// (iω)², iω or 1.
pub(super) fn power(matrix: Matrix, omega: f64) -> Complex<f64> {
    match matrix {
        Matrix::Mass => Complex::from(-omega * omega),
        Matrix::Damping => Complex::new(0.0, omega),
        Matrix::Stiffness => Complex::from(1.0),
    }
}
