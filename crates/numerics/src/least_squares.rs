//! Linear least squares from blocks of rows, with covariance, condition and undetermined
//! directions.

use nalgebra::{DMatrix, DMatrixView, DVector};

use crate::error::{NumericsError, check_finite, check_size};
use crate::limits::{RANK_TOLERANCE, SHARE_TOLERANCE};
use crate::linear_algebra::svd;
use crate::triangular::TriangularFactor;

/// Overdetermined linear equations A θ ≈ B, gathered block by block, so that the memory does not
/// grow with the number of rows.
///
/// ```
/// use mechid_numerics::least_squares::LeastSquares;
/// use nalgebra::DMatrix;
///
/// // A straight line 2 + 3 t through a million points, a thousand at a time.
/// let mut line = LeastSquares::new(2, 1);
/// for block in 0..1000 {
///     let t = |row: usize| (1000 * block + row) as f64 * 1e-6;
///     let regressors = DMatrix::from_fn(1000, 2, |row, column| t(row).powi(column as i32));
///     let targets = DMatrix::from_fn(1000, 1, |row, _| 2.0 + 3.0 * t(row));
///     line.push_rows(regressors.as_view(), targets.as_view())?;
/// }
/// let solution = line.solve()?;
/// assert!((solution.coefficients[(1, 0)] - 3.0).abs() < 1e-12);
/// # Ok::<(), mechid_numerics::NumericsError>(())
/// ```
#[derive(Debug, Clone)]
pub struct LeastSquares {
    unknowns: usize,
    targets: usize,
    factor: TriangularFactor,
}

/// Least-squares solution of one set of regressors for one or several right-hand sides.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    /// θ: unknowns × right-hand sides, in the unit of the target divided by the unit of the
    /// regressor. Undetermined entries are NaN.
    pub coefficients: DMatrix<f64>,
    /// (AᵀA)⁻¹: unknowns × unknowns, in inverse units of the regressors, restricted to the
    /// determined directions. The covariance of coefficients (i, a) and (j, b) is
    /// `unscaled_covariance[(i, j)] · residual_covariance[(a, b)]`.
    pub unscaled_covariance: DMatrix<f64>,
    /// EᵀE / `degrees_of_freedom` with the residuals E: right-hand sides × right-hand sides, in the
    /// units of the targets; infinite if there are no degrees of freedom.
    pub residual_covariance: DMatrix<f64>,
    /// √(Σe² / Σb²) of each right-hand side b with its residual e, a pure number.
    pub residual_nrmse: Vec<f64>,
    /// Number of rows minus number of determined directions.
    pub degrees_of_freedom: usize,
    /// Ratio of the largest to the smallest singular value of A with its columns scaled to unit
    /// length.
    pub condition: f64,
    /// Combinations of unknowns that the rows do not determine.
    pub undetermined: Vec<Direction>,
    /// Pseudo-inverse A⁺ of the rows of the triangular factor, in inverse units of the regressors.
    pub inverse: DMatrix<f64>,
    /// Residuals of the rows of the triangular factor, in the units of the targets.
    pub residuals: DMatrix<f64>,
}

/// Combination of unknowns that can be added to a solution without changing the fit.
#[derive(Debug, Clone, PartialEq)]
pub struct Direction {
    /// Singular value along this direction divided by the largest one, for regressors with columns
    /// scaled to unit length.
    pub relative_singular_value: f64,
    /// One entry per unknown, in its unit; the entry that is largest after scaling of the columns
    /// is 1.
    pub combination: DVector<f64>,
    /// `true` for each unknown that is part of the combination.
    pub involved: Vec<bool>,
}

impl LeastSquares {
    /// Creates equations without rows; A has `unknowns` columns and B has `targets` columns.
    pub fn new(unknowns: usize, targets: usize) -> Self {
        Self { unknowns, targets, factor: TriangularFactor::new(unknowns.saturating_add(targets)) }
    }

    /// Returns the number of rows so far.
    pub fn rows(&self) -> usize {
        self.factor.rows()
    }

