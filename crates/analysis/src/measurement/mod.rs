//! Measured forces and responses: file or arrays, columns, and window.

pub mod channels;
#[cfg(feature = "parquet")]
mod many;
mod reading;
mod repeated;
mod stated;
pub mod units;
mod window;

use std::path::{Path, PathBuf};
use std::sync::Arc;

use mechid_checks::Finding;
use mechid_io::{Limits, RecordFile, name_without_unit, stated_unit};
use mechid_model::ResponseQuantity;
use mechid_signal::{Record, Sampling};
use nalgebra::DMatrix;

use self::channels::ABSENT;
pub use self::channels::Channels;
#[cfg(feature = "parquet")]
pub(crate) use self::many::{open_all, records_of};
pub use self::reading::{Detrend, Reading, RecordPlan};
pub(crate) use self::repeated::check_distinct;
use self::units::ToSi;
pub(crate) use self::window::Hold;
pub use self::window::{Window, Windowed};
use crate::AnalysisError;
use crate::limits::{FEW_CHANNELS, PAIR_BYTES, PREDICT_BYTES, check_memory};

/// Number of samples of a window that are buffered in memory if the whole window is not needed; a
/// buffer of whole periods may be smaller or larger, and a caller may request more samples.
pub const IN_MEMORY_SAMPLES: usize = 1 << 18;

/// Number of samples read at a time from a window that is not buffered.
pub const CHUNK_SAMPLES: usize = 1 << 16;

/// Forces and responses of a machine, in a file of any length or in memory, and the window to use.
///
/// Columns in other units are converted to SI units, from files and from arrays.
///
/// ```
/// use mechid_analysis::{Channels, Measurement, ResponseQuantity};
/// use mechid_signal::Sampling;
///
/// let (force, x) = (vec![1.0, 2.0, 1.0, 2.0], vec![10.0, 20.0, 10.0, 20.0]);
/// let columns = [("force", force.as_slice()), ("x [um]", x.as_slice())];
/// let channels = Channels::new("force", ResponseQuantity::Displacement, "x [um]");
/// let test = Measurement::from_columns(Sampling::new(0.01, 4)?, &columns, &channels)?.period(2)?;
/// assert!((test.responses()?[0].1.channel(0)[1] / 20e-6 - 1.0).abs() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone)]
pub struct Measurement {
    source: Arc<RecordSource>,
    window: Window,
}

/// Samples of the used columns, and their statistics from one pass.
#[derive(Debug)]
pub(crate) struct RecordSource {
    /// Name for messages.
    pub name: String,
    /// Path that the record was read from; `None` for arrays.
    pub path: Option<PathBuf>,
    pub channels: Channels,
    /// Channels with the names that results use, without units.
    pub names: Arc<Channels>,
    pub reading: Reading,
    /// Time axis of the whole record.
    pub sampling: Sampling,
    /// Largest magnitude of each column used, in its own unit.
    pub peaks: Vec<f64>,
    /// Constant to subtract from each column used, in its own unit.
    pub offsets: Vec<f64>,
    pub units: ToSi,
    /// Maximum memory of an analysis of the record, in bytes.
    memory: usize,
    samples: Samples,
}

#[derive(Debug)]
enum Samples {
    File(Box<RecordFile>),
    /// Samples in memory, samples × used columns.
    Memory(DMatrix<f64>),
}

/// Consecutive samples, sorted into forces and responses.
#[derive(Debug, Clone)]
pub struct Block {
    /// Name of the record for messages.
    pub file: String,
    /// Forces, samples × degrees of freedom, in N. For a long window, forces and responses contain
    /// only the first samples.
    pub force: Record,
    /// Displacement, samples × degrees of freedom, in m.
    pub displacement: Option<Record>,
    /// Velocity, samples × degrees of freedom, in m/s.
    pub velocity: Option<Record>,
    /// Acceleration, samples × degrees of freedom, in m/s².
    pub acceleration: Option<Record>,
    /// First sample of the window, counted from 1.
    pub first_sample: usize,
    /// Number of samples in a period.
    pub period: usize,
    /// Number of periods in the window.
    pub periods: usize,
    /// Degrees of freedom on which a force acts, counted from 0.
    pub driven: Vec<usize>,
    /// Remarks on columns that were not in SI units, and on a time axis with a doubtful unit.
    pub unit_remarks: Vec<String>,
    /// Texts in headers that may be units.
    pub unit_findings: Vec<Finding>,
    /// Names of the channels for results, without units.
    pub names: Arc<Channels>,
}

