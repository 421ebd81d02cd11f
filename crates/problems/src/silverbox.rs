//! Records of the Silverbox, a public benchmark that is not part of the project.
//!
//! Wigren & Schoukens, "Three free data sets for development and benchmarking in nonlinear system
//! identification", ECC 2013. The Silverbox is an electronic circuit with the equation of a mass on
//! a hardening spring; force and displacement are in volts.

use std::path::Path;

use mechid_signal::{Record, Sampling};

/// Returns force (first channel) and displacement (second) of a whole record, from two columns
/// counted from 0. If the file is missing, prints a message and returns `None`.
#[allow(clippy::print_stderr, reason = "a skipped test says so")]
fn channels(file: &str, columns: [usize; 2]) -> Option<Record> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/silverbox");
    let Ok(text) = std::fs::read_to_string(folder.join(file)) else {
        eprintln!("skipped: {file} of the Silverbox is missing in ../shared/data/silverbox");
        return None;
    };
    let mut channels = [Vec::new(), Vec::new()];
    for row in text.lines().skip(1).filter(|row| !row.is_empty()) {
        let fields: Vec<&str> = row.split(',').collect();
        for (channel, column) in channels.iter_mut().zip(columns) {
            channel.push(fields[column].trim().parse().expect("a voltage"));
        }
    }
    let sampling = Sampling::from_rate_hz(1e7 / 16384.0, channels[0].len()).unwrap();
    Some(Record::from_channels(sampling, &channels).unwrap())
}

/// Returns the Schroeder multisine of period 1024.
pub fn schroeder() -> Option<Record> {
    channels("Schroeder80mV.csv", [2, 3])
}

/// Returns the estimation part of the benchmark: six realisations of a random odd multisine.
pub fn realisations() -> Option<Record> {
    channels("SNLS80mV_estimation.csv", [0, 1])
}

/// Number of samples in the steady period of a realisation.
pub const REALISATION: usize = 8192;

/// Returns the index, counted from 0, of the first sample of the steady period of a realisation;
/// `realisation` is 1 to 6.
pub fn start_of(realisation: usize) -> usize {
    8692 * realisation + 337
}

/// Returns one channel of the samples `start .. start + len`.
pub fn channel_window(record: &Record, channel: usize, start: usize, len: usize) -> Record {
    let window = record.window(start, len).unwrap();
    Record::from_channel(window.sampling(), window.channel(channel).to_vec()).unwrap()
}
