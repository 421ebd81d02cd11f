//! The columns of a record as the motion of a machine.

use clap::Args;
use mechid::force::{Channel, Measurement, Quantity};
use mechid::io;
use mechid::model::Response;
use mechid::signal::Record;
use nalgebra::DMatrix;

use crate::error::CliError;
use crate::options::RecordArgs;
use crate::units::ToSi;

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

/// The window of a record, its channels described.
pub struct Motion {
    /// How messages call the file.
    pub file: String,
    pub measured: Measurement,
    /// Periods in the window; 1 for an open record.
    pub periods: usize,
    /// Which columns were in other than SI units.
    pub converted: Option<String>,
}

impl MotionArgs {
    /// Reads the columns and cuts the window out; a periodic window is averaged over its periods.
    pub fn read(
        &self,
        input: &RecordArgs,
        dofs: usize,
        periodic: bool,
    ) -> Result<Motion, CliError> {
        let groups = [
            ("--displacement", Quantity::Displacement, &self.displacement),
            ("--velocity", Quantity::Velocity, &self.velocity),
            ("--acceleration", Quantity::Acceleration, &self.acceleration),
        ];
        let (mut wanted, mut roles, mut channels) = (Vec::new(), Vec::new(), Vec::new());
        for (option, quantity, columns) in groups {
            if !columns.is_empty() && columns.len() != dofs {
                return Err(CliError::MotionCount { option, got: columns.len(), dofs });
            }
            for (dof, column) in columns.iter().enumerate().filter(|(_, c)| *c != NOT_MEASURED) {
                wanted.push(column);
                roles.push((column, held(quantity), option));
                channels.push(Channel { dof, quantity });
            }
        }
        if channels.is_empty() {
            return Err(CliError::NoMotion);
        }
        let table = input.table()?;
        let units = ToSi::of(&table, &roles)?;
        let mut record = units.record(input.window(&table, &wanted)?)?;
        let mut periods = 1;
        if periodic {
            let period = input.period.unwrap_or(record.len());
            periods = record.len() / period;
            record = record.period_mean(period)?;
        }
        let measured = Measurement::new(record, channels)?;
        Ok(Motion { file: table.file().into(), measured, periods, converted: units.remark })
    }
}

/// What a column holds that was measured as this.
fn held(quantity: Quantity) -> io::Quantity {
    match quantity {
        Quantity::Displacement => io::Quantity::Displacement,
        Quantity::Velocity => io::Quantity::Velocity,
        Quantity::Acceleration => io::Quantity::Acceleration,
    }
}

impl Motion {
    /// Displacement, velocity and acceleration of every degree of freedom, if all were measured;
    /// without accelerations these are zero.
    pub fn response(&self, dofs: usize, with_acceleration: bool) -> Option<Response> {
        let record = self.measured.record();
        let column = |quantity: Quantity, dof: usize| {
            self.measured.channels().iter().position(|c| *c == Channel { dof, quantity })
        };
        let all = |quantity: Quantity| -> Option<Record> {
            let columns: Vec<usize> =
                (0..dofs).map(|dof| column(quantity, dof)).collect::<Option<_>>()?;
            let data =
                DMatrix::from_fn(record.len(), dofs, |k, dof| record.data()[(k, columns[dof])]);
            Record::new(record.sampling(), data).ok()
        };
        let (x, v) = (all(Quantity::Displacement)?, all(Quantity::Velocity)?);
        let a = if with_acceleration {
            all(Quantity::Acceleration)?
        } else {
            Record::new(record.sampling(), DMatrix::zeros(record.len(), dofs)).ok()?
        };
        Response::new(x, v, a).ok()
    }
}
