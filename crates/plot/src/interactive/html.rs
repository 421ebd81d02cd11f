//! The script of interactive figures, its content security policy, and a page of one figure.

use std::sync::LazyLock;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest as _, Sha256};

use super::squeeze::squeeze;
use crate::canvas::escape;
use crate::style::{Color, DARK_MODE};

static SCRIPT: LazyLock<String> = LazyLock::new(|| squeeze(include_str!("script.js")));

static POLICY: LazyLock<String> = LazyLock::new(|| {
    let hash = STANDARD.encode(Sha256::digest(script().as_bytes()));
    format!("default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{hash}'")
});

/// Returns the script that makes figures with `metadata` interactive: zoom, cursor, legend, scales,
/// animation.
///
/// It has no dependency, loads no other file, and treats names as text only. A page that includes
/// it inline needs the [`content_policy`].
pub fn script() -> &'static str {
    &SCRIPT
}

/// Returns the content security policy of a page: no other file is loaded, and only the
/// [`script()`], identified by its hash, is run, even if a name in a record contains HTML.
pub fn content_policy() -> &'static str {
    &POLICY
}

static STYLE: LazyLock<String> = LazyLock::new(|| {
    let of_color = |(light, dark): &(Color, Color)| {
        let of = |part: &str| format!("svg [{part}=\"{}\"] {{ {part}: {}; }}\n", light.0, dark.0);
        of("fill") + &of("stroke")
    };
    let colors: String = DARK_MODE.iter().map(of_color).collect();
    let style = include_str!("figure.css");
    format!("{style}@media screen and (prefers-color-scheme: dark) {{\n{colors}}}\n")
});

/// Returns the CSS of the figures: rules for the elements that the script adds, and rules for dark
/// mode.
pub fn figure_style() -> &'static str {
    &STYLE
}

/// Returns a page of drawn figures.
pub(super) fn page(title: &str, figures: &str) -> String {
    let heading = if title.is_empty() { "Figure".into() } else { escape(title) };
    let above = if title.is_empty() { String::new() } else { format!("<h1>{heading}</h1>") };
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\
         <meta name=\"color-scheme\" content=\"light dark\"><title>{heading}</title>\
         <style>{}</style></head>\n<body><main>{above}{figures}</main>\
         <script>{}</script></body></html>\n",
        content_policy(),
        figure_style(),
        script()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_script_is_small_and_stays_within_its_element() {
        assert!(script().len() <= 20_000, "{} bytes", script().len());
        for end in ["</", "<!--"] {
            assert!(!script().contains(end), "{end}");
        }
        for word in [
            "eval",
            "Function",
            "innerHTML",
            "insertAdjacentHTML",
            "fetch",
            "import",
            "document.write",
        ] {
            assert!(!script().contains(word), "{word}");
        }
    }

    /// The content policy must contain the hash of the script; the hash function must give the hash
    /// of "abc" in FIPS 180-2.
    #[test]
    fn the_policy_names_the_hash_of_the_script() {
        let hash = STANDARD.encode(Sha256::digest(b"abc"));
        assert_eq!(hash, "ungWv48Bz+pBQUDeXa4iI7ADYaOWF3qctBD/YfIAFa0=");
        let of_script = STANDARD.encode(Sha256::digest(script().as_bytes()));
        assert!(content_policy().ends_with(&format!("script-src 'sha256-{of_script}'")));
    }
}
