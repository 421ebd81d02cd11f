//! Records as comma-separated text.

use std::path::Path;

use mechid_signal::Sampling;

use crate::number_text::push_number;
use crate::{BegunFile, IoError};

/// Number of bytes of text that are collected before they are written.
const BUFFER_BYTES: usize = 1 << 16;

/// Returns a table with a `time` column in seconds and the named columns, which
/// [`Table`](crate::Table) reads back bit for bit: every number has the fewest digits that identify
/// it.
///
/// # Panics
/// If a column is not as long as the sampling.
pub fn csv_text(sampling: Sampling, columns: &[(String, &[f64])]) -> String {
    let mut text = header(columns.iter().map(|(name, _)| name.as_str()));
    for (name, column) in columns {
        assert_eq!(column.len(), sampling.len(), "column {name} must be as long as the time axis");
    }
    for (k, time) in sampling.times().enumerate() {
        push_row(&mut text, time, columns.iter().map(|(_, column)| column[k]));
    }
    text
}

/// Writer of the text of [`csv_text`], in blocks of rows, into a [`BegunFile`].
///
/// ```
/// use mechid_io::{CsvFile, write_all};
/// use mechid_signal::Sampling;
///
/// let path = std::env::temp_dir().join("mechid-csv-file.csv");
/// let mut file = CsvFile::begin(&path, Sampling::new(0.5, 3)?, &["force"])?;
/// file.append(&[&[1.0, 2.0]])?;
/// file.append(&[&[3.0]])?;
/// write_all(vec![file.finish()?], &[])?;
/// assert_eq!(std::fs::read_to_string(&path)?, "time,force\n0.0,1.0\n0.5,2.0\n1.0,3.0\n");
/// # std::fs::remove_file(path)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CsvFile {
    file: BegunFile,
    sampling: Sampling,
    /// Number of rows so far.
    rows: usize,
    /// Text that is not written to the file yet.
    text: String,
}

impl CsvFile {
    /// Begins the file with destination `path`: a `time` column, in seconds, and the named columns.
    ///
    /// # Errors
    /// As [`BegunFile::begin`].
    pub fn begin(
        path: impl AsRef<Path>,
        sampling: Sampling,
        names: &[impl AsRef<str>],
    ) -> Result<Self, IoError> {
        let text = header(names.iter().map(AsRef::as_ref));
        Ok(Self { file: BegunFile::begin(path)?, sampling, rows: 0, text })
    }

    /// Appends rows: the next samples of each column, in its own unit.
    ///
    /// # Errors
    /// [`IoError::Write`].
    ///
    /// # Panics
    /// If the columns are not equally long.
    pub fn append(&mut self, columns: &[&[f64]]) -> Result<(), IoError> {
        let rows = columns.first().map_or(0, |column| column.len());
        assert!(columns.iter().all(|column| column.len() == rows), "columns are equally long");
        for k in 0..rows {
            let time = self.sampling.time(self.rows);
            push_row(&mut self.text, time, columns.iter().map(|column| column[k]));
            self.rows += 1;
            if self.text.len() >= BUFFER_BYTES {
                log::trace!("row {} of {}", self.rows, self.sampling.len());
                self.file.append(&self.text)?;
                self.text.clear();
            }
        }
        Ok(())
    }

    /// Returns the complete file, which gets its name in [`write_all`](crate::write_all).
    ///
    /// # Errors
    /// [`IoError::Write`].
    ///
    /// # Panics
    /// If the number of rows differs from the number of samples.
    pub fn finish(mut self) -> Result<BegunFile, IoError> {
        assert_eq!(self.rows, self.sampling.len(), "every instant needs one row");
        self.file.append(&self.text)?;
        Ok(self.file)
    }
}

fn header<'a>(names: impl Iterator<Item = &'a str>) -> String {
    let mut text = String::from("time");
    for name in names {
        text.push(',');
        text.push_str(&quoted(name));
    }
    text.push('\n');
    text
}

fn push_row(text: &mut String, time: f64, values: impl Iterator<Item = f64>) {
    push_number(text, time);
    for value in values {
        text.push(',');
        push_number(text, value);
    }
    text.push('\n');
}

fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r', ';', '\t']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.into()
    }
}
