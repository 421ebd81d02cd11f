//! Free entries of M, C and K as parameters of a model, with sensors and forces at any degree of
//! freedom.

use std::collections::BTreeMap;

use mechid_model::elements::{
    Assembly, InputColumn, MachineParameter, Pattern, Power, SensorRow, Term,
};
use mechid_model::{Matrix, Parameter, ResponseQuantity, SecondOrderSystem};
use mechid_spectra::{LineData, Transient};

use super::estimate::LikelihoodEstimate;
use super::fit::{ParameterSpace, fit};
use super::machine::MachineModel;
use super::search::Bounds;
use super::{LikelihoodError, Settings};
use crate::Unknowns;

/// Degrees of freedom, counted from 0, with sensors and forces.
#[derive(Debug, Clone, PartialEq)]
pub struct Channels {
    /// Degree of freedom and quantity of each output.
    pub sensors: Vec<(usize, ResponseQuantity)>,
    /// Degree of freedom of each input.
    pub forces: Vec<usize>,
}

/// Identifies the free entries of M, C and K (the independent unknowns of related entries) from
/// sensors and forces at some of the degrees of freedom. The search starts at the system `near`.
///
/// The parameters have the names of their entries, such as `m11` and `k12`. A parameter of two
/// symmetric entries has the name of the upper entry. The parameters of proportional damping are
/// `alpha` and `beta`.
///
/// # Errors
/// [`LikelihoodError::Size`] if the numbers of degrees of freedom of `near` and `unknowns` differ,
/// [`LikelihoodError::Machine`] for a channel at a degree of freedom that does not exist, and the
/// other errors of a fit.
///
/// # Source
/// As [`identify_machine`](super::machine::identify_machine).
pub fn identify_entries(
    data: &LineData,
    unknowns: &Unknowns,
    near: &SecondOrderSystem,
    channels: &Channels,
    settings: &Settings,
) -> Result<LikelihoodEstimate, LikelihoodError> {
    if near.dof() != unknowns.dof() {
        let (expected, got) = (unknowns.dof(), near.dof());
        let what = "degrees of freedom of the initial system";
        return Err(LikelihoodError::Size { what, expected, got });
    }
    let assembly = assembly(unknowns, near, channels)?;
    let open = data.records().iter().any(|(_, kind)| *kind != Transient::None);
    let model = MachineModel::new(&assembly, data.omega(), None, open)?;
    let count = assembly.parameters().len();
    let bounds = Bounds { min: vec![f64::NEG_INFINITY; count], max: vec![f64::INFINITY; count] };
    let space = ParameterSpace { start: assembly.start(), bounds, priors: Vec::new() };
    let fit = fit(&model, data, &space, settings)?;
    let names: Vec<String> = assembly.parameters().iter().map(|p| p.name.clone()).collect();
    Ok(LikelihoodEstimate::new(&fit, &names, settings.confidence))
}

/// Parameters of the entries; related entries share a parameter.
struct Entries<'a> {
    unknowns: &'a Unknowns,
    near: &'a SecondOrderSystem,
    index: BTreeMap<(usize, usize, usize), usize>,
    parameters: Vec<MachineParameter>,
}

/// Value or parameter of an entry.
enum Entry {
    Known(f64),
    Unknown(usize),
}

impl Entries<'_> {
    fn push(&mut self, name: String, unit: &'static str, start: f64) -> usize {
        let (min, max) = (f64::NEG_INFINITY, f64::INFINITY);
        self.parameters.push(MachineParameter { name, unit, start, min, max, prior: None });
        self.parameters.len() - 1
    }

    fn entry(&mut self, matrix: Matrix, row: usize, column: usize) -> Entry {
        if let Some(value) = self.unknowns.fixed(matrix, row, column) {
            return Entry::Known(value);
        }
        let (row, column) = if self.unknowns.is_symmetric(matrix) {
            (row.min(column), row.max(column))
        } else {
            (row, column)
        };
        let key = (matrix as usize, row, column);
        if let Some(at) = self.index.get(&key) {
            return Entry::Unknown(*at);
        }
        let name = match Parameter::new(matrix, row, column, self.unknowns.dof()) {
            Ok(parameter) => parameter.to_string(),
            Err(_) => format!("{}{}{}", matrix.letter(), row + 1, column + 1),
        };
        let at = self.push(name, matrix.unit(), self.near.matrix(matrix)[(row, column)]);
        self.index.insert(key, at);
        Entry::Unknown(at)
    }
}

fn assembly(
    unknowns: &Unknowns,
    near: &SecondOrderSystem,
    channels: &Channels,
) -> Result<Assembly, LikelihoodError> {
    let n = unknowns.dof();
    let mut entries = Entries { unknowns, near, index: BTreeMap::new(), parameters: Vec::new() };
    let mut terms = Vec::new();
    let mut add =
        |row: usize, column: usize, power: Power, entry: &Entry, factor: Option<usize>| {
            let (scale, parameter) = match entry {
                Entry::Known(value) => (*value, None),
                Entry::Unknown(at) => (1.0, Some(*at)),
            };
            if scale != 0.0 {
                let pattern = Pattern::Dyad { left: vec![(row, 1.0)], right: vec![(column, 1.0)] };
                let parameters = factor.into_iter().chain(parameter).collect();
                terms.push(Term { pattern, power, scale, parameters });
            }
        };
    let proportional = unknowns.has_proportional_damping();
    let factors = proportional.then(|| nearest_damping(near)).map(|[alpha, beta]| {
        [entries.push("alpha".into(), "1/s", alpha), entries.push("beta".into(), "s", beta)]
    });
    for row in 0..n {
        for column in 0..n {
            let mass = entries.entry(Matrix::Mass, row, column);
            let stiffness = entries.entry(Matrix::Stiffness, row, column);
            add(row, column, Power::Mass, &mass, None);
            add(row, column, Power::Stiffness, &stiffness, None);
            match factors {
                Some([alpha, beta]) => {
                    add(row, column, Power::Damping, &mass, Some(alpha));
                    add(row, column, Power::Damping, &stiffness, Some(beta));
                }
                None => {
                    let damping = entries.entry(Matrix::Damping, row, column);
                    add(row, column, Power::Damping, &damping, None);
                }
            }
        }
    }
    let names: Vec<String> = (1..=n).map(|at| format!("x{at}")).collect();
    let sensors = channels.sensors.iter().enumerate().map(|(at, (dof, quantity))| SensorRow {
        name: format!("output {}", at + 1),
        entries: vec![(*dof, 1.0)],
        quantity: *quantity,
        delay: 0.0,
        delay_parameter: None,
    });
    let inputs = channels.forces.iter().map(|dof| InputColumn::Force(vec![(*dof, 1.0)]));
    let (sensors, inputs) = (sensors.collect(), inputs.collect());
    Ok(Assembly::from_terms(names, terms, entries.parameters, sensors, inputs)?)
}

/// Returns α and β of the least-squares fit C ≈ αM + βK over all entries.
fn nearest_damping(near: &SecondOrderSystem) -> [f64; 2] {
    let [m, c, k] = [near.mass(), near.damping(), near.stiffness()];
    let [mm, mk, kk] = [m.dot(m), m.dot(k), k.dot(k)];
    let [mc, kc] = [m.dot(c), k.dot(c)];
    let determinant = mm * kk - mk * mk;
    if determinant > f64::EPSILON * mm * kk {
        [(kk * mc - mk * kc) / determinant, (mm * kc - mk * mc) / determinant]
    } else {
        [0.0, if kk > 0.0 { kc / kk } else { 0.0 }]
    }
}