impl Measurement {
    /// Opens a record file: text, MATLAB or universal file, optionally compressed with gzip.
    ///
    /// A long text is read in one pass and not stored in memory.
    ///
    /// # Errors
    /// The errors of [`Measurement::open_with`].
    pub fn open(path: impl AsRef<Path>, channels: &Channels) -> Result<Self, AnalysisError> {
        Self::open_with(path, channels, &Reading::default())
    }

    /// Opens a record file as [`Measurement::open`] does, with a time axis, lines to skip or a mean
    /// to subtract.
    ///
    /// # Errors
    /// [`AnalysisError::Io`] if the file cannot be read or has no such columns,
    /// [`AnalysisError::NoTimeAxis`], [`AnalysisError::Unit`] if a column is in a unit of another
    /// quantity, [`AnalysisError::Setting`] if a time column and a sampling rate are given and
    /// contradict each other.
    pub fn open_with(
        path: impl AsRef<Path>,
        channels: &Channels,
        reading: &Reading,
    ) -> Result<Self, AnalysisError> {
        let path = path.as_ref();
        Self::from_file(reading.open(path, IN_MEMORY_SAMPLES)?, Some(path), channels, reading)
    }

    /// Creates a measurement from columns of an open file.
    pub(crate) fn from_file(
        mut file: RecordFile,
        path: Option<&Path>,
        channels: &Channels,
        reading: &Reading,
    ) -> Result<Self, AnalysisError> {
        let channels = &channels.distinguished(file.head());
        let units = ToSi::from_table(file.head(), &channels.roles())?;
        let time = reading.time_axis(file.head()).ok_or_else(|| AnalysisError::NoTimeAxis {
            file: file.head().file().into(),
            available: file.head().available(),
            unclear: file.head().unclear_time().map(|(at, text)| (file.head().label(at), text)),
        })?;
        units::check_rate(file.head(), reading)?;
        let survey = file.survey(&time, &channels.used())?;
        let doubtful_time = units::doubtful_time(file.head(), &time, survey.sampling);
        let doubt = units::contradicted_rate(file.head(), reading);
        let doubt = doubt
            .or_else(|| units::coarse_time(file.head(), &time, survey.sampling))
            .filter(|_| doubtful_time.is_none());
        file.forget_head();
        let mut units = units;
        units.findings.extend(doubtful_time);
        units.remarks.extend(doubt.into_iter().chain(survey.remarks));
        let name = |column: &String| {
            let index = file.head().find(column);
            index.map_or_else(|_| column.clone(), |index| file.head().short_name(index))
        };
        let source = RecordSource {
            names: Arc::new(channels.renamed(name)),
            name: file.head().file().to_owned(),
            path: path.map(Path::to_owned),
            channels: channels.clone(),
            reading: reading.clone(),
            sampling: survey.sampling,
            peaks: survey.peaks,
            offsets: offsets(reading.detrend, survey.means),
            units,
            memory: file.memory(),
            samples: Samples::File(Box::new(file)),
        };
        Ok(Self { source: Arc::new(source), window: Window::default() })
    }

    /// Creates a measurement from a force and one or several kinds of response in memory, in SI
    /// units, samples × degrees of freedom each.
    ///
    /// # Errors
    /// [`AnalysisError::ArrayShape`] if a response and the force differ in length or in the number
    /// of degrees of freedom.
    pub fn from_records(
        force: &Record,
        responses: &[(ResponseQuantity, &Record)],
    ) -> Result<Self, AnalysisError> {
        let name = |group: &str, dof: usize| format!("{group} {}", dof + 1);
        let names = |group: &str| (0..force.channels()).map(|dof| name(group, dof)).collect();
        let mut channels = Channels { force: names("force"), ..Channels::default() };
        let mut columns: Vec<&[f64]> =
            (0..force.channels()).map(|dof| force.channel(dof)).collect();
        for kind in ResponseQuantity::ALL {
            let Some((_, record)) = responses.iter().find(|(given, _)| *given == kind) else {
                continue;
            };
            let (samples, dofs) = (record.len(), record.channels());
            if (samples, dofs) != (force.len(), force.channels()) {
                let expected = [force.len(), force.channels()];
                let name = kind.to_string();
                return Err(AnalysisError::ArrayShape { name, got: [samples, dofs], expected });
            }
            let kind_names: Vec<String> = names(&kind.to_string());
            channels = channels.and(kind, &kind_names.join(","));
            columns.extend((0..dofs).map(|dof| record.channel(dof)));
        }
        let named = channels.used().into_iter().map(String::as_str).zip(columns);
        let named: Vec<(&str, &[f64])> = named.collect();
        Self::from_columns(force.sampling(), &named, &channels)
    }

