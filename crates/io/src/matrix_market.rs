//! Matrices in Matrix Market files, the text format of sparse matrices.
//!
//! # Source
//! Boisvert, Pozo & Remington, *The Matrix Market Exchange Formats: Initial Design*, NISTIR 5935
//! (1996).

use std::io::BufRead as _;
use std::path::Path;

use fast_float2::parse;
use mechid_model::triplets;
use mechid_signal::message;
use nalgebra_sparse::csr::CsrMatrix;

use crate::contents::Place;
use crate::table::source::{Source, failed};
use crate::{IoError, Limit, Limits};

/// Share of [`Limits::numbers`] that each row uses, because a row without entries needs memory,
/// too. By default, a matrix can therefore have at most 2²² rows.
pub(crate) const NUMBERS_PER_ROW: usize = 64;

/// Relation between the stored triangle of a matrix and the triangle that is not stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Symmetry {
    General,
    Symmetric,
    SkewSymmetric,
}

/// Contents of the first line.
#[derive(Debug, Clone, Copy)]
struct Header {
    is_coordinate: bool,
    symmetry: Symmetry,
}

/// Reads a square matrix from a file, which may be in gzip; its entries are in the unit of the file
/// (kg, N·s/m or N/m), and entries with the same row and column are added.
///
/// # Errors
/// [`IoError::Read`] if it cannot be read, otherwise as [`parse_matrix_market`].
pub fn read_matrix_market(
    path: impl AsRef<Path>,
    limits: &Limits,
) -> Result<CsrMatrix<f64>, IoError> {
    matrix(Source::open(path.as_ref())?, limits)
}

/// Reads a square matrix from the bytes of a file, in the unit of the file (kg, N·s/m or N/m);
/// `file` is its name in messages.
///
/// ```
/// use mechid_io::{Limits, parse_matrix_market};
///
/// let text = "%%MatrixMarket matrix coordinate real symmetric\n2 2 2\n1 1 300\n2 1 -100\n";
/// let stiffness = parse_matrix_market("k.mtx", text.as_bytes(), &Limits::default())?;
/// assert_eq!((stiffness.nrows(), stiffness.nnz()), (2, 3));
/// # Ok::<(), mechid_io::IoError>(())
/// ```
///
/// # Errors
/// [`IoError::Malformed`] with the line, [`IoError::TooLarge`], [`IoError::Gzip`].
pub fn parse_matrix_market(
    file: impl Into<String>,
    bytes: &[u8],
    limits: &Limits,
) -> Result<CsrMatrix<f64>, IoError> {
    matrix(Source::new(file.into(), bytes)?, limits)
}

fn matrix(source: Source<'_>, limits: &Limits) -> Result<CsrMatrix<f64>, IoError> {
    let mut source = source.bounded(limits);
    let mut lines = Lines { file: source.file.clone(), at: 0, text: Vec::new(), limits: *limits };
    if !lines.next(&mut source)? {
        return Err(
            lines.malformed("the file is empty; a Matrix Market file begins with %%MatrixMarket")
        );
    }
    let header = Header::parse(&lines)?;
    if !lines.next_of_data(&mut source)? {
        return Err(lines.malformed("the line with the size of the matrix is missing"));
    }
    let (size, stored) = header.size(&lines)?;
    if size > limits.numbers / NUMBERS_PER_ROW || stored > limits.numbers {
        return Err(lines.too_large());
    }
    // The vector grows with the entries that are read: the number in the header may be forged.
    let mut entries = Vec::new();
    let mut next_entry = match header.symmetry {
        Symmetry::SkewSymmetric => Some((1, 0)),
        Symmetry::General | Symmetry::Symmetric => Some((0, 0)),
    };
    for count in 0..stored {
        if !lines.next_of_data(&mut source)? {
            let (count, stored) = (message::count(count, "entry"), message::count(stored, "entry"));
            return Err(lines.malformed(format!("the file ends after {count} of {stored}")));
        }
        let (row, column, value) = if header.is_coordinate {
            lines.entry(size)?
        } else {
            let (row, column) = next_entry.expect("each stored entry has a row and a column");
            next_entry = header.symmetry.after(row, column, size);
            (row, column, lines.value()?)
        };
        if value == 0.0 {
            continue;
        }
        let mirrored = match header.symmetry {
            Symmetry::General => None,
            Symmetry::Symmetric => Some(value).filter(|_| row != column),
            Symmetry::SkewSymmetric if row == column => {
                return Err(lines.malformed("a skew-symmetric matrix has no diagonal"));
            }
            Symmetry::SkewSymmetric => Some(-value),
        };
        entries.push((row, column, value));
        entries.extend(mirrored.map(|value| (column, row, value)));
        if entries.len() > limits.numbers {
            return Err(lines.too_large());
        }
    }
    if lines.next_of_data(&mut source)? {
        Err(lines
            .malformed(format!("the file has more entries than the {stored} stated in its header")))
    } else {
        Ok(triplets(size, entries).expect("every entry was checked to be in the matrix"))
    }
}

