//! Rendering of SVG to PNG with the embedded font.

use std::sync::{Arc, LazyLock};

use resvg::{tiny_skia, usvg};

use crate::error::PlotError;
use crate::text::FONTS;

/// Maximum length of a side of a bitmap, in pixels: 16,384² pixels of four bytes are 1 GiB.
const LIMIT: u32 = 16_384;

/// Parsing the font takes longer than drawing a small figure, so it is done once.
static FONT_BASE: LazyLock<Arc<usvg::fontdb::Database>> = LazyLock::new(|| {
    let mut fonts = usvg::fontdb::Database::new();
    for file in FONTS {
        fonts.load_font_data(file.to_vec());
    }
    fonts.set_sans_serif_family("Noto Sans");
    Arc::new(fonts)
});

/// Converts an SVG document to a PNG file, with `scale` pixels for each px of the document.
///
/// Text is set in the embedded Noto Sans, not in an installed font, so the same document always
/// gives the same bytes.
///
/// # Errors
/// A document that is not SVG, or a scale for which the bitmap is empty or too large.
pub fn svg_to_png(svg: &str, scale: f64) -> Result<Vec<u8>, PlotError> {
    let raster = |reason: String| PlotError::Raster { reason };
    let options = usvg::Options {
        font_family: "Noto Sans".to_owned(),
        fontdb: Arc::clone(&FONT_BASE),
        ..usvg::Options::default()
    };
    let tree = usvg::Tree::from_str(svg, &options).map_err(|error| raster(error.to_string()))?;
    let width = (f64::from(tree.size().width()) * scale).round();
    let height = (f64::from(tree.size().height()) * scale).round();
    let sides = 1.0..=f64::from(LIMIT);
    if !(sides.contains(&width) && sides.contains(&height)) {
        return Err(PlotError::BitmapSize { width, height, limit: LIMIT });
    }
    let mut pixels = tiny_skia::Pixmap::new(width as u32, height as u32)
        .ok_or_else(|| raster(format!("no memory for {width} × {height} pixels")))?;
    let transform = tiny_skia::Transform::from_scale(scale as f32, scale as f32);
    resvg::render(&tree, transform, &mut pixels.as_mut());
    pixels.encode_png().map_err(|error| raster(error.to_string()))
}
