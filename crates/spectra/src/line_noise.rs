//! Covariance of the noise of outputs and inputs, line by line.

use nalgebra::{Complex, DMatrix};

use crate::SpectraError;

/// Covariance E[z zᴴ] of the noise z of outputs and inputs, outputs first, (p + q) × (p + q): one
/// matrix per row of line data, in the products of the units of its amplitudes.
///
/// The noise is circular: real and imaginary parts are independent and have equal variances.
///
/// # Source
/// Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed. (2012),
/// section 12.2 (noise on input and output).
#[derive(Debug, Clone, PartialEq)]
pub struct LineNoise {
    covariance: Vec<DMatrix<Complex<f64>>>,
    degrees_of_freedom: f64,
    total_degrees_of_freedom: f64,
}

impl LineNoise {
    /// Creates the noise from known covariances.
    ///
    /// # Errors
    /// [`SpectraError::Size`] if the covariances differ in size, [`SpectraError::NotFinite`] for an
    /// entry that is not finite or a variance that is negative.
    pub fn new(covariance: Vec<DMatrix<Complex<f64>>>) -> Result<Self, SpectraError> {
        let expected = covariance.first().map_or(0, DMatrix::nrows);
        for (row, matrix) in covariance.iter().enumerate() {
            if let Some(got) = [matrix.nrows(), matrix.ncols()].into_iter().find(|s| *s != expected)
            {
                return Err(SpectraError::Size { what: "channels of a covariance", expected, got });
            }
            let sums = matrix.iter().map(|z| z.re + z.im).find(|sum| !sum.is_finite());
            let negative = matrix.diagonal().iter().map(|z| z.re).find(|variance| *variance < 0.0);
            if let Some(value) = sums.or(negative) {
                return Err(SpectraError::NotFinite { row, value });
            }
        }
        let known = f64::INFINITY;
        Ok(Self { covariance, degrees_of_freedom: known, total_degrees_of_freedom: known })
    }

    /// Returns the same noise as sample covariances. Each covariance is averaged from `each`
    /// complex deviations, all covariances together from `total` deviations; `total` is smaller
    /// than the number of rows times `each` if rows share deviations.
    #[must_use]
    pub fn with_degrees_of_freedom(self, each: f64, total: f64) -> Self {
        Self { degrees_of_freedom: each, total_degrees_of_freedom: total, ..self }
    }

    /// Returns the covariance of each row.
    pub fn covariance(&self) -> &[DMatrix<Complex<f64>>] {
        &self.covariance
    }

    /// Returns the degrees of freedom of each covariance; ∞ if the covariances are known exactly.
    pub fn degrees_of_freedom(&self) -> f64 {
        self.degrees_of_freedom
    }

    /// Returns the total number of complex deviations that were averaged to get all the
    /// covariances; ∞ if the covariances are known exactly.
    pub fn total_degrees_of_freedom(&self) -> f64 {
        self.total_degrees_of_freedom
    }

    /// Returns some of the rows; the total number of deviations is reduced in proportion.
    pub(crate) fn rows(&self, rows: &[usize]) -> Self {
        let share = rows.len() as f64 / self.covariance.len().max(1) as f64;
        Self {
            covariance: rows.iter().map(|row| self.covariance[*row].clone()).collect(),
            degrees_of_freedom: self.degrees_of_freedom,
            total_degrees_of_freedom: self.total_degrees_of_freedom * share,
        }
    }

    /// Returns these rows followed by the rows of another record.
    #[must_use]
    pub(crate) fn followed_by(mut self, other: &Self) -> Self {
        self.covariance.extend_from_slice(&other.covariance);
        // The less certain covariance limits the accuracy of the weights.
        self.degrees_of_freedom = self.degrees_of_freedom.min(other.degrees_of_freedom);
        self.total_degrees_of_freedom += other.total_degrees_of_freedom;
        self
    }
}