impl Header {
    /// Returns the numbers of rows and of stored entries, from the line with the size.
    fn size(&self, lines: &Lines) -> Result<(usize, usize), IoError> {
        let sizes: Vec<Option<usize>> = lines.words().map(whole).collect();
        match (self.is_coordinate, sizes.as_slice()) {
            (true, [Some(rows), Some(columns), Some(stored)]) if rows == columns => {
                Ok((*rows, *stored))
            }
            (false, [Some(rows), Some(columns)]) if rows == columns => {
                Ok((*rows, self.symmetry.stored(*rows)))
            }
            (true, [Some(_), Some(_), Some(_)]) | (false, [Some(_), Some(_)]) => {
                Err(lines.malformed("the matrix of a machine must have as many rows as columns"))
            }
            (true, _) => {
                Err(lines
                    .malformed("this line must state the numbers of rows, columns and entries"))
            }
            (false, _) => {
                Err(lines.malformed("this line must state the numbers of rows and columns"))
            }
        }
    }

    fn parse(lines: &Lines) -> Result<Self, IoError> {
        let words: Vec<String> =
            lines.words().map(|word| String::from_utf8_lossy(word).to_lowercase()).collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let ["%%matrixmarket", "matrix", format, field, symmetry] = words[..] else {
            return Err(lines.malformed(
                "a Matrix Market file begins with a line such as \
                 %%MatrixMarket matrix coordinate real general",
            ));
        };
        let is_coordinate = match format {
            "coordinate" => true,
            "array" => false,
            _ => return Err(lines.malformed("only the formats coordinate and array can be read")),
        };
        if !matches!(field, "real" | "double" | "integer") {
            return Err(lines.malformed(
                "only matrices with real, double or integer entries can be read (fourth word of the first line)",
            ));
        }
        let symmetry = match symmetry {
            "general" => Symmetry::General,
            "symmetric" => Symmetry::Symmetric,
            "skew-symmetric" => Symmetry::SkewSymmetric,
            _ => {
                return Err(lines.malformed(
                    "the symmetry (fifth word of the first line) must be general, symmetric or skew-symmetric",
                ));
            }
        };
        Ok(Self { is_coordinate, symmetry })
    }
}

impl Symmetry {
    /// Returns the number of stored entries of a matrix with `size` rows.
    fn stored(self, size: usize) -> usize {
        match self {
            Self::General => size.saturating_mul(size),
            Self::Symmetric => size.saturating_mul(size.saturating_add(1)) / 2,
            Self::SkewSymmetric => size.saturating_mul(size.saturating_sub(1)) / 2,
        }
    }

    /// Returns the row and column of the next stored entry. The entries are stored column by
    /// column; a symmetric matrix has only the entries from the diagonal downwards.
    fn after(self, row: usize, column: usize, size: usize) -> Option<(usize, usize)> {
        let first = match self {
            Self::General => 0,
            Self::Symmetric => column + 1,
            Self::SkewSymmetric => column + 2,
        };
        let next = if row + 1 < size { (row + 1, column) } else { (first, column + 1) };
        (next.0 < size && next.1 < size).then_some(next)
    }
}

