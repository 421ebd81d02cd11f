//! Arguments of `mechid identify` and `mechid report`: which records, what in them, and how to identify
//! the machine.

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use mechid::analysis::identify::{
    Band, Derivatives, Disturbance, Fit, Form, Identified, IdentifiedResponses, Identify,
    IdentifyResponses, KnownMass, LeftOut, LineChoice, Method, Nonlinear, Refinement, ResponseFit,
    SampleFit, Structure, ValidationWindow,
};
use mechid::analysis::{Segmentation, Window};
use mechid::io::{FrequencyResponses, LineSpec};
use mechid::model::Terms;
use mechid::nonlinear::{Criterion, ShapeConstants, Weighting};
use mechid::spectra::Pooling;

use super::choices::{
    BetweenSamplesChoice, CriterionChoice, EstimatorChoice, ExtentChoice, InterpolationChoice,
    MethodChoice, QuantityChoice, SearchChoice, WeightChoice, WeightingChoice,
};
use super::hits::HitArgs;
use super::{ChannelArgs, RecordArgs, at_least_one};
use crate::error::CliError;
use crate::outcome::Files;

/// Records, what in them, and how to identify the machine.
#[derive(Debug, Args)]
pub struct FitArgs {
    #[command(flatten)]
    input: RecordArgs,
    /// More records of the same machine, with the same columns and window: all are fitted together
    #[arg(value_name = "RECORD")]
    more: Vec<PathBuf>,
    /// First samples of more windows of the first record, each as long as that from --start on: all are
    /// fitted together, as realisations of one excitation
    #[arg(long, value_name = "SAMPLE,…", value_parser = at_least_one, value_delimiter = ',',
          requires = "period", help_heading = "Time and window")]
    more_starts: Vec<usize>,
    #[command(flatten)]
    channels: ChannelArgs,
    /// Domain of the fit
    #[arg(long, value_name = "DOMAIN", value_enum, default_value_t = Domain::Frequency)]
    domain: Domain,
    #[command(flatten)]
    lines: LineArgs,
    /// Estimator of the parameters from the spectra [default: maximum-likelihood where two periods or
    /// more show the noise, where it biases least squares, or with --from-frf; otherwise least-squares]
    #[arg(long, value_name = "METHOD", value_enum)]
    method: Option<MethodChoice>,
    /// Noise spectrum by which maximum likelihood weighs the lines: white, smooth, neighbours:N (means over
    /// N lines to either side), per-line, or auto, which chooses
    #[arg(long, value_name = "NOISE")]
    noise: Option<Pooling>,
    /// Standard deviation of the noise on the samples of the force, in N, one for all forces or one per
    /// degree of freedom; for open records, which are fitted as such then [default: that above the band
    /// that the force drives, or between hits]
    #[arg(
        long,
        value_name = "N,…",
        value_delimiter = ',',
        conflicts_with = "period",
        allow_negative_numbers = true
    )]
    force_noise: Vec<f64>,
    /// Extent of the window: of open records the unknown loads of their ends are fitted with the machine
    /// [default: period with --period; otherwise period unless the ends show, and in the time domain open
    /// but for spectral derivatives]
    #[arg(long, value_name = "EXTENT", value_enum)]
    extent: Option<ExtentChoice>,
    /// Assumption on the force between samples, in the time domain [default: the equation of motion
    /// at the samples if there is an acceleration, else linear]
    #[arg(long, value_name = "ASSUMPTION", value_enum)]
    between_samples: Option<BetweenSamplesChoice>,
    /// Masses, in kg, one per degree of freedom (or all n×n entries row by row), each a number or
    /// unknown
    #[arg(
        long,
        value_name = "KG|unknown,…",
        default_value = "unknown",
        allow_hyphen_values = true
    )]
    mass: KnownMass,
    /// What is known of the form of M, C and K: symmetric; chain (masses in a row, with springs and
    /// dampers to neighbours and to the ground); diagonal-mass; proportional-damping (C = αM + βK); or
    /// the value of an entry, such as k13=0. Several of them with spaces between, or each by itself
    #[arg(long, value_name = "FORM", value_delimiter = ' ')]
    structure: Vec<Form>,
    #[command(flatten)]
    hits: HitArgs,
    #[command(flatten)]
    nonlinear: NonlinearArgs,
    #[command(flatten)]
    time: TimeArgs,
    /// Fit frequency responses, averaged over segments, with their coherence as weights
    #[arg(long, value_name = "ESTIMATOR", value_enum, help_heading = "Frequency responses")]
    from_frf: Option<EstimatorChoice>,
    #[command(flatten)]
    segments: SegmentArgs,
    #[command(flatten)]
    validation: ValidationArgs,
    /// Add every line of the fit to the JSON: force, measured and fitted response with their standard errors,
    /// and the residual
    #[arg(long, help_heading = "Output", requires = "json")]
    fitted_lines: bool,
    /// List every check with its verdict, not only the warnings (--json and the report always do)
    #[arg(long, help_heading = "Output", conflicts_with_all = ["json", "quiet"])]
    verbose: bool,
}

