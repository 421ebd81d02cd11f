//! Sinusoids in the responses of open records that the forces do not cause; they are subtracted.

use std::f64::consts::TAU;

use mechid_signal::message;
use mechid_spectra::Sinusoid;
use serde::Serialize;

use crate::measurement::Block;
use crate::text::significant;

/// Maximum number of frequencies that a remark lists.
const NAMED: usize = 4;
/// Maximum relative difference of two frequencies, in different records, that count as equal.
const SAME: f64 = 1e-3;

/// A sinusoid in the responses of one record that the forces do not explain.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SinusoidRow {
    /// The record.
    pub record: String,
    /// Frequency, in Hz.
    pub frequency_hz: f64,
    /// Amplitude in the response of each degree of freedom, in the unit of the fitted response.
    pub amplitudes: Vec<f64>,
    /// Largest ratio of an amplitude to √2 times the standard deviation of its response.
    pub share: f64,
    /// Index of the record; several records may have the same name.
    #[serde(skip)]
    record_index: usize,
}

impl SinusoidRow {
    /// Lists the sinusoids of the record with the index `record_index`.
    pub(super) fn all(record_index: usize, held: &Block, sinusoids: &[Sinusoid]) -> Vec<Self> {
        let deviations: Vec<f64> =
            held.response().0.data().column_iter().map(|x| x.variance().sqrt()).collect();
        let row = |sinusoid: &Sinusoid| {
            let amplitudes: Vec<f64> = sinusoid.amplitude().iter().map(|z| z.norm()).collect();
            let shares = amplitudes.iter().zip(&deviations);
            let shares = shares.filter(|(_, deviation)| **deviation > 0.0);
            Self {
                record: held.file.clone(),
                frequency_hz: sinusoid.omega() / TAU,
                share: shares.map(|(a, s)| a.abs() / s).fold(0.0, f64::max) / 2_f64.sqrt(),
                amplitudes,
                record_index,
            }
        };
        sinusoids.iter().map(row).collect()
    }

    /// Returns the remark on the sinusoids of all records, the strongest first; `None` if there are
    /// none.
    pub(super) fn remark(all: &[Self]) -> Option<String> {
        let mut by_size: Vec<&Self> = all.iter().collect();
        by_size.sort_by(|a, b| b.share.total_cmp(&a.share));
        let mut named: Vec<&Self> = Vec::new();
        for one in by_size {
            // Records of one test contain the same sinusoids.
            let known = |other: &&Self| {
                other.record_index != one.record_index
                    && (other.frequency_hz / one.frequency_hz - 1.0).abs() < SAME
            };
            if !named.iter().any(known) {
                named.push(one);
            }
        }
        let name = |one: &&Self| {
            let percent = significant(100.0 * one.share, 2);
            format!("{} Hz ({percent} % of the motion)", significant(one.frequency_hz, 6))
        };
        let list = message::list(named.iter().map(name), ", ", NAMED);
        (!named.is_empty()).then(|| {
            format!(
                "{} not caused by the forces {} fitted together with the machine and subtracted from the \
                 responses: {list}. Possible causes: run-out, an unbalance, mains",
                message::count(named.len(), "sinusoid"),
                if named.len() == 1 { "was" } else { "were" },
            )
        })
    }
}
