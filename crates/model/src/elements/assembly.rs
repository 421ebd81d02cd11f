//! Terms, sensors, inputs and unknowns of a machine, by index.

use nalgebra::{Complex, DMatrix};

use super::channels::{InputColumn, SensorRow, unbalance};
use super::{MachineError, Pattern, Power, Prior, Speed, Term};
use crate::{Matrix, ModelError, SecondOrderSystem};

/// Unknown parameter of a machine.
#[derive(Debug, Clone, PartialEq)]
pub struct MachineParameter {
    /// Name of the shared parameter, or of the element and its coefficient.
    pub name: String,
    /// SI unit for translations. The unit for rotations differs: for a stiffness it is N·m/rad
    /// instead of N/m.
    pub unit: &'static str,
    /// Initial value of the search, in the unit of the parameter.
    pub start: f64,
    /// Lower bound, in the unit of the parameter; −∞ if there is no lower bound.
    pub min: f64,
    /// Upper bound, in the unit of the parameter; ∞ if there is no upper bound.
    pub max: f64,
    /// Prior knowledge.
    pub prior: Option<Prior>,
}

/// Load of an unbalance element: forces per unit of its parameter.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OwnLoad {
    pub(super) at: [usize; 2],
    pub(super) scale: Complex<f64>,
    /// Index of the parameter; `None` for a known unbalance.
    pub(super) parameter: Option<usize>,
}

/// Load (N) of an unknown unbalance per unit of its parameter, by degree of freedom; for a known
/// load the parameter is `None`.
pub type ParameterLoad = (Option<usize>, Vec<(usize, Complex<f64>)>);

/// Machine whose description was checked: its dynamic stiffness is the sum of its [`Term`]s.
///
/// ```text
/// D(ω) x = F − D_g(ω) x_g
/// ```
///
/// with the dynamic stiffness D(ω), the displacements x, the forces F, the motion x_g of the
/// support, and the column D_g of the dynamic stiffness that belongs to the support.
#[derive(Debug, Clone, PartialEq)]
pub struct Assembly {
    pub(super) dofs: Vec<String>,
    pub(super) terms: Vec<Term>,
    pub(super) sensors: Vec<SensorRow>,
    pub(super) inputs: Vec<InputColumn>,
    pub(super) loads: Vec<OwnLoad>,
    pub(super) parameters: Vec<MachineParameter>,
    pub(super) speed: Speed,
    pub(super) measured: Vec<usize>,
}

impl Assembly {
    /// Creates an assembly from terms, sensors and inputs by index, for models whose parameters are
    /// entries of M, C and K instead of coefficients of named elements.
    ///
    /// # Errors
    /// [`ModelError::EntryOutside`] for the index of a degree of freedom or of a parameter that
    /// does not exist; the error counts the index from 1.
    pub fn from_terms(
        dofs: Vec<String>,
        terms: Vec<Term>,
        parameters: Vec<MachineParameter>,
        sensors: Vec<SensorRow>,
        inputs: Vec<InputColumn>,
    ) -> Result<Self, MachineError> {
        let n = dofs.len();
        let outside =
            |row: usize| ModelError::EntryOutside { row: row + 1, column: row + 1, dof: n };
        for term in &terms {
            let entries: Vec<usize> = match &term.pattern {
                Pattern::Dyad { left, right } => left.iter().chain(right).map(|e| e.0).collect(),
                Pattern::Block { dofs, .. } => dofs.clone(),
            };
            // The index of the support is the number of degrees of freedom.
            if let Some(at) = entries.into_iter().find(|at| *at > n) {
                return Err(outside(at).into());
            }
            if let Some(at) = term.parameters.iter().find(|at| **at >= parameters.len()) {
                return Err(outside(*at).into());
            }
        }
        let read = sensors.iter().flat_map(|sensor| sensor.entries.iter().map(|entry| entry.0));
        let loaded = inputs.iter().flat_map(|input| input.load(n, 1.0, Speed::None));
        if let Some(at) = read.chain(loaded.map(|load| load.0)).find(|at| *at > n) {
            return Err(outside(at).into());
        }
        Ok(Self {
            dofs,
            terms,
            sensors,
            inputs,
            loads: Vec::new(),
            parameters,
            speed: Speed::None,
            measured: Vec::new(),
        })
    }

    /// Returns the number of degrees of freedom.
    pub fn dof(&self) -> usize {
        self.dofs.len()
    }