/// Domain of the fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Domain {
    /// Spectral lines of whole periods
    Frequency,
    /// Sample by sample, any record
    Time,
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
    band_hz: Option<Band>,
    /// Lines to leave out of these, numbers and ranges as for --lines
    #[arg(long, value_name = "LINES")]
    without_lines: Option<LineSpec>,
    /// Frequencies whose lines are left out, in Hz, such as 50 (mains), 50:0.5 (half a hertz to
    /// either side) and 24.5:multiples (rotation)
    #[arg(long, value_name = "HZ,…", value_delimiter = ',')]
    without_hz: Vec<Disturbance>,
}

/// Nonlinear springs and dampers.
#[derive(Debug, Args)]
#[command(next_help_heading = "Nonlinear terms", group = ArgGroup::new("terms").multiple(true))]
struct NonlinearArgs {
    /// Springs and dampers to fit beside mass, damping and stiffness, each `name: law`: powers of x1
    /// and v1 (displacement and velocity of degree of freedom 1) or of (x1-x2) and (v1-v2), |v1| v1,
    /// v1^3/(1 + (v1/b)^2) with a number for b, gap(x1, 0.001) for a stop with that clearance (m) on either
    /// side, tanh(v1/0.01) for friction smoothed below that velocity (m/s), x1^0 for a constant force
    #[arg(long, value_name = "TERMS", group = "terms")]
    nonlinear: Option<Terms>,
    /// Terms to try besides, written in the same way: one after the other the most useful is added, as
    /// long as --criterion finds it worth it
    #[arg(long, value_name = "TERMS", group = "terms")]
    candidates: Option<Terms>,
    /// Criterion by which a candidate is added [default: information]
    #[arg(long, value_name = "CRITERION", value_enum, requires = "candidates")]
    criterion: Option<CriterionChoice>,
    /// Constants to search for besides: those inside the laws, the delay of the force, the phase that
    /// all channels have in common
    #[arg(long, value_name = "WHAT,…", value_enum, value_delimiter = ',', requires = "terms")]
    search: Vec<SearchChoice>,
    /// Weighting of the lines [default: automatic]
    #[arg(long, value_name = "WEIGHTING", value_enum, requires = "terms")]
    weighting: Option<WeightingChoice>,
}

impl NonlinearArgs {
    /// Returns the settings of the terms, if there are any.
    fn settings(&self) -> Option<Nonlinear> {
        self.given()?;
        let searched = |what| self.search.contains(&what);
        Some(Nonlinear {
            terms: self.nonlinear.clone().unwrap_or_default(),
            candidates: self.candidates.clone().unwrap_or_default(),
            criterion: self.criterion.map_or(Criterion::default(), Into::into),
            search: ShapeConstants {
                laws: searched(SearchChoice::Laws),
                delay: searched(SearchChoice::Delay),
                phase: searched(SearchChoice::Phase),
            },
            weighting: self.weighting.map_or(Weighting::Automatic, Into::into),
        })
    }

