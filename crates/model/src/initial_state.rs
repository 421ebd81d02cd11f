//! Displacement and velocity at the start of a response.

use nalgebra::DVector;

use crate::ModelError;

/// Displacement and velocity at t = 0, one entry per degree of freedom.
#[derive(Debug, Clone, PartialEq)]
pub struct InitialState {
    displacement: DVector<f64>,
    velocity: DVector<f64>,
}

impl InitialState {
    /// Creates a state from x(0) (m) and ẋ(0) (m/s).
    ///
    /// # Errors
    /// [`ModelError::StateLength`] if x(0) and ẋ(0) have different lengths,
    /// [`ModelError::StateNotFinite`] at the first NaN or infinity.
    pub fn new(displacement: DVector<f64>, velocity: DVector<f64>) -> Result<Self, ModelError> {
        let (got, dof) = (velocity.len(), displacement.len());
        if got != dof {
            return Err(ModelError::StateLength { got, dof });
        }
        for (quantity, values) in [("displacement", &displacement), ("velocity", &velocity)] {
            if let Some(at) = values.iter().position(|v| !v.is_finite()) {
                let value = values[at];
                return Err(ModelError::StateNotFinite { quantity, dof: at + 1, value });
            }
        }
        Ok(Self { displacement, velocity })
    }

    /// State of rest at the origin.
    pub fn rest(dof: usize) -> Self {
        Self { displacement: DVector::zeros(dof), velocity: DVector::zeros(dof) }
    }

    /// Displacement x(0), in m.
    pub fn displacement(&self) -> &DVector<f64> {
        &self.displacement
    }

    /// Velocity ẋ(0), in m/s.
    pub fn velocity(&self) -> &DVector<f64> {
        &self.velocity
    }

    /// Number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.displacement.len()
    }

    /// Checks that the state fits a system of `dof` degrees of freedom.
    ///
    /// # Errors
    /// [`ModelError::StateLength`] if it does not.
    pub fn check_dof(&self, dof: usize) -> Result<(), ModelError> {
        let got = self.dof();
        if got == dof { Ok(()) } else { Err(ModelError::StateLength { got, dof }) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::dvector;

    use super::*;

    #[test]
    fn a_state_fits_and_is_finite() {
        let state = InitialState::new(dvector![1.0, 2.0], dvector![0.0, -1.0]).unwrap();
        assert!(state.check_dof(2).is_ok());
        assert_eq!(state.check_dof(3), Err(ModelError::StateLength { got: 2, dof: 3 }));
        assert_eq!(
            InitialState::new(dvector![1.0], dvector![]),
            Err(ModelError::StateLength { got: 0, dof: 1 })
        );
        assert_eq!(
            InitialState::new(dvector![0.0, 1.0], dvector![0.0, f64::INFINITY]),
            Err(ModelError::StateNotFinite { quantity: "velocity", dof: 2, value: f64::INFINITY })
        );
        assert_eq!(InitialState::rest(3).velocity().norm(), 0.0);
    }
}
