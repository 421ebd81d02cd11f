//! Results that are told, drawn, and nothing else.

use std::fmt::Display;
use std::sync::Arc;

use mechid::report::{FigureStyle, ReportError, ToFigure};
use pyo3::prelude::*;
use serde::Serialize;

use crate::{failure, work};

/// A result as JSON, as text and as a drawing.
pub trait Told: Send + Sync {
    /// Returns the JSON that the program prints.
    fn json(&self, py: Python<'_>) -> PyResult<String>;

    /// Returns the text that the program prints.
    fn text(&self) -> String;

    /// Returns the picture that the program draws.
    fn svg(&self) -> Result<String, ReportError>;

    /// Returns the picture as a page that answers, as HTML.
    fn html(&self) -> Result<String, ReportError>;
}

impl<T: Serialize + Display + ToFigure + Send + Sync> Told for T {
    fn json(&self, py: Python<'_>) -> PyResult<String> {
        failure::json(py, self)
    }

    fn text(&self) -> String {
        self.to_string()
    }

    fn svg(&self) -> Result<String, ReportError> {
        Ok(self.figure()?.to_svg()?)
    }

    fn html(&self) -> Result<String, ReportError> {
        self.styled_page(FigureStyle::default())
    }
}

/// Draws a result off the lock.
pub fn svg(py: Python<'_>, told: Arc<impl Told + ?Sized + 'static>) -> PyResult<String> {
    work::watched(py, None, || Ok(()), move || told.svg())
}

/// Makes the page of a result off the lock.
pub fn html(py: Python<'_>, told: Arc<impl Told + ?Sized + 'static>) -> PyResult<String> {
    work::watched(py, None, || Ok(()), move || told.html())
}

/// A result that is told and drawn.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Answer(pub Arc<dyn Told>);

impl Answer {
    /// Keeps a result.
    pub fn of(told: impl Told + 'static) -> Self {
        Self(Arc::new(told))
    }
}

#[pymethods]
impl Answer {
    /// The result as the program prints it with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.0.json(py)
    }

    /// The result as a person reads it.
    fn text(&self) -> String {
        self.0.text()
    }

    /// The picture of the program, as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        svg(py, Arc::clone(&self.0))
    }

    /// The picture as a page that answers, as HTML.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        html(py, Arc::clone(&self.0))
    }
}
