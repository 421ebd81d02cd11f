//! The measures of an excitation, for people and for programs.

use mechid::signal::{Sampling, SignalError, Spectrum, measures, message};
use serde::Serialize;

use super::design::Channel;
use mechid::analysis::text::{significant, text_table};

/// Lines weaker than this fraction of the strongest are taken as rounding.
const FLOOR: f64 = 1e-9;

/// The effective band ends where the lines are this much weaker than the strongest, in dB.
const DROP_DB: f64 = 20.0;

#[derive(Debug, Serialize)]
pub struct Report {
    samples: usize,
    rate_hz: f64,
    period_s: f64,
    line_spacing_hz: f64,
    channels: Vec<Measures>,
}

#[derive(Debug, Serialize)]
struct Measures {
    name: String,
    rms: f64,
    /// Between samples, too.
    peak: f64,
    /// Peak over RMS.
    crest_factor: f64,
    /// Of the samples alone.
    sampled_crest_factor: f64,
    /// Geometric over arithmetic mean of the power of the lines asked for.
    spectral_flatness: f64,
    persistent_excitation_order: usize,
    /// Where the lines are at most 20 dB below the strongest.
    effective_band_low_hz: f64,
    effective_band_high_hz: f64,
    /// Largest circular autocorrelation of the samples at any lag but zero, over that at zero.
    autocorrelation_side_lobe: f64,
    lines: Vec<usize>,
    amplitudes: Vec<f64>,
    /// In rad, of cosines.
    phases: Vec<f64>,
}

impl Report {
    pub fn of(sampling: Sampling, channels: &[Channel]) -> Result<Self, SignalError> {
        Ok(Self {
            samples: sampling.len(),
            rate_hz: sampling.rate_hz(),
            period_s: sampling.duration(),
            line_spacing_hz: sampling.line_spacing_hz(),
            channels: channels.iter().map(Measures::of).collect::<Result<_, _>>()?,
        })
    }

    pub fn text(&self) -> String {
        let Self { samples, channels, .. } = self;
        let samples = message::count(*samples, "sample");
        let digits = |v: f64| significant(v, 6);
        let text = format!(
            "{samples} at {} Hz, a period of {} s, lines every {} Hz\n\n",
            digits(self.rate_hz),
            digits(self.period_s),
            digits(self.line_spacing_hz)
        );
        let header = std::iter::once(String::new()).chain(channels.iter().map(|c| c.name.clone()));
        let mut rows: Vec<Vec<String>> = vec![header.collect()];
        let mut row = |name: &str, cell: &dyn Fn(&Measures) -> String| {
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
        text + &text_table(&rows)
    }
}

impl Measures {
    fn of(channel: &Channel) -> Result<Self, SignalError> {
        let (multisine, period) = (&channel.multisine, &channel.period);
        let spectrum = Spectrum::of(period);
        let band = measures::effective_band(&spectrum, 0, DROP_DB)?;
        let lines = multisine.lines().to_vec();
        let correlation = measures::circular_autocorrelation(period.channel(0));
        Ok(Self {
            name: channel.name.clone(),
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
