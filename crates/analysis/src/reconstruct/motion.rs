//! Measured responses of a machine whose force is unknown.

use std::ops::Range;
use std::sync::Arc;

use mechid_force::{Channel, Measurement};
use mechid_model::{Response, ResponseQuantity};
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use super::scatter::{Scatter, Sums};
use crate::AnalysisError;
use crate::measurement::channels::ABSENT;
use crate::measurement::{self, CHUNK_SAMPLES, RecordSource};

/// The responses in a record; they are buffered only on request.
pub struct Recorded {
    source: Arc<RecordSource>,
    columns: Vec<String>,
    /// Number of force columns; they precede the response columns.
    forces: usize,
    /// Degree of freedom and quantity of each column.
    pub channels: Vec<Channel>,
    /// Samples, counted from 0.
    window: Range<usize>,
    /// Time axis of the window, or of its mean period.
    pub sampling: Sampling,
    /// Number of periods in the window; 1 for an open record.
    pub periods: usize,
}

/// The samples of a window, or of its mean period.
pub struct Held {
    pub motion: Measurement,
    /// Scatter of the periods about their mean, one per channel; `None` with one period.
    pub scatter: Option<Vec<Scatter>>,
}

impl Recorded {
    /// Selects the responses of a machine and the window of a measurement; a periodic window is
    /// averaged over its periods.
    pub fn new(
        measured: &measurement::Measurement,
        dofs: usize,
        periodic: bool,
    ) -> Result<Self, AnalysisError> {
        let source = measured.source();
        let mut columns = Vec::new();
        for kind in ResponseQuantity::ALL {
            let named = source.channels.response(kind);
            if !named.is_empty() && named.len() != dofs {
                let got = named.len();
                return Err(AnalysisError::MotionCount { response: kind, got, dofs });
            }
            let present = named.iter().enumerate().filter(|(_, column)| *column != ABSENT);
            columns.extend(present.map(|(dof, _)| (kind, dof, dof)));
        }
        Self::with_columns(measured, &columns, periodic)
    }

    /// Selects responses, each with its quantity, its number among the columns of this quantity and
    /// the degree of freedom or output that it measures, in the order of the columns.
    pub fn with_columns(
        measured: &measurement::Measurement,
        selected: &[(ResponseQuantity, usize, usize)],
        periodic: bool,
    ) -> Result<Self, AnalysisError> {
        let source = Arc::clone(measured.source());
        let name = |&(kind, column, _): &_| source.names.response_name(kind, column);
        let columns = selected.iter().map(name).collect();
        let channels: Vec<Channel> =
            selected.iter().map(|&(quantity, _, dof)| Channel { dof, quantity }).collect();
        if channels.is_empty() {
            return Err(AnalysisError::NoMotion);
        }
        let (start, len) = measured.span()?;
        let period = measured.window_settings().period.filter(|_| periodic).unwrap_or(len);
        let sampling = source.sampling.with_len(period)?;
        let forces = source.channels.force.iter().filter(|column| *column != ABSENT).count();
        let (window, periods) = (start..start + len, len / period);
        Ok(Self { source, columns, forces, channels, window, sampling, periods })
    }

    /// Returns the name of the record in messages.
    pub fn file(&self) -> &str {
        &self.source.name
    }

    /// Returns the column of each channel.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Converts stated noise levels of the columns, in their units, to levels of the buffered
    /// samples: in SI units, and reduced by the averaging of periods.
    pub fn levels(&self, stated: &[f64]) -> Vec<f64> {
        let mean = (self.periods as f64).sqrt();
        let stated = stated.iter().enumerate();
        stated
            .map(|(column, level)| level * self.source.units.factor(self.forces + column) / mean)
            .collect()
    }

    /// Returns findings and remarks about units and time.
    pub fn unit_notes(&self) -> Vec<String> {
        let findings = self.source.units.findings.iter().map(ToString::to_string);
        findings.chain(self.source.units.remarks.iter().cloned()).collect()
    }

