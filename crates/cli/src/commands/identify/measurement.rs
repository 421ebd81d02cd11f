//! The columns of a record as the forces and motions of a machine.

use clap::Args;
use mechid::estimate::frequency_domain::Motion;
use mechid::signal::Record;
use nalgebra::DMatrix;

use crate::error::CliError;
use crate::options::RecordArgs;

/// Which columns hold what; one column per degree of freedom, in the same order everywhere.
#[derive(Debug, Args)]
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

/// The window of a record, sorted into forces and motions.
#[derive(Debug)]
pub struct Measurement {
    /// How messages call the file.
    pub file: String,
    /// Samples × degrees of freedom, in N.
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
}

impl Measurement {
    /// The first kind of motion measured, and what it is.
    pub fn motion(&self) -> (&Record, Motion) {
        let (kind, record) = self.motions()[0];
        (record, kind)
    }

    /// Every kind of motion measured.
    pub fn motions(&self) -> Vec<(Motion, &Record)> {
        let candidates = [
            (Motion::Displacement, &self.displacement),
            (Motion::Velocity, &self.velocity),
            (Motion::Acceleration, &self.acceleration),
        ];
        let measured = candidates.into_iter();
        measured.filter_map(|(kind, record)| Some((kind, record.as_ref()?))).collect()
    }
}

impl ChannelArgs {
    /// Reads the columns and cuts the window out.
    pub fn measure(&self, input: &RecordArgs) -> Result<Measurement, CliError> {
        self.check_counts()?;
        let table = input.table()?;
        let forces = self.force.iter().filter(|c| *c != NO_FORCE);
        let groups = [&self.displacement, &self.velocity, &self.acceleration];
        let wanted: Vec<&String> = forces.chain(groups.into_iter().flatten()).collect();
        let record = input.window(&table, &wanted)?;
        let mut next = 0;
        let mut take = |columns: &[String]| {
            let data = DMatrix::from_columns(
                &columns
                    .iter()
                    .map(|column| match column.as_str() {
                        NO_FORCE => DMatrix::zeros(record.len(), 1).column(0).into_owned(),
                        _ => {
                            next += 1;
                            record.column(next - 1).into_owned()
                        }
                    })
                    .collect::<Vec<_>>(),
            );
            Record::new(record.sampling(), data)
        };
        let force = take(&self.force)?;
        if force.data().iter().all(|f| *f == 0.0) {
            let columns = self.force.join(", ");
            return Err(CliError::ZeroForce { file: table.file().into(), columns });
        }
        let mut motion = |columns: &[String]| {
            if columns.is_empty() { Ok(None) } else { take(columns).map(Some) }
        };
        let period = input.period.unwrap_or(record.len());
        Ok(Measurement {
            file: table.file().into(),
            displacement: motion(&self.displacement)?,
            velocity: motion(&self.velocity)?,
            acceleration: motion(&self.acceleration)?,
            first_sample: input.start,
            periods: force.len() / period,
            period,
            force,
        })
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
