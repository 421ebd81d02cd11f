//! Survey of a file: which of its columns are usable, and their contents.

use std::ops::ControlFlow;

use mechid_signal::Sampling;

use super::time_axis::Steps;
use super::{RecordFile, time_unit};
use crate::IoError;

/// Result of reading a file to its end; some columns may be unusable.
#[derive(Debug)]
pub struct Inventory {
    /// Most frequent number of samples of a column; equal for all columns of a text.
    pub samples: usize,
    /// Contents of each requested column, or the reason why it cannot be used.
    pub columns: Vec<Result<Tally, IoError>>,
    /// Time axis from the column of instants, if one is given, or the reason why this column gives
    /// no time axis.
    pub sampling: Option<Result<Sampling, IoError>>,
    /// Last line of a text, counted from 1 in the file, if no line break ends it: the file may have
    /// been truncated within its last number.
    pub open_line: Option<u64>,
    /// Remarks on the end of a long text, which are not in
    /// [`Table::remarks`](super::Table::remarks).
    pub remarks: Vec<String>,
}

/// Contents of a column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tally {
    /// Number of samples.
    pub samples: usize,
    /// Mean of the samples, in the unit of the column.
    pub mean: f64,
}

impl RecordFile {
    /// Reads columns to the end, by their indices, counted from 0, and the time axis from the
    /// column `instants`, in its stated unit. In the same pass, `take` receives every sample of
    /// each column that is usable so far, in order. Its arguments are the index of the column in
    /// `columns`, the number of the first sample, counted from 0, and the samples from this one on,
    /// in the unit of the column.
    ///
    /// # Errors
    /// Errors of a column or of the time axis are part of the result, as in
    /// [`Table::column`](super::Table::column) and [`Table::sampling`](super::Table::sampling);
    /// errors of the file are as in [`Table::read_with`](super::Table::read_with).
    ///
    /// # Panics
    /// If there is no such column.
    pub fn inventory(
        &self,
        columns: &[usize],
        instants: Option<usize>,
        take: &mut dyn FnMut(usize, usize, &[f64]),
    ) -> Result<Inventory, IoError> {
        if !self.is_whole() {
            return self.inventory_of_text(columns, instants, take);
        }
        let mut tally = |(at, column): (usize, &usize)| {
            let values = self.head.values(*column)?;
            take(at, 0, values);
            Ok(Tally { samples: values.len(), mean: mean(values.iter().sum(), values.len()) })
        };
        let sampling = |column: usize| {
            let mut steps = Steps::default();
            let times = self.head.values(column)?;
            for (k, time) in times.iter().enumerate() {
                steps.push(*time, || self.head.position(k));
            }
            self.sampling_of(column, steps, times.len())
        };
        Ok(Inventory {
            samples: self.head.len(),
            columns: columns.iter().enumerate().map(&mut tally).collect(),
            sampling: instants.map(sampling),
            open_line: self.head.contents.open_line,
            remarks: Vec::new(),
        })
    }

    fn inventory_of_text(
        &self,
        columns: &[usize],
        instants: Option<usize>,
        take: &mut dyn FnMut(usize, usize, &[f64]),
    ) -> Result<Inventory, IoError> {
        // An empty sum is −0 in Rust. These sums begin with −0, so that they equal the sum of a
        // column in memory.
        let mut sums = vec![-0.0; columns.len()];
        let mut steps = Steps::default();
        let read: Vec<usize> = columns.iter().copied().chain(instants).collect();
        let reader = self.rows(&read, &mut |first, rows| {
            for (at, (sum, column)) in sums.iter_mut().zip(columns).enumerate() {
                if let Ok(values) = &rows.column(*column).values {
                    *sum = values.iter().fold(*sum, |sum, value| sum + value);
                    take(at, first, values);
                }
            }
            for times in instants.iter().flat_map(|column| &rows.column(*column).values) {
                for (k, time) in (first..).zip(times) {
                    steps.push(*time, || rows.lines().position(k));
                }
            }
            Ok::<_, IoError>(ControlFlow::Continue(()))
        })?;
        let end = reader.end().unwrap_or_default();
        let rows = reader.rows();
        let samples = rows.samples();
        let usable = |column: usize| match &rows.column(column).values {
            Ok(_) => Ok(()),
            Err(why) => Err(self.unusable(column, why)),
        };
        let tallies = columns.iter().zip(sums);
        let tally = |(column, sum): (&usize, f64)| {
            usable(*column).map(|()| Tally { samples, mean: mean(sum, samples) })
        };
        Ok(Inventory {
            samples,
            columns: tallies.map(tally).collect(),
            sampling: instants.map(|column| {
                usable(column).and_then(|()| self.sampling_of(column, steps, samples))
            }),
            open_line: end.open_line,
            remarks: end.remark().into_iter().collect(),
        })
    }

    /// Returns the time axis of `len` samples at the instants of a column.
    pub(super) fn sampling_of(
        &self,
        column: usize,
        steps: Steps,
        len: usize,
    ) -> Result<Sampling, IoError> {
        let unit = time_unit::unit(&self.head.contents.columns[column]);
        let dt = steps.step(self.head.file(), unit)?;
        self.head.signal(Sampling::new(dt, len))
    }
}

fn mean(sum: f64, samples: usize) -> f64 {
    sum / samples as f64
}
