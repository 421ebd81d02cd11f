//! Difference between the measured response and the prediction of the identified system.

use mechid_checks::SpectralResidual;
use mechid_signal::correlation::{Correlation, cross_correlation, whiteness};
use mechid_signal::{Record, measures};

use crate::AnalysisError;
use crate::identify::Identified;
use crate::identify::fitted;
use crate::identify::prediction::Compared;
use crate::measurement::Block;

/// Maximum ratio of residual to response that counts as a rounding error.
const ROUNDING: f64 = 1e-12;

/// Measured and predicted motion of one record, and correlations of the residual of the fit.
pub struct Residual {
    /// Every measured quantity with its prediction.
    pub compared: Vec<Compared>,
    /// Correlations of each residual channel; empty if the channels are not tested separately.
    pub correlations: Vec<Correlations>,
    /// First measured quantity over the mean period, with its prediction; `None` without a mean
    /// period.
    pub mean: Option<Compared>,
}

/// Correlations of one channel of a residual.
pub struct Correlations {
    /// Autocorrelation; `None` if there are too few lines.
    pub own: Option<OwnCorrelation>,
    /// Time between two lags of the correlation with a force, in s.
    pub lag: f64,
    /// Cross-correlation with each acting force, by its degree of freedom counted from 0.
    pub forces: Vec<(usize, Correlation)>,
}

/// Autocorrelation of a channel of a residual.
pub enum OwnCorrelation {
    /// Correlation from sample to sample, at the lags 1, 2 …
    Samples {
        /// Autocorrelation.
        correlation: Correlation,
        /// Number of lags at which the residual is correlated because of noise on the response.
        span: usize,
    },
    /// Correlation from line to line: real and imaginary part at the distances 1, 2 …
    Lines(Correlation),
}

impl Residual {
    /// Computes the residual of the record with this index, for its samples in memory and its mean
    /// period.
    ///
    /// # Errors
    /// [`AnalysisError`] if the prediction of the machine does not exist.
    pub fn new(
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
            Some(fitted::Residual::Samples(residual)) => sample_correlations(residual)?,
            Some(fitted::Residual::Lines(residual)) => line_correlations(residual),
            None => Vec::new(),
        };
        Ok(Self { compared, correlations, mean })
    }
}

/// Returns the RMS of one channel of the measured response and of its residual, both in the unit of
/// the channel.
pub fn sizes(compared: &Compared, channel: usize) -> (f64, f64) {
    let measured = compared.measured.channel(channel);
    let residual: Vec<f64> =
        measured.iter().zip(compared.predicted.channel(channel)).map(|(x, p)| x - p).collect();
    let (size, residual) = (measures::rms(measured), measures::rms(&residual));
    (size, if residual > ROUNDING * size { residual } else { 0.0 })
}

/// Computes the correlations of the residual at the lags that the checks of the residual use.
fn sample_correlations(
    residual: &fitted::SampleResidual,
) -> Result<Vec<Correlations>, AnalysisError> {
    let (force, span, lags) = (&residual.force, residual.noise_span, residual.lags());
    if lags == 0 {
        return Ok(Vec::new());
    }
    let acting = || (0..force.channels()).filter(|c| varies(force, *c));
    let correlations = |channel: usize| {
        let samples = residual.samples.channel(channel);
        let with = |c: usize| Ok((c, cross_correlation(samples, force.channel(c), lags)?));
        let forces = acting().map(with).collect::<Result<_, AnalysisError>>()?;
        let auto = OwnCorrelation::Samples { correlation: whiteness(samples, lags)?, span };
        Ok(Correlations { own: Some(auto), lag: force.sampling().dt(), forces })
    };
    (0..residual.samples.channels()).map(correlations).collect()
}

fn line_correlations(residual: &SpectralResidual) -> Vec<Correlations> {
    let empty = |channel: usize| Correlations {
        own: residual.line_to_line(channel, 1).map(OwnCorrelation::Lines),
        lag: residual.lag(),
        forces: Vec::new(),
    };
    let mut channels: Vec<Correlations> = (0..residual.dof()).map(empty).collect();
    for force in 0..residual.dof() {
        for (channel, correlation) in channels.iter_mut().zip(residual.with_force(force)) {
            channel.forces.extend(correlation.map(|correlation| (force, correlation)));
        }
    }
    let any = channels.iter().any(|channel| channel.own.is_some() || !channel.forces.is_empty());
    if any { channels } else { Vec::new() }
}

fn varies(force: &Record, channel: usize) -> bool {
    let values = force.channel(channel);
    values.iter().any(|value| *value != values[0])
}
