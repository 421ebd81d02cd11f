//! Arguments of `mechid identify` and `mechid report`: records, columns, and settings of the
//! identification.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use mechid::analysis::identify::{
    AcCoupling, Band, Constant, Derivatives, Disturbance, Domain, Form, Identified,
    IdentifiedResponses, Identify, IdentifyResponses, Keywords, KnownMass, LeftOut, LineChoice,
    Method, Refinement, Structure, ValidationWindow,
};
use mechid::analysis::{Channels, ResponseQuantity, Segmentation, Window, frf};
use mechid::io::LineSpec;
use mechid::model::{Discretisation, Terms};
use mechid::nonlinear::{Criterion, Weighting};
use mechid::signal::Extent;
use mechid::spectra::Pooling;

use super::hits::HitArgs;
use super::word::word;
use super::{ChannelArgs, RecordArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::Files;

/// Records, the columns and lines to use, and the settings of the identification.
#[derive(Debug, Args)]
pub struct FitArgs {
    #[command(flatten)]
    pub(super) input: RecordArgs,
    /// More records of the same machine, with the same columns and window: all are fitted together
    #[arg(value_name = "RECORD")]
    pub(super) more: Vec<PathBuf>,
    /// First samples of further windows of the first record, each as long as the window at --start;
    /// all windows are fitted together, as realisations of one excitation
    #[arg(long, value_name = "SAMPLE,…", value_parser = at_least_one, value_delimiter = ',',
          requires = "period", help_heading = "Time and window")]
    more_starts: Vec<usize>,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Domain of the fit: lines of spectra (frequency), or samples of any record (time)
    #[arg(long, value_name = "DOMAIN", value_parser = word::<Domain>(), default_value = "frequency")]
    domain: Domain,
    #[command(flatten)]
    pub(super) lines: LineArgs,
    /// Estimator of the parameters from the spectra: least-squares on the equation of motion
    /// (biased by noise on the response), instrumental (instrumental variables from the other half
    /// of the periods; unbiased), or maximum-likelihood on the response (unbiased, with the least
    /// scatter) [default: maximum-likelihood if the noise is known from at least two periods, if
    /// noise biases least squares, or with --from-frf; otherwise least-squares]
    #[arg(long, value_name = "METHOD", value_parser = word::<Method>())]
    method: Option<Method>,
    /// Noise spectrum that weights the lines in maximum likelihood: white, smooth, neighbours:N
    /// (means over N lines to either side), per-line, or auto (automatic choice)
    #[arg(long, value_name = "NOISE")]
    pub(super) noise: Option<Pooling>,
    /// Standard deviation of the noise on the force samples, in N: one value for all forces, or one
    /// per degree of freedom. With this option, the record is fitted as an open record [default:
    /// estimated above the excited band, or between hits]
    #[arg(long, value_name = "N,…", value_delimiter = ',', allow_negative_numbers = true)]
    force_noise: Vec<f64>,
    /// Extent of the window: open (any part of a response; its transient is estimated with the
    /// machine) or period (whole periods) [default: in the time domain, period with spectral
    /// derivatives, otherwise open; in the frequency domain, period with --period; without
    /// --period, open for nonlinear terms, and for a linear machine open if a transient is found,
    /// otherwise period]
    #[arg(long, value_name = "EXTENT", value_parser = word::<Extent>())]
    extent: Option<Extent>,
    /// Assumed force between the samples. For open records, hits and the time domain: held
    /// (constant, as from the D/A converter that drives a shaker) or linear; the fit is exact if
    /// the assumption is true. For the time domain only: euler (Euler's rule), with a bias
    /// proportional to the step [default: band-limited; in the time domain no assumption (equation
    /// of motion at the samples) if there is an acceleration, otherwise linear]
    #[arg(long, value_name = "ASSUMPTION", value_parser = word::<Discretisation>())]
    between_samples: Option<Discretisation>,
    /// Channels behind a first-order high-pass filter, such as an AC-coupled input, each with its
    /// corner frequency in Hz; for open records and hits
    #[arg(long, value_name = "COLUMN=HZ,…", value_delimiter = ',')]
    ac_coupling: Vec<AcCoupling>,
    /// Masses, in kg, one per degree of freedom (or all n×n entries row by row), each a number or
    /// unknown
    #[arg(
        long,
        value_name = "KG|unknown,…",
        default_value = "unknown",
        allow_hyphen_values = true
    )]
    mass: KnownMass,
    /// Known structure of M, C and K: symmetric; chain (masses in a row, with springs and dampers
    /// to neighbours and to the ground); diagonal-mass; proportional-damping (C = αM + βK); or the
    /// value of an entry, such as k13=0. Several may be given: separated by spaces, or one per
    /// option
    #[arg(long, value_name = "FORM", value_delimiter = ' ')]
    structure: Vec<Form>,
    #[command(flatten)]
    pub(super) hits: HitArgs,
    #[command(flatten)]
    nonlinear: NonlinearArgs,
    #[command(flatten)]
    time: TimeArgs,
    /// Fit frequency responses averaged over segments, weighted by their coherence; choose the
    /// estimator by the channels that have the noise: h1 for noise on the response, h2 on the
    /// force, hv on both
    #[arg(long, value_name = "ESTIMATOR", value_parser = word::<frf::Estimator>(),
          help_heading = "Frequency responses")]
    from_frf: Option<frf::Estimator>,
    #[command(flatten)]
    segments: SegmentArgs,
    /// Record to predict, with the same columns: COUNT samples from START on; the report states the
    /// percentage of its response that the identified system predicts. Without RECORD, as in
    /// :2049:1024, samples of the first record are predicted [default: all samples]
    #[arg(long, value_name = "RECORD:START:COUNT", help_heading = "Validation")]
    validate: Option<Validated>,
    /// Add every line of the fit to the JSON: force, measured and fitted response with their
    /// standard errors, and the residual
    #[arg(long, help_heading = "Output", requires = "json")]
    fitted_lines: bool,
    /// List every check with its verdict, not only the warnings (--json and the report always do)
    #[arg(long, help_heading = "Output", conflicts_with_all = ["json", "quiet"])]
    pub(super) verbose: bool,
}

