//! Text from files in a form that is safe on a terminal.

use std::borrow::Cow;
use std::fmt::{self, Write as _};
use std::path::Path;

/// Returns a text in which unprintable characters are written as in Rust, such as `\u{1b}` or `\n`:
/// control characters, invisible characters, those that change the direction of writing, and those
/// that Unicode excludes from text.
///
/// Names of columns and files may have any characters; printed unchanged, they could move the
/// cursor, hide text or imitate a line of output.
///
/// ```
/// use mechid_io::escaped;
///
/// assert_eq!(escaped("force [µN]"), "force [µN]");
/// assert_eq!(escaped("a\u{1b}[2Jb\u{202e}c\n"), r"a\u{1b}[2Jb\u{202e}c\n");
/// ```
pub fn escaped(text: &str) -> Cow<'_, str> {
    if !text.contains(is_unshown) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        push(&mut shown, c);
    }
    Cow::Owned(shown)
}

/// Returns the name of a file as text. Bytes that are not UTF-8 are written as in Rust, such as
/// `\xff`, so that different names have different texts.
///
/// ```
/// use std::path::Path;
///
/// use mechid_io::path_text;
///
/// assert_eq!(path_text(Path::new("day 1/µ.csv")), "day 1/µ.csv");
/// ```
pub fn path_text(path: &Path) -> Cow<'_, str> {
    if let Some(text) = path.to_str() {
        return Cow::Borrowed(text);
    }
    let mut shown = String::new();
    for chunk in path.as_os_str().as_encoded_bytes().utf8_chunks() {
        shown.push_str(chunk.valid());
        for byte in chunk.invalid() {
            let _ = write!(shown, "\\x{byte:02x}");
        }
    }
    Cow::Owned(shown)
}

/// Returns whether a character must be escaped.
fn is_unshown(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}'
            | '\u{61c}'
            | '\u{180e}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{feff}'
            | '\u{fff0}'..='\u{fffb}'
            | '\u{e0000}'..='\u{e007f}')
        // Unicode reserves the last two code points of every plane and 32 more as non-characters.
        || u32::from(c) & 0xfffe == 0xfffe
        || ('\u{fdd0}'..='\u{fdef}').contains(&c)
}

fn push(into: &mut String, c: char) {
    if is_unshown(c) {
        into.extend(c.escape_default());
    } else {
        into.push(c);
    }
}

/// Message whose parts come from files; it is shown [`escaped`].
pub(crate) struct Message<'a>(pub fmt::Arguments<'a>);

impl fmt::Display for Message<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        struct Escaping<'a, 'b>(&'a mut fmt::Formatter<'b>);

        impl fmt::Write for Escaping<'_, '_> {
            fn write_str(&mut self, text: &str) -> fmt::Result {
                self.0.write_str(&escaped(text))
            }
        }
        Escaping(f).write_fmt(self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_written_out() {
        for (text, shown) in [
            ("Schwingweg µm – 加速度 é 👍", "Schwingweg µm – 加速度 é 👍"),
            ("a\\b \"c\" 'd'", "a\\b \"c\" 'd'"),
            ("\t\r\n", "\\t\\r\\n"),
            ("\u{0}\u{7}\u{7f}\u{9b}", "\\u{0}\\u{7}\\u{7f}\\u{9b}"),
            ("\u{2066}x\u{2069}\u{200f}", "\\u{2066}x\\u{2069}\\u{200f}"),
            ("\u{fffe}\u{ffff}\u{1ffff}", "\\u{fffe}\\u{ffff}\\u{1ffff}"),
            ("\u{fffd}", "\u{fffd}"),
        ] {
            assert_eq!(escaped(text), shown);
            assert_eq!(Message(format_args!("{text}")).to_string(), shown);
        }
    }
}