    /// Returns the first of these options that was given.
    fn given(&self) -> Option<&'static str> {
        let candidates = self.candidates.as_ref().map(|_| "--candidates");
        self.nonlinear.as_ref().map(|_| "--nonlinear").or(candidates)
    }
}

/// Fits in the time domain.
#[derive(Debug, Args)]
#[command(next_help_heading = "Time domain")]
struct TimeArgs {
    /// Derivation of the velocity and the acceleration where only the displacement was measured, or
    /// only the acceleration: by the spectrum of whole periods, or by a polynomial of an ORDER
    /// through a sliding WINDOW of samples (odd)
    #[arg(long, value_name = "spectral|savitzky-golay:WINDOW:ORDER")]
    derivatives: Option<Derivatives>,
    /// Put this many steps into every interval, which makes the error of --between-samples smaller
    #[arg(long, value_name = "FACTOR", value_parser = at_least_one,
          requires_all = ["interpolation", "between_samples"])]
    refine: Option<usize>,
    /// Interpolation between the samples
    #[arg(long, value_name = "WAY", value_enum, requires = "refine")]
    interpolation: Option<InterpolationChoice>,
}

/// Segments of a record to average over.
#[derive(Debug, Args)]
#[command(next_help_heading = "Frequency responses")]
pub struct SegmentArgs {
    /// Samples of a segment, for a random excitation [default: the periods are the segments; of records
    /// without --period, chosen by the coherence]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one)]
    segment: Option<usize>,
    /// Window that weights the samples of a segment [default: hann]
    #[arg(long, value_name = "WINDOW", value_enum, requires = "segment")]
    segment_window: Option<WeightChoice>,
    /// Part of a segment that the next one repeats, in per cent [default: 50]
    #[arg(long, value_name = "PERCENT", value_parser = share, requires = "segment",
          allow_negative_numbers = true)]
    segment_overlap: Option<f64>,
}

/// Frequency responses that were measured elsewhere.
#[derive(Debug, Args)]
#[command(next_help_heading = "Tables of frequency responses")]
pub struct TableArgs {
    /// The files are tables of frequency responses: text with columns h_1_1_real, h_1_1_imaginary …
    /// as `mechid frf --output` writes it, or universal files (datasets 58 of types 4 and 6)
    #[arg(long, conflicts_with_all = ["force", "displacement", "velocity", "acceleration",
          "sample_rate", "time", "period", "detrend", "lines", "without_lines", "without_hz", "from_frf", "segment", "nonlinear", "candidates", "more_starts",
          "between_samples", "extent", "force_noise", "hits", "struck", "derivatives", "refine", "validate", "validate_start",
          "validate_samples", "skip_lines", "record_column"])]
    frf_table: bool,
    /// Measured quantity of the responses, where the table does not state it
    #[arg(long, value_name = "QUANTITY", value_enum, requires = "frf_table")]
    quantity: Option<QuantityChoice>,
    /// Number of independent averages behind the coherence, from which standard errors follow; not
    /// needed where the table has standard errors
    #[arg(long, value_name = "COUNT", value_parser = at_least_one, requires = "frf_table")]
    averages: Option<usize>,
    /// Points to use, one per degree of freedom, as the table names them [default: all]
    #[arg(long, value_name = "POINT,…", value_delimiter = ',', requires = "frf_table")]
    points: Vec<String>,
}

