//! Known coefficients of a machine, made unknown one at a time.

use super::{Coefficient, Element, FreeCoefficient, Machine};

impl Machine {
    /// Returns one machine for each known, non-zero coefficient of the elements. In this machine
    /// the coefficient is unknown: the search begins at the known value, and a bound at 0 keeps the
    /// sign of this value.
    pub fn with_each_known_free(&self) -> Vec<Self> {
        let mut machines = Vec::new();
        for (at, (_, element)) in self.elements.iter().enumerate() {
            let mut element = element.clone();
            for place in 0..coefficients(&mut element).len() {
                let mut machine = self.clone();
                let coefficient = coefficients(&mut machine.elements[at].1).swap_remove(place);
                let Coefficient::Known(value) = *coefficient else { continue };
                if value == 0.0 {
                    continue;
                }
                let free = FreeCoefficient::from_start(value);
                *coefficient =
                    if value > 0.0 { free.at_least(0.0) } else { free.at_most(0.0) }.into();
                machines.push(machine);
            }
        }
        machines
    }
}

/// Returns the coefficients of an element.
fn coefficients(element: &mut Element) -> Vec<&mut Coefficient> {
    match element {
        Element::Mass { mass, .. } => vec![mass],
        Element::Link { stiffness, damping, loss_factor, .. } => {
            vec![stiffness, damping, loss_factor]
        }
        Element::Bearing(bearing) => {
            let parts = [&mut bearing.stiffness, &mut bearing.damping, &mut bearing.mass];
            parts.into_iter().flatten().collect()
        }
        Element::Matrices(matrices) => {
            let parts = [
                &mut matrices.mass,
                &mut matrices.damping,
                &mut matrices.stiffness,
                &mut matrices.gyroscopic,
            ];
            parts.into_iter().flatten().map(|(_, factor)| factor).collect()
        }
        Element::Unbalance { real, imaginary, .. } => vec![real, imaginary],
    }
}
