//! A machine with the uncertainty of its parameters.

use std::path::Path;

use mechid_estimate::{Estimate, IdentifiedMode, Unknowns, identified_modes};
use mechid_io::{
    ParameterCovariance, input_name, read_covariance, read_json, read_nonlinear, read_system,
};
use mechid_model::{
    NonlinearParameter, NonlinearSystem, Parameter, SecondOrderSystem, Terms,
    UncertainNonlinearSystem, UncertainSystem,
};
use mechid_nonlinear::ChannelPhase;
use nalgebra::DMatrix;
use serde::Deserialize;

use crate::AnalysisError;
use crate::measurement::Channels;

/// A system with the covariance of its parameters, if it was identified.
#[derive(Debug, Clone, PartialEq)]
pub struct Machine {
    /// Name for messages: the file it was read from.
    pub name: String,
    /// M, C and K, and the covariance of their uncertain entries.
    pub uncertain: UncertainSystem,
    /// Statistical degrees of freedom of the covariance.
    pub degrees_of_freedom: usize,
    /// The system with its nonlinear terms; `None` for a linear system.
    pub nonlinear: Option<NonlinearPart>,
    /// Names of the channels that the system was identified from, one per degree of freedom; empty
    /// if they are not known.
    pub names: Channels,
}

/// A system with nonlinear terms, and the delay and phase of the channels that record it.
#[derive(Debug, Clone, PartialEq)]
pub struct NonlinearPart {
    /// M, C and K with the terms and their coefficients, and the covariance of the uncertain
    /// values.
    pub uncertain: UncertainNonlinearSystem,
    /// Delay and phase of the channels.
    pub channels: ChannelPhase,
    /// Largest displacement (m) of a term in the data of its identification; `None` without terms.
    pub largest_displacement: Option<f64>,
}

impl NonlinearPart {
    /// Returns M, C and K with the terms and their coefficients.
    pub fn system(&self) -> &NonlinearSystem {
        self.uncertain.system()
    }
}

impl Machine {
    /// Creates an exactly known machine.
    pub fn known(system: SecondOrderSystem) -> Self {
        let uncertain = UncertainSystem::exact(system);
        Self {
            name: "the system".into(),
            uncertain,
            degrees_of_freedom: 0,
            nonlinear: None,
            names: Channels::default(),
        }
    }

    /// Creates a machine from an estimate, with the covariance of its parameters.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the data do not determine a parameter.
    pub fn from_estimate(estimate: &Estimate) -> Result<Self, AnalysisError> {
        Ok(Self {
            name: "the identified system".into(),
            uncertain: estimate.uncertain_system()?,
            degrees_of_freedom: estimate.degrees_of_freedom(),
            nonlinear: None,
            names: Channels::default(),
        })
    }