/// A record to predict.
#[derive(Debug, Args)]
#[command(next_help_heading = "Validation")]
struct ValidationArgs {
    /// Validation record (same columns): report the percentage of its response that the identified
    /// system predicts
    #[arg(long, value_name = "RECORD")]
    validate: Option<PathBuf>,
    /// First sample to predict, counted from 1; without --validate, of the record itself
    /// [default: 1]
    #[arg(long, value_name = "SAMPLE", value_parser = at_least_one)]
    validate_start: Option<usize>,
    /// Samples to predict [default: all from --validate-start on]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one)]
    validate_samples: Option<usize>,
}

fn share(text: &str) -> Result<f64, String> {
    let percent: f64 = text.parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    match (0.0..100.0).contains(&percent) {
        true => Ok(percent),
        false => Err(format!("an overlap lies from 0 to below 100 %, got {percent}")),
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

    /// Returns the first of these options that was given.
    fn given(&self) -> Option<&'static str> {
        let lines = self.lines.as_ref().map(|_| "--lines");
        let without = self.without_lines.as_ref().map(|_| "--without-lines");
        let frequencies = self.without_hz.first().map(|_| "--without-hz");
        lines.or(self.band_hz.map(|_| "--band-hz")).or(without).or(frequencies)
    }
}

impl SegmentArgs {
    /// Returns the segments.
    pub fn segmentation(&self) -> Segmentation {
        let usual = Segmentation::default();
        Segmentation {
            segment: self.segment,
            window: self.segment_window.map_or(usual.window, Into::into),
            overlap_percent: self.segment_overlap.unwrap_or(usual.overlap_percent),
        }
    }
}

impl TimeArgs {
    /// Returns the first of these options that was given.
    fn given(&self) -> Option<&'static str> {
        [(self.derivatives.is_some(), "--derivatives"), (self.refine.is_some(), "--refine")]
            .into_iter()
            .find_map(|(given, name)| given.then_some(name))
    }
}

impl FitArgs {
    /// Reads the records, identifies the machine, and predicts the validation record.
    pub fn identify(&self) -> Result<Identified, CliError> {
        self.check_options()?;
        let channels = self.hits.channels_of(&self.channels.channels(), 1 + self.more.len())?;
        let first = self.input.open(&channels[0])?;
        let mut records = vec![first.clone()];
        for &start in &self.more_starts {
            records.push(first.clone().window(Window { start, ..self.input.window() })?);
        }
        for (record, channels) in self.more.iter().zip(&channels[1..]) {
            records.push(self.input.open_other(record, channels, self.input.window())?);
        }
        let mut identified = mechid::identify(&records, &self.settings())?;
        if self.fitted_lines {
            identified.add_fitted_lines()?;
        }
        let predicted = &self.validation;
        let (start, samples) = (predicted.validate_start, predicted.validate_samples);
        let other = match (&predicted.validate, start, samples) {
            (None, None, None) => return Ok(identified),
            (None, None, Some(samples)) => return Err(CliError::ValidationStart { samples }),
            (Some(record), _, _) => {
                self.input.open_other(record, &channels[0], Window::default())?
            }
            (None, _, _) => records.swap_remove(0),
        };
        let other = identified.validation_window(other, &ValidationWindow { start, samples })?;
        identified.add_validation(&other)?;
        Ok(identified)
    }

    /// Identifies the machine from tables of frequency responses, if the files are such.
    pub fn identify_tables(
        &self,
        table: &TableArgs,
    ) -> Result<Option<IdentifiedResponses>, CliError> {
        if !table.frf_table {
            return Ok(None);
        }
        if let Domain::Time = self.domain {
            let (option, why) = ("--frf-table", "belongs to --domain frequency");
            return Err(CliError::MisplacedOption { option, why });
        }
        let files = std::iter::once(self.input.record.as_path())
            .chain(self.more.iter().map(PathBuf::as_path));
        let tables: Vec<FrequencyResponses> =
            files.map(FrequencyResponses::read).collect::<Result<_, _>>()?;
        let how = IdentifyResponses {
            quantity: table.quantity.map(Into::into),
            averages: table.averages.map(|count| count as f64),
            points: table.points.clone(),
            band: self.lines.band_hz,
            mass: self.mass.clone(),
            structure: self.structure(),
            method: self.method.map(Method::from),
        };
        let mut identified = mechid::identify_responses(&tables, &how)?;
        if self.fitted_lines {
            identified.add_fitted_lines()?;
        }
        Ok(Some(identified))
    }

