//! Errors in the description of a machine.

use mechid_signal::message;

use crate::ModelError;

/// Error in the description of a machine; every variant names the element, the sensor or the
/// parameter concerned.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MachineError {
    /// No degree of freedom has a name.
    #[error("the machine has no degrees of freedom")]
    NoDof,
    /// A name appears twice.
    #[error("the {what} {name:?} appears twice")]
    Repeated {
        /// Kind of item whose name appears twice.
        what: &'static str,
        /// Name concerned.
        name: String,
    },
    /// The name is reserved for the support.
    #[error("\"support\" is the ground and cannot be the name of a degree of freedom")]
    Reserved,
    /// An element, a sensor or an input is at a degree of freedom that the machine does not have.
    #[error("{what} {name:?} is at {dof:?}, which is none of the degrees of freedom ({known})")]
    UnknownDof {
        /// `"element"`, `"sensor"` or `"input"`.
        what: &'static str,
        /// Name of the element, the sensor or the input.
        name: String,
        /// Name that no degree of freedom of the machine has.
        dof: String,
        /// Degrees of freedom of the machine.
        known: String,
    },
    /// The two ends of an element or a sensor are the same.
    #[error("{what} {name:?} has both ends at {dof:?}")]
    SameEnds {
        /// `"element"` or `"sensor"`.
        what: &'static str,
        /// Name of the element or the sensor.
        name: String,
        /// Degree of freedom of both ends.
        dof: String,
    },
    /// The fields of an element do not fit its kind.
    #[error("element {name:?}: {problem}")]
    Element {
        /// Name of the element.
        name: String,
        /// Fault, in words.
        problem: String,
    },
    /// A coefficient refers to a parameter that is not described.
    #[error(
        "{name:?} refers to the parameter {parameter:?}, which \"parameters\" does not describe"
    )]
    UnknownParameter {
        /// Name of the coefficient.
        name: String,
        /// Name of the parameter that is not described.
        parameter: String,
    },
    /// No coefficient and no sensor uses the parameter.
    #[error("no element or sensor uses the parameter {name:?}")]
    UnusedParameter {
        /// Name of the parameter.
        name: String,
    },
    /// A number is NaN or infinite.
    #[error("{name:?} has the value {}, which is not a finite number", message::number(*value))]
    NotFinite {
        /// Name of the coefficient, sensor or matrix.
        name: String,
        /// Value given, in its own unit.
        value: f64,
    },
    /// The lower bound is not below the upper one.
    #[error(
        "the bounds of {name:?} contradict each other: \"min\" {} is not below \"max\" {}",
        message::number(*min),
        message::number(*max)
    )]
    Bounds {
        /// Name of the coefficient.
        name: String,
        /// Lower bound, in the unit of the coefficient.
        min: f64,
        /// Upper bound, in the unit of the coefficient.
        max: f64,
    },
    /// The initial value of the search is outside the bounds.
    #[error(
        "\"start\" {} of {name:?} is outside its bounds, {} to {}",
        message::number(*start),
        message::number(*min),
        message::number(*max)
    )]
    StartOutside {
        /// Name of the coefficient.
        name: String,
        /// Initial value, in the unit of the coefficient.
        start: f64,
        /// Lower bound, in the unit of the coefficient.
        min: f64,
        /// Upper bound, in the unit of the coefficient.
        max: f64,
    },
    /// An unknown has no initial value for the search.
    #[error(
        "{name:?} is an unknown coefficient without an initial value: give \"start\", \
         both \"min\" and \"max\", or \"prior\""
    )]
    NoStart {
        /// Name of the coefficient.
        name: String,
    },
    /// The standard deviation of a prior is not positive.
    #[error(
        "the standard deviation of the prior of {name:?} must be positive, not {}",
        message::number(*standard_deviation)
    )]
    PriorDeviation {
        /// Name of the coefficient.
        name: String,
        /// Standard deviation given, in the unit of the coefficient.
        standard_deviation: f64,
    },
    /// A degree of freedom has no mass.
    #[error(
        "degree of freedom {dof:?} has no mass (it belongs to {elements}); add a mass there, \
         0 if it really has none"
    )]
    NoMass {
        /// Degree of freedom.
        dof: String,
        /// Elements at this degree of freedom.
        elements: String,
    },
    /// A degree of freedom has no element.
    #[error("no element is connected to degree of freedom {dof:?}")]
    Detached {
        /// Degree of freedom.
        dof: String,
    },
    /// The machine has no sensor or no input.
    #[error("the machine has no {what}")]
    NoInstrument {
        /// `"sensors"` or `"inputs"`.
        what: &'static str,
    },
    /// A gain of a sensor is zero.
    #[error("the gain of sensor {name:?} is 0")]
    NoGain {
        /// Name of the sensor.
        name: String,
    },
    /// Unbalance or gyroscopic terms need a speed.
    #[error("{what} {name:?} needs the speed of the rotor: give \"speed\"")]
    NoSpeed {
        /// `"element"` or `"input"`.
        what: &'static str,
        /// Name of the element or the input.
        name: String,
    },
    /// A matrix of the identified machine cannot be used.
    #[error(transparent)]
    Model(#[from] ModelError),
}
