//! Mode shapes with the covariance of their errors.

use nalgebra::{Complex, DMatrix, DVector};

use super::IndicatorError;

/// Complex mode shape of p entries with the covariance of its real and imaginary parts.
#[derive(Debug, Clone, PartialEq)]
pub struct ShapeWithCovariance {
    shape: DVector<Complex<f64>>,
    covariance: DMatrix<f64>,
}

impl ShapeWithCovariance {
    /// Creates a shape from its p entries and the 2p × 2p covariance of their real and imaginary
    /// parts (the p real parts first), in the squared unit of the shape. The covariance is zero for
    /// entries without error, as in a finite-element model.
    ///
    /// # Errors
    /// [`IndicatorError::Size`], [`IndicatorError::NotFinite`], [`IndicatorError::ZeroShape`].
    pub fn new(
        shape: DVector<Complex<f64>>,
        covariance: DMatrix<f64>,
    ) -> Result<Self, IndicatorError> {
        let entries = shape.len();
        super::check_size("rows of the covariance of a shape", 2 * entries, covariance.nrows())?;
        super::check_size("columns of the covariance of a shape", 2 * entries, covariance.ncols())?;
        let infinite = shape.iter().position(|z| !(z.re.is_finite() && z.im.is_finite()));
        if let Some(index) = infinite {
            return Err(IndicatorError::NotFinite { what: "shape", index });
        }
        if let Some(index) = covariance.iter().position(|v| !v.is_finite()) {
            return Err(IndicatorError::NotFinite { what: "covariance of a shape", index });
        }
        if shape.iter().all(|z| z.norm_sqr() == 0.0) {
            return Err(IndicatorError::ZeroShape { entries });
        }
        Ok(Self { shape, covariance })
    }

    /// Creates a shape without errors, such as one of a finite-element model.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn exact(shape: DVector<Complex<f64>>) -> Result<Self, IndicatorError> {
        let len = 2 * shape.len();
        Self::new(shape, DMatrix::zeros(len, len))
    }

    /// Creates a shape whose entries have independent errors, equal in the real and the imaginary
    /// part.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn from_standard_errors(
        shape: DVector<Complex<f64>>,
        standard_errors: &[f64],
    ) -> Result<Self, IndicatorError> {
        super::check_size("standard errors of a shape", shape.len(), standard_errors.len())?;
        let both = standard_errors.iter().chain(standard_errors).map(|s| s * s);
        let variances = DVector::from_iterator(2 * shape.len(), both);
        Self::new(shape, DMatrix::from_diagonal(&variances))
    }

    /// Returns the shape.
    pub fn shape(&self) -> &DVector<Complex<f64>> {
        &self.shape
    }

    /// Returns the covariance of the real and imaginary parts, 2p × 2p, the real parts first.
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns the shape with all standard errors multiplied by `scale`.
    pub(crate) fn with_error_scale(mut self, scale: f64) -> Self {
        self.covariance *= scale * scale;
        self
    }

    /// Returns √(variance of the real part + variance of the imaginary part) of every entry.
    pub fn standard_errors(&self) -> DVector<f64> {
        let p = self.shape.len();
        let variance = |i: usize| self.covariance[(i, i)] + self.covariance[(p + i, p + i)];
        DVector::from_fn(p, |i, _| variance(i).max(0.0).sqrt())
    }

    /// Returns the shape divided by one of its entries. This entry becomes exactly 1; `None` if it
    /// is zero.
    pub fn normalised_to(&self, entry: usize) -> Option<Self> {
        let p = self.shape.len();
        let reference = *self.shape.get(entry)?;
        if reference.norm_sqr() == 0.0 {
            return None;
        }
        let shape = &self.shape / reference;
        // d(φ/φ_r) = (dφ − φ/φ_r dφ_r) / φ_r. The covariance is that of real and imaginary parts,
        // so each complex factor gives four real entries of the Jacobian.
        let mut jacobian = DMatrix::zeros(2 * p, 2 * p);
        let mut add = |i: usize, j: usize, factor: Complex<f64>| {
            jacobian[(i, j)] += factor.re;
            jacobian[(i, p + j)] -= factor.im;
            jacobian[(p + i, j)] += factor.im;
            jacobian[(p + i, p + j)] += factor.re;
        };
        for i in (0..p).filter(|i| *i != entry) {
            add(i, i, reference.inv());
            add(i, entry, -shape[i] / reference);
        }
        let covariance = &jacobian * &self.covariance * jacobian.transpose();
        Some(Self { shape, covariance })
    }

    /// Returns the shape divided by its largest entry.
    pub fn normalised(&self) -> Self {
        self.normalised_to(self.largest_entry()).unwrap_or_else(|| self.clone())
    }

    /// Returns the index of the entry of the largest modulus.
    pub fn largest_entry(&self) -> usize {
        // `icamax` of nalgebra compares |Re| + |Im|, which depends on the phase of the shape.
        let modulus = |i: &usize| self.shape[*i].norm_sqr();
        (0..self.shape.len()).max_by(|a, b| modulus(a).total_cmp(&modulus(b))).unwrap_or(0)
    }
}
