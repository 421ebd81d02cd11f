//! Errors of an analysis, from the reading of a record to the result.

use mechid_estimate::EstimateError;
use mechid_io::{Quantity, escaped};
use mechid_model::ResponseQuantity;
use mechid_signal::message;

use crate::identify::Unscaled;
use crate::text::significant;

/// A failure of an analysis.
///
/// Messages name settings by the fields of the option structs, between backticks, so that each
/// interface can show its own spelling (`--sample-rate` on the command line).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AnalysisError {
    /// A file cannot be read or understood.
    #[error(transparent)]
    Io(#[from] mechid_io::IoError),
    /// A machine of named elements cannot be identified.
    #[error(transparent)]
    Likelihood(#[from] mechid_estimate::likelihood::LikelihoodError),
    /// The data determine none of the unknowns, or too few for a machine.
    #[error(
        "{combinations}: add a sensor or a force, or state a coefficient or its prior; \
         \"candidates\" in the description of the machine show what a measurement would add"
    )]
    Undetermined {
        /// Unknowns, and the combinations that the data determine, a sentence each.
        combinations: String,
    },
    /// No modes can be identified from the responses alone.
    #[error(transparent)]
    Ambient(#[from] mechid_modal::ambient::AmbientError),
    /// No modes can be identified.
    #[error(transparent)]
    Modal(#[from] mechid_modal::ModalError),
    /// The record does not have all samples of the window.
    #[error(
        "the window needs samples {first} to {last} (counted from 1), but {file} has {len}: \
         choose `start`, `period` and `periods` so that the window fits"
    )]
    Window {
        /// The record.
        file: String,
        /// First sample needed, counted from 1.
        first: usize,
        /// Last sample needed, counted from 1.
        last: usize,
        /// Number of samples in the record.
        len: usize,
    },
    /// The record has no time column, and no sampling rate is given.
    #[error(
        "{file} has no column called time, time_s or t{}: name the time column with `time`, or give \
         `sample_rate` in Hz; its columns are {available}",
        unclear_time(unclear.as_ref())
    )]
    NoTimeAxis {
        /// The record.
        file: String,
        /// Numbers and names of the columns of the record.
        available: String,
        /// A time column whose unit is not understood, and the text of this unit.
        unclear: Option<(String, String)>,
    },
    /// A file of many records does not contain the requested one, or none was requested.
    #[error("{file} holds {} ({available}){}", message::count(*records, "record"), other(id.as_deref()))]
    RecordId {
        /// The file.
        file: String,
        /// The requested record.
        id: Option<String>,
        /// Number of records in the file.
        records: usize,
        /// Some of the records in the file.
        available: String,
    },
    /// An array in memory has no column of this name.
    #[error("there is no column \"{column}\"; the columns are {available}")]
    NoColumn {
        /// The requested column.
        column: String,
        /// Names of the columns.
        available: String,
    },
    /// An array in memory has another shape than the others.
    #[error(
        "{name} has {} × {} values, expected {} × {} (samples × degrees of freedom)",
        got[0], got[1], expected[0], expected[1]
    )]
    ArrayShape {
        /// Name of the array.
        name: String,
        /// Samples and columns of the array.
        got: [usize; 2],
        /// Samples and columns of the other arrays.
        expected: [usize; 2],
    },
    /// No record was given.
    #[error("no record: an identification needs at least one")]
    NoRecord,
    /// Two records of one analysis are equal in every sample.
    #[error(
        "{first} and {second} are equal in every sample: they are one test. A test that \
         is counted twice halves the variances of all results; leave one of the two out"
    )]
    RepeatedRecord {
        /// The record given first.
        first: String,
        /// The record that repeats the first one.
        second: String,
    },
    /// A table of frequency responses does not contain all responses for its forces and points.
    #[error(
        "{file} has no response at {response} to a force at {force}: every point needs a response to \
         every force, and every force needs a response at its point (choose `points`){advice}"
    )]
    NoResponse {
        /// The table.
        file: String,
        /// Point of the response.
        response: String,
        /// Point of the force.
        force: String,
        /// Further advice, beginning with its punctuation; empty if there is none.
        advice: &'static str,
    },
    /// A file is neither a record with named columns nor a table of frequency responses.
    #[error(
        "{file}: name the columns of the response with `displacement`, `velocity` or `acceleration`; without \
         such a name, the file is read as a table of frequency responses, but it has no column such as \
         h_1_1_real; its \
         columns are {available}"
    )]
    NeitherRecordNorTable {
        /// The file.
        file: String,
        /// Numbers and names of the columns of the file.
        available: String,
    },
    /// A table does not have the responses of all points to a force.
    #[error(
        "{file} has no response at {response} to the force at {force}, only to other forces: a mode \
         shape needs the responses of all points to every force"
    )]
    MissingResponse {
        /// The table.
        file: String,
        /// Point of the response.
        response: String,
        /// Point of the force.
        force: String,
    },
    /// Responses without power in the band.
    #[error(
        "{columns}: constant or zero in the band; the sensor may be dead or not connected: leave it out"
    )]
    DeadResponses {
        /// Names of the responses.
        columns: String,
    },
    /// Forces without power in the band.
    #[error(
        "force {columns}: constant or zero in the band; the shaker may be off or not connected: leave it \
         out of `force`"
    )]
    DeadForces {
        /// Names of the forces.
        columns: String,
    },
    /// A record does not decay.
    #[error(
        "{file} does not decay: the second half of the response has more power than the first. Possible causes: an \
         unstable system, a force that still acts, or a record that begins before the release"
    )]
    NoDecay {
        /// The record.
        file: String,
    },
    /// No candidate is a mode.
    #[error("no mode from {from_hz:.6} to {to_hz:.6} Hz{candidates}")]
    NoMode {
        /// Lowest frequency, in Hz.
        from_hz: f64,
        /// Highest frequency, in Hz.
        to_hz: f64,
        /// The candidates with the reasons of their rejection; empty if there are none.
        candidates: String,
    },
    /// A force is a combination of the others on every line.
    #[error(
        "force {force} is a multiple of {others} in the band (independent part {own_share:.1e}): their \
         responses cannot be separated; record a test in which this force varies independently, or leave it out of \
         `force`"
    )]
    DependentForces {
        /// The force.
        force: String,
        /// Names of the forces before `force` in the list.
        others: String,
        /// Ratio of the RMS of the independent part of this force to the RMS of the force.
        own_share: f64,
    },
    /// A file has no modes that can be compared.
    #[error(
        "{file} has no modes to compare: each mode needs a frequency, and all shapes need the same length"
    )]
    NothingToCompare {
        /// The file.
        file: String,
    },
    /// A JSON file that should contain saved modes is not a result with modes.
    #[error("{file} is not a result with modes: {why}")]
    SavedModes {
        /// The file.
        file: String,
        /// The reason.
        why: String,
    },
    /// Two sets of modes have no point in common.
    #[error(
        "{first} has shapes at {points}, {second} at {other_points}: no point in common; name the places \
         of the responses (`response_at`) with the names of the other set, such as 3 or 12+Z"
    )]
    NoCommonPoint {
        /// The first set.
        first: String,
        /// Points of the first set of modes.
        points: String,
        /// The second set.
        second: String,
        /// Points of the second set of modes.
        other_points: String,
    },
    /// An indicator of modes cannot be computed.
    #[error("{error}")]
    Indicator {
        /// The failure.
        error: mechid_modal::indicators::IndicatorError,
    },
    /// No force column is named.
    #[error("the force is missing: name its columns with `force`")]
    NoForce,
    /// No response column is named.
    #[error(
        "the response is missing: name its columns with `displacement`, `velocity` or `acceleration`"
    )]
    NoMotion,
    /// The columns do not pair up with the degrees of freedom.
    #[error(
        "`{response}` names {}, but `force` names {forces}: every degree of freedom needs one response and one force \
         (`force` 0 where no force acts)", message::count(*got, "column")
    )]
    ColumnCount {
        /// Kind of response with the wrong number of columns.
        response: ResponseQuantity,
        /// Number of columns given.
        got: usize,
        /// Number of force columns.
        forces: usize,
    },
    /// The identified system is unstable, so its response to a record cannot be predicted.
    #[error(
        "{file}: the identified system is unstable (free response grows e-fold every {} s), so its \
         response to this record cannot be predicted; fit a longer record, other lines, or fewer \
         parameters",
        significant(1.0 / rate, 3)
    )]
    Diverges {
        /// The record.
        file: String,
        /// Rate of growth, in 1/s.
        rate: f64,
    },
    /// A column is in a unit of another quantity than required.
    #[error(
        "{file}: column {column} is in {unit}, a unit of {measures}; `{setting}` takes columns of {wanted}{}",
        support_advice(*measures, *wanted)
    )]
    Unit {
        /// The record.
        file: String,
        /// Number and name of the column.
        column: String,
        /// Unit that the name of the column or the line of units states.
        unit: String,
        /// Quantity that the unit measures.
        measures: Quantity,
        /// Setting that names the column.
        setting: &'static str,
        /// Required quantity.
        wanted: Quantity,
    },
    /// The number of response columns differs from the number of degrees of freedom of the system.
    #[error(
        "`{response}` names {}, but the system has {}: name one column for each, or 0 if there is no measurement",
        message::count(*got, "column"), message::count(*dofs, "degree of freedom")
    )]
    MotionCount {
        /// Kind of response with the wrong number of columns.
        response: ResponseQuantity,
        /// Number of columns given.
        got: usize,
        /// Degrees of freedom of the system.
        dofs: usize,
    },
    /// A force is to be identified on a degree of freedom that the system does not have.
    #[error(
        "`forced` names degree of freedom {dof} (counted from 1), but the system has {}",
        message::count(*dofs, "degree of freedom")
    )]
    Forced {
        /// Degree of freedom, counted from 1.
        dof: usize,
        /// Degrees of freedom of the system.
        dofs: usize,
    },
    /// The number of noise levels differs from the number of measured columns.
    #[error(
        "`noise` gives {}, but the response has {}: give one level for each column",
        message::count(*levels, "level"), message::count(*columns, "column")
    )]
    NoiseCount {
        /// Number of levels given.
        levels: usize,
        /// Number of response columns.
        columns: usize,
    },
    /// The equation of motion needs all its terms.
    #[error(
        "this method needs displacement, velocity{} of every degree of freedom: measure them, or \
         choose another `method`",
        if *with_acceleration { " and acceleration" } else { "" }
    )]
    ForceMotions {
        /// `true` if accelerations are needed, too.
        with_acceleration: bool,
    },
    /// The frequency domain needs whole periods, and no period was given.
    #[error("the frequency domain needs whole periods: give the length of a period (`period`)")]
    ForceNeedsPeriods,
    /// The Kalman smoother needs an open record, and a period or lines were given.
    #[error("the Kalman smoother is for open records: leave `period` and `lines` out")]
    KalmanIsOpen,
    /// The method cannot keep the force within a frequency band.
    #[error(
        "the force from sample to sample (`discretised`) cannot be restricted to the band from {low_hz} \
         to {high_hz} Hz: leave `band_hz` out, or choose another `method`"
    )]
    BandMethod {
        /// Lower end of the band, in Hz.
        low_hz: f64,
        /// Upper end of the band, in Hz.
        high_hz: f64,
    },
    /// A bearing with an invalid description.
    #[error(transparent)]
    Bearing(#[from] mechid_bearing::BearingError),
    /// The reconstruction failed.
    #[error(transparent)]
    Force(#[from] mechid_force::ForceError),
    /// The fit failed for reasons shown by the checks of its data.
    #[error("{error}; {reasons}")]
    Unfit {
        /// The failure.
        error: EstimateError,
        /// Findings of the checks, or of a fit with another model that succeeds.
        reasons: String,
    },
    /// The data determine neither a parameter nor a mode of the machine.
    #[error("the data do not determine the machine: {why}")]
    NothingDetermined {
        /// Reason, with the numbers.
        why: String,
    },
    /// The force is zero.
    #[error(
        "{file}: the force (column {columns}) is zero throughout the window: nothing drives the machine"
    )]
    ZeroForce {
        /// The record.
        file: String,
        /// The force columns.
        columns: String,
    },
    /// A known mass is not positive.
    #[error("a mass must be positive and finite, got {value} kg", value = message::number(*value))]
    Mass {
        /// The value given, in kg.
        value: f64,
    },
    /// The number of masses differs from both the number of degrees of freedom and the number of
    /// matrix entries.
    #[error(
        "`mass` gives {}, the record has {}: give one mass for each, or all entries of the \
         {dof}×{dof} matrix row by row", message::count(*got, "value"), message::count(*dof, "degree of freedom")
    )]
    MassCount {
        /// Number of values given.
        got: usize,
        /// Degrees of freedom.
        dof: usize,
    },
    /// The force has no spectral line.
    #[error("no excited line: the force does not vary over a period of {}", message::count(*period, "sample"))]
    StillForce {
        /// Number of samples in the period.
        period: usize,
    },
    /// No input varies.
    #[error(
        "no measured force or other input varies in any record, so no input excites the machine. Leave the \
         inputs out: the record is then a free decay, or with `ambient` the response to forces that were not measured"
    )]
    IdleInputs,
    /// The force has no spectral line in the band.
    #[error(
        "no excited line between {low_hz} and {high_hz} Hz: the excited lines are between \
         {first_hz} and {last_hz} Hz",
        low_hz = message::number(*low_hz), high_hz = message::number(*high_hz),
        first_hz = message::number_to(*first_hz, 6), last_hz = message::number_to(*last_hz, 6)
    )]
    EmptyBand {
        /// Requested lower end, in Hz.
        low_hz: f64,
        /// Requested upper end, in Hz.
        high_hz: f64,
        /// Lowest frequency with force, in Hz.
        first_hz: f64,
        /// Highest frequency with force, in Hz.
        last_hz: f64,
    },
    /// None of the chosen lines carries force.
    #[error("no excited line among {lines}: the excited lines are between {first} and {last}")]
    NoExcitedLine {
        /// The choice.
        lines: String,
        /// Lowest line with force.
        first: usize,
        /// Highest line with force.
        last: usize,
    },
    /// The time domain needs both displacement and velocity.
    #[error(
        "in the time domain `displacement` and `velocity` are both needed (in the frequency domain \
         one kind of response is enough); with displacement or acceleration alone, `derivatives` sets \
         how the other motions are computed: spectral for whole periods, savitzky-golay:WINDOW:ORDER for any record"
    )]
    TimeDomainMotions,
    /// Derivatives are computed from one measured kind of response only.
    #[error(
        "`derivatives` computes the other motions from the displacement alone or from the acceleration \
         alone: name only one of these, or leave `derivatives` out"
    )]
    NothingToDerive,
    /// Second derivatives are only for the fit of the equation of motion.
    #[error(
        "with the acceleration alone, a sliding polynomial gives second derivatives of force and \
         response. Only the fit of the equation of motion uses these derivatives: leave `between_samples` out"
    )]
    TwiceDifferentiated,
    /// Instrumental variables need two halves of the periods, which averaged frequency responses do
    /// not have.
    #[error(
        "instrumental variables need single periods, not averages: leave `from_frf` or `method` \
         instrumental out"
    )]
    InstrumentalResponses,
    /// The record for validation is shorter than one period.
    #[error("`validate`: {samples} samples are less than one period of {period}")]
    ValidationPeriod {
        /// Number of samples asked for.
        samples: usize,
        /// Number of samples in a period.
        period: usize,
    },
    /// The record for validation has other columns than the fitted records.
    #[error("{file} has {got} degrees of freedom, the identified system has {dofs}")]
    DegreesOfFreedom {
        /// The record, or the file of the system.
        file: String,
        /// Degrees of freedom of the system.
        got: usize,
        /// Degrees of freedom of the system that the record or system is compared with.
        dofs: usize,
    },
    /// A covariance names a parameter that the system does not have.
    #[error("{file}: the covariance names \"{name}\"; the parameters of this machine are {known}")]
    UnknownParameter {
        /// The file.
        file: String,
        /// Name of the unknown parameter.
        name: String,
        /// Names of the parameters of the system.
        known: String,
    },
    /// The machine has nonlinear terms, and the measured responses are not sufficient for them.
    #[error(
        "{file}: this machine has nonlinear terms ({terms}), so its force is reconstructed by the \
         equation of motion. This method needs displacement, velocity and acceleration of every degree of \
         freedom, and `forced` must not exclude a degree of freedom"
    )]
    NonlinearMachine {
        /// The file of the machine.
        file: String,
        /// Nonlinear terms of the machine.
        terms: String,
    },
    /// The record cannot be decimated to the requested sampling rate.
    #[error(
        "a record sampled at {own_hz} Hz cannot be reduced to {rate_hz} Hz: possible rates are {own_hz} \
         Hz divided by whole numbers"
    )]
    SweepRate {
        /// Requested rate, in Hz.
        rate_hz: f64,
        /// Sampling rate of the record, in Hz.
        own_hz: f64,
    },
    /// NPI (cycles of the natural frequency per period) needs a described experiment, whose
    /// sampling can be chosen.
    #[error(
        "`npi` applies only to a described experiment, whose sampling rate can be chosen; for a record, \
         use `decimate`, which takes every n-th sample"
    )]
    NpiOfRecord,
    /// A decimation must be a whole number.
    #[error(
        "a decimation takes every n-th sample of a record: n must be a whole number, got {value}"
    )]
    Decimation {
        /// Given value of n, a pure number: every n-th sample is to be taken.
        value: f64,
    },
    /// A period is not a whole number of decimated samples.
    #[error("a period of {} cannot be reduced to every {} sample: the ratio must be a whole number", message::count(*period, "sample"), message::ordinal(*factor))]
    DecimatedPeriod {
        /// Number of samples in a period.
        period: usize,
        /// The decimation.
        factor: usize,
    },
    /// The estimator needs a response that was not measured.
    #[error("this `estimator` needs the {wanted}: name its columns with `{wanted}`")]
    SweepMotion {
        /// The response that is missing.
        wanted: ResponseQuantity,
    },
    /// A sweep was requested without a setting.
    #[error("a sweep needs at least one setting")]
    NoSetting,
    /// No setting of a sweep gave an estimate.
    #[error(
        "no setting gave an estimate; the reason at the first setting, {setting}, is: {reason}",
        setting = message::number(*setting)
    )]
    EmptySweep {
        /// First setting of the sweep, in the unit of the swept quantity.
        setting: f64,
        /// Reason of the failure at this setting.
        reason: String,
    },
    /// An experiment cannot be simulated at a setting of a sweep.
    #[error("{0}")]
    Simulation(String),
    /// No record shows a receptance.
    #[error(
        "the record shows no receptance: several forces act on every line, so the response to one force \
         alone was not measured"
    )]
    NoReceptance,
    /// A record of a hammer test has no good hit.
    #[error("no usable hit in {file}: {reasons}")]
    NoHit {
        /// The record.
        file: String,
        /// Reasons, hit by hit.
        reasons: String,
    },
    /// The computation needs more memory than the limit for a file of this size.
    #[error(
        "{file}: an analysis of {numbers} numbers needs about {} GB of memory, but the limit for a file \
         of this size is {} GB; if the record is correct and the memory is available, set `memory_gb`: {}",
        message::number(two_digits(*needed_gb)),
        message::number(two_digits(*allowed_gb)),
        message::number(needed_gb.ceil())
    )]
    Memory {
        /// The record.
        file: String,
        /// Quantity of numbers that the computation stores at once.
        numbers: usize,
        /// Estimate of the required memory, in units of GB.
        needed_gb: f64,
        /// The limit, in units of GB.
        allowed_gb: f64,
    },
    /// A record of a fleet exceeded its memory limit.
    #[error("the record took more than {gb} GB of memory, and the process that worked on it was ended; `record_memory_gb` sets the limit",
        gb = message::number(*gb))]
    RecordMemory {
        /// The limit, in units of GB.
        gb: f64,
    },
    /// A record of a fleet exceeded its time limit.
    #[error("the record took more than {seconds} s, and the process that worked on it was ended; `record_seconds` sets the limit",
        seconds = message::number(*seconds))]
    RecordTime {
        /// The limit, in s.
        seconds: f64,
    },
    /// The time limit has ended the work before there was a result.
    #[error(
        "the time limit of {seconds} s ended the work before there was a result ({failure}): raise `time_limit`"
    )]
    TimeLimit {
        /// The limit, in s.
        seconds: f64,
        /// Failure with which the work ended after the time limit, in a sentence.
        failure: String,
    },
    /// The searches reached the limit of the work before there was a result.
    #[error(
        "the searches reached the limit of the work for a file of this size ({operations:.1e} operations) before \
         there was a result ({failure}): a time (`time_limit`) replaces this limit"
    )]
    WorkLimit {
        /// The limit, a number of operations (pure number).
        operations: f64,
        /// Failure with which the work ended at the limit, in a sentence.
        failure: String,
    },
    /// The process that analysed a record of a fleet ended without a usable result, or could not be
    /// started.
    #[error("the process that worked on the record has ended: {how}")]
    RecordProcess {
        /// Exit status of the process and its message, in words.
        how: String,
    },
    /// A setting cannot be understood.
    #[error("`{setting}`: {why}")]
    Setting {
        /// The setting.
        setting: &'static str,
        /// The reason.
        why: String,
    },
    /// M, C and K have no scale: the data determine only the modes.
    #[error("{unscaled}")]
    Unscaled {
        /// Equations of motion whose entries in M, C and K are not reported.
        unscaled: Unscaled,
    },
    /// The identification failed.
    #[error(transparent)]
    Estimate(#[from] EstimateError),
    /// A free decay cannot be identified.
    #[error(transparent)]
    FreeDecay(#[from] mechid_modal::free_decay::FreeDecayError),
    /// Spectral lines are unusable.
    #[error(transparent)]
    Spectra(#[from] mechid_spectra::SpectraError),
    /// A numerical method fails.
    #[error(transparent)]
    Numerics(#[from] mechid_numerics::NumericsError),
    /// A signal cannot be used.
    #[error(transparent)]
    Signal(#[from] mechid_signal::SignalError),
    /// A model cannot be used.
    #[error(transparent)]
    Model(#[from] mechid_model::ModelError),
}

impl From<mechid_modal::indicators::IndicatorError> for AnalysisError {
    fn from(error: mechid_modal::indicators::IndicatorError) -> Self {
        Self::Indicator { error }
    }
}

impl AnalysisError {
    /// Returns a stable identifier of the failure for programs, such as `io.missing-column` or
    /// `analysis.window`. The first word names a part of the library, and the second is the variant
    /// of the innermost failure.
    ///
    /// ```
    /// use mechid_analysis::{AnalysisError, Machine};
    ///
    /// assert_eq!(AnalysisError::NoRecord.code(), "analysis.no-record");
    /// assert_eq!(Machine::read("no-such-file").unwrap_err().code(), "io.read");
    /// ```
    pub fn code(&self) -> String {
        // A derived `Debug` writes a wrapped variant in parentheses after its outer variant.
        let written = format!("{self:?}");
        let (mut rest, mut names) = (written.as_str(), vec!["Analysis"]);
        loop {
            let end = rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len());
            if !rest.starts_with(|c: char| c.is_ascii_uppercase()) {
                break;
            }
            names.push(&rest[..end]);
            match rest[end..].strip_prefix('(') {
                Some(inner) => rest = inner,
                None => break,
            }
        }
        let [part, name] = [names[names.len() - 2], names[names.len() - 1]];
        format!("{}.{}", kebab(part_of_library(part, name)), kebab(name))
    }
}

impl AnalysisError {
    /// Returns the error of a description that does not make sense.
    pub(crate) fn machine(error: mechid_model::elements::MachineError) -> Self {
        Self::Likelihood(error.into())
    }
}

/// Returns the first part of an error code, which names a part of the library. An error that has
/// moved to another crate keeps its code.
fn part_of_library<'a>(part: &'a str, name: &str) -> &'a str {
    match (part, name) {
        ("Numerics", "EntryNotFinite" | "ExponentialOverflow" | "NotConverged" | "NotSquare") => {
            "Model"
        }
        ("Numerics" | "Spectra" | "FreeDecay", _) | ("Signal", "TooShort") => "Estimate",
        _ => part,
    }
}

/// Returns a size with two digits.
fn two_digits(size: f64) -> f64 {
    format!("{size:.1e}").parse().unwrap_or(size)
}

/// Returns the reason why no record could be selected.
fn other(id: Option<&str>) -> String {
    match id {
        Some(id) => format!(", but none of them is {}", escaped(id)),
        None => ": choose one with `record_id`".into(),
    }
}

/// Returns the name of a variant in lower case, its words joined by hyphens.
fn kebab(name: &str) -> String {
    let mut text = String::new();
    for (at, letter) in name.char_indices() {
        if letter.is_ascii_uppercase() && at > 0 {
            text.push('-');
        }
        text.push(letter.to_ascii_lowercase());
    }
    text
}

/// Returns a remark about a time column with an unknown unit.
fn unclear_time(unclear: Option<&(String, String)>) -> String {
    unclear.map_or_else(String::new, |(column, text)| {
        format!(
            " in a unit of time (\"{text}\" of column {column} is not a known unit: state the unit (`unit`), or \
             name the column to read it in seconds)"
        )
    })
}

/// Returns advice if the column of a response was given as a force, otherwise an empty text.
fn support_advice(measures: Quantity, wanted: Quantity) -> &'static str {
    if wanted == Quantity::Force && matches!(measures, Quantity::Response(_)) {
        return "; the motion of a support is an input of a machine of named elements (`machine`)";
    }
    ""
}
