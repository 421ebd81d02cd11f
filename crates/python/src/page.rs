//! Reports of results, and files of their mode shapes.

use std::path::PathBuf;

use mechid::analysis::modes::SavedModes;
use mechid::io::{Geometry, record_details};
use mechid::report::{ModeShapes, PageSettings};
use pyo3::prelude::*;

use crate::{failure, work};

/// Texts of a report.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PageTexts {
    title: Option<String>,
    /// Names and values of further information.
    about: Vec<(String, String)>,
    /// File of the record, whose header may contain further information; empty if there is no
    /// record.
    record: PathBuf,
    /// File with the positions of the channels.
    geometry: Option<PathBuf>,
    /// If true, the force is reconstructed, too.
    reconstruct_force: bool,
}

impl PageTexts {
    /// Returns the settings of the page. Details in the record are added if `about` has no detail
    /// with the same name.
    ///
    /// # Errors
    /// `MechidError` if the geometry cannot be read.
    pub fn settings(self, py: Python<'_>) -> PyResult<PageSettings> {
        let Self { title, mut about, record, geometry, reconstruct_force } = self;
        let geometry = geometry.map(|path| work::brief(py, || Geometry::read(path))).transpose()?;
        for (name, value) in record_details(record) {
            if about.iter().all(|(other, _)| !other.eq_ignore_ascii_case(&name)) {
                about.push((name, value));
            }
        }
        Ok(PageSettings { title, about, geometry, reconstruct_force, command: None })
    }
}

/// Returns geometry and shapes of a result with modes (its JSON) as a universal file; `None` if no
/// mode oscillates, there are fewer than two channels, or a channel has no point.
#[pyfunction]
#[pyo3(signature = (result, geometry))]
pub fn shapes_file(
    py: Python<'_>,
    result: &str,
    geometry: Option<PathBuf>,
) -> PyResult<Option<String>> {
    let result: serde_json::Value = failure::settings(py, result)?;
    let modes = work::brief(py, || SavedModes::from_json("the result", result))?;
    let geometry = geometry.map(|path| work::brief(py, || Geometry::read(path))).transpose()?;
    let shapes = ModeShapes::from_saved(&modes, geometry.as_ref());
    Ok(shapes.map(|shapes| shapes.geometry.universal_file(&shapes.modes)))
}