    /// Returns the names of the degrees of freedom.
    pub fn dofs(&self) -> &[String] {
        &self.dofs
    }

    /// Returns the terms of the dynamic stiffness.
    pub fn terms(&self) -> &[Term] {
        &self.terms
    }

    /// Returns the sensors.
    pub fn sensors(&self) -> &[SensorRow] {
        &self.sensors
    }

    /// Returns the inputs.
    pub fn inputs(&self) -> &[InputColumn] {
        &self.inputs
    }

    /// Returns the unknowns.
    pub fn parameters(&self) -> &[MachineParameter] {
        &self.parameters
    }

    /// Returns the speed of the rotor.
    pub fn speed(&self) -> Speed {
        self.speed
    }

    /// Returns the indices of the degrees of freedom of the part whose receptance was measured.
    pub fn measured(&self) -> &[usize] {
        &self.measured
    }

    /// Returns the initial values of the search, one for each parameter, in its unit.
    pub fn start(&self) -> Vec<f64> {
        self.parameters.iter().map(|parameter| parameter.start).collect()
    }

    /// Returns the assembly with other initial values of the search, one for each parameter, in its
    /// unit.
    ///
    /// # Panics
    /// If there are more values than parameters.
    #[must_use]
    pub fn with_start(mut self, start: &[f64]) -> Self {
        for (at, value) in start.iter().enumerate() {
            self.parameters[at].start = *value;
        }
        self
    }

    /// Returns whether any element is an unbalance.
    pub fn has_own_loads(&self) -> bool {
        !self.loads.is_empty()
    }

    /// Returns the loads of the unbalance elements, at `omega` (rad/s).
    pub fn own_loads(&self, omega: f64) -> Vec<ParameterLoad> {
        let load = |own: &OwnLoad| {
            let forces = unbalance(own.at, omega, self.speed);
            (own.parameter, forces.map(|(at, force)| (at, force * own.scale)).to_vec())
        };
        self.loads.iter().map(load).collect()
    }

    /// Returns \[D(ω) D_g\], n × (n + 1), in N/m: the dynamic stiffness, then the column of the
    /// support. Both are sums over the terms that `included` accepts.
    ///
    /// # Source
    /// Bathe (1982), the direct stiffness method.
    pub fn dynamic_stiffness(
        &self,
        parameters: &[f64],
        omega: f64,
        included: impl Fn(&Term) -> bool,
    ) -> DMatrix<Complex<f64>> {
        let n = self.dof();
        let mut sum = DMatrix::zeros(n, n + 1);
        for term in self.terms.iter().filter(|term| included(term)) {
            let factor = term.power.factor(omega, self.speed.at(omega)) * term.value(parameters);
            term.for_each_entry(n, |row, column, value| sum[(row, column)] += factor * value);
        }
        sum
    }

    /// Returns M, C + Ω G and K, n × n each, at a speed (rad/s) of the rotor; they do not contain
    /// hysteretic damping.
    ///
    /// # Errors
    /// [`ModelError::SingularMass`] and other errors of [`SecondOrderSystem::new`].
    ///
    /// # Source
    /// Bathe (1982), the direct stiffness method.
    pub fn system(&self, parameters: &[f64], speed: f64) -> Result<SecondOrderSystem, ModelError> {
        let n = self.dof();
        let mut sums = Matrix::ALL.map(|_| DMatrix::zeros(n, n + 1));
        for term in &self.terms {
            let (matrix, factor) = match term.power {
                Power::Stiffness => (Matrix::Stiffness, 1.0),
                Power::Damping => (Matrix::Damping, 1.0),
                Power::Gyroscopic => (Matrix::Damping, speed),
                Power::Mass => (Matrix::Mass, 1.0),
                Power::Hysteresis => continue,
            };
            let (sum, value) = (&mut sums[matrix as usize], factor * term.value(parameters));
            term.for_each_entry(n, |row, column, entry| sum[(row, column)] += value * entry);
        }
        let [mass, damping, stiffness] = sums.map(|sum| sum.columns(0, n).into_owned());
        SecondOrderSystem::new(mass, damping, stiffness)
    }

    /// Returns whether any term is hysteretic.
    pub fn has_hysteresis(&self) -> bool {
        self.terms.iter().any(|term| term.power == Power::Hysteresis)
    }
}
