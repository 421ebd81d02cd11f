//! The columns of a record as the motion of a machine.

use std::ops::Range;

use clap::Args;
use mechid::force::{Channel, Measurement};
use mechid::io::{self, RecordFile};
use mechid::model::{Response, ResponseQuantity};
use mechid::signal::{Record, Sampling};
use nalgebra::DMatrix;

use super::periods::{Scatter, Sums};
use crate::commands::identify::measurement::{HELD, STRETCH};
use crate::error::CliError;
use crate::options::{Detrend, RecordArgs};
use crate::units::{Role, ToSi};

/// Which columns hold what; one entry per degree of freedom, in the machine's order.
#[derive(Debug, Args)]
pub struct MotionArgs {
    /// Displacement columns, in m, one per degree of freedom; 0 where it was not measured
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    displacement: Vec<String>,
    /// Velocity columns, in m/s, likewise
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    velocity: Vec<String>,
    /// Acceleration columns, in m/s², likewise
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    acceleration: Vec<String>,
}

/// What stands for a degree of freedom without a sensor.
const NOT_MEASURED: &str = "0";

/// Which column is what, as the machine's channels.
type Columns<'a> = (Vec<Role<'a>>, Vec<Channel>);

/// The motion in a record, of which no more is held than is asked for.
pub struct Recorded {
    file: RecordFile,
    columns: Vec<String>,
    /// What each column is.
    pub channels: Vec<Channel>,
    /// Of each column, taken away from it.
    offsets: Vec<f64>,
    units: ToSi,
    /// Samples, counted from 0.
    window: Range<usize>,
    /// Time axis of the window, or of its mean period.
    pub sampling: Sampling,
    /// Periods in the window; 1 for an open record.
    pub periods: usize,
}

/// The samples of a window, or of its mean period.
pub struct Held {
    pub motion: Measurement,
    /// How the periods differ from their mean, one per channel; nothing where there is one period.
    pub scatter: Option<Vec<Scatter>>,
}

impl MotionArgs {
    /// Reads the columns once and finds the window; a periodic window is averaged over its periods.
    pub fn open(
        &self,
        input: &RecordArgs,
        dofs: usize,
        periodic: bool,
    ) -> Result<Recorded, CliError> {
        let (roles, channels) = self.columns(dofs)?;
        let file = input.file(HELD)?;
        let units = ToSi::of(file.head(), &roles)?;
        let columns: Vec<String> = roles.iter().map(|(column, ..)| (*column).clone()).collect();
        let time = input.needed_time_axis(file.head())?;
        let survey = file.survey(&time, &columns)?;
        let units = units.at_instants(file.head(), &time, survey.sampling);
        let offsets = match input.detrend {
            Some(Detrend::Mean) => survey.means,
            _ => vec![0.0; columns.len()],
        };
        let (start, len) = input.span(file.head().file(), survey.sampling.len())?;
        let period = if periodic { input.period.unwrap_or(len) } else { len };
        Ok(Recorded {
            file,
            columns,
            channels,
            offsets,
            units,
            window: start..start + len,
            sampling: survey.sampling.with_len(period)?,
            periods: len / period,
        })
    }

    /// The columns that are named.
    fn columns(&self, dofs: usize) -> Result<Columns<'_>, CliError> {
        let groups = [
            ("--displacement", ResponseQuantity::Displacement, &self.displacement),
            ("--velocity", ResponseQuantity::Velocity, &self.velocity),
            ("--acceleration", ResponseQuantity::Acceleration, &self.acceleration),
        ];
        let (mut roles, mut channels) = (Vec::new(), Vec::new());
        for (option, quantity, columns) in groups {
            if !columns.is_empty() && columns.len() != dofs {
                return Err(CliError::MotionCount { option, got: columns.len(), dofs });
            }
            for (dof, column) in columns.iter().enumerate().filter(|(_, c)| *c != NOT_MEASURED) {
                roles.push((column, io::Quantity::from(quantity), option));
                channels.push(Channel { dof, quantity });
            }
        }
        if channels.is_empty() { Err(CliError::NoMotion) } else { Ok((roles, channels)) }
    }
}

