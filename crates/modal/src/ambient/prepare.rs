//! Lines and subspace models of an ambient record, and checks of the record.

use std::f64::consts::TAU;

use mechid_signal::{Record, transform};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};

use super::error::AmbientError;
use super::limits::{
    COPIED_CHANNEL, DEAD_CHANNEL, DEFAULT_BAND_TOP, DEFAULT_FIRST_LINE, EXCLUDED_LINES,
    EXTRA_ORDERS, MIN_BLOCK_ROWS, MIN_LINES_PER_UNKNOWN, RESAMPLING,
};
use super::lines::BandLines;
use super::parameters::Span;
use super::subspace::ssi_cov;
use crate::stabilisation::Stabilisation;

/// Checks the channels and returns the checked band.
pub(super) fn checked_band(
    record: &Record,
    band_hz: Option<[f64; 2]>,
) -> Result<[f64; 2], AmbientError> {
    for channel in 0..record.channels() {
        let samples = record.channel(channel);
        if samples.iter().all(|v| *v == samples[0]) {
            let (samples, value) = (samples.len(), samples[0]);
            return Err(AmbientError::ConstantChannel { channel, samples, value });
        }
    }
    let nyquist_hz = record.sampling().nyquist_hz();
    let spacing_hz = record.sampling().line_spacing_hz();
    let default = [DEFAULT_FIRST_LINE * spacing_hz, DEFAULT_BAND_TOP * nyquist_hz];
    let [from_hz, to_hz] = band_hz.unwrap_or(default);
    if !(from_hz >= 0.0 && from_hz < to_hz && to_hz <= nyquist_hz) {
        return Err(AmbientError::Band { from_hz, to_hz, nyquist_hz });
    }
    Ok([from_hz, to_hz])
}

/// Returns the lines of a band, without lines next to excluded frequencies.
pub(super) fn band_lines(
    record: &Record,
    band_hz: [f64; 2],
    excluded_hz: &[f64],
) -> Result<BandLines, AmbientError> {
    let data = LineData::from_open_record(None, &record.without_mean(), band_hz)?;
    let (duration, sample_interval) = (record.sampling().duration(), record.sampling().dt());
    let half_width = EXCLUDED_LINES * TAU / duration;
    let included: Vec<usize> = (0..data.len())
        .filter(|k| excluded_hz.iter().all(|f| (data.omega()[*k] - TAU * f).abs() > half_width))
        .collect();
    let outputs = record.channels();
    let (lines, needed) = (included.len(), MIN_LINES_PER_UNKNOWN * (2 * outputs + 2));
    if lines < needed {
        let [from_hz, to_hz] = band_hz;
        return Err(AmbientError::TooFewLines { lines, needed, outputs, from_hz, to_hz });
    }
    let mut amplitudes = data.outputs().select_rows(&included);
    let mean_square = |channel| amplitudes.column(channel).norm_squared() / lines as f64;
    let scale: Vec<f64> = (0..outputs).map(|channel| f64::sqrt(mean_square(channel))).collect();
    let largest = scale.iter().copied().fold(0.0, f64::max);
    for (channel, &rms) in scale.iter().enumerate() {
        let ratio = rms / largest;
        // The ratio is NaN if all channels are zero.
        if ratio.is_nan() || ratio < DEAD_CHANNEL {
            return Err(AmbientError::DeadChannel { channel, rms, ratio });
        }
    }
    for (mut column, rms) in amplitudes.column_iter_mut().zip(&scale) {
        column /= Complex::from(*rms);
    }
    check_copies(&amplitudes)?;
    let omega = included.iter().map(|k| data.omega()[*k]).collect();
    let span = Span { duration, sample_interval };
    Ok(BandLines { omega, amplitudes, scale, span, transient: None })
}

fn check_copies(amplitudes: &DMatrix<Complex<f64>>) -> Result<(), AmbientError> {
    let products = amplitudes.ad_mul(amplitudes) / Complex::from(amplitudes.nrows() as f64);
    for second in 0..products.ncols() {
        for first in 0..second {
            let unexplained = 1.0 - products[(first, second)].norm_sqr();
            if unexplained < COPIED_CHANNEL {
                return Err(AmbientError::CopiedChannel { first, second, unexplained });
            }
        }
    }
    Ok(())
}

/// Returns subspace models of the record after resampling to the band and scaling of the channels.
pub(super) fn subspace_models(
    record: &Record,
    band_hz: [f64; 2],
    scale: &[f64],
    modes: usize,
) -> Result<Stabilisation, AmbientError> {
    let (samples, sample_interval) = resampled(record, band_hz, scale);
    let highest = 2 * modes + EXTRA_ORDERS;
    let orders: Vec<usize> = (1..=highest / 2).map(|half| 2 * half).collect();
    let block_rows = MIN_BLOCK_ROWS.max((2 * highest).div_ceil(record.channels()));
    let (len, lags) = (samples.nrows(), 2 * block_rows);
    if len < 2 * lags {
        return Err(AmbientError::TooShort { samples: len, lags });
    }
    ssi_cov(&samples, sample_interval, block_rows, &orders)
        .ok_or(AmbientError::Numerics { what: "the subspace model", size: highest })
}

/// Returns the samples of a band at a rate that suits the band, and the sample interval.
fn resampled(record: &Record, band_hz: [f64; 2], scale: &[f64]) -> (DMatrix<f64>, f64) {
    let (len, duration) = (record.len(), record.sampling().duration());
    let wanted = (RESAMPLING * band_hz[1] * duration).ceil() as usize;
    let resampled_len = wanted.clamp(4, len);
    let forward = transform::forward(len);
    let inverse = transform::inverse(resampled_len);
    let mut resampled = DMatrix::zeros(resampled_len, record.channels());
    let first = (band_hz[0] * duration).ceil() as usize;
    for (channel, unit) in scale.iter().enumerate() {
        let mut input = record.channel(channel).to_vec();
        let mut lines = forward.make_output_vec();
        let mut in_band = inverse.make_input_vec();
        let count = in_band.len().min(lines.len());
        // The lengths match the plans, so that this cannot fail.
        let _ = forward.process(&mut input, &mut lines);
        for k in first.max(1)..count.saturating_sub(1) {
            in_band[k] = lines[k] / (len as f64 * unit);
        }
        let mut output = inverse.make_output_vec();
        let _ = inverse.process(&mut in_band, &mut output);
        resampled.column_mut(channel).copy_from_slice(&output);
    }
    (resampled, duration / resampled_len as f64)
}