    /// Creates a measurement from named columns in memory; a name may contain a unit, as in a file
    /// (`x [um]`).
    ///
    /// # Errors
    /// [`AnalysisError::NoColumn`] if a channel has no column, [`AnalysisError::ArrayShape`] if a
    /// column and the time axis differ in length, [`AnalysisError::Signal`] if a value is not
    /// finite, [`AnalysisError::Unit`].
    pub fn from_columns(
        sampling: Sampling,
        columns: &[(&str, &[f64])],
        channels: &Channels,
    ) -> Result<Self, AnalysisError> {
        let roles = channels.roles();
        let find = |wanted: &String| {
            let alone = |is_named: &dyn Fn(&str) -> bool| {
                let mut named = columns.iter().filter(|(name, _)| is_named(name));
                named.next().filter(|_| named.next().is_none())
            };
            let column = alone(&|name| name == wanted)
                .or_else(|| alone(&|name| name_without_unit(name) == *wanted));
            let available = || columns.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
            column.ok_or_else(|| AnalysisError::NoColumn {
                column: wanted.clone(),
                available: available(),
            })
        };
        let mut data = DMatrix::zeros(sampling.len(), roles.len());
        let mut labels = Vec::new();
        for (mut into, role) in data.column_iter_mut().zip(&roles) {
            let (name, values) = find(role.column)?;
            if values.len() != sampling.len() {
                let (got, expected) = ([values.len(), 1], [sampling.len(), 1]);
                return Err(AnalysisError::ArrayShape { name: (*name).into(), got, expected });
            }
            into.copy_from_slice(values);
            labels.push((format!("\"{name}\""), stated_unit(name, "", Some(role.quantity))));
        }
        // `Record::new` refuses values that are not finite.
        let record = Record::new(sampling, data)?;
        let units = ToSi::new("the record", labels.into_iter(), &roles)?;
        let data = record.into_data();
        let source = RecordSource {
            name: "the record".into(),
            names: Arc::new(channels.renamed(|name| name_without_unit(name))),
            path: None,
            channels: channels.clone(),
            reading: Reading::default(),
            sampling,
            peaks: data.column_iter().map(|column| column.amax()).collect(),
            offsets: vec![0.0; roles.len()],
            units,
            memory: Limits::DEFAULT.memory(size_of_val(data.as_slice())),
            samples: Samples::Memory(data),
        };
        Ok(Self { source: Arc::new(source), window: Window::default() })
    }

    /// Uses whole periods of this number of samples, beginning with the first sample of the window.
    ///
    /// # Errors
    /// [`AnalysisError::Window`] if the record is shorter than one period,
    /// [`AnalysisError::Setting`] for a period without samples.
    pub fn period(mut self, samples: usize) -> Result<Self, AnalysisError> {
        self.window.period = Some(samples);
        self.span().map(|_| self)
    }

    /// Uses a part of the record.
    ///
    /// # Errors
    /// [`AnalysisError::Window`] if the window exceeds the record, [`AnalysisError::Setting`] for a
    /// period without samples.
    pub fn window(mut self, window: Window) -> Result<Self, AnalysisError> {
        self.window = window;
        self.span().map(|_| self)
    }

    /// Names the record in messages and results, for instance one from memory.
    #[must_use]
    pub fn named(mut self, name: &str) -> Self {
        if let Some(source) = Arc::get_mut(&mut self.source) {
            source.name = name.into();
        }
        self
    }

    /// Returns the name of the record in messages: the file name as the user wrote it.
    pub fn name(&self) -> &str {
        &self.source.name
    }

    /// Returns the columns of force and response.
    pub fn channels(&self) -> &Channels {
        &self.source.channels
    }

    /// Returns the time axis of the whole record.
    pub fn sampling(&self) -> Sampling {
        self.source.sampling
    }

    /// Returns the force of the whole window, samples × degrees of freedom, in N.
    ///
    /// # Errors
    /// If the file cannot be read again.
    pub fn force(&self) -> Result<Record, AnalysisError> {
        Ok(self.hold_any(Hold::Whole)?.held.force)
    }

