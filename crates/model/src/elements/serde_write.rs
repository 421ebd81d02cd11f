//! Conversion of the description of a machine to its JSON form.

use nalgebra::DMatrix;

use super::serde_form::{ElementForm, Kind, MachineForm, MatrixForm, Places};
use super::{Bearing, Coefficient, Element, Machine, MatrixElement};

impl From<Machine> for MachineForm {
    fn from(machine: Machine) -> Self {
        Self {
            elements: machine.elements.into_iter().map(ElementForm::from).collect(),
            dofs: machine.dofs,
            parameters: machine.parameters.into_iter().collect(),
            damping: machine.damping,
            support_direction: machine.support_direction,
            measured: machine.measured,
        }
    }
}

/// Returns a coefficient unless it is a known zero.
fn given(coefficient: Coefficient) -> Option<Coefficient> {
    (!coefficient.is_zero()).then_some(coefficient)
}

fn written(part: Option<(DMatrix<f64>, Coefficient)>) -> (Option<MatrixForm>, Option<Coefficient>) {
    let Some((matrix, factor)) = part else { return (None, None) };
    let factor = (factor != Coefficient::Known(1.0)).then_some(factor);
    let filled = matrix.iter().filter(|value| **value != 0.0).count();
    // A sparse entry needs three numbers.
    if matrix.is_square() && 3 * filled < matrix.len() {
        let size = matrix.nrows();
        let (mut rows, mut columns, mut values) = (Vec::new(), Vec::new(), Vec::new());
        for (row, entries) in matrix.row_iter().enumerate() {
            for (column, value) in entries.iter().enumerate().filter(|(_, value)| **value != 0.0) {
                rows.push(row + 1);
                columns.push(column + 1);
                values.push(*value);
            }
        }
        return (Some(MatrixForm::Sparse { size, rows, columns, values }), factor);
    }
    let rows = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    (Some(MatrixForm::Dense(rows)), factor)
}