/// Spectral lines.
#[derive(Debug, Args)]
pub struct LineArgs {
    /// Spectral lines: all, odd, even, or numbers and ranges first:step:last such as 1:2:335
    /// [default: every line at which the force exceeds its noise]
    #[arg(long, value_name = "LINES", conflicts_with = "band_hz")]
    lines: Option<LineSpec>,
    /// Use the lines with force between two frequencies, in Hz
    #[arg(long, value_name = "LOW:HIGH")]
    pub(super) band_hz: Option<Band>,
    /// Lines to exclude, numbers and ranges as for --lines
    #[arg(long, value_name = "LINES")]
    without_lines: Option<LineSpec>,
    /// Frequencies whose lines are excluded, in Hz, such as 50 (mains), 50:0.5 (half a hertz to
    /// either side) and 24.5:multiples (rotation)
    #[arg(long, value_name = "HZ,…", value_delimiter = ',')]
    pub(super) without_hz: Vec<Disturbance>,
}

/// Nonlinear springs and dampers.
#[derive(Debug, Args)]
#[command(next_help_heading = "Nonlinear terms")]
struct NonlinearArgs {
    /// Springs and dampers to fit in addition to mass, damping and stiffness, each `name: law`:
    /// powers of x1 and v1 (displacement and velocity of degree of freedom 1) or of (x1-x2) and
    /// (v1-v2), |v1| v1, v1^3/(1 + (v1/b)^2) with a number in place of b, gap(x1, 0.001) for a stop
    /// with that clearance (m) on either side, tanh(v1/0.01) for friction smoothed below that
    /// velocity (m/s), x1^0 for a constant force. They are fitted to whole periods if --period
    /// states their length, otherwise to any record
    #[arg(long, value_name = "TERMS")]
    nonlinear: Option<Terms>,
    /// Candidate terms, written as for --nonlinear: the most useful ones are added one by one, as
    /// long as --criterion accepts them
    #[arg(long, value_name = "TERMS")]
    candidates: Option<Terms>,
    /// Criterion for the addition of a candidate: information (the extended Bayesian criterion
    /// decreases, and the coefficient differs from zero) or held-out (the fit to the other records
    /// predicts each record with a smaller error; needs at least three records or windows)
    /// [default: information]
    #[arg(long, value_name = "CRITERION", value_parser = word::<Criterion>())]
    criterion: Option<Criterion>,
    /// Further constants to estimate: laws (constants inside the laws; the given values are the
    /// initial ones), delay (of the force), phase (a phase error common to all channels, as from
    /// equal filters)
    #[arg(long, value_name = "WHAT,…", value_parser = word::<Constant>(), value_delimiter = ',')]
    search: Vec<Constant>,
    /// Assumed spectrum of the error of the equation of motion, which weights the lines:
    /// white-force (equal forces on all lines), response (equal responses on all lines),
    /// smooth-spectrum (estimated from the residual), or automatic (the most likely of the three)
    /// [default: automatic]
    #[arg(long, value_name = "WEIGHTING", value_parser = word::<Weighting>())]
    weighting: Option<Weighting>,
}

