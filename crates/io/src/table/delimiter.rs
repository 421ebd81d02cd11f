//! Delimiters and comments of a text.

/// Separator of two fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    /// One byte: comma, semicolon or tab.
    Byte(u8),
    /// Any run of blanks.
    Blanks,
}

impl Delimiter {
    /// Returns the name of the format of such a text, for messages.
    pub fn name(self) -> &'static str {
        match self {
            Delimiter::Byte(b';') => "text, fields between semicolons",
            Delimiter::Byte(b'\t') => "text, fields between tabs",
            Delimiter::Byte(_) => "text, fields between commas",
            Delimiter::Blanks => "text, fields between blanks",
        }
    }

    /// Returns whether numbers may have a decimal comma.
    pub fn allows_decimal_comma(self) -> bool {
        self != Delimiter::Byte(b',')
    }
}

/// First bytes of comment lines; a semicolon only if it is not the delimiter.
pub(crate) const COMMENTS: &[u8] = b"#%!;";

/// Returns whether a line is a comment.
pub(crate) fn is_comment(line: &[u8], delimiter: Delimiter) -> bool {
    let first = match delimiter {
        Delimiter::Byte(_) => line.first(),
        Delimiter::Blanks => words(line).next().and_then(<[u8]>::first),
    };
    first.is_some_and(|first| COMMENTS.contains(first) && delimiter != Delimiter::Byte(*first))
}

/// Returns the fields of a line that are separated by blanks.
pub(crate) fn words(line: &[u8]) -> impl Iterator<Item = &[u8]> {
    line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
}
