//! Terms of each kind of element.

use nalgebra::{Complex, DMatrix};

use super::assembly::OwnLoad;
use super::build::{Builder, Factor};
use super::{Bearing, Coefficient, MachineError, MatrixElement, Pattern, Power, SUPPORT, Speed};

impl Builder<'_> {
    pub(super) fn mass(
        &mut self,
        name: &str,
        at: &str,
        mass: &Coefficient,
    ) -> Result<(), MachineError> {
        let at = self.dof("element", name, at)?;
        let factor = self.factor(name, "kg", mass)?;
        let entries = vec![(at, 1.0)];
        // A mass of 0 declares a degree of freedom without mass.
        if mass.is_zero() {
            self.allow_no_mass(at);
        } else {
            self.touch(name, &entries, true);
        }
        let relative = vec![(at, 1.0), (self.machine.dofs.len(), -self.direction[at])];
        let pattern = Pattern::Dyad { left: entries.clone(), right: entries.clone() };
        self.push(&pattern, Power::Mass, &[factor]);
        let pattern = Pattern::Dyad { left: entries, right: relative };
        self.push(&pattern, Power::Damping, &[self.alpha, factor]);
        Ok(())
    }

    pub(super) fn link(
        &mut self,
        name: &str,
        ends: [&str; 2],
        [stiffness, damping, loss_factor]: [&Coefficient; 3],
    ) -> Result<(), MachineError> {
        let entries = self.difference("element", name, ends)?;
        self.touch(name, &entries, false);
        let used = [stiffness, damping].into_iter().filter(|value| !value.is_zero()).count();
        if used == 0 {
            let problem = "a link needs a stiffness `k` or a damping `c`".to_owned();
            return Err(MachineError::Element { name: name.to_owned(), problem });
        }
        let named = |letter: &str| match used + usize::from(!loss_factor.is_zero()) {
            1 => name.to_owned(),
            _ => format!("{name}.{letter}"),
        };
        let k = self.factor(&named("k"), "N/m", stiffness)?;
        let c = self.factor(&named("c"), "N·s/m", damping)?;
        let eta = if loss_factor.is_zero() {
            self.loss_factor
        } else {
            self.factor(&named("eta"), "", loss_factor)?
        };
        let pattern = Pattern::Dyad { left: entries.clone(), right: entries };
        self.push(&pattern, Power::Stiffness, &[k]);
        self.push(&pattern, Power::Damping, &[c]);
        self.push(&pattern, Power::Hysteresis, &[k, eta]);
        self.push(&pattern, Power::Damping, &[k, self.beta]);
        Ok(())
    }

    pub(super) fn bearing(&mut self, name: &str, bearing: &Bearing) -> Result<(), MachineError> {
        let mut ends = Vec::new();
        for direction in 0..2 {
            let opposite = bearing.to.as_ref().map_or(SUPPORT, |to| to[direction].as_str());
            ends.push(self.difference(
                "element",
                name,
                [bearing.at[direction].as_str(), opposite],
            )?);
            self.touch(name, &ends[direction], false);
        }
        let matrices = [
            ("k", "N/m", Power::Stiffness, &bearing.stiffness),
            ("c", "N·s/m", Power::Damping, &bearing.damping),
            ("m", "kg", Power::Mass, &bearing.mass),
        ];
        for (letter, unit, power, coefficients) in matrices {
            let places = [("xx", 0, 0), ("xy", 0, 1), ("yx", 1, 0), ("yy", 1, 1)];
            for ((place, row, column), coefficient) in places.into_iter().zip(coefficients) {
                let factor = self.factor(&format!("{name}.{letter}{place}"), unit, coefficient)?;
                let (left, right) = (ends[row].clone(), ends[column].clone());
                self.push(&Pattern::Dyad { left, right }, power, &[factor]);
            }
        }
        Ok(())
    }

    pub(super) fn matrices(
        &mut self,
        name: &str,
        element: &MatrixElement,
    ) -> Result<(), MachineError> {
        let dofs = element.dofs.iter().map(|dof| self.dof("element", name, dof));
        let dofs: Vec<usize> = dofs.collect::<Result<_, _>>()?;
        let entries: Vec<(usize, f64)> = dofs.iter().map(|at| (*at, 1.0)).collect();
        self.touch(name, &entries, element.mass.is_some());
        let known = Factor::Known(1.0);
        let parts = [
            ("mass", &element.mass, Power::Mass),
            ("damping", &element.damping, Power::Damping),
            ("stiffness", &element.stiffness, Power::Stiffness),
            ("gyroscopic", &element.gyroscopic, Power::Gyroscopic),
        ];
        for (what, part, power) in parts {
            let Some((matrix, coefficient)) = part else { continue };
            self.check_matrix(name, what, matrix, dofs.len())?;
            let factor = self.factor(&format!("{name}.{what}"), "", coefficient)?;
            let relative = self.block(&dofs, matrix, true);
            match power {
                Power::Mass => {
                    let absolute = self.block(&dofs, matrix, false);
                    self.push(&absolute, power, &[factor, known]);
                    self.push(&relative, Power::Damping, &[factor, self.alpha]);
                }
                Power::Stiffness => {
                    self.push(&relative, power, &[factor]);
                    self.push(&relative, Power::Hysteresis, &[factor, self.loss_factor]);
                    self.push(&relative, Power::Damping, &[factor, self.beta]);
                }
                Power::Gyroscopic if self.speed == Speed::None => {
                    return Err(MachineError::NoSpeed { what: "element", name: name.to_owned() });
                }
                Power::Gyroscopic => {
                    let absolute = self.block(&dofs, matrix, false);
                    self.push(&absolute, power, &[factor]);
                }
                _ => self.push(&relative, power, &[factor]),
            }
        }
        Ok(())
    }

    fn check_matrix(
        &self,
        name: &str,
        what: &str,
        matrix: &DMatrix<f64>,
        order: usize,
    ) -> Result<(), MachineError> {
        let (rows, columns) = matrix.shape();
        if (rows, columns) != (order, order) {
            let problem = format!(
                "the {what} matrix is {rows}×{columns}, but `dofs` has {order} degrees of freedom"
            );
            return Err(MachineError::Element { name: name.to_owned(), problem });
        }
        match matrix.iter().find(|value| !value.is_finite()) {
            Some(&value) => Err(MachineError::NotFinite { name: format!("{name}.{what}"), value }),
            None => Ok(()),
        }
    }

    /// Returns the pattern of a matrix that acts on the absolute motion, or on the motion relative
    /// to the support.
    fn block(&self, dofs: &[usize], matrix: &DMatrix<f64>, relative: bool) -> Pattern {
        let support = matrix.row_iter().map(|row| {
            let moved = row.iter().zip(dofs).map(|(value, at)| value * self.direction[*at]);
            if relative { -moved.sum::<f64>() } else { 0.0 }
        });
        let support = support.collect();
        Pattern::Block { dofs: dofs.to_vec(), matrix: matrix.clone(), support }
    }

    pub(super) fn unbalance(
        &mut self,
        name: &str,
        at: &[String; 2],
        parts: [&Coefficient; 2],
    ) -> Result<(), MachineError> {
        if self.speed == Speed::None {
            return Err(MachineError::NoSpeed { what: "element", name: name.to_owned() });
        }
        let at = [self.dof("element", name, &at[0])?, self.dof("element", name, &at[1])?];
        let units = [("real", Complex::new(1.0, 0.0)), ("imaginary", Complex::new(0.0, 1.0))];
        for ((what, unit), part) in units.into_iter().zip(parts) {
            match self.factor(&format!("{name}.{what}"), "kg·m", part)? {
                Factor::Known(0.0) => {}
                Factor::Known(value) => {
                    self.loads.push(OwnLoad { at, scale: unit * value, parameter: None });
                }
                Factor::Unknown(parameter) => {
                    self.loads.push(OwnLoad { at, scale: unit, parameter: Some(parameter) });
                }
            }
        }
        Ok(())
    }
}
