//! Least squares on all equations of motion together, for related entries.

use mechid_model::{Matrix, Parameter};
use mechid_numerics::NumericsError;
use mechid_numerics::least_squares::{Solution, solve_compressed};
use mechid_numerics::triangular::TriangularFactor;
use nalgebra::{DMatrix, DVector};

use crate::covariance::Covariance;
use crate::estimate::EstimateParts;
use crate::limits::{EQUATION_ROUNDING, RELATED_SETTLED, RELATED_STEPS, ROWS_PER_EQUATION};
use crate::relations::Relations;
use crate::unknowns::only_ratios;
use crate::{Estimate, EstimateError, Undetermined, Unknowns};

/// All equations of motion, compressed to rows with the same Gram matrix.
pub(crate) struct RelatedEquations<'a> {
    /// Columns \[ẍ | ẋ | x\] of all degrees of freedom.
    pub(crate) motions: DMatrix<f64>,
    /// Force of each equation minus the forces of its known entries.
    pub(crate) targets: DMatrix<f64>,
    /// Number of original rows.
    pub(crate) rows: usize,
    pub(crate) unknowns: &'a Unknowns,
}

/// Solution of the related equations.
struct Fit {
    unknowns: DVector<f64>,
    solution: Solution,
}

impl RelatedEquations<'_> {
    /// Solves for the independent unknowns by least squares; the weights of the equations follow
    /// from the covariance of their residuals.
    pub(crate) fn solve(&self) -> Result<Estimate, EstimateError> {
        let free = self.unknowns.free();
        let (Some(relations), Some(linear)) =
            (Relations::from_unknowns(self.unknowns), Relations::linear(self.unknowns))
        else {
            unreachable!("entries are related");
        };
        let n = self.targets.ncols();
        if self.targets.iter().all(|force| *force == 0.0) {
            return Err(only_ratios(self.unknowns, 0));
        }
        let equal = DMatrix::identity(n, n);
        let start = self.step(&free, &linear, &DVector::zeros(linear.count()), &equal)?;
        let theta = linear.entries(start.coefficients.as_slice());
        if !start.undetermined.is_empty() {
            return self.estimate(&free, &linear, start.coefficients.column(0).into_owned(), start);
        }
        let start = relations.unknowns(theta.as_slice());
        let mut fit = self.search(&free, &relations, start, &equal)?;
        let theta = relations.entries(fit.unknowns.as_slice());
        if let Some(weights) = self.weights(&self.residuals(&free, &theta)) {
            fit = self.search(&free, &relations, fit.unknowns, &weights)?;
        }
        self.estimate(&free, &relations, fit.unknowns, fit.solution)
    }

    /// Searches for the minimum of the sum of squares by Gauss–Newton steps; linear relations need
    /// one step.
    fn search(
        &self,
        free: &[Parameter],
        relations: &Relations,
        mut unknowns: DVector<f64>,
        weights: &DMatrix<f64>,
    ) -> Result<Fit, EstimateError> {
        let cost = |unknowns: &DVector<f64>| {
            let theta = relations.entries(unknowns.as_slice());
            (self.residuals(free, &theta) * weights.transpose()).norm_squared()
        };
        let mut before = cost(&unknowns);
        for _ in 0..RELATED_STEPS {
            let solution = self.step(free, relations, &unknowns, weights)?;
            let step = solution.coefficients.column(0);
            if !step.iter().all(|value| value.is_finite()) {
                return Ok(Fit { unknowns, solution });
            }
            // The standard errors, known up to a common factor, give each unknown its scale.
            let scale = solution.unscaled_covariance.diagonal().map(f64::sqrt);
            let size = unknowns.component_div(&scale).norm();
            let settled = step.component_div(&scale).norm() <= RELATED_SETTLED * size;
            let lower = [1.0, 0.5, 0.25, 0.125].into_iter().find_map(|part| {
                let next = &unknowns + step * part;
                let lower = cost(&next);
                (lower < before).then_some((next, lower))
            });
            match lower {
                Some((next, lower)) => (unknowns, before) = (next, lower),
                // Even a shorter step does not reduce the cost: this is a minimum up to rounding.
                None => return Ok(Fit { unknowns, solution }),
            }
            if settled {
                return Ok(Fit { unknowns, solution });
            }
        }
        Err(EstimateError::NotConverged { searches: 1, steps: RELATED_STEPS })
    }

    /// Returns the Gauss–Newton step of the independent unknowns for the weighted equations.
    fn step(
        &self,
        free: &[Parameter],
        relations: &Relations,
        unknowns: &DVector<f64>,
        weights: &DMatrix<f64>,
    ) -> Result<Solution, EstimateError> {
        let tangent = relations.tangent(unknowns.as_slice());
        let theta = relations.entries(unknowns.as_slice());
        let residuals = self.residuals(free, &theta) * weights.transpose();
        let (count, n) = (relations.count(), self.targets.ncols());
        let mut factor = TriangularFactor::new(count + 1);
        let mut block = DMatrix::zeros(self.motions.nrows(), count);
        for equation in 0..n {
            block.fill(0.0);
            for (p, changes) in free.iter().zip(tangent.row_iter()) {
                let weight = weights[(equation, p.row())];
                if weight == 0.0 {
                    continue;
                }
                let motion = self.motions.column(self.column(p));
                for (at, change) in changes.iter().enumerate().filter(|(_, c)| **c != 0.0) {
                    block.column_mut(at).axpy(weight * change, &motion, 1.0);
                }
            }
            let right = residuals.columns(equation, 1);
            if !factor.push(&[block.as_view(), right.into_owned().as_view()]) {
                return Err(NumericsError::Overflow.into());
            }
        }
        let (regressors, targets) = factor.r().columns_range_pair(..count, count..);
        Ok(solve_compressed(regressors, targets, n * self.rows)?)
    }

    /// Returns the residual force of the equations, rows × equations.
    fn residuals(&self, free: &[Parameter], theta: &DVector<f64>) -> DMatrix<f64> {
        let mut residuals = self.targets.clone();
        for (p, value) in free.iter().zip(theta.iter()) {
            residuals.column_mut(p.row()).axpy(-value, &self.motions.column(self.column(p)), 1.0);
        }
        residuals
    }

    /// Returns L⁻¹ of the covariance L Lᴴ of the residuals of all equations, without correlations
    /// if there are few rows; `None` if the residuals are rounding.
    ///
    /// # Source
    /// Zellner (1962), J. American Statistical Association 57, 348–368 (seemingly unrelated
    /// regressions).
    fn weights(&self, residuals: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let n = residuals.ncols();
        let size = self.targets.norm();
        let mut covariance = residuals.tr_mul(residuals);
        // An equation that fits exactly must not take all the weight.
        let floor = (EQUATION_ROUNDING * size).powi(2);
        if covariance.diagonal().max() <= floor {
            return None;
        }
        let enough = self.rows >= ROWS_PER_EQUATION * n;
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            if i == j {
                covariance[(i, i)] += floor + 1e-9 * covariance[(i, i)];
            } else if !enough {
                covariance[(i, j)] = 0.0;
            }
        }
        let lower = covariance.cholesky()?.unpack();
        let inverse = lower.solve_lower_triangular(&DMatrix::identity(n, n))?;
        inverse.iter().all(|value| value.is_finite()).then_some(inverse)
    }

    fn estimate(
        &self,
        free: &[Parameter],
        relations: &Relations,
        unknowns: DVector<f64>,
        solution: Solution,
    ) -> Result<Estimate, EstimateError> {
        let theta = relations.entries(unknowns.as_slice());
        let tangent = relations.tangent(unknowns.as_slice());
        let covariance = solution.unscaled_covariance * solution.residual_covariance[(0, 0)];
        let residuals = self.residuals(free, &theta);
        // The mean over the equations is used, because an equation may have no force.
        let force = self.targets.norm() / (self.targets.ncols() as f64).sqrt();
        let undetermined = solution.undetermined.iter().map(|direction| {
            let of_entries = &tangent * &direction.combination;
            let involved = |entry: usize| {
                let row = tangent.row(entry);
                row.iter().zip(&direction.involved).any(|(change, i)| *i && *change != 0.0)
            };
            let terms = free.iter().enumerate().filter(|(entry, _)| involved(*entry));
            Undetermined {
                relative_singular_value: direction.relative_singular_value,
                terms: terms.map(|(entry, p)| (*p, of_entries[entry])).collect(),
            }
        });
        Estimate::new(EstimateParts {
            unknowns: self.unknowns.clone(),
            values: theta.as_slice().to_vec(),
            covariance: Covariance::Full(&tangent * covariance * tangent.transpose()),
            degrees_of_freedom: solution.degrees_of_freedom,
            residual_nrmse: residuals.column_iter().map(|e| e.norm() / force).collect(),
            condition: solution.condition,
            undetermined: undetermined.collect(),
        })
    }

    fn column(&self, p: &Parameter) -> usize {
        let kind = match p.matrix() {
            Matrix::Mass => 0,
            Matrix::Damping => 1,
            Matrix::Stiffness => 2,
        };
        kind * self.targets.ncols() + p.column()
    }
}
