//! Headers of LabVIEW measurement files (`.lvm`).
//!
//! # Source
//! National Instruments, *Specification for the LabVIEW Measurement File (.lvm)*, version 2.

use memchr::memmem;

use super::rows::text_of;

/// First bytes of a LabVIEW measurement file.
const MAGIC: &[u8] = b"LabVIEW Measurement";

/// Line that ends the header of the file, and the header of each segment.
const END: &[u8] = b"***End_of_Header***";

/// Name of a column of instants.
pub(super) const X: &str = "X_Value";

/// Maximum length of the header, in bytes.
pub(super) const MAX_BYTES: usize = 1 << 20;

/// Header of a LabVIEW measurement file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LvmHeader {
    /// Number of lines of the header.
    pub lines: u64,
    /// Number of bytes of the header.
    pub bytes: usize,
    /// Text for the unit of each channel.
    pub units: Vec<String>,
    /// First instant and step of each channel, in s.
    pub axes: Vec<(f64, f64)>,
    /// Columns of instants in the table.
    pub instants: Instants,
}

/// Number of columns of instants in the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Instants {
    /// No column of instants; the first field of a row is empty.
    No,
    /// One column of instants for all channels.
    One,
    /// One column of instants before the column of each channel.
    Each,
}

/// Returns whether a text is a LabVIEW measurement file.
pub(super) fn is_lvm(text: &[u8]) -> bool {
    text.starts_with(MAGIC)
}

/// Returns whether the text contains the ends of all its headers.
pub(super) fn is_complete(text: &[u8]) -> bool {
    LvmHeader::parse(text, b'\n').is_some_and(|header| text[header.bytes..].contains(&b'\n'))
}

impl LvmHeader {
    /// Reads the headers of the file and of its first segment; `None` if there is no such header.
    pub fn parse(text: &[u8], terminator: u8) -> Option<Self> {
        let start = &text[..text.len().min(MAX_BYTES)];
        let mut ends = memmem::find_iter(start, END);
        let first = ends.next()?;
        // A second header above the table is the header of the segment.
        let table = memmem::find(&start[first..], X.as_bytes()).map(|at| first + at);
        let last =
            ends.next().filter(|end| table.is_none_or(|table| *end < table)).unwrap_or(first);
        let mut bytes = last + start[last..].iter().position(|b| *b == terminator)? + 1;
        // Empty lines above the names are skipped.
        while let Some(len) = start[bytes..].iter().position(|b| *b == terminator)
            && start[bytes..bytes + len].trim_ascii().is_empty()
        {
            bytes += len + 1;
        }
        let lines = start[..bytes].iter().filter(|b| **b == terminator).count() as u64;
        let mut header =
            Self { lines, bytes, units: Vec::new(), axes: Vec::new(), instants: Instants::One };
        let separator = if memmem::find(&start[..first], b"Separator\tComma").is_some()
            || memmem::find(&start[..first], b"Separator,Comma").is_some()
        {
            b','
        } else {
            b'\t'
        };
        let mut rows = ChannelRows::default();
        for line in start[..bytes].split(|b| *b == terminator) {
            let mut fields =
                line.split(|b| *b == separator).map(|field| text_of(field.trim_ascii()));
            let key = fields.next().unwrap_or_default();
            if key == "X_Columns" {
                header.instants = match fields.next().unwrap_or_default().as_str() {
                    "No" => Instants::No,
                    "Multi" => Instants::Each,
                    _ => Instants::One,
                };
            } else {
                rows.add(&key, fields.collect());
            }
        }
        header.units = rows.channel_fields(&rows.units, header.instants);
        let number = |text: String| text.replace(',', ".").parse::<f64>().unwrap_or(f64::NAN);
        let numbers = |fields: &[String]| {
            rows.channel_fields(fields, header.instants).into_iter().map(number).collect::<Vec<_>>()
        };
        header.axes = numbers(&rows.starts).into_iter().zip(numbers(&rows.steps)).collect();
        Some(header)
    }

    /// Returns the column of a channel; both are counted from 0.
    pub fn column(&self, channel: usize) -> usize {
        match self.instants {
            Instants::No | Instants::One => channel + 1,
            Instants::Each => 2 * channel + 1,
        }
    }
}

/// Rows of a header with one field per channel, without their keys.
#[derive(Debug, Default)]
struct ChannelRows {
    units: Vec<String>,
    starts: Vec<String>,
    steps: Vec<String>,
    /// `true` if no empty field separates the channels in a row that has a field for every channel.
    are_packed: bool,
}

impl ChannelRows {
    /// Adds a row of the header; a row with an unknown key is ignored.
    fn add(&mut self, key: &str, fields: Vec<String>) {
        self.are_packed |= match key {
            "Samples" | "X_Dimension" | "X0" | "Delta_X" => is_packed(&fields),
            _ => false,
        };
        match key {
            "Y_Unit_Label" => self.units = fields,
            "X0" => self.starts = fields,
            "Delta_X" => self.steps = fields,
            _ => {}
        }
    }

    /// Returns the fields of a row, one per channel.
    ///
    /// If each channel has a column of instants, most programs write the field of a channel above
    /// its values, and an empty field above the next column of instants. Other programs write no
    /// empty fields.
    fn channel_fields(&self, fields: &[String], instants: Instants) -> Vec<String> {
        let is_packed = self.are_packed || is_packed(fields);
        let step = if instants == Instants::Each && !is_packed { 2 } else { 1 };
        fields.iter().step_by(step).cloned().collect()
    }
}

/// Returns whether a row has one field per channel. A row with one field per column would have
/// empty fields above the columns of instants.
fn is_packed(fields: &[String]) -> bool {
    fields.iter().skip(1).step_by(2).any(|field| !field.is_empty())
}
