//! Rendering of figures to documents and files.

use std::path::Path;

use crate::bitmap;
use crate::canvas::Canvas;
use crate::draw;
use crate::error::PlotError;
use crate::figure::Figure;
use crate::layout::Layout;
use crate::save;

impl Figure {
    /// Returns the figure as an SVG document.
    ///
    /// # Errors
    /// A panel or a curve without points, coordinates an axis cannot show, or a size without room to draw in.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.svg("", &self.title)
    }

    /// Returns the figure as an SVG element for an HTML document beside others: its ids begin with `ids`,
    /// different for each, and `label` is its name for readers who do not see it.
    ///
    /// # Errors
    /// As [`Figure::to_svg`].
    pub fn to_inline_svg(&self, ids: &str, label: &str) -> Result<String, PlotError> {
        self.svg(ids, label)
    }

    fn svg(&self, ids: &str, label: &str) -> Result<String, PlotError> {
        self.validate()?;
        let layout = Layout::new(self)?;
        let mut sheet = Canvas::new(layout.size.0, layout.size.1).with_ids(ids);
        draw::figure(self, &layout, &mut sheet);
        Ok(sheet.finish(label))
    }

    /// Returns the figure as a PNG file with `scale` pixels for each px of the drawing; 2 suits screens and slides, 4 print.
    ///
    /// # Errors
    /// As [`Figure::to_svg`], and a scale that leads to an empty or an overlarge bitmap.
    pub fn to_png(&self, scale: f64) -> Result<Vec<u8>, PlotError> {
        bitmap::svg_to_png(&self.to_svg()?, scale)
    }

    /// Saves the figure as SVG or, at two pixels per px, as PNG, by the extension of `path`.
    ///
    /// The file is written completely or not at all: a temporary file beside it is renamed.
    ///
    /// # Errors
    /// As [`Figure::to_svg`]; [`PlotError::Extension`] unless the extension is `.svg` or `.png`,
    /// [`PlotError::Write`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PlotError> {
        // Check the extension before drawing.
        let format = save::Format::of(path.as_ref())?;
        save::write(path.as_ref(), format, &self.to_svg()?)
    }
}