/// Fits in the time domain.
#[derive(Debug, Args)]
#[command(next_help_heading = "Time domain")]
struct TimeArgs {
    /// Method for the other responses if only the displacement, or only the acceleration, was
    /// measured: spectral (spectrum of whole periods) or savitzky-golay (polynomial of degree ORDER
    /// through a sliding WINDOW, an odd number of samples)
    #[arg(long, value_name = "spectral|savitzky-golay:WINDOW:ORDER")]
    derivatives: Option<Derivatives>,
    /// Divide every interval into FACTOR steps, with linear, spline or band-limited interpolation
    /// between the samples; this reduces the error of --between-samples
    #[arg(long, value_name = "FACTOR:INTERPOLATION", requires = "between_samples")]
    refine: Option<Refinement>,
}

/// Segments of a record to average over.
#[derive(Debug, Args)]
#[command(next_help_heading = "Frequency responses")]
pub struct SegmentArgs {
    /// Segments for a random excitation: number of samples; overlap in per cent (default: 50); and
    /// window: hann (default), hamming (a narrower peak, more leakage from far away), blackman (the
    /// least leakage, a wider peak) or rectangular (for bursts that begin and end at rest)
    /// [default: each period is a segment; without --period, the length is chosen by the coherence]
    #[arg(long, value_name = "SAMPLES:OVERLAP:WINDOW")]
    segment: Option<Segmentation>,
}

/// Frequency responses that were measured elsewhere.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tables of frequency responses")]
pub struct TableArgs {
    /// The files are tables of frequency responses: text with columns h_1_1_real, h_1_1_imaginary …
    /// as `mechid frf --output` writes it, or universal files (datasets 58 of types 4 and 6)
    #[arg(long, conflicts_with_all = ["ChannelArgs", "HitArgs", "HitRuleArgs", "NonlinearArgs", "TimeArgs",
          "SegmentArgs", "sample_rate", "time", "period", "detrend", "lines", "without_lines", "without_hz",
          "from_frf", "more_starts", "between_samples", "ac_coupling", "extent", "force_noise", "validate",
          "skip_lines", "record_column"])]
    pub(super) frf_table: bool,
    /// Measured quantity of the responses per force, if the table does not state it
    #[arg(long, value_name = "QUANTITY", value_parser = word::<ResponseQuantity>(), requires = "frf_table")]
    quantity: Option<ResponseQuantity>,
    /// Number of independent averages of the coherence, for the standard errors; not needed if the
    /// table has standard errors
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, requires = "frf_table")]
    averages: Option<usize>,
    /// Points to use, one per degree of freedom, as the table names them [default: all]
    #[arg(long, value_name = "POINT,…", value_delimiter = ',', requires = "frf_table")]
    points: Vec<String>,
}

impl TableArgs {
    /// Returns whether the files are tables of frequency responses.
    pub fn is_given(&self) -> bool {
        self.frf_table
    }
}

/// Record to predict, written `RECORD:START:COUNT`.
#[derive(Debug, Clone)]
struct Validated {
    /// Record; `None` for the first fitted record.
    record: Option<PathBuf>,
    window: ValidationWindow,
}

impl FromStr for Validated {
    type Err = String;

    /// Reads at most two numbers from the end of the text, so that the name of a record may contain
    /// colons.
    fn from_str(text: &str) -> Result<Self, String> {
        let number = |part: &str| part.parse::<usize>().ok();
        let (name, numbers) = match text.rsplit_once(':') {
            None => (text, (None, None)),
            Some((before, last)) => match (before.rsplit_once(':'), number(last)) {
                (Some((name, start)), count @ Some(_)) if number(start).is_some() => {
                    (name, (number(start), count))
                }
                (_, start @ Some(_)) => (before, (start, None)),
                _ => (text, (None, None)),
            },
        };
        let (start, samples) = numbers;
        match (name, start) {
            (_, Some(0)) | (_, Some(_)) if samples == Some(0) || start == Some(0) => {
                Err("samples are counted from 1".into())
            }
            ("", None) => {
                Err("write RECORD, RECORD:START, RECORD:START:COUNT or :START:COUNT".into())
            }
            ("", _) => Ok(Self { record: None, window: ValidationWindow { start, samples } }),
            _ => {
                Ok(Self { record: Some(name.into()), window: ValidationWindow { start, samples } })
            }
        }
    }
}

impl LineArgs {
    /// Returns the choice of lines.
    pub fn choice(&self) -> LineChoice {
        match (&self.lines, self.band_hz) {
            (Some(lines), _) => LineChoice::Lines(lines.clone()),
            (None, Some(band)) => LineChoice::Band(band),
            (None, None) => LineChoice::Driven,
        }
    }

    /// Returns the lines to leave out.
    pub fn without(&self) -> LeftOut {
        LeftOut { lines: self.without_lines.clone(), frequencies: self.without_hz.clone() }
    }
}

impl SegmentArgs {
    /// Returns the segments.
    pub fn segmentation(&self) -> Segmentation {
        self.segment.clone().unwrap_or_default()
    }
}