/// Reader of the lines of a file, one at a time.
struct Lines {
    file: String,
    /// Number of the line, counted from 1.
    at: u64,
    text: Vec<u8>,
    limits: Limits,
}

impl Lines {
    /// Reads the next line; `false` at the end of the file.
    fn next(&mut self, source: &mut Source<'_>) -> Result<bool, IoError> {
        self.text.clear();
        self.at += 1;
        let most = self.limits.row_bytes;
        let mut line = std::io::Read::take(&mut source.reader, most as u64 + 1);
        match line.read_until(b'\n', &mut self.text) {
            Ok(0) => Ok(false),
            Ok(_) if self.text.len() > most => {
                let (at, limit) = (Place::Line(self.at), Limit::RowBytes(most));
                Err(IoError::TooLarge { file: self.file.clone(), at, limit })
            }
            Ok(_) => Ok(true),
            Err(cause) => Err(failed(&self.file, source.gzip, cause)),
        }
    }

    /// Reads the next line that is neither empty nor a comment; `false` at the end of the file.
    fn next_of_data(&mut self, source: &mut Source<'_>) -> Result<bool, IoError> {
        while self.next(source)? {
            if !self.text.starts_with(b"%") && self.words().next().is_some() {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty())
    }

    /// Returns row and column, counted from 0, and value of the entry on this line.
    fn entry(&self, size: usize) -> Result<(usize, usize, f64), IoError> {
        let mut words = self.words();
        let (row, column, value) = (words.next(), words.next(), words.next());
        let (Some(row), Some(column), Some(value), None) =
            (row.and_then(whole), column.and_then(whole), value, words.next())
        else {
            return Err(self.malformed("an entry consists of its row, its column and its value"));
        };
        if row.min(column) < 1 || row.max(column) > size {
            return Err(self.malformed(format!(
                "row {row}, column {column}: the matrix has rows and columns 1 to {size}"
            )));
        }
        Ok((row - 1, column - 1, self.number(value)?))
    }

    /// Returns the only number of the line.
    fn value(&self) -> Result<f64, IoError> {
        let mut words = self.words();
        match (words.next(), words.next()) {
            (Some(value), None) => self.number(value),
            _ => Err(self.malformed("in the array format, each line has one number")),
        }
    }

    fn number(&self, word: &[u8]) -> Result<f64, IoError> {
        match parse::<f64, _>(word) {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(self.malformed(format!(
                "\"{}\" is not a finite number",
                crate::escaped(&String::from_utf8_lossy(word))
            ))),
        }
    }

    fn malformed(&self, what: impl Into<String>) -> IoError {
        IoError::Malformed { file: self.file.clone(), at: Place::Line(self.at), what: what.into() }
    }

    fn too_large(&self) -> IoError {
        let (at, limit) = (Place::Line(self.at), Limit::Numbers(self.limits.numbers));
        IoError::TooLarge { file: self.file.clone(), at, limit }
    }
}

/// Reads a whole number.
fn whole(word: &[u8]) -> Option<usize> {
    str::from_utf8(word).ok()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, dmatrix};

    use super::*;

    fn matrix(text: &str) -> Result<DMatrix<f64>, IoError> {
        let sparse = parse_matrix_market("k.mtx", text.as_bytes(), &Limits::default())?;
        Ok(DMatrix::from(&sparse))
    }

