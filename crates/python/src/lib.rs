//! Compiled part of the Python package `mechid`: it exposes the facade and the program, and
//! `python/mechid` gives them the interface that users of NumPy expect.
//!
//! Settings and results are the JSON that the program reads and prints; input arrays are copied,
//! and output arrays are owned by Python. This crate contains no numerical method. Long calls run
//! without the interpreter's lock, in a thread pool of this process (`work`); errors and panics
//! become `MechidError` (`failure`).

#![allow(unnameable_types, reason = "the classes are named from Python")]

mod answer;
mod arrays;
mod bearing;
mod elements;
mod failure;
mod fleet;
mod identified;
mod machine;
mod measurement;
mod page;
mod predicted;
mod program;
mod questions;
mod reconstructed;
mod responses;
mod simulated;
mod trends;
mod work;

#[pyo3::pymodule(gil_used = false)]
mod _mechid {
    #[pymodule_export]
    use super::answer::Answer;
    #[pymodule_export]
    use super::bearing::{bearing, bearing_campaign, bearing_of_responses};
    #[pymodule_export]
    use super::elements::{IdentifiedElements, described_machine, identify_elements};
    #[pymodule_export]
    use super::fleet::{fleet_begin, fleet_part, fleet_record_column, fleet_rows, fleet_summary};
    #[pymodule_export]
    use super::identified::{Identified, identify};
    #[pymodule_export]
    use super::machine::{Machine, ModalSystem, selected_modes};
    #[pymodule_export]
    use super::measurement::{Measurement, find_column, rate_of, time_column};
    #[pymodule_export]
    use super::page::shapes_file;
    #[pymodule_export]
    use super::predicted::{Predicted, predict_record};
    #[pymodule_export]
    use super::program::program;
    #[pymodule_export]
    use super::questions::{compare_modes, decay, frf, inspect, modes, sweep};
    #[pymodule_export]
    use super::reconstructed::{Reconstructed, reconstruct};
    #[pymodule_export]
    use super::responses::{IdentifiedResponses, ResponseTable, identify_responses};
    #[pymodule_export]
    use super::simulated::{integrate, multisine, predict, simulate};
    #[pymodule_export]
    use super::trends::{fleet_simulate, fleet_trends};

    use pyo3::prelude::*;

    #[pymodule_init]
    fn version(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
