//! Values with a standard error, and their confidence intervals.

use statrs::distribution::{ContinuousCDF, StudentsT};

use crate::NumericsError;

/// Value with its standard error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uncertain {
    /// Value, in the unit that its field or function states.
    pub value: f64,
    /// Standard error, in the same unit; infinite if the value has no derivative with respect to
    /// the parameters (repeated eigenvalues).
    pub standard_error: f64,
    /// Degrees of freedom of the variance behind the standard error.
    pub degrees_of_freedom: usize,
}

impl Uncertain {
    /// Returns the confidence interval [low, high] at `level` (0.95 for 95 %), in the unit of the
    /// value.
    ///
    /// # Errors
    /// [`NumericsError::Level`] unless 0 < level < 1.
    ///
    /// # Source
    /// As [`student_interval`].
    ///
    /// ```
    /// use mechid_numerics::Uncertain;
    ///
    /// let stiffness = Uncertain { value: 10.0, standard_error: 1.0, degrees_of_freedom: 4 };
    /// let [low, high] = stiffness.interval(0.95)?;
    /// assert!((low - 7.223_55).abs() < 1e-5 && (high - 12.776_45).abs() < 1e-5);
    /// # Ok::<(), mechid_numerics::NumericsError>(())
    /// ```
    pub fn interval(&self, level: f64) -> Result<[f64; 2], NumericsError> {
        student_interval(self.value, self.standard_error, self.degrees_of_freedom, level)
    }
}

/// Returns the interval [low, high] at `level` around a value with its standard error, in the unit
/// of the value. The interval is infinite if the standard error is not finite or has no degrees of
/// freedom.
///
/// # Errors
/// [`NumericsError::Level`] unless 0 < level < 1.
///
/// # Source
/// Student (1908), Biometrika 6, 1–25.
pub fn student_interval(
    value: f64,
    standard_error: f64,
    degrees_of_freedom: usize,
    level: f64,
) -> Result<[f64; 2], NumericsError> {
    if !(level > 0.0 && level < 1.0) {
        return Err(NumericsError::Level { level });
    }
    if !standard_error.is_finite() || degrees_of_freedom == 0 {
        return Ok([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let t = StudentsT::new(0.0, 1.0, degrees_of_freedom as f64)
        .expect("positive degrees of freedom")
        .inverse_cdf(0.5 + 0.5 * level);
    Ok([value - t * standard_error, value + t * standard_error])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_the_table_of_student() {
        // The expected two-sided 95 % quantiles are from a printed table with three decimal places.
        for (degrees_of_freedom, quantile) in [(1, 12.706), (4, 2.776), (10, 2.228), (120, 1.980)] {
            let [low, high] = student_interval(3.0, 2.0, degrees_of_freedom, 0.95).unwrap();
            assert!((0.5 * (high - 3.0) - quantile).abs() < 5e-4, "{degrees_of_freedom}");
            assert!((low + high - 6.0).abs() < 1e-12);
        }
    }

    #[test]
    fn without_degrees_of_freedom_nothing_is_excluded() {
        let whole = [f64::NEG_INFINITY, f64::INFINITY];
        assert_eq!(student_interval(3.0, 2.0, 0, 0.95), Ok(whole));
        assert_eq!(student_interval(3.0, f64::INFINITY, 9, 0.95), Ok(whole));
        let refused = student_interval(3.0, 2.0, 9, 1.0);
        assert_eq!(refused, Err(NumericsError::Level { level: 1.0 }));
    }
}
