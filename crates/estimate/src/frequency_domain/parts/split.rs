//! Parts of the data: records, bands of lines, intervals of time.

use std::f64::consts::TAU;
use std::ops::Range;

use mechid_signal::{Sampling, transform};
use mechid_spectra::FrequencyData;
use nalgebra::{Complex, DMatrix};

use super::PartsOfFit;
use crate::limits::PARTS;

/// A way to split the data into parts.
#[derive(Debug, Clone, PartialEq)]
pub enum Split {
    /// Rows of each part, such as the rows of each record; the remaining rows form
    /// an additional part.
    Rows(Vec<Vec<Range<usize>>>),
    /// Bands of lines of all records, each with the same information about the parameters.
    Bands,
    /// Equally long intervals of time of an open record.
    Time,
}

/// One part of a split.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Part {
    /// Rows of one part of [`Split::Rows`].
    Rows {
        /// Index of the part, counted from 0.
        index: usize,
    },
    /// Band of lines, in Hz.
    Band {
        /// Lowest line, in Hz.
        first_hz: f64,
        /// Highest line, in Hz.
        last_hz: f64,
    },
    /// Samples of an open record, counted from 0.
    Time {
        /// First sample.
        first: usize,
        /// First sample after the interval.
        end: usize,
    },
}

/// Selection D_p of the rows, or of the time samples, that belong to a part of the data.
enum Cut {
    Rows(Vec<Range<usize>>),
    Time(Range<usize>),
}

/// Selections D_p of all parts, each with the name of its part.
pub(super) struct Cuts(Vec<(Part, Cut)>);

impl Cuts {
    /// Cuts the data into parts; `None` if there are fewer than two parts.
    pub(super) fn new(fit: &PartsOfFit<'_>, split: &Split) -> Option<Self> {
        let cuts = match split {
            Split::Rows(parts) => {
                let part = |(index, rows): (usize, &Vec<Range<usize>>)| {
                    (Part::Rows { index }, Cut::Rows(rows.clone()))
                };
                parts.iter().enumerate().map(part).collect()
            }
            Split::Bands => bands(fit),
            Split::Time => {
                let len = fit.data.open_record(0)?.sampling.len();
                let bound = |at: usize| at * len / PARTS;
                let part = |at: usize| {
                    let (first, end) = (bound(at), bound(at + 1));
                    (Part::Time { first, end }, Cut::Time(first..end))
                };
                (0..PARTS).map(part).collect()
            }
        };
        let cuts: Vec<(Part, Cut)> = cuts;
        (cuts.len() > 1).then_some(Self(cuts))
    }

    pub(super) fn parts(&self) -> impl Iterator<Item = Part> + '_ {
        self.0.iter().map(|(part, _)| *part)
    }

    /// Returns, for every part p of the data, D_p Q: the `columns` Q restricted to the data of the
    /// part.
    pub(super) fn columns(
        &self,
        data: &FrequencyData,
        columns: &DMatrix<f64>,
    ) -> Vec<DMatrix<f64>> {
        let n = data.dof();
        let cut = |(_, cut): &(Part, Cut)| match cut {
            Cut::Rows(ranges) => {
                let mut part = DMatrix::zeros(columns.nrows(), columns.ncols());
                for rows in ranges {
                    let (first, len) = (2 * n * rows.start, 2 * n * rows.len());
                    part.rows_mut(first, len).copy_from(&columns.rows(first, len));
                }
                part
            }
            Cut::Time(samples) => {
                let sampling = data.open_record(0).expect("an open record").sampling;
                stretch(data, columns, sampling, samples)
            }
        };
        self.0.iter().map(cut).collect()
    }
}

/// Returns bands of lines with equal information. The information of a band is the sum of the
/// leverages of its residuals.
fn bands(fit: &PartsOfFit<'_>) -> Vec<(Part, Cut)> {
    let n = fit.data.dof();
    let leverage = |row: usize| fit.linear.basis.rows(2 * n * row, 2 * n).norm_squared();
    let band = |(part, rows): (Part, Vec<usize>)| {
        (part, Cut::Rows(rows.into_iter().map(|row| row..row + 1).collect()))
    };
    equal_bands(fit.data.omega(), leverage).into_iter().map(band).collect()
}

/// Divides lines at `omega` (rad/s) into bands with the same sum of the leverages; returns each
/// band with its rows.
pub(crate) fn equal_bands(
    omega: &[f64],
    leverage: impl Fn(usize) -> f64,
) -> Vec<(Part, Vec<usize>)> {
    let mut rows: Vec<usize> = (0..omega.len()).collect();
    rows.sort_by(|a, b| omega[*a].total_cmp(&omega[*b]));
    let total: f64 = rows.iter().map(|row| leverage(*row)).sum();
    let mut bands: Vec<Vec<usize>> = vec![Vec::new()];
    let (mut sum, mut last) = (0.0, f64::NAN);
    for row in rows {
        // Rows of the same frequency are in the same band.
        let is_next = sum >= total * bands.len() as f64 / PARTS as f64 && bands.len() < PARTS;
        if is_next && omega[row] > last {
            bands.push(Vec::new());
        }
        bands.last_mut().expect("never empty").push(row);
        sum += leverage(row);
        last = omega[row];
    }
    let band = |rows: Vec<usize>| {
        let (first_hz, last_hz) = (omega[rows[0]] / TAU, omega[rows[rows.len() - 1]] / TAU);
        (Part::Band { first_hz, last_hz }, rows)
    };
    bands.into_iter().filter(|rows| !rows.is_empty()).map(band).collect()
}

/// Restricts columns over the lines of a record to some samples of the record: transforms the
/// columns to the time domain, sets all other samples to zero, and transforms the columns back.
fn stretch(
    data: &FrequencyData,
    columns: &DMatrix<f64>,
    sampling: Sampling,
    samples: &Range<usize>,
) -> DMatrix<f64> {
    let (n, len) = (data.dof(), sampling.len());
    let lines: Vec<usize> =
        data.omega().iter().map(|omega| (omega / sampling.omega0()).round() as usize).collect();
    let (forward, inverse) = (transform::forward(len), transform::inverse(len));
    let (mut spectrum, mut time) = (forward.make_output_vec(), forward.make_input_vec());
    let mut part = DMatrix::zeros(columns.nrows(), columns.ncols());
    for (column, mut to) in columns.column_iter().zip(part.column_iter_mut()) {
        for channel in 0..n {
            spectrum.fill(Complex::ZERO);
            let index = |row: usize| 2 * (n * row + channel);
            for (row, line) in lines.iter().enumerate() {
                spectrum[*line] = Complex::new(column[index(row)], column[index(row) + 1]);
            }
            // The transform cannot fail: the lengths match the plan, and there is no line at DC or
            // Nyquist.
            if inverse.process(&mut spectrum, &mut time).is_err() {
                return part;
            }
            for (at, value) in time.iter_mut().enumerate() {
                *value = if samples.contains(&at) { *value / len as f64 } else { 0.0 };
            }
            if forward.process(&mut time, &mut spectrum).is_err() {
                return part;
            }
            for (row, line) in lines.iter().enumerate() {
                (to[index(row)], to[index(row) + 1]) = (spectrum[*line].re, spectrum[*line].im);
            }
        }
    }
    part
}