    /// Adds rows: `regressors` rows × unknowns, `targets` rows × right-hand sides, in any units.
    ///
    /// # Errors
    /// [`NumericsError::Size`], [`NumericsError::NotFinite`] and [`NumericsError::Overflow`]; no
    /// row is then added.
    pub fn push_rows(
        &mut self,
        regressors: DMatrixView<'_, f64>,
        targets: DMatrixView<'_, f64>,
    ) -> Result<(), NumericsError> {
        check_size("columns of the regressors", self.unknowns, regressors.ncols())?;
        check_size("columns of the right-hand side", self.targets, targets.ncols())?;
        check_size("rows of the right-hand side", regressors.nrows(), targets.nrows())?;
        if !self.factor.push(&[regressors, targets]) {
            check_finite("regressors", regressors)?;
            check_finite("right-hand side", targets)?;
            return Err(NumericsError::Overflow);
        }
        Ok(())
    }

    /// Adds all rows of `other`, for example of another record.
    ///
    /// # Errors
    /// [`NumericsError::Size`] if `other` has a different number of unknowns or right-hand sides,
    /// [`NumericsError::Overflow`].
    pub fn merge(&mut self, other: &Self) -> Result<(), NumericsError> {
        check_size("columns of the regressors", self.unknowns, other.unknowns)?;
        check_size("columns of the right-hand side", self.targets, other.targets)?;
        if self.factor.merge(&other.factor) { Ok(()) } else { Err(NumericsError::Overflow) }
    }

    /// Returns the triangle of \[A | B\], which has the same Gram matrix as all rows so far, in the
    /// units of regressors and targets.
    pub fn triangle(&self) -> &DMatrix<f64> {
        self.factor.r()
    }

    /// Returns the least-squares solution of all rows so far; more rows may follow.
    ///
    /// Columns are scaled to unit length, and the triangle is solved by QR or, if it is
    /// rank-deficient, by a truncated singular value decomposition.
    ///
    /// # Errors
    /// [`NumericsError::TooFewRows`], [`NumericsError::NothingUnknown`] without unknowns,
    /// [`NumericsError::Underflow`].
    ///
    /// # Source
    /// Björck, *Numerical Methods for Least Squares Problems* (1996), chapters 1–2; Dissertation
    /// eqs. (4.4.1)–(4.4.6), there by normal equations.
    pub fn solve(&self) -> Result<Solution, NumericsError> {
        if let Some((at, norm)) = self.factor.too_small() {
            let (what, column) = match at.checked_sub(self.unknowns) {
                None => ("regressors in column", at),
                Some(target) => ("right-hand side in column", target),
            };
            return Err(NumericsError::Underflow { what, column, norm });
        }
        let r = self.factor.r();
        if r.is_empty() {
            return match self.unknowns {
                0 => Err(NumericsError::NothingUnknown),
                unknowns => Err(NumericsError::TooFewRows { rows: 0, unknowns }),
            };
        }
        let regressors = r.columns(0, self.unknowns);
        let targets = r.columns(self.unknowns, self.targets);
        solve_compressed(regressors, targets, self.rows())
    }
}

/// Solves least squares on compressed rows, which have the same Gram matrices as the `rows`
/// original rows. Units are as in [`Solution`].
///
/// # Errors
/// [`NumericsError::NothingUnknown`], [`NumericsError::TooFewRows`], and errors of a decomposition.
///
/// # Source
/// As [`LeastSquares::solve`].
pub fn solve_compressed(
    regressors: DMatrixView<'_, f64>,
    targets: DMatrixView<'_, f64>,
    rows: usize,
) -> Result<Solution, NumericsError> {
    let unknowns = regressors.ncols();
    if unknowns == 0 {
        return Err(NumericsError::NothingUnknown);
    }
    if rows < unknowns {
        return Err(NumericsError::TooFewRows { rows, unknowns });
    }
    let scaled = Scaled::new(regressors)?;
    let undetermined = scaled.undetermined();
    let inverse = scaled.pseudo_inverse(undetermined.len());
    let mut coefficients = &inverse * targets;
    let residuals = targets - regressors * &coefficients;
    let degrees_of_freedom = rows - (unknowns - undetermined.len());
    let residual_covariance =
        residuals.tr_mul(&residuals).map(|square| square / degrees_of_freedom as f64);
    let ratio = |(e, b): (f64, f64)| if e == 0.0 { 0.0 } else { e / b };
    let norms = residuals.column_iter().zip(targets.column_iter());
    let residual_nrmse = norms.map(|(e, b)| ratio((e.norm(), b.norm()))).collect();
    for direction in &undetermined {
        for (row, involved) in direction.involved.iter().enumerate() {
            if *involved {
                coefficients.row_mut(row).fill(f64::NAN);
            }
        }
    }
    Ok(Solution {
        coefficients,
        unscaled_covariance: &inverse * inverse.transpose(),
        residual_covariance: match degrees_of_freedom {
            0 => DMatrix::from_element(targets.ncols(), targets.ncols(), f64::INFINITY),
            _ => residual_covariance,
        },
        residual_nrmse,
        degrees_of_freedom,
        condition: scaled.condition(),
        undetermined,
        inverse,
        residuals,
    })
}

