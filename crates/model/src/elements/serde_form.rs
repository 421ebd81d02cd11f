//! JSON form of the description of a machine.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::limits::MAX_MATRIX_ORDER;

use super::{
    Bearing, Coefficient, Element, FreeCoefficient, Machine, MachineError, MatrixElement,
    ProportionalDamping, SUPPORT,
};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MachineForm {
    pub(super) dofs: Vec<String>,
    pub(super) elements: Vec<ElementForm>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub(super) parameters: BTreeMap<String, FreeCoefficient>,
    #[serde(default, skip_serializing_if = "ProportionalDamping::is_zero")]
    pub(super) damping: ProportionalDamping,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) support_direction: Option<Vec<String>>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) measured: Vec<String>,
}

#[derive(Debug, Serialize, Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "snake_case")]
pub(super) enum Kind {
    Mass,
    Link,
    Bearing,
    Matrices,
    Unbalance,
}

/// One degree of freedom or several.
#[derive(Serialize, Deserialize)]
#[serde(untagged)]
pub(super) enum Places {
    One(String),
    Several(Vec<String>),
}

/// Rows of a matrix, or its non-zero entries by row and column, counted from 1.
#[derive(Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a matrix is a list of rows; a sparse matrix has size, rows, columns and values"
)]
pub(super) enum MatrixForm {
    Dense(Vec<Vec<f64>>),
    Sparse { size: usize, rows: Vec<usize>, columns: Vec<usize>, values: Vec<f64> },
}

/// Element of any kind; the fields that only other kinds have are absent.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ElementForm {
    pub(super) name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kind: Option<Kind>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) at: Option<Places>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) between: Option<[String; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) to: Option<[String; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) dofs: Option<Vec<String>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) m: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) k: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) c: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) eta: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kxx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kxy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kyx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) kyy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cxx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cxy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cyx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) cyy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mxx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mxy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) myx: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) myy: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) real: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) imaginary: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mass_factor: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) damping_factor: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) stiffness_factor: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) gyroscopic_factor: Option<Coefficient>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) mass: Option<MatrixForm>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) damping: Option<MatrixForm>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) stiffness: Option<MatrixForm>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) gyroscopic: Option<MatrixForm>,
}

impl ElementForm {
    fn error(&self, problem: impl Into<String>) -> MachineError {
        MachineError::Element { name: self.name.clone(), problem: problem.into() }
    }

