//! Machines of named elements: degrees of freedom with names, elements between them, sensors and
//! inputs at any degree of freedom, and coefficients that are known or unknown.
//!
//! ```
//! use mechid_model::ResponseQuantity;
//! use mechid_model::elements::{Element, FreeCoefficient, Input, Instruments, Machine, Sensor};
//!
//! // Two masses, a force on the first, an accelerometer on the second, an unknown spring.
//! let k = FreeCoefficient::from_start(3e4).at_least(0.0);
//! let machine = Machine::new(["x1", "x2"])
//!     .with("m1", Element::mass("x1", 2.0))
//!     .with("m2", Element::mass("x2", 1.5))
//!     .with("foot", Element::spring_damper(["x1", "support"], 4e4, 6.0))
//!     .with("k2", Element::spring(["x1", "x2"], k));
//! let instruments = Instruments {
//!     sensors: vec![Sensor::new("x2", ResponseQuantity::Acceleration)],
//!     inputs: vec![Input::force("x1")],
//!     ..Instruments::default()
//! };
//! let assembly = machine.assembly(&instruments)?;
//! assert_eq!(assembly.parameters()[0].name, "k2");
//! # Ok::<(), mechid_model::elements::MachineError>(())
//! ```
//!
//! With the feature `serde` a machine and its instruments are read from and written to JSON. A
//! coefficient is a number, an unknown (`start`, `min`, `max`, `prior`), or the name of one of the
//! `parameters`:
//!
//! ```json
//! {
//!   "dofs": ["x", "y"],
//!   "elements": [
//!     {"name": "m", "kind": "mass", "at": "x", "m": "mass"},
//!     {"name": "my", "kind": "mass", "at": "y", "m": "mass"},
//!     {"name": "stop", "kind": "link", "at": "x", "k": 2e4, "c": {"start": 5, "min": 0}},
//!     {"name": "coupling", "kind": "link", "between": ["x", "y"], "k": 1e4, "eta": 0.02},
//!     {"name": "A", "kind": "bearing", "at": ["x", "y"], "kxx": {"start": 1e7}, "kyy": 1e7},
//!     {"name": "plate", "kind": "matrices", "dofs": ["x", "y"],
//!      "stiffness": {"size": 2, "rows": [1, 2], "columns": [1, 2], "values": [1e5, 1e5]}}
//!   ],
//!   "parameters": {"mass": {"prior": {"mean": 12, "standard_deviation": 0.5}}},
//!   "damping": {"alpha": 0.1, "beta": 1e-5}
//! }
//! ```
//!
//! Rows and columns of sparse matrices are counted from 1. Another kind is `unbalance` (`at` two
//! degrees of freedom, `real`, `imaginary`); links with a single degree of freedom end at the
//! support.

mod assembly;
mod build;
mod build_elements;
mod channels;
mod coefficient;
mod element;
mod error;
mod instrumented;
mod instruments;
mod known;
mod machine;
#[cfg(feature = "serde")]
mod serde_form;
#[cfg(feature = "serde")]
mod serde_instrumented;
#[cfg(feature = "serde")]
mod serde_write;
mod term;

pub use assembly::{Assembly, MachineParameter};
pub use channels::{InputColumn, SensorRow};
pub use coefficient::{Coefficient, FreeCoefficient, Prior};
pub use element::{Bearing, Element, MatrixElement, SUPPORT};
pub use error::MachineError;
pub use instrumented::{Candidates, InstrumentedMachine};
pub use instruments::{Input, Instruments, Sensor, Speed};
pub use machine::{Machine, ProportionalDamping};
pub use term::{Pattern, Power, Term};
