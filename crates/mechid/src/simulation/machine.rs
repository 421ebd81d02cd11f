//! The machine of an experiment.

use mechid_integrate::{
    Matrices, SelectedDofs, SystemWithForces, TermForces, growth_per_period, sparse_steady_state,
};
use mechid_io::{Experiment, NonlinearDescription, ResponseKind};
use mechid_model::{
    Instability, ModelError, Response, SecondOrderSystem, SparseSystem, exact_periodic,
};
use mechid_signal::{Record, Sampling};

use super::{SimulateError, SimulatedTerms};

/// M, C and K of a simulated machine, dense or sparse.
#[derive(Debug, Clone, PartialEq)]
pub enum SimulatedSystem {
    /// All entries.
    Dense(SecondOrderSystem),
    /// The non-zero entries, for a large machine in Matrix Market files.
    Sparse(SparseSystem),
}

impl SimulatedSystem {
    /// Returns the number of degrees of freedom.
    pub fn dof(&self) -> usize {
        match self {
            Self::Dense(system) => system.dof(),
            Self::Sparse(system) => system.dof(),
        }
    }

    /// Returns M (kg), C (N·s/m) and K (N/m), each n × n, dense or sparse.
    pub fn matrices(&self) -> Matrices<'_> {
        match self {
            Self::Dense(system) => Matrices::Dense(system),
            Self::Sparse(system) => Matrices::Sparse(system),
        }
    }

    /// Returns the system if all entries of its matrices are stored.
    pub fn dense(&self) -> Option<&SecondOrderSystem> {
        match self {
            Self::Dense(system) => Some(system),
            Self::Sparse(_) => None,
        }
    }
}

/// The machine of an experiment.
pub(super) struct Described {
    pub(super) linear: SimulatedSystem,
    pub(super) nonlinear: Option<SimulatedTerms>,
}

impl Described {
    pub(super) fn new(experiment: &Experiment) -> Result<Self, SimulateError> {
        let terms = experiment.nonlinear()?.filter(|described| !described.terms.is_empty());
        let nonlinear = terms.map(|NonlinearDescription { terms, coefficients, .. }| {
            SimulatedTerms { terms: terms.clone(), coefficients: coefficients.clone() }
        });
        let linear = match experiment.sparse_system() {
            Some(sparse) => SimulatedSystem::Sparse(sparse.clone()),
            None => SimulatedSystem::Dense(experiment.system()?),
        };
        Ok(Self { linear, nonlinear })
    }

    /// Returns the growth of the free response of a linear machine; the growth of a nonlinear
    /// machine may be limited, so it is not considered.
    pub(super) fn instability(&self) -> Result<Option<Instability>, ModelError> {
        match (&self.linear, &self.nonlinear) {
            (SimulatedSystem::Dense(system), None) => system.instability(),
            (SimulatedSystem::Sparse(_), None) | (_, Some(_)) => Ok(None),
        }
    }

    /// Refuses the steady state of an unstable machine: this state solves the equations, but no
    /// simulation reaches it.
    pub(super) fn refuse_unstable_periodic(
        &self,
        experiment: &Experiment,
        instability: Option<Instability>,
        period: Sampling,
    ) -> Result<(), SimulateError> {
        if experiment.response != ResponseKind::Periodic {
            return Ok(());
        }
        if let Some(instability) = instability {
            return Err(SimulateError::UnstablePeriodic { instability });
        }
        let growth = match (&self.linear, &self.nonlinear) {
            (SimulatedSystem::Sparse(system), None) => growth_per_period(system, period)?,
            _ => None,
        };
        match growth {
            Some(factor) => Err(SimulateError::UnstableOrbit { multiplier: factor.into() }),
            None => Ok(()),
        }
    }

    pub(super) fn exact_periodic(
        &self,
        experiment: &Experiment,
        force: &Record,
    ) -> Result<Response, SimulateError> {
        match (&self.nonlinear, &self.linear) {
            (Some(_), _) => Err(SimulateError::ExactNonlinear),
            (None, SimulatedSystem::Dense(system)) => Ok(exact_periodic(system, force)?),
            (None, SimulatedSystem::Sparse(system)) => {
                let (forced, observed) = (experiment.forced()?, experiment.outputs()?);
                let dofs = SelectedDofs { forced: &forced, observed: &observed };
                Ok(sparse_steady_state(system, dofs, force)?)
            }
        }
    }

    /// Returns M, C and K with the forces of the nonlinear terms.
    pub(super) fn with_forces(&self) -> Result<SystemWithForces<'_>, SimulateError> {
        let system = match &self.linear {
            SimulatedSystem::Dense(system) => SystemWithForces::new(system),
            SimulatedSystem::Sparse(system) => SystemWithForces::new(system),
        };
        match &self.nonlinear {
            None => Ok(system),
            Some(SimulatedTerms { terms, coefficients }) => {
                let forces = TermForces::new(terms, coefficients)?;
                Ok(system.with(forces)?)
            }
        }
    }
}
