//! The columns of a record as the forces and motions of a machine.

use mechid::model::ResponseQuantity;
use std::ops::Range;

use clap::Args;
use mechid::io::{Quantity, RecordFile};
use mechid::signal::{Record, Sampling};
use nalgebra::{DMatrix, DVector};

use crate::error::CliError;
use crate::options::{Detrend, RecordArgs};
use crate::units::{Role, ToSi};

/// Which columns hold what; one column per degree of freedom, in the same order everywhere.
#[derive(Debug, Clone, Args)]
pub struct ChannelArgs {
    /// Force columns, in N, one per degree of freedom; 0 where no force acts
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    pub force: Vec<String>,
    /// Displacement columns, in m
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    pub displacement: Vec<String>,
    /// Velocity columns, in m/s
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    pub velocity: Vec<String>,
    /// Acceleration columns, in m/s²
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    pub acceleration: Vec<String>,
}

/// What stands for the column of a force that does not act.
const NO_FORCE: &str = "0";

/// Samples of a window that are held where not all of it is needed at once.
pub const HELD: usize = 1 << 18;

/// Samples taken at a time from a window that is not held whole.
pub const STRETCH: usize = 1 << 16;

/// How much of a window is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hold {
    /// All of it.
    Whole,
    /// As many whole periods as [`HELD`] samples have, one at least.
    Periods,
    /// [`HELD`] samples, or so many if they are more.
    Samples(usize),
}

/// The window of a record, sorted into forces and motions.
#[derive(Debug)]
pub struct Measurement {
    /// How messages call the file.
    pub file: String,
    /// Samples × degrees of freedom, in N; of a long window the first samples only, as of the
    /// motions.
    pub force: Record,
    /// Samples × degrees of freedom, in m.
    pub displacement: Option<Record>,
    /// Samples × degrees of freedom, in m/s.
    pub velocity: Option<Record>,
    /// Samples × degrees of freedom, in m/s².
    pub acceleration: Option<Record>,
    /// First sample of the window, counted from 1.
    pub first_sample: usize,
    /// Samples in a period.
    pub period: usize,
    /// Periods in the window.
    pub periods: usize,
    /// Degrees of freedom on which a force acts, counted from 0.
    pub driven: Vec<usize>,
    /// Which columns were in other than SI units, and whether the time may be.
    pub of_units: Vec<String>,
}

/// A measurement that can be gone through from beginning to end, however long it is.
#[derive(Debug)]
pub struct Recorded {
    /// What of it is held.
    pub held: Measurement,
    source: Source,
}

/// Where the samples of a window come from.
#[derive(Debug)]
struct Source {
    file: RecordFile,
    columns: ChannelArgs,
    /// Of each column used, taken away from it.
    offsets: DVector<f64>,
    units: ToSi,
    /// Samples, counted from 0.
    window: Range<usize>,
    sampling: Sampling,
}

/// A record and then the samples of a later one.
pub fn joined(record: &Record, later: &Record) -> Result<Record, CliError> {
    let (before, len) = (record.len(), record.len() + later.len());
    let mut data = DMatrix::zeros(len, record.channels());
    data.rows_mut(0, before).copy_from(record.data());
    data.rows_mut(before, later.len()).copy_from(later.data());
    Ok(Record::new(record.sampling().with_len(len)?, data)?)
}

impl Measurement {
    /// The first kind of motion measured, and what it is.
    pub fn motion(&self) -> (&Record, ResponseQuantity) {
        let (kind, record) = self.motions()[0];
        (record, kind)
    }

    /// Every kind of motion measured.
    pub fn motions(&self) -> Vec<(ResponseQuantity, &Record)> {
        let candidates = [
            (ResponseQuantity::Displacement, &self.displacement),
            (ResponseQuantity::Velocity, &self.velocity),
            (ResponseQuantity::Acceleration, &self.acceleration),
        ];
        let measured = candidates.into_iter();
        measured.filter_map(|(kind, record)| Some((kind, record.as_ref()?))).collect()
    }

    /// The last sample of the window, counted from 1.
    pub fn last_sample(&self) -> usize {
        self.first_sample + self.period * self.periods - 1
    }

    /// The last sample that is held, counted from 1, if others follow in the window.
    pub fn held_to(&self) -> Option<usize> {
        let held = self.first_sample + self.force.len() - 1;
        (held < self.last_sample()).then_some(held)
    }
}

impl Hold {
    /// Samples held of a window of so many, in periods of so many.
    fn samples(self, len: usize, period: usize) -> usize {
        let held = match self {
            Hold::Whole => len,
            Hold::Periods => period * (HELD / period).max(1),
            Hold::Samples(least) => least.max(HELD),
        };
        held.min(len)
    }
}

impl Recorded {
    /// What is held, the rest left behind.
    pub fn into_held(self) -> Measurement {
        self.held
    }

    /// Goes through the window in stretches of so many samples, each beginning `advance` samples
    /// after the one before; the last may be shorter. A window that is held and fits into one is
    /// not read again.
    pub fn stretches(
        &self,
        samples: usize,
        advance: usize,
        take: &mut dyn FnMut(&Measurement) -> Result<(), CliError>,
    ) -> Result<(), CliError> {
        if self.held.held_to().is_none() && self.held.force.len() <= samples {
            return take(&self.held);
        }
        let mut first = self.held.first_sample;
        let window = self.source.window.clone();
        let columns = self.source.columns.used();
        self.source.file.blocks(&columns, window, samples, advance, &mut |block| {
            let stretch = self.source.sorted(block, first)?;
            first += advance;
            take(&stretch)
        })
    }
}

