//! Systems with uncertain entries.

use nalgebra::DMatrix;

use crate::{ModelError, Parameter, SecondOrderSystem};

/// System with some uncertain entries, and their covariance; all other entries are known.
///
/// ```
/// use mechid_model::{Parameter, SecondOrderSystem, UncertainSystem};
/// use nalgebra::dmatrix;
///
/// // The stiffness is known to ±0.2 N/m.
/// let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![3.0], dmatrix![8.0])?;
/// let stiffness = Parameter::named("k", 1)?;
/// let uncertain = UncertainSystem::new(system, vec![stiffness], dmatrix![0.2 * 0.2])?;
/// assert_eq!(uncertain.standard_error(stiffness), 0.2);
/// # Ok::<(), mechid_model::ModelError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(
        try_from = "crate::serde_forms::UncertainForm",
        into = "crate::serde_forms::UncertainForm"
    )
)]
pub struct UncertainSystem {
    system: SecondOrderSystem,
    parameters: Vec<Parameter>,
    covariance: DMatrix<f64>,
}

impl UncertainSystem {
    /// Creates a system whose entries `parameters` are uncertain. The covariance has one row and
    /// one column per parameter, in products of their units (kg, N·s/m, N/m).
    ///
    /// # Errors
    /// [`ModelError::CovarianceShape`] unless the covariance has one row and one column per
    /// parameter, [`ModelError::Covariance`] if it has a negative variance or an entry that is not
    /// finite, [`ModelError::RepeatedParameter`] if a parameter is named twice,
    /// [`ModelError::NoSuchParameter`] if a parameter belongs to a system of another size.
    pub fn new(
        system: SecondOrderSystem,
        parameters: Vec<Parameter>,
        covariance: DMatrix<f64>,
    ) -> Result<Self, ModelError> {
        let dof = system.dof();
        if let Some(parameter) = parameters.iter().find(|parameter| parameter.dof() != dof) {
            return Err(ModelError::NoSuchParameter { name: parameter.to_string(), dof });
        }
        let names: Vec<String> = parameters.iter().map(Parameter::to_string).collect();
        check_covariance(&names, &covariance)?;
        Ok(Self { system, parameters, covariance })
    }

    /// Creates a system with known entries only.
    pub fn exact(system: SecondOrderSystem) -> Self {
        Self { system, parameters: Vec::new(), covariance: DMatrix::zeros(0, 0) }
    }

    /// The system with the uncertain entries at their estimates.
    pub fn system(&self) -> &SecondOrderSystem {
        &self.system
    }

    /// Uncertain entries, in the order of the covariance.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// Covariance of the uncertain entries, with one row and one column per entry, in the products
    /// of the units of the entries (kg, N·s/m, N/m).
    pub fn covariance(&self) -> &DMatrix<f64> {
        &self.covariance
    }

    /// Returns the standard error of one entry, in its unit (kg, N·s/m or N/m); 0 for a known
    /// entry.
    pub fn standard_error(&self, parameter: Parameter) -> f64 {
        let at = self.parameters.iter().position(|p| *p == parameter);
        at.map_or(0.0, |at| self.covariance[(at, at)].sqrt())
    }
}

/// Checks that a covariance has one row and one column per name, finite entries and no negative
/// variance, and that no name is repeated.
pub(crate) fn check_covariance(
    names: &[String],
    covariance: &DMatrix<f64>,
) -> Result<(), ModelError> {
    let (rows, columns) = covariance.shape();
    if (rows, columns) != (names.len(), names.len()) {
        let parameters = names.len();
        return Err(ModelError::CovarianceShape { rows, columns, parameters });
    }
    for (at, name) in names.iter().enumerate() {
        if names[..at].contains(name) {
            return Err(ModelError::RepeatedParameter { parameter: name.clone() });
        }
        let variance = covariance[(at, at)];
        if variance < 0.0 || covariance.column(at).iter().any(|value| !value.is_finite()) {
            return Err(ModelError::Covariance { parameter: name.clone(), variance });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use nalgebra::dmatrix;

    use super::*;

    #[test]
    fn invalid_covariances_are_refused() {
        let system = SecondOrderSystem::new(dmatrix![2.0], dmatrix![3.0], dmatrix![8.0]).unwrap();
        let k = Parameter::named("k", 1).unwrap();
        let of = |parameters: &[Parameter], covariance| {
            UncertainSystem::new(system.clone(), parameters.to_vec(), covariance)
        };
        let refused =
            |parameters: &[Parameter], covariance| of(parameters, covariance).unwrap_err();
        assert_eq!(
            refused(&[k], DMatrix::identity(2, 2)),
            ModelError::CovarianceShape { rows: 2, columns: 2, parameters: 1 }
        );
        for variance in [-1.0, f64::INFINITY] {
            let error = ModelError::Covariance { parameter: k.to_string(), variance };
            assert_eq!(refused(&[k], dmatrix![variance]), error);
        }
        assert_eq!(
            refused(&[k, k], DMatrix::identity(2, 2)),
            ModelError::RepeatedParameter { parameter: k.to_string() }
        );
        let k22 = Parameter::named("k22", 2).unwrap();
        assert_eq!(
            refused(&[k22], dmatrix![1.0]),
            ModelError::NoSuchParameter { name: "k22".into(), dof: 1 }
        );
        let c = Parameter::named("c", 1).unwrap();
        assert_eq!(of(&[k], dmatrix![4.0]).unwrap().standard_error(c), 0.0);
        assert_eq!(UncertainSystem::exact(system).parameters(), []);
    }
}
