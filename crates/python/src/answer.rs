//! Results with a text and a picture, and no further methods.

use std::fmt::Display;
use std::sync::Arc;

use mechid::report::{FigureStyle, PageSettings, ReportError, ToFigure};
use pyo3::prelude::*;
use serde::Serialize;

use crate::page::PageTexts;
use crate::{failure, work};

/// Result as JSON, as text and as a figure.
pub trait ResultOutput: Send + Sync {
    /// Returns the JSON that the program prints.
    fn json(&self, py: Python<'_>) -> PyResult<String>;

    /// Returns the text that the program prints.
    fn text(&self) -> String;

    /// Returns the figure that the program draws, as SVG.
    fn svg(&self) -> Result<String, ReportError>;

    /// Returns the figure as an interactive HTML page.
    fn html(&self) -> Result<String, ReportError>;

    /// Returns the page with the heading and the details of the settings.
    fn page(&self, settings: &PageSettings) -> Result<String, ReportError>;
}

impl<T: Serialize + Display + ToFigure + Send + Sync> ResultOutput for T {
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

    fn page(&self, settings: &PageSettings) -> Result<String, ReportError> {
        self.page_with(FigureStyle::default(), settings)
    }
}

/// Draws a result without the interpreter's lock.
pub fn svg(py: Python<'_>, result: Arc<impl ResultOutput + ?Sized + 'static>) -> PyResult<String> {
    work::watched(py, None, || Ok(()), move || result.svg())
}

/// Creates the HTML page of a result without the interpreter's lock.
pub fn html(py: Python<'_>, result: Arc<impl ResultOutput + ?Sized + 'static>) -> PyResult<String> {
    work::watched(py, None, || Ok(()), move || result.html())
}

/// Creates the HTML page of a result with these texts. The lock of the interpreter is released
/// during the computation.
pub fn page(
    py: Python<'_>,
    result: Arc<impl ResultOutput + ?Sized + 'static>,
    texts: PageTexts,
) -> PyResult<String> {
    let settings = texts.settings(py)?;
    work::watched(py, None, || Ok(()), move || result.page(&settings))
}

/// Result with JSON, text and figure.
#[pyclass(frozen, module = "mechid._mechid")]
pub struct Answer(pub Arc<dyn ResultOutput>);

impl Answer {
    /// Creates an answer from a result.
    pub fn new(result: impl ResultOutput + 'static) -> Self {
        Self(Arc::new(result))
    }
}

#[pymethods]
impl Answer {
    /// Returns the JSON that the program prints with `--json`.
    fn to_json(&self, py: Python<'_>) -> PyResult<String> {
        self.0.json(py)
    }

    /// Returns the text that the program prints.
    fn text(&self) -> String {
        self.0.text()
    }

    /// Returns the figure that the program draws, as SVG.
    fn svg(&self, py: Python<'_>) -> PyResult<String> {
        svg(py, Arc::clone(&self.0))
    }

    /// Returns the figure as an interactive HTML page.
    fn html(&self, py: Python<'_>) -> PyResult<String> {
        html(py, Arc::clone(&self.0))
    }

    /// Returns the figure as a page with these texts.
    fn page(&self, py: Python<'_>, texts: PageTexts) -> PyResult<String> {
        page(py, Arc::clone(&self.0), texts)
    }
}