/// Factored regressor matrix with columns of unit length.
struct Scaled {
    lengths: DVector<f64>,
    q: DMatrix<f64>,
    r: DMatrix<f64>,
    singular_values: DVector<f64>,
    u: DMatrix<f64>,
    v_t: DMatrix<f64>,
}

impl Scaled {
    fn new(regressors: DMatrixView<'_, f64>) -> Result<Self, NumericsError> {
        let mut scaled = regressors.into_owned();
        let lengths = DVector::from_iterator(
            scaled.ncols(),
            scaled.column_iter().map(|c| c.norm()).map(|l| if l > 0.0 { l } else { 1.0 }),
        );
        for (mut column, length) in scaled.column_iter_mut().zip(lengths.iter()) {
            column.unscale_mut(*length);
        }
        let qr = scaled.qr();
        let (q, r) = qr.unpack();
        let svd = svd(r.clone())?;
        let u = svd.u.expect("asked for");
        let v_t = svd.v_t.expect("asked for");
        Ok(Self { lengths, q, r, singular_values: svd.singular_values, u, v_t })
    }

    fn relative(&self, at: usize) -> f64 {
        let largest = self.singular_values.max();
        if largest > 0.0 { self.singular_values[at] / largest } else { 0.0 }
    }

    fn condition(&self) -> f64 {
        let ratios = (0..self.singular_values.len()).map(|at| self.relative(at));
        1.0 / ratios.fold(1.0, f64::min)
    }

    fn undetermined(&self) -> Vec<Direction> {
        let count = self.singular_values.len();
        let tolerance = RANK_TOLERANCE * count as f64;
        let lost = (0..count).filter(|at| self.relative(*at) <= tolerance);
        lost.map(|at| {
            let scaled = self.v_t.row(at).transpose();
            // The threshold keeps rounding from deciding which of two equal entries becomes 1.
            let main = scaled.iter().position(|v| v.abs() > 0.999 * scaled.amax()).unwrap_or(0);
            let involved = scaled.iter().map(|v| v.abs() > SHARE_TOLERANCE).collect();
            let mut combination = scaled.component_div(&self.lengths);
            combination.unscale_mut(combination[main]);
            Direction { relative_singular_value: self.relative(at), combination, involved }
        })
        .collect()
    }

    /// Returns the pseudo-inverse, unknowns × rows, without `lost` undetermined directions.
    fn pseudo_inverse(&self, lost: usize) -> DMatrix<f64> {
        let mut inverse = if lost == 0 {
            self.r.solve_upper_triangular(&self.q.transpose()).expect("full rank")
        } else {
            let tolerance = RANK_TOLERANCE * self.singular_values.len() as f64;
            let mut weighted = self.v_t.transpose();
            for (at, mut column) in weighted.column_iter_mut().enumerate() {
                let is_determined = self.relative(at) > tolerance;
                column *= if is_determined { 1.0 / self.singular_values[at] } else { 0.0 };
            }
            weighted * self.u.transpose() * self.q.transpose()
        };
        for (mut row, length) in inverse.row_iter_mut().zip(self.lengths.iter()) {
            row.unscale_mut(*length);
        }
        inverse
    }
}
