//! Information of data and priors, covariance of the parameters, and undetermined combinations.

use mechid_numerics::linear_algebra::svd;
use nalgebra::{DMatrix, DVector};

use super::LikelihoodError;
use super::limits::RANK;
use super::residual::Residual;
use super::response_model::ResponseModel;
use super::search::Minimum;

/// Singular value decomposition of the Jacobian of the residual; the columns of the Jacobian are
/// scaled to unit length.
#[derive(Debug, Clone)]
pub(super) struct Information {
    /// Indices of the parameters that are not at a bound.
    pub(super) free: Vec<usize>,
    /// Lengths of the Jacobian columns of the parameters that are not at a bound.
    pub(super) scale: DVector<f64>,
    /// Right singular vectors, free × free, by falling singular values.
    pub(super) directions: DMatrix<f64>,
    pub(super) singular_values: DVector<f64>,
    /// Number of directions that the data and the priors determine.
    pub(super) rank: usize,
    /// Covariance of all parameters; 0 for parameters at a bound.
    pub(super) covariance: DMatrix<f64>,
    /// Ratio of the covariance to the inverse information.
    pub(super) inflation: f64,
    /// Flags of all parameters: `true` if the parameter is determined.
    pub(super) is_determined: Vec<bool>,
}

/// Minimum component of a direction along a parameter; a direction with a smaller component does
/// not depend on the parameter.
const PART: f64 = 1e-6;

impl Information {
    /// Decomposes the Jacobian at a minimum; `inflation` is the ratio of the covariance to the
    /// inverse information.
    pub(super) fn new<M: ResponseModel>(
        residual: &Residual<'_, M>,
        minimum: &Minimum,
        inflation: f64,
    ) -> Result<Self, LikelihoodError> {
        let failed = || LikelihoodError::Overflow { what: "the Fisher information" };
        let linearisation = residual.linearise(&minimum.parameters).ok_or_else(failed)?;
        let count = minimum.parameters.len();
        let free: Vec<usize> = (0..count).filter(|at| !minimum.at_bound[*at]).collect();
        let mut columns = linearisation.jacobian.select_columns(&free);
        let scale = DVector::from_iterator(free.len(), columns.column_iter().map(|c| c.norm()));
        let scale = scale.map(|length| if length > 0.0 { length } else { 1.0 });
        for (mut column, scale) in columns.column_iter_mut().zip(scale.iter()) {
            column.unscale_mut(*scale);
        }
        let decomposition = svd(columns.qr().r()).map_err(|_| failed())?;
        let singular_values = decomposition.singular_values;
        let directions = decomposition.v_t.ok_or_else(failed)?.transpose();
        let largest = singular_values.iter().copied().fold(0.0, f64::max);
        let rank = singular_values.iter().take_while(|s| **s > RANK * largest).count();
        let mut roots = directions.columns(0, rank).into_owned();
        for (mut column, value) in roots.column_iter_mut().zip(singular_values.iter()) {
            column.unscale_mut(*value);
        }
        for (mut row, scale) in roots.row_iter_mut().zip(scale.iter()) {
            row.unscale_mut(*scale);
        }
        let of_free = &roots * roots.transpose() * inflation;
        let mut covariance = DMatrix::zeros(count, count);
        let mut is_determined = vec![true; count];
        for (i, row) in free.iter().enumerate() {
            for (j, column) in free.iter().enumerate() {
                covariance[(*row, *column)] = of_free[(i, j)];
            }
            let undetermined = directions.columns_range(rank..).row(i).norm();
            is_determined[*row] = undetermined < PART;
        }
        Ok(Self {
            free,
            scale,
            directions,
            singular_values,
            rank,
            covariance,
            inflation,
            is_determined,
        })
    }

    /// Standard error of a parameter; `None` if it is not determined.
    pub(super) fn standard_error(&self, at: usize) -> Option<f64> {
        self.is_determined[at].then(|| self.covariance[(at, at)].max(0.0).sqrt())
    }

    /// Ratio of the largest to the smallest singular value of the scaled Jacobian.
    pub(super) fn condition(&self) -> f64 {
        match (self.singular_values.iter().next(), self.singular_values.iter().next_back()) {
            (Some(largest), Some(smallest)) => largest / smallest,
            _ => 1.0,
        }
    }

    /// Returns groups of parameters that are determined only in combinations: the indices of the
    /// parameters and the gradients of the combinations. Each gradient is scaled so that its
    /// largest coefficient is 1.
    pub(super) fn combinations(&self) -> Vec<(Vec<usize>, Vec<Vec<f64>>)> {
        let null = self.directions.columns_range(self.rank..);
        let takes_part = |at: usize, column: usize| null[(at, column)].abs() > PART;
        let mut groups: Vec<Vec<usize>> = Vec::new();
        for column in 0..null.ncols() {
            let mut members: Vec<usize> =
                (0..self.free.len()).filter(|at| takes_part(*at, column)).collect();
            groups.retain(|group| {
                let joins = group.iter().any(|at| members.contains(at));
                if joins {
                    members.extend_from_slice(group);
                }
                !joins
            });
            members.sort_unstable();
            members.dedup();
            groups.push(members);
        }
        groups.into_iter().map(|group| self.combinations_of(&group)).collect()
    }

    /// Returns the combinations of one group that are orthogonal to the undetermined directions.
    fn combinations_of(&self, group: &[usize]) -> (Vec<usize>, Vec<Vec<f64>>) {
        let null = self.directions.columns_range(self.rank..).select_rows(group);
        let projector = DMatrix::identity(group.len(), group.len()) - &null * null.transpose();
        let mut combinations = Vec::new();
        if let Ok(decomposition) = svd(projector) {
            let vectors = decomposition.u.unwrap_or_else(|| DMatrix::zeros(group.len(), 0));
            for (value, vector) in decomposition.singular_values.iter().zip(vectors.column_iter()) {
                if *value > 0.5 {
                    let gradient = vector.iter().zip(group).map(|(v, at)| v * self.scale[*at]);
                    let gradient: Vec<f64> = gradient.collect();
                    let largest = gradient
                        .iter()
                        .copied()
                        .fold(0.0, |a: f64, b| if b.abs() > a.abs() { b } else { a });
                    combinations.push(gradient.iter().map(|g| g / largest).collect());
                }
            }
        }
        (group.iter().map(|at| self.free[*at]).collect(), combinations)
    }
}