    /// Returns every measured kind of response over the whole window, samples × degrees of freedom,
    /// in m, m/s or m/s².
    ///
    /// # Errors
    /// If the file cannot be read again.
    pub fn responses(&self) -> Result<Vec<(ResponseQuantity, Record)>, AnalysisError> {
        let window = self.hold_any(Hold::Whole)?.held;
        Ok(window.responses().into_iter().map(|(kind, record)| (kind, record.clone())).collect())
    }

    /// Returns the settings that open the record again; `None` for a record from memory.
    pub fn plan(&self) -> Option<RecordPlan> {
        Some(RecordPlan {
            path: self.source.path.clone()?,
            channels: self.source.channels.clone(),
            reading: self.source.reading.clone(),
            window: self.window.clone(),
        })
    }

    /// Returns the settings of the window.
    pub fn window_settings(&self) -> &Window {
        &self.window
    }

    /// Returns the maximum memory of an analysis of the record, in bytes.
    pub(crate) fn memory(&self) -> usize {
        self.source.memory
    }

    pub(crate) fn source(&self) -> &Arc<RecordSource> {
        &self.source
    }

    /// Reads the whole window with all named channels.
    ///
    /// # Errors
    /// [`AnalysisError::Window`], and if the file cannot be read again.
    pub(crate) fn whole_block(&self) -> Result<Block, AnalysisError> {
        let (start, len) = self.span()?;
        self.source.check_memory(len, PREDICT_BYTES)?;
        let mut whole = None;
        self.source.blocks(start..start + len, len, len, &mut |block| {
            whole = Some(self.source.sorted(&block, start + 1)?);
            Ok(())
        })?;
        let (first, last) = (start + 1, start + len);
        let file = self.source.name.clone();
        let mut whole =
            whole.ok_or(AnalysisError::Window { file, first, last, len: self.sampling().len() })?;
        whole.period = self.window.period.unwrap_or(len);
        whole.periods = len / whole.period;
        Ok(whole)
    }

    /// Returns the first sample, counted from 0, and the number of samples of the window.
    pub(crate) fn span(&self) -> Result<(usize, usize), AnalysisError> {
        self.window.span(&self.source.name, self.source.sampling.len())
    }

    /// Reads the window and buffers the part stated by `hold`.
    ///
    /// # Errors
    /// [`AnalysisError::Window`], [`AnalysisError::ZeroForce`] if no force acts, and if the file
    /// cannot be read again.
    pub(crate) fn hold(&self, hold: Hold) -> Result<Windowed, AnalysisError> {
        Windowed::new(self, hold)
    }
}

impl Measurement {
    /// Reads the window, with any numbers of forces and responses, and buffers the part stated by
    /// `hold`.
    ///
    /// # Errors
    /// As [`Measurement::hold`].
    pub(crate) fn hold_any(&self, hold: Hold) -> Result<Windowed, AnalysisError> {
        Windowed::from_any_layout(self, hold)
    }
}

fn offsets(detrend: Detrend, means: Vec<f64>) -> Vec<f64> {
    match detrend {
        Detrend::Mean => means,
        Detrend::None => vec![0.0; means.len()],
    }
}

impl RecordSource {
    /// Refuses a computation on `samples` samples of the used columns, with `bytes` bytes per
    /// number, if it needs too much memory.
    pub fn check_memory(&self, samples: usize, bytes: usize) -> Result<(), AnalysisError> {
        let numbers = samples.saturating_mul(self.channels.roles().len());
        check_memory(&self.name, numbers, bytes, self.memory)
    }

    /// Refuses a computation on the noise of `lines` spectral lines of all used columns if it needs
    /// too much memory.
    pub fn check_spectra(&self, lines: usize) -> Result<(), AnalysisError> {
        let channels = self.channels.roles().len();
        if channels <= FEW_CHANNELS {
            return Ok(());
        }
        let pairs = lines.saturating_mul(channels).saturating_mul(channels);
        check_memory(&self.name, pairs, PAIR_BYTES, self.memory)
    }

