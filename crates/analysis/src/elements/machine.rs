//! Identified machine with its covariance, for force reconstruction, prediction and modes.

use mechid_estimate::likelihood::machine::{MachineEstimate, UncertainEntries};
use mechid_io::ParameterCovariance;
use mechid_model::elements::Speed;
use mechid_model::{Parameter, SecondOrderSystem, UncertainSystem};

use super::notes::ElementNote;
use crate::AnalysisError;
use crate::identify::rows::MOST_WITH_COVARIANCE;
use crate::machine::Machine;
use crate::measurement::Channels;

/// M, C, K and the covariance of their entries for the result, with notes on their limits.
pub(super) struct StatedMachine {
    pub system: Option<SecondOrderSystem>,
    pub covariance: Option<ParameterCovariance>,
    pub notes: Vec<ElementNote>,
}

/// Returns M, C and K of an estimate, which was fitted to `equations` real-valued equations.
pub(super) fn stated(
    estimate: &MachineEstimate,
    equations: usize,
) -> Result<StatedMachine, AnalysisError> {
    let mut notes = Vec::new();
    let system = match estimate.system() {
        Ok(system) => Some(system),
        Err(error) => {
            notes.push(ElementNote::NoSystem { reason: error.to_string() });
            None
        }
    };
    if estimate.assembly.has_hysteresis() {
        notes.push(ElementNote::Hysteresis);
    }
    if estimate.assembly.speed() == Speed::Synchronous {
        notes.push(ElementNote::AtRest);
    }
    let entries = estimate.uncertain_entries(MOST_WITH_COVARIANCE)?;
    if entries.is_none() {
        notes.push(ElementNote::NoCovariance { most: MOST_WITH_COVARIANCE });
    }
    let covariance = entries.filter(|_| system.is_some()).map(|entries| {
        let UncertainEntries { entries, covariance } = entries;
        let names = entries.iter().map(Parameter::to_string).collect();
        ParameterCovariance::new(names, &covariance, degrees_of_freedom(estimate, equations))
    });
    Ok(StatedMachine { system, covariance, notes })
}

/// Returns the degrees of freedom of the covariance. If the noise is exactly known, this is the
/// number of equations minus the number of parameters.
pub(super) fn degrees_of_freedom(estimate: &MachineEstimate, equations: usize) -> usize {
    let spare = equations.saturating_sub(estimate.likelihood.parameters.len()).max(1);
    match estimate.likelihood.degrees_of_freedom {
        known if known.is_infinite() => spare,
        freedom => freedom.clamp(1.0, 1e6) as usize,
    }
}

/// Returns the machine with its covariance.
pub(super) fn machine(
    estimate: &MachineEstimate,
    equations: usize,
) -> Result<Machine, AnalysisError> {
    let system = estimate.system()?;
    let Some(entries) = estimate.uncertain_entries(MOST_WITH_COVARIANCE)? else {
        let why = format!("more than {MOST_WITH_COVARIANCE} entries of M, C and K are uncertain");
        return Err(AnalysisError::Setting { setting: "machine", why });
    };
    let UncertainEntries { entries, covariance } = entries;
    if covariance.iter().any(|value| value.is_infinite()) {
        let combinations = estimate.likelihood.combinations.iter().map(ToString::to_string);
        let combinations = combinations.collect::<Vec<_>>().join("; ");
        return Err(AnalysisError::Undetermined { combinations });
    }
    let dofs = estimate.assembly.dofs().to_vec();
    Ok(Machine {
        name: "the identified machine".into(),
        uncertain: UncertainSystem::new(system, entries, covariance)?,
        degrees_of_freedom: degrees_of_freedom(estimate, equations),
        nonlinear: None,
        names: Channels { force: dofs.clone(), displacement: dofs, ..Channels::default() },
    })
}
