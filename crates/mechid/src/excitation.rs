//! Design of multisines for a test with one or several inputs, and measures of their quality.

use std::fmt;

use mechid_analysis::text::{significant, text_table};
use mechid_signal::multi_input::{Mixing, orthogonal};
use mechid_signal::{
    CrestSearch, Multisine, Phases, Record, Sampling, SignalError, Spectrum, lines, measures,
    message,
};
use serde::Serialize;

/// Maximum amplitude, relative to the strongest line, of a line that counts as rounding.
const FLOOR: f64 = 1e-9;

/// Difference of level between the strongest line and the ends of the effective band, in dB.
const DROP_DB: f64 = 20.0;

/// Design of the excitation of a test.
///
/// ```
/// use mechid::excitation::{ExcitationDesign, Separation};
/// use mechid::signal::{Phases, Sampling, lines};
///
/// let design = ExcitationDesign {
///     inputs: 2,
///     separation: Separation::Orthogonal(mechid::signal::multi_input::Mixing::Hadamard),
///     ..ExcitationDesign::flat(lines::odd(61), Phases::Schroeder)
/// };
/// // Two experiments of two inputs each.
/// let inputs = design.inputs(Sampling::from_rate_hz(256.0, 256)?)?;
/// assert_eq!(inputs.len(), 4);
/// assert_eq!(inputs[3].name, "experiment_2_force_2");
/// # Ok::<(), mechid::signal::SignalError>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct ExcitationDesign {
    /// Numbers of the lines, multiples of the reciprocal period.
    pub lines: Vec<usize>,
    /// Amplitude of the first line, in N.
    pub amplitude: f64,
    /// Slope of the amplitudes after the first line, in dB per decade.
    pub slope_db: f64,
    /// Law of the phases; random phases of further inputs have other seeds.
    pub phases: Phases,
    /// Number of starting points of a search for phases of low crest factor; 0 for no search.
    pub starts: usize,
    /// Seed of the search.
    pub seed: u64,
    /// Number of inputs.
    pub inputs: usize,
    /// Separation of several inputs.
    pub separation: Separation,
    /// Level of each input; `None`: the level that follows from the amplitudes.
    pub level: Option<ExcitationLevel>,
}

/// Methods to separate the responses to several inputs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Separation {
    /// Interleaved lines: each input has separate lines, assigned in turn, in one experiment.
    Interleaved,
    /// All inputs have the same lines; the number of experiments is equal to the number of inputs.
    Orthogonal(Mixing),
}

/// Level of a force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ExcitationLevel {
    /// RMS value, in N.
    Rms(f64),
    /// Largest absolute value, including values between samples, in N.
    Peak(f64),
}

/// One input of one experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct DesignedInput {
    /// Name of the column of this input.
    pub name: String,
    /// The multisine.
    pub multisine: Multisine,
    /// One period of the force, in N.
    pub period: Record,
}

impl ExcitationDesign {
    /// Designs one input of amplitude 1 N on every line.
    pub fn flat(lines: Vec<usize>, phases: Phases) -> Self {
        Self {
            lines,
            amplitude: 1.0,
            slope_db: 0.0,
            phases,
            starts: 0,
            seed: 0,
            inputs: 1,
            separation: Separation::Interleaved,
            level: None,
        }
    }

    /// Creates the inputs and samples one period of each, experiment by experiment.
    ///
    /// # Errors
    /// [`SignalError`] for lines beyond half the sampling rate, a level that is not positive,
    /// inputs that cannot be mixed, or more inputs than lines.
    pub fn inputs(&self, sampling: Sampling) -> Result<Vec<DesignedInput>, SignalError> {
        let chosen = self.lines.clone();
        if self.inputs == 1 {
            return Ok(vec![self.sampled("force".into(), self.input(chosen, 0)?, sampling)?]);
        }
        let lines_of_inputs = match self.separation {
            Separation::Interleaved => lines::interleaved(&chosen, self.inputs)?,
            Separation::Orthogonal(_) => vec![chosen; self.inputs],
        };
        let inputs = (0..).zip(lines_of_inputs).map(|(k, lines)| self.input(lines, k));
        let inputs: Vec<Multisine> = inputs.collect::<Result<_, _>>()?;
        let experiments = match self.separation {
            Separation::Interleaved => vec![inputs],
            Separation::Orthogonal(mixing) => orthogonal(&inputs, mixing)?,
        };
        let single = experiments.len() == 1;
        let mut designed = Vec::new();
        for (e, inputs) in (1..).zip(experiments) {
            for (k, multisine) in (1..).zip(inputs) {
                let name =
                    if single { format!("force_{k}") } else { format!("experiment_{e}_force_{k}") };
                designed.push(self.sampled(name, multisine, sampling)?);
            }
        }
        Ok(designed)
    }