    /// Returns the records that are read.
    pub fn files(&self) -> Files<'_> {
        Files::default()
            .reads([&self.input.record])
            .reads(&self.more)
            .reads(&self.validation.validate)
    }

    /// Returns the result as text, with every check if asked for.
    pub fn text(&self, identified: &Identified) -> String {
        match self.verbose {
            true => format!("{identified}\nchecks:\n{}", identified.summary().all_checks()),
            false => identified.to_string(),
        }
    }

    /// Returns what is known of the form of M, C and K.
    fn structure(&self) -> Structure {
        Structure { forms: self.structure.clone() }
    }

    /// Returns the settings of the identification.
    fn settings(&self) -> Identify {
        let method = self.method.map(Method::from);
        let fit = match (self.domain, self.from_frf) {
            (Domain::Time, _) => Fit::Samples(SampleFit {
                between_samples: self.between_samples.map(Into::into),
                extent: self.extent.map(Into::into),
                derivatives: self.time.derivatives,
                refine: self.time.refine.zip(self.time.interpolation).map(
                    |(factor, interpolation)| Refinement {
                        factor,
                        interpolation: interpolation.into(),
                    },
                ),
            }),
            (Domain::Frequency, Some(estimator)) => Fit::Responses(ResponseFit {
                estimator: estimator.into(),
                segments: self.segments.segmentation(),
                method,
            }),
            (Domain::Frequency, None) => {
                let (noise, extent) = (self.noise.unwrap_or_default(), self.extent);
                let stated = !self.force_noise.is_empty();
                let force_noise = stated.then(|| self.force_noise.clone());
                Fit::Spectra { method, noise, extent: extent.map(Into::into), force_noise }
            }
        };
        Identify {
            fit,
            lines: self.lines.choice(),
            without: self.lines.without(),
            mass: self.mass.clone(),
            structure: self.structure(),
            hits: self.hits.rule(),
            nonlinear: self.nonlinear.settings(),
        }
    }

    /// Refuses options that the domain does not use.
    fn check_options(&self) -> Result<(), CliError> {
        let of_time = [self.between_samples.map(|_| "--between-samples"), self.time.given()];
        let of_frequency = [
            self.lines.given(),
            self.method.map(|_| "--method"),
            self.noise.map(|_| "--noise"),
            self.force_noise.first().map(|_| "--force-noise"),
            self.from_frf.map(|_| "--from-frf"),
            self.nonlinear.given(),
        ];
        let first = |options: &[Option<&'static str>]| options.iter().flatten().next().copied();
        let (misplaced, why) = match self.domain {
            Domain::Frequency => (first(&of_time), "belongs to --domain time"),
            Domain::Time => (first(&of_frequency), "belongs to --domain frequency"),
        };
        let alone =
            (self.from_frf.is_none() && self.segments.segment.is_some()).then_some("--segment");
        let of_spectra = [
            (self.noise.is_some(), "--noise"),
            (!self.force_noise.is_empty(), "--force-noise"),
            (self.extent.is_some(), "--extent"),
        ];
        let of_spectra =
            of_spectra.into_iter().find(|(given, _)| *given && self.from_frf.is_some());
        let alone = alone.map(|o| (o, "belongs to --from-frf"));
        let of_spectra = of_spectra.map(|(_, o)| (o, "belongs to fits without --from-frf"));
        match misplaced.map(|o| (o, why)).or(alone).or(of_spectra) {
            Some((option, why)) => Err(CliError::MisplacedOption { option, why }),
            None => Ok(()),
        }
    }
}
