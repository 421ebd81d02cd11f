//! What can go wrong between the command line and the result.

use mechid::signal::{counted, ordinal, told, told_to};

/// A failure of a subcommand; its message is all the user sees.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CliError {
    /// A file cannot be read, understood or written.
    #[error(transparent)]
    Io(#[from] mechid::io::IoError),
    /// The samples asked for are not all there.
    #[error(
        "the window needs samples {first} to {last} (counted from 1), {file} has {len}: choose \
         --start, --period and --periods to fit"
    )]
    Window {
        /// The record.
        file: String,
        /// First sample needed, counted from 1.
        first: usize,
        /// Last sample needed, counted from 1.
        last: usize,
        /// Samples there are.
        len: usize,
    },
    /// Neither a time column nor a sampling rate is known.
    #[error(
        "{file} has no column called time, time_s or t: name the time column with --time, or give \
         --sample-rate in Hz; its columns are {available}"
    )]
    NoTimeAxis {
        /// The record.
        file: String,
        /// Numbers and names of the columns there are.
        available: String,
    },
    /// No force was measured.
    #[error("the force is missing: name its columns with --force")]
    NoForce,
    /// No motion was measured.
    #[error(
        "the motion is missing: name its columns with --displacement, --velocity or --acceleration"
    )]
    NoMotion,
    /// The columns do not pair up with the degrees of freedom.
    #[error(
        "{option} names {} and --force {forces}: every degree of freedom needs one of each \
         (--force 0 where no force acts)", counted(*got, "column")
    )]
    ColumnCount {
        /// The option with the wrong number of columns.
        option: &'static str,
        /// Columns it names.
        got: usize,
        /// Columns that `--force` names.
        forces: usize,
    },
    /// A machine that was found cannot be led through a record.
    #[error(
        "{file}: the machine found is unstable, its free motion grows by a factor of e in {} s: it \
         cannot be led through this record; fit a longer record, other lines, or fewer parameters",
        crate::text_table::significant(1.0 / rate, 3)
    )]
    Diverges {
        /// The record.
        file: String,
        /// Rate of growth, in 1/s.
        rate: f64,
    },
    /// A column measures something else than it is used for.
    #[error(
        "{file}: column {column} is in {unit}, a unit of {measures}; {option} takes columns of {wanted}"
    )]
    Unit {
        /// The file.
        file: String,
        /// Number and name of the column.
        column: String,
        /// The unit that its name or the line of units says.
        unit: &'static str,
        /// What that measures.
        measures: mechid::io::Quantity,
        /// The option that names the column.
        option: &'static str,
        /// What it asks for.
        wanted: mechid::io::Quantity,
    },
    /// Not one motion column per degree of freedom of the machine.
    #[error(
        "{option} names {}, the machine has {}: name one for \
         each, 0 where it was not measured", counted(*got, "column"), counted(*dofs, "degree of freedom")
    )]
    MotionCount {
        /// The option with the wrong number of columns.
        option: &'static str,
        /// Columns it names.
        got: usize,
        /// Degrees of freedom of the machine.
        dofs: usize,
    },
    /// Not one noise level per measured column.
    #[error(
        "--noise gives {}, the motion has {}: give one for each",
        counted(*levels, "level"), counted(*columns, "column")
    )]
    NoiseCount {
        /// Levels given.
        levels: usize,
        /// Columns of the motion.
        columns: usize,
    },
    /// An equation of motion needs all its terms.
    #[error(
        "this method needs displacement, velocity{} of every degree of freedom: measure them, or \
         choose another --method",
        if *with_acceleration { " and acceleration" } else { "" }
    )]
    ForceMotions {
        /// Whether accelerations are needed too.
        with_acceleration: bool,
    },
    /// Lines belong to whole periods.
    #[error("the frequency domain needs whole periods: say how long one is with --period")]
    ForceNeedsPeriods,
    /// The smoother knows no periods.
    #[error("the Kalman smoother takes an open record: leave --period and --lines out")]
    KalmanIsOpen,
    /// The reconstruction failed.
    #[error(transparent)]
    Force(#[from] mechid::force::ForceError),
    /// The fit failed, and something is wrong with its data.
    #[error("{error}; {reasons}")]
    Unfit {
        /// What failed.
        error: mechid::estimate::EstimateError,
        /// What was seen before the fit.
        reasons: String,
    },
    /// The force does nothing.
    #[error(
        "{file}: the force (column {columns}) is zero throughout the window: nothing drives the machine"
    )]
    ZeroForce {
        /// The record.
        file: String,
        /// The force columns.
        columns: String,
    },
    /// A mass that no body has.
    #[error("a mass must be positive and finite, got {value} kg", value = told(*value))]
    Mass {
        /// The value given, in kg.
        value: f64,
    },
    /// Not one mass per degree of freedom.
    #[error(
        "--mass gives {}, the record has {}: give one mass for each, or \
         all entries of the {dof}×{dof} matrix row by row", counted(*got, "value"), counted(*dof, "degree of freedom")
    )]
    MassCount {
        /// Values given.
        got: usize,
        /// Degrees of freedom.
        dof: usize,
    },
    /// There is no line at all.
    #[error("no excited line: over a period of {} the force does not vary", counted(*period, "sample"))]
    StillForce {
        /// Samples in the period.
        period: usize,
    },
    /// No line of the band is driven.
    #[error(
        "no excited line between {low_hz} and {high_hz} Hz: the force has its lines between \
         {first_hz} and {last_hz} Hz",
        low_hz = told(*low_hz), high_hz = told(*high_hz),
        first_hz = told_to(*first_hz, 6), last_hz = told_to(*last_hz, 6)
    )]
    EmptyBand {
        /// Lower end asked for, in Hz.
        low_hz: f64,
        /// Upper end asked for, in Hz.
        high_hz: f64,
        /// Lowest frequency with force, in Hz.
        first_hz: f64,
        /// Highest frequency with force, in Hz.
        last_hz: f64,
    },
    /// None of the lines chosen is driven.
    #[error("no excited line among {lines}: the force has its lines between {first} and {last}")]
    NoExcitedLine {
        /// The choice.
        lines: String,
        /// Lowest line with force.
        first: usize,
        /// Highest line with force.
        last: usize,
    },
    /// The time domain needs the whole state.
    #[error(
        "in the time domain --displacement and --velocity are both needed (in the frequency domain \
         one kind of motion is enough); with displacement or acceleration alone, --derivatives says \
         how to find the others: spectral for whole periods, savitzky-golay:WINDOW:ORDER for any record"
    )]
    TimeDomainMotions,
    /// Derivatives belong to one measured motion.
    #[error(
        "--derivatives completes a record of the displacement alone or of the acceleration alone: name \
         one of them, or leave --derivatives out"
    )]
    NothingToDerive,
    /// Second derivatives fit the equation of motion only.
    #[error(
        "with the acceleration alone, a sliding polynomial gives second derivatives of force and motion, \
         which only the equation of motion takes: leave --between-samples out"
    )]
    TwiceDifferentiated,
    /// An option without its object.
    #[error("{option} {why}")]
    MisplacedOption {
        /// The option.
        option: &'static str,
        /// What is wrong with it there.
        why: &'static str,
    },
    /// Frequency responses have no halves.
    #[error(
        "instrumental variables need periods, not their averages: leave --from-frf or --method \
         instrumental out"
    )]
    InstrumentalResponses,
    /// Which samples are to be predicted is open.
    #[error(
        "--validate-samples {samples} of which record? Name another one with --validate, or the first \
         sample of this one with --validate-start"
    )]
    ValidationStart {
        /// Samples asked for.
        samples: usize,
    },
    /// A steady state is predicted over whole periods.
    #[error("--validate-samples {samples} is less than one period of {period}")]
    ValidationPeriod {
        /// Samples asked for.
        samples: usize,
        /// Samples in a period.
        period: usize,
    },
    /// No receptance can be read off the record.
    #[error(
        "nothing to plot: several forces act on every line, so the record shows no single receptance"
    )]
    NothingToDraw,
    /// A record without numbers but those of time.
    #[error("{file}: nothing to plot: no column other than time holds numbers")]
    NoColumnToDraw { file: String },
    /// A mass without a spring.
    #[error("{file}: nothing to plot: the machine has no natural frequency other than zero")]
    NothingResonates { file: String },
    /// A fit sample by sample has no receptances.
    #[error("there are no spectra to draw: the fit was done sample by sample")]
    NoSpectra,
    /// A covariance names a parameter the machine does not have.
    #[error("{file}: the covariance names \"{name}\"; the parameters of this machine are {known}")]
    UnknownParameter {
        /// The report.
        file: String,
        /// The name found.
        name: String,
        /// The names there can be.
        known: String,
    },
    /// A figure cannot be drawn.
    #[error(transparent)]
    Plot(#[from] mechid::plot::PlotError),
    /// A time-stepping scheme refuses.
    #[error(transparent)]
    Integrate(#[from] mechid::integrate::IntegrateError),
    /// The simulation failed.
    #[error(transparent)]
    Simulate(#[from] mechid::SimulateError),
    /// A record has no such rate.
    #[error(
        "a record of {own_hz} Hz has no samples at {rate_hz} Hz: its rates are {own_hz} Hz divided by \
         whole numbers"
    )]
    SweepRate {
        /// The rate asked for, in Hz.
        rate_hz: f64,
        /// The rate of the record, in Hz.
        own_hz: f64,
    },
    /// Samples cannot be taken that often.
    #[error("every n-th sample of a record: n is a whole number, got {value}")]
    Decimation {
        /// The number asked for.
        value: f64,
    },
    /// The period is lost.
    #[error("a period of {} is no whole number of every {} sample", counted(*period, "sample"), ordinal(*factor))]
    DecimatedPeriod {
        /// Samples in a period.
        period: usize,
        /// Every how many-th is taken.
        factor: usize,
    },
    /// The estimator needs what was not measured.
    #[error("this --estimator needs the {wanted}: name its columns with --{wanted}")]
    SweepMotion {
        /// What is missing.
        wanted: mechid::model::ResponseQuantity,
    },
    /// No setting of a sweep gave an estimate.
    #[error(
        "no setting gave an estimate; at the first one, {setting}: {reason}",
        setting = told(*setting)
    )]
    EmptySweep {
        /// The first setting.
        setting: f64,
        /// What went wrong there.
        reason: String,
    },
    /// More numbers than can be held.
    #[error(
        "a record of {numbers} numbers is too large, {largest} is the limit: fewer --samples, \
         --periods or --inputs"
    )]
    RecordSize {
        /// Samples times columns.
        numbers: usize,
        /// The limit.
        largest: usize,
    },
    /// The identification failed.
    #[error(transparent)]
    Estimate(#[from] mechid::estimate::EstimateError),
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid::signal::SignalError),
    /// A model cannot be used.
    #[error(transparent)]
    Model(#[from] mechid::model::ModelError),
    /// Two things on one stream.
    #[error(
        "standard output takes one thing, not {}{}",
        counted(*files, "file"),
        if *json { " and the report: name files, or leave --json out" } else { ": name the others" }
    )]
    SharedOutput {
        /// Files that are to go there.
        files: usize,
        /// Whether the report as JSON goes there, too.
        json: bool,
    },
    /// The report cannot be printed.
    #[error("cannot print the report: {0}")]
    Print(#[from] std::io::Error),
    /// The report has no JSON form.
    #[error("cannot write the report as JSON: {0}")]
    Json(#[from] serde_json::Error),
}
