//! Frequency responses of a measurement.

use clap::{Args, ValueEnum};
use mechid::estimate::frequency_domain::Lines;
use mechid::estimate::{Frf, FrfAverage, FrfEstimator, Segments, Window};
use mechid::signal::Record;

use crate::commands::identify::measurement::{Hold, Recorded, STRETCH};
use crate::error::CliError;
use crate::options::at_least_one;

/// Which signal is believed where force and motion disagree.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Estimator {
    /// The force is exact, the motion noisy
    H1,
    /// The motion is exact, the force noisy
    H2,
    /// Both are noisy alike
    Hv,
}

impl Estimator {
    /// As it is written.
    pub fn name(self) -> &'static str {
        match self {
            Estimator::H1 => "H1",
            Estimator::H2 => "H2",
            Estimator::Hv => "Hv",
        }
    }
}

/// How a record is cut into pieces to average over.
#[derive(Debug, Args)]
#[command(next_help_heading = "Frequency responses")]
pub struct SegmentArgs {
    /// Samples of a segment, for a random excitation [default: the periods are the segments]
    #[arg(long, value_name = "SAMPLES", value_parser = at_least_one)]
    segment: Option<usize>,
    /// What the samples of a segment are weighted with [default: hann]
    #[arg(long, value_name = "WINDOW", value_enum, requires = "segment")]
    segment_window: Option<Weight>,
    /// How much of a segment the next one repeats, in per cent [default: 50]
    #[arg(long, value_name = "PERCENT", value_parser = share, requires = "segment",
          allow_negative_numbers = true)]
    segment_overlap: Option<f64>,
}

/// What the samples of a segment are weighted with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Weight {
    /// The usual choice
    Hann,
    /// A narrower peak, more leakage from far away
    Hamming,
    /// The least leakage, a wider peak
    Blackman,
    /// All alike, for bursts that begin and end at rest
    Rectangular,
}

fn share(text: &str) -> Result<f64, String> {
    let percent: f64 = text.parse().map_err(|_| format!("\"{text}\" is not a number"))?;
    match (0.0..100.0).contains(&percent) {
        true => Ok(percent),
        false => Err(format!("an overlap lies from 0 to below 100 %, got {percent}")),
    }
}

impl SegmentArgs {
    /// Whether the segments are whole periods.
    pub fn are_periods(&self) -> bool {
        self.segment.is_none()
    }

    /// What must be held of a record: segments are averaged one after another.
    pub fn hold(&self) -> Hold {
        self.segment.map_or(Hold::Periods, Hold::Samples)
    }

    /// The segments of a window with periods of so many samples.
    pub fn segments(&self, period: usize) -> Segments {
        let Some(len) = self.segment else { return Segments::Periods(period) };
        let left = 1.0 - self.segment_overlap.unwrap_or(50.0) / 100.0;
        let hop = ((len as f64 * left).round() as usize).clamp(1, len);
        let window = match self.segment_window.unwrap_or(Weight::Hann) {
            Weight::Hann => Window::Hann,
            Weight::Hamming => Window::Hamming,
            Weight::Blackman => Window::Blackman,
            Weight::Rectangular => Window::Rectangular,
        };
        Segments::Windowed { len, hop, window }
    }
}

/// The frequency responses of a measurement.
#[derive(Debug)]
pub struct Responses {
    pub frf: Frf,
    /// Of a segment.
    pub lines: Lines,
    /// Degrees of freedom a force acts on, counted from 0.
    pub driven: Vec<usize>,
    pub segments: Segments,
}

impl Responses {
    /// From the forces that act to the first kind of motion measured, on the lines that `choose`
    /// finds in a segment of the force.
    pub fn of(
        recorded: &Recorded,
        segments: &SegmentArgs,
        estimator: Estimator,
        choose: impl Fn(&Record, usize) -> Result<Vec<usize>, CliError>,
    ) -> Result<Self, CliError> {
        let held = &recorded.held;
        let segments = segments.segments(held.period);
        let (force, driven) = (&held.force, held.driven.clone());
        let len = segments.samples();
        let chosen = match segments {
            Segments::Periods(period) => choose(force, period)?,
            Segments::Windowed { len, .. } => choose(&force.window(0, len)?, len)?,
        };
        let lines = Lines::new(force.sampling().with_len(len)?, chosen)?;
        let average = average(recorded, &lines, segments)?;
        let frf = average.frf(match estimator {
            Estimator::H1 => FrfEstimator::H1,
            Estimator::H2 => FrfEstimator::H2,
            Estimator::Hv => FrfEstimator::Hv,
        })?;
        Ok(Self { frf, lines, driven, segments })
    }
}

/// From the forces that act to the first kind of motion measured, on some lines of a segment, over all
/// of the window.
pub fn average(
    recorded: &Recorded,
    lines: &Lines,
    segments: Segments,
) -> Result<FrfAverage, CliError> {
    let driven = &recorded.held.driven;
    let (motion, kind) = recorded.held.motion();
    let channels = [driven.len(), motion.channels()];
    let mut average = FrfAverage::new(lines.clone(), channels, kind, segments)?;
    let (hop, at_once) = (segments.hop(), (STRETCH / segments.hop()).max(1));
    let (samples, advance) = ((at_once - 1) * hop + segments.samples(), at_once * hop);
    recorded.stretches(samples, advance, &mut |stretch| {
        let acting: Vec<&[f64]> = driven.iter().map(|dof| stretch.force.channel(*dof)).collect();
        let acting = Record::from_channels(stretch.force.sampling(), &acting)?;
        Ok(average.push(&acting, stretch.motion().0)?)
    })?;
    Ok(average)
}