impl Recorded {
    /// How messages call the file.
    pub fn file(&self) -> &str {
        self.file.head().file()
    }

    /// What each channel was called.
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Levels stated of the columns, in their units, as the held samples have them: in SI units, and
    /// of the mean of periods.
    pub fn levels(&self, stated: &[f64]) -> Vec<f64> {
        let mean = (self.periods as f64).sqrt();
        let stated = stated.iter().enumerate();
        stated.map(|(column, level)| level * self.units.factor(column) / mean).collect()
    }

    /// Which columns were in other than SI units, and whether the time may be.
    pub fn of_units(&self) -> &[String] {
        &self.units.remarks
    }

    /// All of the window, or its mean period.
    pub fn hold(&self) -> Result<Held, CliError> {
        let period = self.sampling.len();
        let mut mean = DMatrix::zeros(period, self.channels.len());
        let mut scatters = vec![Sums::default(); self.channels.len()];
        let mut at = 0;
        self.blocks(STRETCH, STRETCH, &mut |block| {
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

    /// Goes through the window in stretches of so many samples, each beginning `advance` samples
    /// after the one before; the last may be shorter.
    pub fn stretches(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(&Measurement) -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        self.blocks(samples, advance, &mut |block| take(&self.measurement(block)?))
    }

    /// The same, as samples × channels in SI units.
    fn blocks(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(DMatrix<f64>) -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        self.file.blocks(&self.columns, self.window.clone(), samples, advance, &mut |mut block| {
            for (mut column, offset) in block.column_iter_mut().zip(&self.offsets) {
                column.add_scalar_mut(-offset);
            }
            self.units.convert(&mut block);
            take(block)
        })
    }

    fn measurement(&self, block: DMatrix<f64>) -> Result<Measurement, CliError> {
        let record = Record::new(self.sampling.with_len(block.nrows())?, block)?;
        Ok(Measurement::new(record, self.channels.clone())?)
    }
}

/// The channels with this quantity of every degree of freedom, if all were measured.
fn of_all(channels: &[Channel], quantity: ResponseQuantity, dofs: usize) -> Option<Vec<usize>> {
    let find = |dof: usize| channels.iter().position(|c| *c == Channel { dof, quantity });
    (0..dofs).map(find).collect()
}

/// Whether displacement and velocity of every degree of freedom were measured, and, if asked for,
/// acceleration.
pub fn complete(channels: &[Channel], dofs: usize, with_acceleration: bool) -> bool {
    let mut needed = vec![ResponseQuantity::Displacement, ResponseQuantity::Velocity];
    needed.extend(with_acceleration.then_some(ResponseQuantity::Acceleration));
    needed.into_iter().all(|quantity| of_all(channels, quantity, dofs).is_some())
}

/// Displacement, velocity and acceleration of every degree of freedom, if all were measured;
/// without accelerations these are zero.
pub fn response(measured: &Measurement, dofs: usize, with_acceleration: bool) -> Option<Response> {
    let record = measured.record();
    let all = |quantity: ResponseQuantity| -> Option<Record> {
        let columns = of_all(measured.channels(), quantity, dofs)?;
        let data = DMatrix::from_fn(record.len(), dofs, |k, dof| record.data()[(k, columns[dof])]);
        Record::new(record.sampling(), data).ok()
    };
    let (x, v) = (all(ResponseQuantity::Displacement)?, all(ResponseQuantity::Velocity)?);
    let a = if with_acceleration {
        all(ResponseQuantity::Acceleration)?
    } else {
        Record::new(record.sampling(), DMatrix::zeros(record.len(), dofs)).ok()?
    };
    Response::new(x, v, a).ok()
}
