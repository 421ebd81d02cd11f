//! Residual of the measured response after the identified system's prediction.

use mechid_checks::SpectralResidual;
use mechid_signal::correlation::{Correlation, cross_correlation, whiteness};
use mechid_signal::{Record, measures};

use crate::AnalysisError;
use crate::identify::Identified;
use crate::identify::fitted;
use crate::identify::prediction::Compared;
use crate::measurement::Block;

/// Share of the response below which a residual is rounding.
const ROUNDING: f64 = 1e-12;

/// Measured and predicted motion of one record, and whether what the fit leaves is noise.
pub struct Residual {
    /// Every kind of motion measured.
    pub compared: Vec<Compared>,
    /// Correlations of each residual channel; empty where it is not tested by itself.
    pub correlations: Vec<Correlations>,
    /// The first kind of motion in the mean period, where there are several.
    pub mean: Option<Compared>,
}

/// Correlations of one channel of a residual.
pub struct Correlations {
    /// Correlation with itself; `None` if there are too few lines.
    pub own: Option<OwnCorrelation>,
    /// Time between two lags of the correlation with a force, in s.
    pub lag: f64,
    /// Cross-correlation with each force that acts, by its degree of freedom counted from 0.
    pub forces: Vec<(usize, Correlation)>,
}

/// Correlation of a channel of a residual with itself.
pub enum OwnCorrelation {
    /// Correlation from sample to sample, at the lags 1, 2 …
    Samples {
        /// Autocorrelation.
        correlation: Correlation,
        /// Number of lags over which noise on the response correlates it.
        span: usize,
    },
    /// Correlation from line to line: real and imaginary part at the distances 1, 2 …
    Lines(Correlation),
}

impl Residual {
    /// Computes it for the record with this index, as far as it is held, and for its mean period.
    ///
    /// # Errors
    /// If the machine has no such motion.
    pub fn of(
        identified: &Identified,
        at: usize,
        mean: Option<&Block>,
    ) -> Result<Self, AnalysisError> {
        let model = identified.fitted().model()?;
        let prediction = identified.fitted().prediction;
        let compared = prediction.predict(&model, &identified.records()[at].held)?;
        let mean = mean.map(|mean| prediction.predict(&model, mean)).transpose()?;
        let mean = mean.map(|mut motions| motions.swap_remove(0));
        let correlations = match identified.fitted().residuals.get(at) {
            Some(fitted::Residual::Samples(residual)) => of_samples(residual)?,
            Some(fitted::Residual::Lines(residual)) => of_lines(residual),
            None => Vec::new(),
        };
        Ok(Self { compared, correlations, mean })
    }
}

/// Returns the RMS of one channel of the measured response, and of its part that the prediction
/// leaves, both in the unit of the channel.
pub fn sizes(compared: &Compared, channel: usize) -> (f64, f64) {
    let measured = compared.measured.channel(channel);
    let apart: Vec<f64> =
        measured.iter().zip(compared.predicted.channel(channel)).map(|(x, p)| x - p).collect();
    let (size, rest) = (measures::rms(measured), measures::rms(&apart));
    (size, if rest > ROUNDING * size { rest } else { 0.0 })
}

/// Correlates at the lags at which the checks judge the residual.
fn of_samples(residual: &fitted::SampleResidual) -> Result<Vec<Correlations>, AnalysisError> {
    let (force, span, lags) = (&residual.force, residual.noise_span, residual.lags());
    if lags == 0 {
        return Ok(Vec::new());
    }
    let acting = || (0..force.channels()).filter(|c| varies(force, *c));
    let of = |channel: usize| {
        let samples = residual.samples.channel(channel);
        let with = |c: usize| Ok((c, cross_correlation(samples, force.channel(c), lags)?));
        let forces = acting().map(with).collect::<Result<_, AnalysisError>>()?;
        let own = OwnCorrelation::Samples { correlation: whiteness(samples, lags)?, span };
        Ok(Correlations { own: Some(own), lag: force.sampling().dt(), forces })
    };
    (0..residual.samples.channels()).map(of).collect()
}

fn of_lines(residual: &SpectralResidual) -> Vec<Correlations> {
    let empty = |channel: usize| Correlations {
        own: residual.line_to_line(channel, 1).map(OwnCorrelation::Lines),
        lag: residual.lag(),
        forces: Vec::new(),
    };
    let mut all: Vec<Correlations> = (0..residual.dof()).map(empty).collect();
    for force in 0..residual.dof() {
        for (channel, correlation) in all.iter_mut().zip(residual.with_force(force)) {
            channel.forces.extend(correlation.map(|correlation| (force, correlation)));
        }
    }
    let any = all.iter().any(|channel| channel.own.is_some() || !channel.forces.is_empty());
    if any { all } else { Vec::new() }
}

fn varies(force: &Record, channel: usize) -> bool {
    let values = force.channel(channel);
    values.iter().any(|value| *value != values[0])
}
