//! The identified bearing as an element of a machine of named elements.

use mechid_model::elements::{Bearing, Coefficient, Element, FreeCoefficient, Machine};

use super::CoefficientRow;

/// Returns a machine of one element: the bearing, which connects x and y to the support. The result
/// is `None` if the coefficients have no standard errors.
pub(super) fn machine(coefficients: &[CoefficientRow]) -> Option<Machine> {
    let free = coefficients.iter().map(coefficient).collect::<Option<Vec<_>>>()?;
    let of_kind = |kind: usize| {
        std::array::from_fn(|at| free.get(4 * kind + at).cloned().unwrap_or_default())
    };
    let bearing = Bearing {
        at: ["x", "y"].map(str::to_owned),
        to: None,
        stiffness: of_kind(0),
        damping: of_kind(1),
        mass: of_kind(2),
    };
    let element = Element::Bearing(Box::new(bearing));
    Some(Machine::new(["x", "y"]).with("bearing", element))
}

/// Returns an unknown whose prior is the estimate with its standard error; a known coefficient if
/// the standard error is zero.
fn coefficient(row: &CoefficientRow) -> Option<Coefficient> {
    let (mean, error) = (row.estimate.value, row.estimate.standard_error?);
    let is_exact = error == 0.0;
    Some(if is_exact {
        Coefficient::Known(mean)
    } else {
        FreeCoefficient::from_start(mean).with_prior(mean, error).into()
    })
}