impl Source {
    /// Some samples of the columns used, from sample `first` on, counted from 1.
    fn sorted(&self, mut block: DMatrix<f64>, first: usize) -> Result<Measurement, CliError> {
        for (mut column, offset) in block.column_iter_mut().zip(&self.offsets) {
            column.add_scalar_mut(-offset);
        }
        self.units.convert(&mut block);
        let sampling = self.sampling.with_len(block.nrows())?;
        let mut next = block.column_iter();
        let mut take = |columns: &[String]| {
            let mut data = DMatrix::zeros(sampling.len(), columns.len());
            let used = columns.iter().enumerate().filter(|(_, c)| *c != NO_FORCE);
            for (at, column) in used.map(|(at, _)| at).zip(&mut next) {
                data.set_column(at, &column);
            }
            Record::new(sampling, data)
        };
        let force = take(&self.columns.force)?;
        let mut motion = |columns: &[String]| {
            if columns.is_empty() { Ok(None) } else { take(columns).map(Some) }
        };
        Ok(Measurement {
            file: self.file.head().file().into(),
            displacement: motion(&self.columns.displacement)?,
            velocity: motion(&self.columns.velocity)?,
            acceleration: motion(&self.columns.acceleration)?,
            first_sample: first,
            period: force.len(),
            periods: 1,
            driven: Vec::new(),
            of_units: self.units.remarks.clone(),
            force,
        })
    }
}

impl ChannelArgs {
    /// Reads the columns and cuts the window out, and holds as much of it as is said.
    pub fn record(&self, input: &RecordArgs, hold: Hold) -> Result<Recorded, CliError> {
        self.check_counts()?;
        let file = input.file(HELD)?;
        let used = self.used();
        let units = ToSi::of(file.head(), &self.roles())?;
        let time = input.needed_time_axis(file.head())?;
        let survey = file.survey(&time, &used)?;
        let units = units.at_instants(file.head(), &time, survey.sampling);
        let name = file.head().file().to_owned();
        let (start, len) = input.span(&name, survey.sampling.len())?;
        let period = input.period.unwrap_or(len);
        let offsets = match input.detrend {
            Some(Detrend::Mean) => DVector::from_vec(survey.means),
            _ => DVector::zeros(used.len()),
        };
        let peaks = survey.peaks;
        let sampling = survey.sampling;
        let window = start..start + len;
        let source = Source { file, columns: self.clone(), offsets, units, window, sampling };
        let held = hold.samples(len, period);
        let mut first = None;
        source.file.blocks(&used, start..start + held, held, held, &mut |block| {
            first = Some(source.sorted(block, start + 1)?);
            Ok::<_, CliError>(())
        })?;
        let Some(mut held) = first else { return Err(input.outside(&name, len, sampling.len())) };
        (held.period, held.periods) = (period, len / period);
        held.driven = self.driven(&held, &peaks);
        if held.driven.is_empty() {
            return Err(CliError::ZeroForce { file: name, columns: self.force.join(", ") });
        }
        Ok(Recorded { held, source })
    }

    /// The columns used, forces first.
    fn used(&self) -> Vec<&String> {
        self.roles().into_iter().map(|(column, ..)| column).collect()
    }

    /// The columns used and what they are to hold, forces first.
    fn roles(&self) -> Vec<Role<'_>> {
        let forces = self.force.iter().filter(|c| *c != NO_FORCE);
        let forces = forces.map(|column| (column, Quantity::Force, "--force"));
        let motions = [
            (&self.displacement, ResponseQuantity::Displacement.into(), "--displacement"),
            (&self.velocity, ResponseQuantity::Velocity.into(), "--velocity"),
            (&self.acceleration, ResponseQuantity::Acceleration.into(), "--acceleration"),
        ];
        let motions = motions.into_iter().flat_map(|(columns, quantity, option)| {
            columns.iter().map(move |column| (column, quantity, option))
        });
        forces.chain(motions).collect()
    }

    /// The degrees of freedom whose force is not zero throughout; `peaks` are those of the columns
    /// used, over the whole record.
    fn driven(&self, held: &Measurement, peaks: &[f64]) -> Vec<usize> {
        let mut peaks = peaks.iter();
        let acts = |(dof, column): (usize, &String)| {
            let peak = if column == NO_FORCE { None } else { peaks.next() };
            let seen = held.force.channel(dof).iter().any(|f| *f != 0.0);
            let beyond = held.held_to().is_some() && peak.is_some_and(|peak| *peak > 0.0);
            (seen || beyond).then_some(dof)
        };
        self.force.iter().enumerate().filter_map(acts).collect()
    }

    fn check_counts(&self) -> Result<(), CliError> {
        if self.force.is_empty() {
            return Err(CliError::NoForce);
        }
        let motions = [
            ("--displacement", &self.displacement),
            ("--velocity", &self.velocity),
            ("--acceleration", &self.acceleration),
        ];
        if motions.iter().all(|(_, columns)| columns.is_empty()) {
            return Err(CliError::NoMotion);
        }
        let forces = self.force.len();
        for (option, columns) in motions {
            let got = columns.len();
            if got != 0 && got != forces {
                return Err(CliError::ColumnCount { option, got, forces });
            }
        }
        Ok(())
    }
}