    /// Reads the `system` of a JSON file (`-`: of standard input) and, if present, its
    /// `covariance`, its `nonlinear` terms and the names of its `channels` or `points`: the
    /// description of an experiment, or the result of an identification.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read, [`AnalysisError::UnknownParameter`] if the
    /// covariance names a parameter that the system does not have.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, AnalysisError> {
        let path = path.as_ref();
        let (name, system) = (input_name(path), read_system(path)?);
        let names = read_json::<Named>(path)?.into_channels();
        let nonlinear = match read_nonlinear(path)? {
            None => None,
            Some(read) => {
                let [delay, cubic, quintic] = read.channels();
                let channels = ChannelPhase { delay, cubic, quintic };
                let largest_displacement = read.largest_displacement();
                let system = NonlinearSystem::new(system.clone(), read.terms, read.coefficients)?;
                Some(NonlinearPart {
                    uncertain: UncertainNonlinearSystem::exact(system),
                    channels,
                    largest_displacement,
                })
            }
        };
        let Some(covariance) = read_covariance(path)? else {
            return Ok(Self { name, nonlinear, names, ..Self::known(system) });
        };
        let (nonlinear, covariance) = match nonlinear {
            None => (None, covariance),
            Some(part) => {
                let system = part.system().clone();
                let entries =
                    part_of(&covariance, |name| Parameter::named(name, system.dof()).is_ok());
                let of_channels = |name: &str| {
                    CHANNELS.contains(&name) && NonlinearParameter::named(name, &system).is_err()
                };
                let of_machine = part_of(&covariance, |name| !of_channels(name));
                let names = of_machine.parameters.iter();
                let parameters = names.map(|parameter| {
                    NonlinearParameter::named(parameter, &system)
                        .map_err(|_| unknown_parameter(&name, parameter, &system))
                });
                let parameters = parameters.collect::<Result<_, AnalysisError>>()?;
                let uncertain =
                    UncertainNonlinearSystem::new(system, parameters, of_machine.matrix())?;
                (Some(NonlinearPart { uncertain, ..part }), entries)
            }
        };
        let parameters = parameters(&name, &system, &covariance)?;
        let degrees_of_freedom = covariance.degrees_of_freedom;
        let uncertain = UncertainSystem::new(system, parameters, covariance.matrix())?;
        Ok(Self { name, uncertain, degrees_of_freedom, nonlinear, names })
    }

    /// Returns the error for a method that ignores nonlinear terms.
    pub(crate) fn not_linear(&self) -> AnalysisError {
        let terms =
            self.nonlinear.as_ref().map_or_else(Terms::none, |p| p.system().terms().clone());
        AnalysisError::NonlinearMachine { file: self.name.clone(), terms: terms.to_string() }
    }

    /// Returns the system with its nonlinear terms (none for a linear system), and the properties
    /// of its channels.
    pub(crate) fn with_terms(&self) -> Result<NonlinearPart, AnalysisError> {
        match &self.nonlinear {
            Some(part) => Ok(part.clone()),
            None => Ok(NonlinearPart {
                uncertain: UncertainNonlinearSystem::exact(NonlinearSystem::new(
                    self.system().clone(),
                    Terms::none(),
                    Vec::new(),
                )?),
                channels: ChannelPhase::default(),
                largest_displacement: None,
            }),
        }
    }

    /// Returns M, C and K; for a nonlinear system, its linear part.
    pub fn system(&self) -> &SecondOrderSystem {
        self.uncertain.system()
    }

    /// Returns whether the system, including its nonlinear terms, is exactly known.
    pub fn is_exact(&self) -> bool {
        let terms = self.nonlinear.as_ref().is_none_or(|p| p.uncertain.parameters().is_empty());
        terms && self.uncertain.parameters().is_empty()
    }

    /// Returns natural frequencies, damping ratios and mode shapes with their standard errors,
    /// which are zero for an exactly known system.
    ///
    /// # Errors
    /// [`AnalysisError::Estimate`] if the system has no modes.
    pub fn modes(&self) -> Result<Vec<IdentifiedMode>, AnalysisError> {
        Ok(identified_modes(&self.uncertain, self.degrees_of_freedom)?)
    }
}

/// Names in the JSON of an identification.
#[derive(Deserialize)]
struct Named {
    /// Channels of records.
    channels: Option<Channels>,
    /// Points of a table of frequency responses, one per degree of freedom. Without `channels`,
    /// they name the forces and the displacements.
    points: Option<Vec<String>>,
}

impl Named {
    fn into_channels(self) -> Channels {
        let of_points = |points: Vec<String>| Channels {
            force: points.clone(),
            displacement: points,
            ..Channels::default()
        };
        self.channels.or(self.points.map(of_points)).unwrap_or_default()
    }
}

/// Names of the parameters that belong to the channels; all other parameters belong to the system.
const CHANNELS: [&str; 3] = ["delay", "p3", "p5"];

/// Returns the covariance of the parameters selected by name.
fn part_of(all: &ParameterCovariance, chosen: impl Fn(&str) -> bool) -> ParameterCovariance {
    let selected: Vec<usize> =
        (0..all.parameters.len()).filter(|at| chosen(&all.parameters[*at])).collect();
    let names = selected.iter().map(|at| all.parameters[*at].clone()).collect();
    let entry = |row: usize, column: usize| all.matrix[selected[row]][selected[column]];
    let matrix = DMatrix::from_fn(selected.len(), selected.len(), entry);
    ParameterCovariance::new(names, &matrix, all.degrees_of_freedom)
}

/// Returns the error for a name that is not a parameter of the system.
fn unknown_parameter(file: &str, name: &str, system: &NonlinearSystem) -> AnalysisError {
    let entries = Parameter::all(system.dof()).map(|entry| entry.to_string());
    let terms = system.terms().iter().map(|term| term.name().to_owned());
    let known: Vec<String> = entries.chain(terms).collect();
    AnalysisError::UnknownParameter {
        file: file.into(),
        name: name.into(),
        known: known.join(", "),
    }
}

/// Returns the parameters of the system that a covariance names.
fn parameters(
    file: &str,
    system: &SecondOrderSystem,
    covariance: &ParameterCovariance,
) -> Result<Vec<Parameter>, AnalysisError> {
    let entries = Unknowns::unknown_mass(system.dof())?.free();
    let find = |name: &String| {
        entries.iter().find(|p| p.to_string() == *name).copied().ok_or_else(|| {
            let names: Vec<String> = entries.iter().map(Parameter::to_string).collect();
            AnalysisError::UnknownParameter {
                file: file.into(),
                name: name.clone(),
                known: names.join(", "),
            }
        })
    };
    covariance.parameters.iter().map(find).collect()
}
