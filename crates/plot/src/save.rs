//! Files that are written completely or not at all.

use std::io::Write as _;
use std::path::Path;

use crate::bitmap::svg_to_png;
use crate::error::PlotError;

/// Number of pixels of a saved bitmap for each px of the drawing.
const SAVED_SCALE: f64 = 2.0;

/// File format, chosen by the extension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Svg,
    Png,
}

impl Format {
    pub(crate) fn from_path(path: &Path) -> Result<Self, PlotError> {
        let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
        match ending.as_deref().and_then(|ending| ending.to_str()) {
            Some("svg") => Ok(Format::Svg),
            Some("png") => Ok(Format::Png),
            _ => Err(PlotError::Extension { path: path.to_owned() }),
        }
    }
}

/// Saves an SVG document. The extension of `path` selects the format: SVG (unchanged), or PNG with
/// two pixels for each px of the drawing.
///
/// # Errors
/// [`PlotError::Extension`] unless the extension is `.svg` or `.png`, [`PlotError::Raster`] for a
/// document that is not SVG, [`PlotError::Write`] if the file cannot be written.
pub fn save_svg(path: impl AsRef<Path>, svg: &str) -> Result<(), PlotError> {
    write(path.as_ref(), Format::from_path(path.as_ref())?, svg)
}

pub(crate) fn write(path: &Path, format: Format, svg: &str) -> Result<(), PlotError> {
    let bytes = match format {
        Format::Svg => svg.as_bytes().to_vec(),
        Format::Png => svg_to_png(svg, SAVED_SCALE)?,
    };
    replace(path, &bytes).map_err(|source| PlotError::Write { path: path.to_owned(), source })
}

/// Writes a temporary file in the same folder and renames it, so that the target is never
/// incomplete.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    #[cfg(not(unix))]
    let builder = tempfile::Builder::new();
    // A temporary file is private by default; a figure gets the permissions of any other new file.
    #[cfg(unix)]
    let builder = {
        use std::os::unix::fs::PermissionsExt as _;

        let mut builder = tempfile::Builder::new();
        builder.permissions(std::fs::Permissions::from_mode(0o666));
        builder
    };
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}