    fn sampled(
        &self,
        name: String,
        multisine: Multisine,
        sampling: Sampling,
    ) -> Result<DesignedInput, SignalError> {
        // The level is set after mixing, because mixing changes the peak.
        let multisine = match self.level {
            Some(ExcitationLevel::Rms(rms)) => multisine.with_rms(rms)?,
            Some(ExcitationLevel::Peak(peak)) => multisine.with_peak(peak)?,
            None => multisine,
        };
        let period = multisine.sample(sampling)?;
        Ok(DesignedInput { name, multisine, period })
    }

    /// Creates the multisine of one input before mixing; inputs differ by their seeds.
    fn input(&self, lines: Vec<usize>, input: u64) -> Result<Multisine, SignalError> {
        let seed = self.seed.wrapping_add(input);
        let law = match &self.phases {
            Phases::Random { seed } => Phases::Random { seed: seed.wrapping_add(input) },
            // The search for a further input begins at other phases, otherwise all inputs would be
            // equal.
            _ if self.starts > 0 && input > 0 => Phases::Random { seed },
            law => law.clone(),
        };
        let first = lines.first().copied().unwrap_or(1) as f64;
        let sloped = |n: &usize| self.amplitude * (*n as f64 / first).powf(self.slope_db / 20.0);
        let amplitudes = lines.iter().map(sloped).collect();
        let multisine = Multisine::new(lines, amplitudes, law)?;
        match self.starts {
            0 => Ok(multisine),
            starts => CrestSearch { starts, seed }.minimise(&multisine),
        }
    }
}

/// Measures of an excitation; `Display` writes them as text, `Serialize` as data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExcitationSummary {
    /// Number of samples in a period.
    pub samples: usize,
    /// Sampling rate, in Hz.
    pub rate_hz: f64,
    /// Period, in s.
    pub period_s: f64,
    /// Distance of neighbouring lines, in Hz.
    pub line_spacing_hz: f64,
    /// Measures of each input.
    pub channels: Vec<InputMeasures>,
}

/// Measures of one input.
///
/// # Source
/// Schroeder (1970), IEEE Trans. Information Theory 16, 85–89; Pintelon & Schoukens, *System
/// Identification: A Frequency Domain Approach*, the chapter on excitations.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InputMeasures {
    /// Name of the column of the input.
    pub name: String,
    /// RMS value, in N.
    pub rms: f64,
    /// Largest absolute force, including values between samples, in N.
    pub peak: f64,
    /// Ratio of peak to RMS value, a pure number.
    pub crest_factor: f64,
    /// Crest factor of the samples only.
    pub sampled_crest_factor: f64,
    /// Ratio of the geometric to the arithmetic mean of the power of the designed lines, a pure
    /// number.
    pub spectral_flatness: f64,
    /// Order of persistent excitation.
    pub persistent_excitation_order: usize,
    /// Lower end of the band whose lines are at most 20 dB below the strongest line, in Hz.
    pub effective_band_low_hz: f64,
    /// Upper end of the band whose lines are at most 20 dB below the strongest line, in Hz.
    pub effective_band_high_hz: f64,
    /// Largest circular autocorrelation of the samples at a lag other than zero, as a ratio to the
    /// value at zero.
    pub autocorrelation_side_lobe: f64,
    /// Numbers of the lines, in rising order.
    pub lines: Vec<usize>,
    /// Amplitudes of the lines, in N, one per line.
    pub amplitudes: Vec<f64>,
    /// Phases of cosines, in rad, one per line.
    pub phases: Vec<f64>,
}

impl ExcitationSummary {
    /// Computes the measures of inputs, which must have one time axis.
    ///
    /// # Errors
    /// [`SignalError`] if there is no input, or if an input has no power.
    pub fn new(inputs: &[DesignedInput]) -> Result<Self, SignalError> {
        let too_few = SignalError::TooFew { what: "inputs", least: 1, got: 0 };
        let sampling = inputs.first().ok_or(too_few)?.period.sampling();
        Ok(Self {
            samples: sampling.len(),
            rate_hz: sampling.rate_hz(),
            period_s: sampling.duration(),
            line_spacing_hz: sampling.line_spacing_hz(),
            channels: inputs.iter().map(InputMeasures::new).collect::<Result<_, _>>()?,
        })
    }
}