    /// Returns the names of the given fields, except name and kind.
    fn given(&self) -> Vec<&'static str> {
        let mut given = Vec::new();
        for (name, present) in [
            ("at", self.at.is_some()),
            ("between", self.between.is_some()),
            ("to", self.to.is_some()),
            ("dofs", self.dofs.is_some()),
            ("mass", self.mass.is_some()),
            ("damping", self.damping.is_some()),
            ("stiffness", self.stiffness.is_some()),
            ("gyroscopic", self.gyroscopic.is_some()),
            ("m", self.m.is_some()),
            ("k", self.k.is_some()),
            ("c", self.c.is_some()),
            ("eta", self.eta.is_some()),
            ("kxx", self.kxx.is_some()),
            ("kxy", self.kxy.is_some()),
            ("kyx", self.kyx.is_some()),
            ("kyy", self.kyy.is_some()),
            ("cxx", self.cxx.is_some()),
            ("cxy", self.cxy.is_some()),
            ("cyx", self.cyx.is_some()),
            ("cyy", self.cyy.is_some()),
            ("mxx", self.mxx.is_some()),
            ("mxy", self.mxy.is_some()),
            ("myx", self.myx.is_some()),
            ("myy", self.myy.is_some()),
            ("real", self.real.is_some()),
            ("imaginary", self.imaginary.is_some()),
            ("mass_factor", self.mass_factor.is_some()),
            ("damping_factor", self.damping_factor.is_some()),
            ("stiffness_factor", self.stiffness_factor.is_some()),
            ("gyroscopic_factor", self.gyroscopic_factor.is_some()),
        ] {
            if present {
                given.push(name);
            }
        }
        given
    }

    /// Refuses fields that do not belong to the kind.
    fn check_fields(&self, kind: Kind) -> Result<(), MachineError> {
        let belongs = |field: &str| match kind {
            Kind::Mass => ["at", "m"].contains(&field),
            Kind::Link => ["at", "between", "k", "c", "eta"].contains(&field),
            Kind::Bearing => {
                ["at", "to"].contains(&field)
                    || (field.len() == 3 && ["x", "y"].contains(&&field[2..]))
            }
            Kind::Unbalance => ["at", "real", "imaginary"].contains(&field),
            Kind::Matrices => {
                let stem = field.trim_end_matches("_factor");
                ["dofs", "mass", "damping", "stiffness", "gyroscopic"].contains(&stem)
            }
        };
        match self.given().into_iter().find(|field| !belongs(field)) {
            Some(field) => {
                let kind = format!("{kind:?}").to_lowercase();
                Err(self.error(format!("an element of `kind` {kind} has no `{field}`")))
            }
            None => Ok(()),
        }
    }

    /// Returns the kind, which follows from the fields if it is not given.
    fn kind(&self) -> Result<Kind, MachineError> {
        if let Some(kind) = self.kind {
            return Ok(kind);
        }
        let given = self.given();
        let has = |field: &str| given.contains(&field);
        if has("m") {
            Ok(Kind::Mass)
        } else if has("k") || has("c") {
            Ok(Kind::Link)
        } else if has("real") || has("imaginary") {
            Ok(Kind::Unbalance)
        } else if has("mass") || has("stiffness") || has("damping") || has("gyroscopic") {
            Ok(Kind::Matrices)
        } else if given.iter().any(|field| field.len() == 3) {
            Ok(Kind::Bearing)
        } else {
            Err(self.error("`kind` is missing: give mass, link, bearing, matrices or unbalance"))
        }
    }

    fn one_place(&mut self) -> Result<String, MachineError> {
        match self.at.take() {
            Some(Places::One(at)) => Ok(at),
            _ => Err(self.error("`at` must be one degree of freedom")),
        }
    }

    fn two_places(&mut self) -> Result<[String; 2], MachineError> {
        match self.at.take() {
            Some(Places::Several(at)) => <[String; 2]>::try_from(at)
                .map_err(|_| self.error("`at` must be two degrees of freedom, x and y")),
            _ => Err(self.error("`at` must be two degrees of freedom, x and y")),
        }
    }

    fn matrix(
        &self,
        what: &str,
        form: Option<MatrixForm>,
        factor: Option<Coefficient>,
    ) -> Result<Option<(DMatrix<f64>, Coefficient)>, MachineError> {
        let Some(form) = form else {
            return match factor {
                Some(_) => Err(self.error(format!("`{what}_factor` needs a matrix `{what}`"))),
                None => Ok(None),
            };
        };
        let matrix = match form {
            MatrixForm::Dense(rows) => {
                let columns = rows.first().map_or(0, Vec::len);
                if let Some(row) = rows.iter().position(|row| row.len() != columns) {
                    let problem = format!(
                        "row {} of `{what}` has {} entries, but the first row has {columns}",
                        row + 1,
                        rows[row].len()
                    );
                    return Err(self.error(problem));
                }
                DMatrix::from_fn(rows.len(), columns, |row, column| rows[row][column])
            }
            MatrixForm::Sparse { size, rows, columns, values } => {
                if size > MAX_MATRIX_ORDER {
                    let problem = format!(
                        "`{what}` has {size} rows, but at most {MAX_MATRIX_ORDER} are possible, because \
                         all entries are stored"
                    );
                    return Err(self.error(problem));
                }
                if rows.len() != values.len() || columns.len() != values.len() {
                    let problem = format!(
                        "`{what}` needs a row, a column and a value for each entry, got {}, {} and {}",
                        rows.len(),
                        columns.len(),
                        values.len()
                    );
                    return Err(self.error(problem));
                }
                let mut matrix = DMatrix::zeros(size, size);
                for ((row, column), value) in rows.into_iter().zip(columns).zip(values) {
                    let inside = 1..=size;
                    if !inside.contains(&row) || !inside.contains(&column) {
                        let problem = format!(
                            "entry ({row}, {column}) of `{what}` is outside a {size}×{size} matrix"
                        );
                        return Err(self.error(problem));
                    }
                    matrix[(row - 1, column - 1)] += value;
                }
                matrix
            }
        };
        Ok(Some((matrix, factor.unwrap_or(Coefficient::Known(1.0)))))
    }

    fn into_element(mut self, dofs: &[String]) -> Result<(String, Element), MachineError> {
        let kind = self.kind()?;
        self.check_fields(kind)?;
        let known = |value: &mut Option<Coefficient>| value.take().unwrap_or_default();
        let element = match kind {
            Kind::Mass => {
                let at = self.one_place()?;
                let mass = self.m.take().ok_or_else(|| self.error("a mass needs `m`"))?;
                Element::Mass { at, mass }
            }
            Kind::Link => {
                let between = match (self.between.take(), self.at.is_some()) {
                    (Some(between), false) => between,
                    (None, true) => [self.one_place()?, SUPPORT.to_owned()],
                    _ => return Err(self.error("a link needs either `between` or `at`")),
                };
                Element::Link {
                    between,
                    stiffness: known(&mut self.k),
                    damping: known(&mut self.c),
                    loss_factor: known(&mut self.eta),
                }
            }
            Kind::Bearing => Element::Bearing(Box::new(Bearing {
                at: self.two_places()?,
                to: self.to.take(),
                stiffness: [&mut self.kxx, &mut self.kxy, &mut self.kyx, &mut self.kyy].map(known),
                damping: [&mut self.cxx, &mut self.cxy, &mut self.cyx, &mut self.cyy].map(known),
                mass: [&mut self.mxx, &mut self.mxy, &mut self.myx, &mut self.myy].map(known),
            })),
            Kind::Unbalance => Element::Unbalance {
                at: self.two_places()?,
                real: known(&mut self.real),
                imaginary: known(&mut self.imaginary),
            },
            Kind::Matrices => self.matrices(dofs)?,
        };
        Ok((self.name, element))
    }

    fn matrices(&mut self, dofs: &[String]) -> Result<Element, MachineError> {
        let dofs = self.dofs.take().unwrap_or_else(|| dofs.to_vec());
        let (mass, factor) = (self.mass.take(), self.mass_factor.take());
        let mass = self.matrix("mass", mass, factor)?;
        let (damping, factor) = (self.damping.take(), self.damping_factor.take());
        let damping = self.matrix("damping", damping, factor)?;
        let (stiffness, factor) = (self.stiffness.take(), self.stiffness_factor.take());
        let stiffness = self.matrix("stiffness", stiffness, factor)?;
        let (gyroscopic, factor) = (self.gyroscopic.take(), self.gyroscopic_factor.take());
        let gyroscopic = self.matrix("gyroscopic", gyroscopic, factor)?;
        Ok(Element::Matrices(Box::new(MatrixElement {
            dofs,
            mass,
            damping,
            stiffness,
            gyroscopic,
        })))
    }
}

impl TryFrom<MachineForm> for Machine {
    type Error = MachineError;

    fn try_from(form: MachineForm) -> Result<Self, MachineError> {
        let elements = form.elements.into_iter().map(|element| element.into_element(&form.dofs));
        let elements = elements.collect::<Result<_, _>>()?;
        Ok(Self {
            elements,
            dofs: form.dofs,
            parameters: form.parameters.into_iter().collect(),
            damping: form.damping,
            support_direction: form.support_direction,
            measured: form.measured,
        })
    }
}