    /// Returns the whole window, or its mean period.
    pub fn hold(&self) -> Result<Held, AnalysisError> {
        let period = self.sampling.len();
        let mut mean = DMatrix::zeros(period, self.channels.len());
        let mut scatters = vec![Sums::default(); self.channels.len()];
        let mut at = 0;
        self.blocks(CHUNK_SAMPLES, CHUNK_SAMPLES, &mut |block| {
            let mut from = 0;
            while from < block.nrows() {
                let rows = (period - at).min(block.nrows() - from);
                let part = block.rows(from, rows);
                for (sums, column) in scatters.iter_mut().zip(part.column_iter()) {
                    sums.push(column.iter().copied(), at == 0);
                }
                let mut mean = mean.rows_mut(at, rows);
                mean += part;
                (from, at) = (from + rows, (at + rows) % period);
            }
            Ok(())
        })?;
        mean /= self.periods as f64;
        let scatter = scatters.iter().zip(mean.column_iter());
        let scatter = scatter.map(|(sums, mean)| sums.about(mean.as_slice(), self.periods));
        let scatter = (self.periods > 1).then(|| scatter.collect());
        Ok(Held { motion: self.measurement(mean)?, scatter })
    }

    /// Passes the window to the callback in chunks of `samples` samples. Each chunk begins
    /// `advance` samples after the previous one; the last may be shorter.
    pub fn chunks(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(&Measurement) -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        self.blocks(samples, advance, &mut |block| take(&self.measurement(block)?))
    }

    /// Passes the chunks of the window to the callback as samples × channels in SI units.
    fn blocks(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(DMatrix<f64>) -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        self.source.blocks(self.window.clone(), samples, advance, &mut |block| {
            take(match self.forces {
                0 => block,
                forces => block.columns_range(forces..).into_owned(),
            })
        })
    }

    fn measurement(&self, block: DMatrix<f64>) -> Result<Measurement, AnalysisError> {
        let record = Record::new(self.source.sampling.with_len(block.nrows())?, block)?;
        Ok(Measurement::new(record, self.channels.clone())?)
    }
}

/// Returns the channels with this quantity for every degree of freedom; `None` unless all were
/// measured.
fn columns_of(channels: &[Channel], quantity: ResponseQuantity, dofs: usize) -> Option<Vec<usize>> {
    let find = |dof: usize| channels.iter().position(|c| *c == Channel { dof, quantity });
    (0..dofs).map(find).collect()
}

/// Returns whether displacement and velocity of every degree of freedom were measured, and, if
/// requested, acceleration.
pub fn complete(channels: &[Channel], dofs: usize, with_acceleration: bool) -> bool {
    let mut needed = vec![ResponseQuantity::Displacement, ResponseQuantity::Velocity];
    needed.extend(with_acceleration.then_some(ResponseQuantity::Acceleration));
    needed.into_iter().all(|quantity| columns_of(channels, quantity, dofs).is_some())
}

/// Returns displacement, velocity and acceleration of every degree of freedom; `None` if one of
/// them was not measured. If `with_acceleration` is false, the accelerations are not needed, and
/// are zero.
pub fn response(measured: &Measurement, dofs: usize, with_acceleration: bool) -> Option<Response> {
    let record = measured.record();
    let record_of = |quantity: ResponseQuantity| -> Option<Record> {
        let columns = columns_of(measured.channels(), quantity, dofs)?;
        let data = DMatrix::from_fn(record.len(), dofs, |k, dof| record.data()[(k, columns[dof])]);
        Record::new(record.sampling(), data).ok()
    };
    let (x, v) =
        (record_of(ResponseQuantity::Displacement)?, record_of(ResponseQuantity::Velocity)?);
    let a = if with_acceleration {
        record_of(ResponseQuantity::Acceleration)?
    } else {
        Record::new(record.sampling(), DMatrix::zeros(record.len(), dofs)).ok()?
    };
    Response::new(x, v, a).ok()
}