    /// Matrices of every format and symmetry are read. The expected entries are written by hand
    /// according to the format.
    #[test]
    fn formats_and_symmetries_are_those_of_the_format() {
        let general = "%%MatrixMarket matrix coordinate real general\n% a comment\n\n3 3 4\n\
                       1 1 1.5\n2 3 -2e-3\n3 1 4\n3 1 1\r\n";
        let expected = dmatrix![1.5, 0.0, 0.0; 0.0, 0.0, -2e-3; 5.0, 0.0, 0.0];
        assert_eq!(matrix(general).unwrap(), expected);
        let symmetric =
            "%%matrixmarket MATRIX coordinate Integer symmetric\n2 2 2\n1 1 3\n2 1 -1\n";
        assert_eq!(matrix(symmetric).unwrap(), dmatrix![3.0, -1.0; -1.0, 0.0]);
        let skew = "%%MatrixMarket matrix coordinate real skew-symmetric\n2 2 1\n2 1 7\n";
        assert_eq!(matrix(skew).unwrap(), dmatrix![0.0, -7.0; 7.0, 0.0]);
        let array = "%%MatrixMarket matrix array real general\n2 2\n1\n2\n3\n4\n";
        assert_eq!(matrix(array).unwrap(), dmatrix![1.0, 3.0; 2.0, 4.0]);
        let lower = "%%MatrixMarket matrix array real symmetric\n3 3\n1\n2\n3\n4\n5\n6\n";
        let expected = dmatrix![1.0, 2.0, 3.0; 2.0, 4.0, 5.0; 3.0, 5.0, 6.0];
        assert_eq!(matrix(lower).unwrap(), expected);
        let lower = "%%MatrixMarket matrix array real skew-symmetric\n3 3\n1\n2\n3\n";
        let expected = dmatrix![0.0, -1.0, -2.0; 1.0, 0.0, -3.0; 2.0, 3.0, 0.0];
        assert_eq!(matrix(lower).unwrap(), expected);
        let empty = "%%MatrixMarket matrix coordinate real general\n2 2 0\n";
        assert_eq!(matrix(empty).unwrap(), DMatrix::zeros(2, 2));
    }

    #[test]
    fn what_breaks_the_format_is_told_with_its_line() {
        let banner = "%%MatrixMarket matrix coordinate real general\n";
        for (text, expected) in [
            ("".into(), "line 1: the file is empty"),
            ("1 2 3\n".into(), "line 1: a Matrix Market file begins"),
            (banner[1..].into(), "line 1: a Matrix Market file begins"),
            (
                "%%MatrixMarket matrix coordinate complex general\n".into(),
                "real, double or integer",
            ),
            (
                "%%MatrixMarket matrix coordinate pattern general\n".into(),
                "real, double or integer",
            ),
            ("%%MatrixMarket matrix coordinate real hermitian\n".into(), "the symmetry"),
            (banner.into(), "line 2: the line with the size"),
            (format!("{banner}2 3 1\n"), "line 2: the matrix of a machine must have as many rows"),
            (format!("{banner}2 2\n"), "line 2: this line must state the numbers of rows"),
            (format!("{banner}2 2 -1\n"), "line 2: this line must state the numbers of rows"),
            (format!("{banner}2 2 1\n3 1 1.0\n"), "line 3: row 3, column 1"),
            (format!("{banner}2 2 1\n0 1 1.0\n"), "line 3: row 0, column 1"),
            (format!("{banner}2 2 1\n1 1\n"), "line 3: an entry consists of"),
            (format!("{banner}2 2 1\n1 1 nan\n"), "line 3: \"nan\" is not a finite number"),
            (format!("{banner}2 2 1\n1 1 1e999\n"), "is not a finite number"),
            (format!("{banner}2 2 2\n1 1 1.0\n"), "line 4: the file ends after 1 entry of 2"),
            (
                format!("{banner}2 2 1\n1 1 1.0\n2 2 1.0\n"),
                "line 4: the file has more entries than",
            ),
            (format!("{banner}2 2 99999999999999\n"), "there are more than 268435456 numbers"),
            (format!("{banner}99999999999 99999999999 1\n1 1 1\n"), "more than 268435456 numbers"),
            (
                "%%MatrixMarket matrix array real general\n2 2\n1 2\n".into(),
                "each line has one number",
            ),
            (
                "%%MatrixMarket matrix coordinate real skew-symmetric\n1 1 1\n1 1 1\n".into(),
                "no diagonal",
            ),
        ] {
            let refused = matrix(&text).unwrap_err().to_string();
            assert!(refused.contains(expected), "{text:?}: {refused}");
        }
        let short = Limits { row_bytes: 60, ..Limits::default() };
        let long = format!("{banner}%{}\n", "x".repeat(100));
        let refused = parse_matrix_market("k.mtx", long.as_bytes(), &short);
        assert!(matches!(refused, Err(IoError::TooLarge { .. })), "{refused:?}");
    }
}
