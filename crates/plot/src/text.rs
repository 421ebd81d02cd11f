//! Widths of text, from the metrics of the embedded font.

use std::sync::LazyLock;

use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider as _};

/// Weight of a piece of text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Weight {
    /// Running text.
    #[default]
    Regular,
    /// Titles.
    Bold,
}

/// Font families for a viewer: the embedded font first, then similar fonts, then any sans serif.
/// [`Canvas::text`](crate::Canvas::text) states the length of most texts, so another font does not
/// change the layout.
pub(crate) const FAMILY: &str =
    "Noto Sans, Open Sans, Segoe UI, Roboto, Helvetica Neue, Arial, sans-serif";

/// Files of the embedded font: regular, bold, italic.
pub(crate) const FONTS: [&[u8]; 3] =
    [notosans::REGULAR_TTF, notosans::BOLD_TTF, notosans::ITALIC_TTF];

static REGULAR: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::new(notosans::REGULAR_TTF).ok());
static BOLD: LazyLock<Option<FontRef<'static>>> =
    LazyLock::new(|| FontRef::new(notosans::BOLD_TTF).ok());

/// Size of a superscript or subscript, as a fraction of the size of the text.
pub(crate) const SCRIPT_SIZE: f64 = 0.72;

/// Vertical position of a run of text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Level {
    Base,
    Raised,
    Lowered,
}

/// Splits a text such as `10^{−3}` or `K_{xx}` into runs of ordinary, raised and lowered
/// characters. A `^` or `_` without a pair of braces is an ordinary character.
pub(crate) fn runs(text: &str) -> Vec<(Level, &str)> {
    let mut runs = Vec::new();
    let (mut rest, mut searched) = (text, 0);
    while let Some(offset) = rest[searched..].find(['^', '_']) {
        let mark = searched + offset;
        let body = rest[mark + 1..].strip_prefix('{').and_then(|inner| inner.split_once('}'));
        let Some((script, after)) = body else {
            searched = mark + 1;
            continue;
        };
        let level = if rest[mark..].starts_with('^') { Level::Raised } else { Level::Lowered };
        runs.push((Level::Base, &rest[..mark]));
        runs.push((level, script));
        (rest, searched) = (after, 0);
    }
    runs.push((Level::Base, rest));
    runs.retain(|(_, run)| !run.is_empty());
    runs
}

/// Returns the width of `text` in px at `size` px, from the advance widths of the embedded font;
/// superscripts `^{…}` and subscripts `_{…}` have their drawn size.
///
/// Kerning is ignored: it changes labels by less than a hundredth, and a layout needs an upper
/// bound. A character that the font lacks has a width of 0.6 em.
pub fn text_width(text: &str, size: f64, weight: Weight) -> f64 {
    let part = |level| if level == Level::Base { 1.0 } else { SCRIPT_SIZE };
    runs(text).into_iter().map(|(level, run)| size * part(level) * ems(run, weight)).sum()
}

fn ems(text: &str, weight: Weight) -> f64 {
    const UNKNOWN_EM: f64 = 0.6;
    let font = match weight {
        Weight::Regular => REGULAR.as_ref(),
        Weight::Bold => BOLD.as_ref(),
    };
    let unknown = UNKNOWN_EM * text.chars().count() as f64;
    font.map_or(unknown, |font| {
        let characters = font.charmap();
        // Scaled metrics are rounded to a grid, whereas font units are exact.
        let glyphs = font.glyph_metrics(Size::unscaled(), LocationRef::default());
        let em = f64::from(font.metrics(Size::unscaled(), LocationRef::default()).units_per_em);
        let advance = |character| glyphs.advance_width(characters.map(character)?);
        text.chars()
            .map(|character| advance(character).map_or(UNKNOWN_EM, |units| f64::from(units) / em))
            .sum()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_font_has_every_sign_the_axes_write() {
        for font in [REGULAR.as_ref(), BOLD.as_ref()] {
            let characters = font.expect("the embedded font parses").charmap();
            for sign in "0123456789−.×ωζθΔδφλσμπ°|·–\u{302}ẋẍ²".chars() {
                assert!(characters.map(sign).is_some(), "{sign:?} is missing");
            }
        }
    }

    #[test]
    fn width_is_proportional_to_size_and_adds_up() {
        let ten = text_width("Frequency", 10.0, Weight::Regular);
        assert!((text_width("Frequency", 20.0, Weight::Regular) - 2.0 * ten).abs() < 1e-9);
        let parts =
            text_width("Freq", 10.0, Weight::Regular) + text_width("uency", 10.0, Weight::Regular);
        assert!((parts - ten).abs() < 1e-6);
        // All digits of the font have the same advance width: 1,171 of the 2,048 units per em.
        let digits = 2.0 * 10.0 * 1171.0 / 2048.0;
        assert!((text_width("08", 10.0, Weight::Regular) - digits).abs() < 1e-9);
    }

    #[test]
    fn scripts_are_cut_out_and_stray_marks_left_in() {
        use Level::{Base, Lowered, Raised};
        assert_eq!(
            runs("K_{xx} 10^{−3} N"),
            [(Base, "K"), (Lowered, "xx"), (Base, " 10"), (Raised, "−3"), (Base, " N")]
        );
        assert_eq!(runs("force_x ^{"), [(Base, "force_x ^{")]);
        assert_eq!(runs(""), []);
    }
}
