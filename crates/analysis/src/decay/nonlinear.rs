//! Signs of a nonlinear response in a free decay: a backbone, harmonics, a second hit.

use mechid_estimate::IdentifiedMode;
use mechid_modal::free_decay::Backbone;
use serde::{Deserialize, Serialize};

use super::summary::DecaySummary;
use crate::AnalysisError;
use crate::identify::rows::Uncertain;
use crate::text::{compact, significant, text_table};

/// Highest order of a harmonic.
const HIGHEST_HARMONIC: u32 = 7;
/// Maximum ratio of the tolerance of a harmonic to the frequency of the fundamental mode.
const HARMONIC_REACH: f64 = 0.1;
/// Maximum difference between the frequency of a harmonic and a multiple of the fundamental
/// frequency, in standard errors.
const HARMONIC_ERRORS: f64 = 4.0;

/// Mode whose frequency is a multiple of another mode's frequency, within their errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Harmonic {
    /// Number, counted from 1, of the mode whose frequency is multiplied.
    pub of_mode: usize,
    /// Order of the harmonic.
    pub order: u32,
}

/// Frequency and damping as functions of the amplitude (backbone curve).
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BackboneRow {
    /// Numbers, counted from 1, of the linear modes that represent this nonlinear mode.
    pub modes: Vec<usize>,
    /// Decrease of the Bayesian information criterion from the linear modes to the backbone, a pure
    /// number.
    pub gain: f64,
    /// Values by falling amplitude.
    pub points: Vec<BackbonePointRow>,
}

/// Frequency and damping at one amplitude.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct BackbonePointRow {
    /// Time from the first sample used, in s.
    pub time_s: f64,
    /// Amplitude in the channel where the mode is largest, in the unit of the response.
    pub amplitude: f64,
    /// Frequency, in Hz.
    pub frequency_hz: Uncertain,
    /// Damping ratio.
    pub damping_ratio: Uncertain,
}

impl BackboneRow {
    pub(super) fn new(backbone: &Backbone) -> Result<Self, AnalysisError> {
        let points = backbone.points.iter().map(|point| {
            Ok(BackbonePointRow {
                time_s: point.time,
                amplitude: point.amplitude,
                frequency_hz: Uncertain::from_estimate(&point.frequency_hz)?,
                damping_ratio: Uncertain::from_estimate(&point.damping_ratio)?,
            })
        });
        Ok(Self {
            modes: backbone.modes.iter().map(|at| at + 1).collect(),
            gain: backbone.gain,
            points: points.collect::<Result<_, AnalysisError>>()?,
        })
    }
}

impl DecaySummary {
    /// Marks the modes whose frequency is, within four standard errors, a multiple of the frequency
    /// of the nonlinear mode at some amplitude. Without a nonlinear mode, no mode is marked,
    /// because then a multiple is a coincidence.
    pub(super) fn name_harmonics(&mut self, modes: &[IdentifiedMode]) {
        let named: Vec<Option<Harmonic>> =
            (0..modes.len()).map(|at| self.harmonic(modes, at)).collect();
        self.modes.iter_mut().zip(named).for_each(|(row, harmonic)| row.harmonic = harmonic);
    }

    fn harmonic(&self, modes: &[IdentifiedMode], at: usize) -> Option<Harmonic> {
        let backbone = self.backbone.as_ref()?;
        if backbone.modes.contains(&(at + 1)) {
            return None;
        }
        let frequency = modes[at].damped_frequency_hz;
        let hz = || backbone.points.iter().map(|point| point.frequency_hz.value);
        let (low, high) = (hz().fold(f64::INFINITY, f64::min), hz().fold(0.0, f64::max));
        let reach = HARMONIC_ERRORS * frequency.standard_error;
        let order = (2..=HIGHEST_HARMONIC).find(|order| {
            let multiple = f64::from(*order);
            (multiple * low - reach..=multiple * high + reach).contains(&frequency.value)
        });
        let energy = |number: usize| self.modes[number - 1].energy_share;
        let strongest = backbone.modes.iter().max_by(|a, b| energy(**a).total_cmp(&energy(**b)));
        // A frequency with a large standard error is not marked: its wide interval may contain a
        // multiple of the fundamental frequency by chance.
        let (order, of_mode) = order.zip(strongest).filter(|_| reach < HARMONIC_REACH * low)?;
        Some(Harmonic { of_mode: *of_mode, order })
    }

    /// Returns remarks about deviations from a sum of decaying oscillations.
    pub(crate) fn model_remarks(&self) -> Vec<String> {
        let mut remarks = Vec::new();
        if let Some(backbone) = &self.backbone {
            let numbers: Vec<String> = backbone.modes.iter().map(usize::to_string).collect();
            let stand = match &numbers[..] {
                [one] => format!(
                    "Mode {one} is not linear, and its frequency and damping ratio are only mean values"
                ),
                all => format!("Modes {} together represent one mode", all.join(", ")),
            };
            remarks.push(format!(
                "the amplitude does not fall exponentially: a frequency and damping that depend on the \
                 amplitude describe the response better (the Bayesian information criterion falls by \
                 {}). {stand}; use the frequencies and damping ratios that are given over the amplitude",
                significant(backbone.gain, 3)
            ));
        }
        if let Some(at) = self.excited_again_s {
            let at = compact(at, 4);
            remarks.push(format!(
                "the response is excited again at about {at} s, for example by a second hit: the modes are not \
                 those of one decay. Use only the samples before this time (`to` {at}) or after it (`from` {at})"
            ));
        }
        if self.analysis.modes.is_none() && self.modes.len() == self.analysis.max_modes {
            remarks.push(format!(
                "as many modes were found as `max_modes` allows ({}): there may be more modes; raise `max_modes`",
                self.modes.len()
            ));
        }
        for (number, row) in (1..).zip(&self.modes) {
            if let Some(Harmonic { of_mode, order }) = row.harmonic {
                remarks.push(format!(
                    "the frequency of mode {number} is {order} × that of mode {of_mode}, within four standard errors: it \
                     may be a harmonic of a nonlinear response instead of a mode of the structure"
                ));
            }
        }
        remarks
    }

    /// Returns frequency and damping over amplitude as a table; an empty text without a backbone.
    pub(super) fn backbone_table(&self) -> String {
        let Some(backbone) = &self.backbone else { return String::new() };
        let header = [
            &format!("amplitude ({})", self.unit),
            "time (s)",
            "frequency (Hz)",
            "±",
            "damping ratio (%)",
            "±",
        ];
        let mut rows = vec![header.map(String::from).to_vec()];
        rows.extend(backbone.points.iter().map(|point| {
            let [frequency, frequency_error, _] = point.frequency_hz.cells();
            let [damping, damping_error, _] = point.damping_ratio.percent().cells();
            let (amplitude, time) = (significant(point.amplitude, 3), significant(point.time_s, 3));
            vec![amplitude, time, frequency, frequency_error, damping, damping_error]
        }));
        text_table(&rows) + "\n"
    }
}
