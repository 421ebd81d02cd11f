//! Matrices M, C and K with their covariance.

use std::f64::consts::TAU;
use std::path::PathBuf;

use mechid::analysis::{AnalysisError, ModalSummary};
use mechid::integrate::ModeSearch;
use mechid::io::parse_sparse_system;
use mechid::model::{SecondOrderSystem, StateTransition};
use mechid::report::{FigureStyle, ReportError, ToFigure as _};
use mechid::selected_modes::SelectedModes;
use nalgebra::{Complex, DMatrix};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::page::PageTexts;
use crate::{arrays, failure, work};

/// System with the covariance of its parameters, if it was identified.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Machine(pub mechid::Machine);

/// Frequency responses of the modes of a test.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct ModalSystem(pub mechid::ModalSystem);

/// Machine, or modes of a test, for the computation of responses to forces.
#[derive(FromPyObject)]
pub enum ForcedSystem<'py> {
    Machine(PyRef<'py, Machine>),
    Modes(PyRef<'py, ModalSystem>),
}

#[pymethods]
impl ModalSystem {
    /// Reads the modes from the JSON file of a result; returns `None` if the file describes a
    /// machine.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Option<Self>> {
        work::brief(py, || mechid::ModalSystem::read(path)).map(|system| system.map(Self))
    }

    /// Takes the modes from the JSON of a result.
    #[staticmethod]
    fn from_json(py: Python<'_>, name: &str, json: &str) -> PyResult<Self> {
        let json: serde_json::Value = failure::settings(py, json)?;
        work::brief(py, || mechid::ModalSystem::from_json(name, json)).map(Self)
    }
}

#[pymethods]
impl Machine {
    /// Creates a machine with exactly known M, C and K.
    #[staticmethod]
    fn known(
        py: Python<'_>,
        mass: PyReadonlyArray2<'_, f64>,
        damping: PyReadonlyArray2<'_, f64>,
        stiffness: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let [mass, damping, stiffness] =
            [mass, damping, stiffness].map(|given| arrays::copied(&given));
        let system = work::brief(py, || SecondOrderSystem::new(mass, damping, stiffness))?;
        Ok(Self(mechid::Machine::known(system)))
    }

    /// Reads the system and its covariance from JSON.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        work::brief(py, || mechid::Machine::read(path)).map(Self)
    }

    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    #[getter]
    fn is_exact(&self) -> bool {
        self.0.is_exact()
    }

    #[getter]
    fn mass<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::matrix(py, self.0.system().mass().clone())
    }

    #[getter]
    fn damping<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::matrix(py, self.0.system().damping().clone())
    }

    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        arrays::matrix(py, self.0.system().stiffness().clone())
    }

    /// Returns the rate matrix A and input matrix B of z = [x; ẋ], ż = A z + B F.
    fn state_matrices<'py>(&self, py: Python<'py>) -> PyResult<[Bound<'py, PyArray2<f64>>; 2]> {
        let system = self.0.system();
        let (rate, input) = py.detach(|| {
            let n = system.dof();
            let mut input = DMatrix::zeros(2 * n, n);
            // The unit of time of `StateTransition` is the step, so a step of 1 s gives SI units.
            input.view_mut((n, 0), (n, n)).copy_from(&StateTransition::force_input(system, 1.0));
            (StateTransition::rate(system, 1.0), input)
        });
        Ok([arrays::matrix(py, rate)?, arrays::matrix(py, input)?])
    }

    /// Returns the receptances x_i / F_j at frequencies in rad/s: one row for each frequency, one
    /// column for each pair of motion and force.
    fn receptances<'py>(
        &self,
        py: Python<'py>,
        omega: Vec<f64>,
    ) -> PyResult<Bound<'py, PyArray2<Complex<f64>>>> {
        let system = self.0.system();
        let receptances = work::brief(py, || system.receptances(&omega))?;
        let n = system.dof();
        let flat = DMatrix::from_fn(receptances.len(), n * n, |row, at| {
            receptances[row][(at / n, at % n)]
        });
        arrays::matrix(py, flat)
    }

    /// Returns the figure that the program draws, as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        let machine = self.0.clone();
        let draw = move || -> Result<String, ReportError> { Ok(machine.figure()?.to_svg()?) };
        work::watched(py, None, || Ok(()), draw)
    }

    /// Returns the figure as an interactive HTML page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        let machine = self.0.clone();
        let draw = move || machine.styled_page(FigureStyle::default());
        work::watched(py, None, || Ok(()), draw)
    }

    /// Returns the report that the program writes, as an HTML page.
    fn page(&self, py: Python<'_>, texts: PageTexts) -> PyResult<String> {
        let settings = texts.settings(py)?;
        let machine = self.0.clone();
        let write = move || machine.page_with(FigureStyle::default(), &settings);
        work::watched(py, None, || Ok(()), write)
    }

    /// Returns the modes as the program prints them: JSON and text.
    fn modal(&self, py: Python<'_>) -> PyResult<(String, String)> {
        let machine = self.0.clone();
        let find = move || -> Result<_, AnalysisError> { ModalSummary::from_machine(&machine) };
        let modes = work::watched(py, None, || Ok(()), find)?;
        Ok((failure::json(py, &modes)?, modes.to_string()))
    }
}

/// Computes the lowest modes, or the modes nearest to a frequency (Hz), of a described machine of
/// any size. The description is JSON; returns JSON and text.
#[pyfunction]
#[pyo3(signature = (description, count, near_hz))]
pub fn selected_modes(
    py: Python<'_>,
    description: &str,
    count: usize,
    near_hz: Option<f64>,
) -> PyResult<(String, String)> {
    let system = work::brief(py, || parse_sparse_system(NAME, description))?;
    let search = near_hz.map_or(ModeSearch::Lowest, |hz| ModeSearch::NearOmega(TAU * hz));
    let find = move || SelectedModes::compute(NAME, &system, search, count);
    let modes = work::watched(py, None, || Ok(()), find)?;
    Ok((failure::json(py, &modes)?, modes.to_string()))
}

/// Name of a described machine in messages.
const NAME: &str = "the machine";
