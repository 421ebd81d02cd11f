//! Lines of a universal file, and numbers in Fortran fields.

use crate::contents::Fault;

/// A line and its offset.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Line<'a> {
    pub text: &'a [u8],
    pub at: usize,
}

impl Line<'_> {
    pub fn fault(&self, what: impl Into<String>) -> Fault {
        Fault::new(self.at, what)
    }
}

/// Reader of the lines of a file, and of binary data between them.
#[derive(Debug)]
pub(crate) struct Lines<'a> {
    bytes: &'a [u8],
    next: usize,
}

impl<'a> Lines<'a> {
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, next: 0 }
    }

    /// Returns the next line, without its line break.
    pub fn next(&mut self) -> Option<Line<'a>> {
        let remaining = self.rest();
        if remaining.is_empty() {
            return None;
        }
        let end = remaining.iter().position(|b| *b == b'\n').unwrap_or(remaining.len());
        let line = Line { text: remaining[..end].trim_ascii_end(), at: self.next };
        self.next += end + 1;
        Some(line)
    }

    /// Returns the next line; at the end, the error `missing`.
    pub fn required(&mut self, missing: &str) -> Result<Line<'a>, Fault> {
        let at = self.bytes.len();
        self.next().ok_or_else(|| Fault::new(at, missing))
    }

    /// Returns the remaining bytes.
    pub fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.next..).unwrap_or_default()
    }

    /// Returns the offset of the remaining bytes.
    pub fn at(&self) -> usize {
        self.next
    }

    /// Returns the next `len` bytes, or fewer at the end.
    pub fn take(&mut self, len: usize) -> &'a [u8] {
        let taken = self.rest().get(..len).unwrap_or(self.rest());
        self.next += taken.len();
        taken
    }

    /// Returns the number of the line with the byte at offset `at`, counted from 1.
    pub fn number_at(&self, at: usize) -> u64 {
        let before = &self.bytes[..at.min(self.bytes.len())];
        // An offset at the end of the file belongs to the last line.
        let before = if at >= self.bytes.len() { before.trim_ascii_end() } else { before };
        1 + before.iter().filter(|b| **b == b'\n').count() as u64
    }
}

/// Returns whether a line begins or ends a dataset.
pub(crate) fn is_mark(line: &[u8]) -> bool {
    line == b"    -1"
}

/// Returns the number in a field, if there is one; Fortran writes 1.0D+00 for double precision.
pub(crate) fn number<T: std::str::FromStr>(field: &[u8]) -> Option<T> {
    let text = std::str::from_utf8(field).ok()?.trim();
    text.parse().ok().or_else(|| text.replace(['D', 'd'], "E").parse().ok())
}