    /// Passes the samples `window` of the used columns to the callback in blocks of `rows` rows
    /// (samples × columns, SI units, offsets subtracted). Each block begins `advance` rows after
    /// the previous one; the last may be shorter.
    pub fn blocks(
        &self,
        window: std::ops::Range<usize>,
        rows: usize,
        advance: usize,
        take: &mut dyn FnMut(DMatrix<f64>) -> Result<(), AnalysisError>,
    ) -> Result<(), AnalysisError> {
        let mut converted = |mut block: DMatrix<f64>| {
            let constants = self.offsets.iter().zip(&self.units.factors);
            for (mut column, (offset, factor)) in block.column_iter_mut().zip(constants) {
                if *offset != 0.0 {
                    column.add_scalar_mut(-offset);
                }
                if *factor != 1.0 {
                    column *= *factor;
                }
            }
            take(block)
        };
        match &self.samples {
            Samples::File(file) => {
                file.blocks(&self.channels.used(), window, rows, advance, &mut converted)
            }
            Samples::Memory(data) => {
                let mut first = window.start;
                loop {
                    let end = window.end.min(first + rows);
                    let mut samples = Vec::with_capacity((end - first) * data.ncols());
                    for column in data.as_slice().chunks_exact(data.nrows()) {
                        samples.extend_from_slice(&column[first..end]);
                    }
                    converted(DMatrix::from_vec(end - first, data.ncols(), samples))?;
                    if end == window.end {
                        return Ok(());
                    }
                    first += advance;
                }
            }
        }
    }

    /// Sorts a block whose first sample is `first`, counted from 1, into forces and responses.
    pub fn sorted(&self, block: &DMatrix<f64>, first: usize) -> Result<Block, AnalysisError> {
        let sampling = self.sampling.with_len(block.nrows())?;
        let mut next = block.as_slice().chunks_exact(block.nrows());
        let mut take = |columns: &[String]| {
            let mut data = Vec::with_capacity(sampling.len() * columns.len());
            for name in columns {
                let column = if name == ABSENT { None } else { next.next() };
                match column {
                    Some(column) => data.extend_from_slice(column),
                    None => data.resize(data.len() + sampling.len(), 0.0),
                }
            }
            Record::new(sampling, DMatrix::from_vec(sampling.len(), columns.len(), data))
        };
        let force = take(&self.channels.force)?;
        let mut response = |columns: &[String]| {
            if columns.is_empty() { Ok(None) } else { take(columns).map(Some) }
        };
        Ok(Block {
            file: self.name.clone(),
            displacement: response(&self.channels.displacement)?,
            velocity: response(&self.channels.velocity)?,
            acceleration: response(&self.channels.acceleration)?,
            first_sample: first,
            period: force.len(),
            periods: 1,
            driven: Vec::new(),
            unit_remarks: self.units.remarks.clone(),
            unit_findings: self.units.findings.clone(),
            names: Arc::clone(&self.names),
            force,
        })
    }
}

impl Block {
    /// Returns the first measured kind of response.
    pub fn response(&self) -> (&Record, ResponseQuantity) {
        let (kind, record) = self.responses()[0];
        (record, kind)
    }

    /// Returns every measured kind of response.
    pub fn responses(&self) -> Vec<(ResponseQuantity, &Record)> {
        let candidates = [
            (ResponseQuantity::Displacement, &self.displacement),
            (ResponseQuantity::Velocity, &self.velocity),
            (ResponseQuantity::Acceleration, &self.acceleration),
        ];
        let measured = candidates.into_iter();
        measured.filter_map(|(kind, record)| Some((kind, record.as_ref()?))).collect()
    }

    /// Returns findings and remarks about units.
    pub fn unit_notes(&self) -> Vec<String> {
        let findings = self.unit_findings.iter().map(Finding::to_string);
        findings.chain(self.unit_remarks.iter().cloned()).collect()
    }

    /// Returns the last sample of the window, counted from 1.
    pub fn last_sample(&self) -> usize {
        self.first_sample + self.period * self.periods - 1
    }

    /// Returns the last buffered sample, counted from 1; `None` if the whole window is buffered.
    pub fn held_to(&self) -> Option<usize> {
        let last_buffered = self.first_sample + self.force.len() - 1;
        (last_buffered < self.last_sample()).then_some(last_buffered)
    }
}

/// Returns a record followed by the samples of a later record.
pub(crate) fn joined(record: &Record, later: &Record) -> Result<Record, AnalysisError> {
    let (before, len) = (record.len(), record.len() + later.len());
    let mut data = DMatrix::zeros(len, record.channels());
    data.rows_mut(0, before).copy_from(record.data());
    data.rows_mut(before, later.len()).copy_from(later.data());
    Ok(Record::new(record.sampling().with_len(len)?, data)?)
}