impl From<(String, Element)> for ElementForm {
    fn from((name, element): (String, Element)) -> Self {
        let form = Self { name, ..Self::default() };
        match element {
            Element::Mass { at, mass } => {
                Self { kind: Some(Kind::Mass), at: Some(Places::One(at)), m: Some(mass), ..form }
            }
            Element::Link { between, stiffness, damping, loss_factor } => Self {
                kind: Some(Kind::Link),
                between: Some(between),
                k: given(stiffness),
                c: given(damping),
                eta: given(loss_factor),
                ..form
            },
            Element::Unbalance { at, real, imaginary } => Self {
                kind: Some(Kind::Unbalance),
                at: Some(Places::Several(at.to_vec())),
                real: Some(real),
                imaginary: Some(imaginary),
                ..form
            },
            Element::Bearing(bearing) => {
                let Bearing { at, to, stiffness, damping, mass } = *bearing;
                let [kxx, kxy, kyx, kyy] = stiffness.map(given);
                let [cxx, cxy, cyx, cyy] = damping.map(given);
                let [mxx, mxy, myx, myy] = mass.map(given);
                let (kind, at) = (Some(Kind::Bearing), Some(Places::Several(at.to_vec())));
                let form = Self { kind, at, to, kxx, kxy, kyx, kyy, ..form };
                Self { cxx, cxy, cyx, cyy, mxx, mxy, myx, myy, ..form }
            }
            Element::Matrices(matrices) => {
                let MatrixElement { dofs, mass, damping, stiffness, gyroscopic } = *matrices;
                let (mass, mass_factor) = written(mass);
                let (damping, damping_factor) = written(damping);
                let (stiffness, stiffness_factor) = written(stiffness);
                let (gyroscopic, gyroscopic_factor) = written(gyroscopic);
                let (kind, dofs) = (Some(Kind::Matrices), Some(dofs));
                let form = Self { kind, dofs, mass, damping, stiffness, gyroscopic, ..form };
                Self { mass_factor, damping_factor, stiffness_factor, gyroscopic_factor, ..form }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, from_value, json, to_value};

    use super::super::{FreeCoefficient, Instruments, Machine};

    fn described() -> Value {
        json!({
            "dofs": ["x", "y", "u", "v"],
            "elements": [
                {"name": "m", "kind": "mass", "at": "x", "m": "rotor mass"},
                {"name": "m2", "at": "y", "m": "rotor mass"},
                {"name": "housing", "dofs": ["u", "v"],
                 "mass": {"size": 2, "rows": [1, 2], "columns": [1, 2], "values": [30.0, 30.0]},
                 "stiffness": [[1e7, 0.0], [0.0, 2e7]]},
                {"name": "film", "at": ["x", "y"], "to": ["u", "v"],
                 "kxx": {"start": 1e6, "min": 0.0}, "kyy": {"prior": {"mean": 2e6, "standard_deviation": 1e5}},
                 "cxx": 300, "cyy": 300.0},
                {"name": "seal", "kind": "link", "at": "x", "k": 1e4, "c": {"min": 1.0, "max": 100.0}}
            ],
            "parameters": {"rotor mass": {"start": 12.0, "min": 1.0}},
            "damping": {"beta": 1e-5}
        })
    }

    #[test]
    fn a_machine_is_read_and_written() {
        let machine: Machine = from_value(described()).unwrap();
        let again: Machine = from_value(to_value(machine.clone()).unwrap()).unwrap();
        assert_eq!(machine, again);
        let instruments: Instruments = from_value(json!({
            "sensors": [{"name": "probe", "at": "x", "relative_to": "u", "quantity": "displacement"}],
            "inputs": [{"kind": "force", "name": "shaker", "at": "y"}],
            "speed": {"constant": 300.0}
        }))
        .unwrap();
        let assembly = machine.assembly(&instruments).unwrap();
        let names: Vec<&str> = assembly.parameters().iter().map(|p| p.name.as_str()).collect();
        assert_eq!(names, ["rotor mass", "film.kxx", "film.kyy", "seal.c"]);
        // The shared mass is one parameter, although two elements use it. The initial value of the
        // damper is the geometric mean of its bounds.
        assert_eq!(assembly.start(), [12.0, 1e6, 2e6, 10.0]);
        let system = assembly.system(&assembly.start(), 300.0).unwrap();
        assert_eq!((system.mass()[(0, 0)], system.mass()[(1, 1)]), (12.0, 12.0));
        assert_eq!(system.stiffness()[(0, 2)], -1e6);
        assert_eq!(system.damping()[(3, 3)], 300.0 + 2e7 * 1e-5);
        assert_eq!(machine.parameters[0].1, FreeCoefficient::from_start(12.0).at_least(1.0));
    }

    #[test]
    fn errors_name_the_element() {
        let refused = |change: &dyn Fn(&mut Value)| {
            let mut value = described();
            change(&mut value);
            from_value::<Machine>(value).unwrap_err().to_string()
        };
        let message = refused(&|v| v["elements"][0]["kxx"] = json!(1.0));
        assert_eq!(message, "element \"m\": an element of `kind` mass has no `kxx`");
        let message = refused(&|v| v["elements"][4]["between"] = json!(["x", "y"]));
        assert_eq!(message, "element \"seal\": a link needs either `between` or `at`");
        let message = refused(&|v| v["elements"][3]["at"] = json!("x"));
        assert_eq!(message, "element \"film\": `at` must be two degrees of freedom, x and y");
        let message = refused(&|v| v["elements"][2]["mass"]["size"] = json!(1));
        assert!(message.starts_with("element \"housing\": entry (2, 2) of `mass`"), "{message}");
        let message = refused(&|v| v["elements"][1] = json!({"name": "q", "at": "x"}));
        assert!(message.starts_with("element \"q\": `kind` is missing"), "{message}");
        let message = refused(&|v| v["elements"][4]["k"] = json!({"begin": 1.0}));
        assert!(message.contains("unknown field `begin`"), "{message}");
    }
}
