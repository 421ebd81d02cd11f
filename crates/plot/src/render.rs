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
    /// A panel or a curve without points, coordinates that an axis cannot show, or a size that is
    /// too small.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.svg("", &self.title)
    }

    /// Returns the figure as an SVG element for an HTML document with several figures: its ids
    /// begin with `ids`, which must be different for each figure, and `label` is its name for
    /// screen readers.
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

    /// Returns the figure as a PNG file with `scale` pixels for each px of the drawing: 2 for
    /// screens and slides, 4 for print.
    ///
    /// # Errors
    /// As [`Figure::to_svg`], and a scale for which the bitmap is empty or too large.
    pub fn to_png(&self, scale: f64) -> Result<Vec<u8>, PlotError> {
        bitmap::svg_to_png(&self.to_svg()?, scale)
    }

    /// Saves the figure. The extension of `path` selects the format: SVG, or PNG with two pixels
    /// for each px of the drawing.
    ///
    /// The file is written completely or not at all: a temporary file in the same folder is
    /// renamed.
    ///
    /// # Errors
    /// As [`Figure::to_svg`]; [`PlotError::Extension`] unless the extension is `.svg` or `.png`,
    /// [`PlotError::Write`] if the file cannot be written.
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), PlotError> {
        // The extension is checked before the drawing, which takes longer.
        let format = save::Format::from_path(path.as_ref())?;
        save::write(path.as_ref(), format, &self.to_svg()?)
    }
}
