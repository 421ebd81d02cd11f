//! Figures: grids of panels with a title.

use crate::curve::Reference;
use crate::error::PlotError;
use crate::panel::{Legend, Panel};

/// Grid of panels with a title, filled row by row.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    pub(crate) title: String,
    pub(crate) panels: Vec<Panel>,
    pub(crate) columns: usize,
    pub(crate) share_x: bool,
    pub(crate) shared_legend: bool,
    pub(crate) size: Option<(f64, f64)>,
}

impl Figure {
    /// Creates a figure without panels; an empty title needs no space.
    pub fn new(title: impl Into<String>) -> Self {
        Figure {
            title: title.into(),
            panels: Vec::new(),
            columns: 1,
            share_x: false,
            shared_legend: false,
            size: None,
        }
    }

    /// Adds a panel.
    #[must_use]
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Arranges the panels in this many columns instead of one.
    #[must_use]
    pub fn columns(mut self, columns: usize) -> Self {
        self.columns = columns.max(1);
        self
    }

    /// Gives the panels of a column one abscissa, labelled only under the lowest panel; a title
    /// that is equal to the title above is written once.
    #[must_use]
    pub fn share_x(mut self) -> Self {
        self.share_x = true;
        self
    }

    /// Draws one legend above all panels instead of one in each. It shows each label once, with the
    /// style of the first curve that has this label.
    #[must_use]
    pub fn shared_legend(mut self) -> Self {
        self.shared_legend = true;
        self
    }

    /// Sets the size of the whole figure, px, which otherwise follows from its panels.
    #[must_use]
    pub fn size(mut self, width: f64, height: f64) -> Self {
        self.size = Some((width, height));
        self
    }

    /// Marks these abscissae, in the unit of their axis, by vertical reference lines through every
    /// panel, with one entry in the first legend.
    #[must_use]
    pub fn mark_x(mut self, label: &str, values: &[f64]) -> Self {
        for (at, panel) in self.panels.iter_mut().enumerate() {
            let named = |k: usize| if (at, k) == (0, 0) { label } else { "" };
            let lines = values.iter().enumerate();
            panel.references.extend(lines.map(|(k, x)| Reference::vertical(named(k), *x)));
        }
        self
    }

    /// Gives the figure another title.
    #[must_use]
    pub fn titled(mut self, title: impl Into<String>) -> Self {
        self.title = title.into();
        self
    }

    /// Returns the title of the figure.
    pub fn name(&self) -> &str {
        &self.title
    }

    /// Returns the panels in order, for example to write the drawn numbers to a table.
    pub fn panels(&self) -> &[Panel] {
        &self.panels
    }

    /// Returns the number of rows of panels.
    pub fn rows(&self) -> usize {
        self.panels.len().div_ceil(self.columns)
    }

    /// Checks that every panel has curves, and that every coordinate can be shown on its axis.
    pub(crate) fn validate(&self) -> Result<(), PlotError> {
        if self.panels.is_empty() {
            return Err(PlotError::NoPanels { figure: self.title.clone() });
        }
        for (panel, content) in self.panels.iter().enumerate() {
            if content.curves.is_empty() {
                return Err(PlotError::NoCurves { figure: self.title.clone(), panel });
            }
            content.validate()?;
        }
        Ok(())
    }

    /// Returns the legend position of a panel; the legend of a panel is hidden if the figure has a
    /// shared legend.
    pub(crate) fn legend_of(&self, panel: &Panel) -> Legend {
        if self.shared_legend { Legend::Hidden } else { panel.legend }
    }
}