impl FitArgs {
    /// Returns the stated noise of the forces, in N.
    pub(super) fn force_noise(&self) -> Option<Vec<f64>> {
        Some(self.force_noise.clone()).filter(|levels| !levels.is_empty())
    }

    /// Reads the records, identifies the machine, and predicts the validation record.
    pub fn identify(&self) -> Result<Identified, CliError> {
        let how = self.settings()?;
        let mut channels = self.channels.channels();
        if channels.is_empty() {
            channels = self.channels.in_file(&self.input.record, &self.input)?.paired_by_point();
        }
        let channels = self.hits.channels_of(&channels, 1 + self.more.len())?;
        channels.iter().try_for_each(Channels::check_pairs)?;
        let first = self.input.open(&channels[0])?;
        let mut records = vec![first.clone()];
        for &start in &self.more_starts {
            records.push(first.clone().window(Window { start, ..self.input.window() })?);
        }
        for (record, channels) in self.more.iter().zip(&channels[1..]) {
            records.push(self.input.open_other(record, channels, self.input.window())?);
        }
        let mut identified = mechid::identify(&records, &how)?;
        if self.fitted_lines {
            identified.add_fitted_lines()?;
        }
        let Some(Validated { record, window }) = &self.validate else { return Ok(identified) };
        let validation = match record {
            Some(record) => self.input.open_other(record, &channels[0], Window::default())?,
            None => records.swap_remove(0),
        };
        let validation = identified.validation_window(validation, window)?;
        identified.add_validation(&validation)?;
        Ok(identified)
    }

    /// Identifies the machine from tables of frequency responses, if the files are tables.
    pub fn identify_tables(
        &self,
        table: &TableArgs,
    ) -> Result<Option<IdentifiedResponses>, CliError> {
        if !table.frf_table {
            return Ok(None);
        }
        if let Domain::Time = self.domain {
            let (option, why) = ("--frf-table", "needs --domain frequency");
            return Err(CliError::MisplacedOption { option, why });
        }
        let tables = self.input.read_responses(&self.more)?;
        let how = IdentifyResponses {
            quantity: table.quantity,
            averages: table.averages.map(|count| count as f64),
            points: table.points.clone(),
            band: self.lines.band_hz,
            mass: self.mass.clone(),
            structure: self.structure(),
            method: self.method,
        };
        let mut identified = mechid::identify_responses(&tables, &how)?;
        if self.fitted_lines {
            identified.add_fitted_lines()?;
        }
        Ok(Some(identified))
    }

    /// Returns the first record.
    pub fn record(&self) -> &Path {
        &self.input.record
    }

    /// Returns the file if it is a saved result or a described machine: a single JSON file for
    /// which no columns are named.
    pub fn saved_result(&self) -> Option<&Path> {
        let record = self.input.record.as_path();
        let has_columns = !self.channels.channels().is_empty();
        let is_json = record.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"));
        (is_json && !has_columns && self.more.is_empty()).then_some(record)
    }

    /// Returns the files that the arguments name.
    pub fn files(&self) -> Files<'_> {
        Files::default()
            .reads([&self.input.record])
            .reads(&self.more)
            .reads(self.validate.iter().filter_map(|validated| validated.record.as_ref()))
    }

    /// Returns the result as text, with every check if requested.
    pub fn text(&self, identified: &Identified) -> String {
        if self.verbose {
            format!("{identified}\nchecks:\n{}", identified.summary().all_checks())
        } else {
            identified.to_string()
        }
    }

    /// Returns the known structure of M, C and K.
    fn structure(&self) -> Structure {
        Structure { forms: self.structure.clone() }
    }

    /// Returns the settings of the identification.
    fn settings(&self) -> Result<Identify, CliError> {
        let keywords = Keywords {
            domain: self.domain,
            method: self.method,
            noise: self.noise,
            force_noise: self.force_noise(),
            extent: self.extent,
            lines: self.lines.lines.clone(),
            band_hz: self.lines.band_hz,
            without_lines: self.lines.without_lines.clone(),
            without_hz: self.lines.without_hz.clone(),
            mass: self.mass.clone(),
            structure: self.structure(),
            hits: self.hits.rule(),
            from_frf: self.from_frf,
            segment: self.segments.segment.clone(),
            nonlinear: self.nonlinear.nonlinear.clone(),
            candidates: self.nonlinear.candidates.clone(),
            criterion: self.nonlinear.criterion,
            search: self.nonlinear.search.clone(),
            weighting: self.nonlinear.weighting,
            between_samples: self.between_samples,
            ac_coupling: self.ac_coupling.clone(),
            derivatives: self.time.derivatives,
            refine: self.time.refine,
        };
        Ok(Identify::try_from(keywords)?)
    }
}