impl InputMeasures {
    fn new(input: &DesignedInput) -> Result<Self, SignalError> {
        let (multisine, period) = (&input.multisine, &input.period);
        let spectrum = Spectrum::from_record(period);
        let band = measures::effective_band(&spectrum, 0, DROP_DB)?;
        let lines = multisine.lines().to_vec();
        let correlation = measures::circular_autocorrelation(period.channel(0));
        Ok(Self {
            name: input.name.clone(),
            rms: multisine.rms(),
            peak: multisine.peak(),
            crest_factor: multisine.crest_factor()?,
            sampled_crest_factor: measures::crest_factor(period, 0)?,
            spectral_flatness: measures::spectral_flatness(&spectrum, 0, lines.iter().copied())?,
            persistent_excitation_order: measures::persistent_excitation_order(
                &spectrum, 0, FLOOR,
            )?,
            effective_band_low_hz: band.low_hz,
            effective_band_high_hz: band.high_hz,
            autocorrelation_side_lobe: measures::peak(&correlation[1..]) / correlation[0],
            lines,
            amplitudes: multisine.amplitudes().to_vec(),
            phases: multisine.phases().to_vec(),
        })
    }
}

impl fmt::Display for ExcitationSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let channels = &self.channels;
        let digits = |v: f64| significant(v, 6);
        write!(
            f,
            "{} at {} Hz, a period of {} s, lines every {} Hz\n\n",
            message::count(self.samples, "sample"),
            digits(self.rate_hz),
            digits(self.period_s),
            digits(self.line_spacing_hz)
        )?;
        let header = std::iter::once(String::new()).chain(channels.iter().map(|c| c.name.clone()));
        let mut rows: Vec<Vec<String>> = vec![header.collect()];
        let mut row = |name: &str, cell: &dyn Fn(&InputMeasures) -> String| {
            rows.push(std::iter::once(name.into()).chain(channels.iter().map(cell)).collect());
        };
        row("lines excited", &|c| c.lines.len().to_string());
        row("RMS, N", &|c| significant(c.rms, 5));
        row("peak, N", &|c| significant(c.peak, 5));
        row("crest factor", &|c| significant(c.crest_factor, 4));
        row("crest factor of the samples", &|c| significant(c.sampled_crest_factor, 4));
        row("spectral flatness", &|c| significant(c.spectral_flatness, 4));
        row("order of persistent excitation", &|c| c.persistent_excitation_order.to_string());
        row("effective band from, Hz", &|c| significant(c.effective_band_low_hz, 5));
        row("effective band to, Hz", &|c| significant(c.effective_band_high_hz, 5));
        row("autocorrelation side lobe", &|c| significant(c.autocorrelation_side_lobe, 3));
        f.write_str(&text_table(&rows))
    }
}

#[cfg(feature = "report")]
mod figure {
    use mechid_plot::{Axis, Curve, Figure, Panel};
    use mechid_signal::resample::refine;
    use mechid_signal::{Interpolation, SignalError};

    use super::DesignedInput;

    /// Minimum number of points of a drawn period: enough to show the force between its samples.
    const DRAWN_POINTS: usize = 4096;

    /// Draws one period of each input, force (N) over time (s), and in a last panel the amplitudes
    /// (N) of the lines of all inputs.
    ///
    /// # Errors
    /// [`SignalError`] if a period cannot be interpolated.
    pub fn excitation_figure(inputs: &[DesignedInput]) -> Result<Figure, SignalError> {
        let mut figure = Figure::new("Multisine");
        let mut lines = Panel::new(Axis::linear("Frequency", "Hz"), Axis::linear("Amplitude", "N"));
        for DesignedInput { name, multisine, period } in inputs {
            // A single curve does not need a name.
            let name = if inputs.len() == 1 { "" } else { name.as_str() };
            let factor = DRAWN_POINTS.div_ceil(period.len());
            let fine = refine(period, factor, Interpolation::BandLimited)?;
            let instants: Vec<f64> = fine.sampling().times().collect();
            let time =
                Panel::new(Axis::linear("Time", "s"), Axis::linear("Force", "N")).title(name);
            let curve = Curve::line("", &instants, fine.channel(0)).width(1.0);
            figure = figure.panel(time.curve(curve));
            let spacing_hz = period.sampling().line_spacing_hz();
            let f: Vec<f64> = multisine.lines().iter().map(|n| *n as f64 * spacing_hz).collect();
            lines = lines.curve(Curve::stems(name, &f, multisine.amplitudes()));
        }
        Ok(figure.panel(lines))
    }
}

#[cfg(feature = "report")]
pub use figure::excitation_figure;
