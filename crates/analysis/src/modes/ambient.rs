//! Modes of an ambient record.

use std::f64::consts::TAU;

use mechid_modal::ambient::{
    AmbientEstimate, AmbientMode, AmbientSettings, DropReason, DroppedCandidate, Harmonic,
    ModalValue, identify_ambient,
};
use mechid_modal::indicators;
use mechid_spectra::LineData;

use super::checks;
use super::diagrams::DiagramData;
use super::halves::Halves;
use super::rows::{rows_of, small_gain};
use super::settings::ModesSettings;
use super::sources::{Output, all_responses, outputs_of};
use super::summary::{
    DroppedRow, HarmonicRow, LEVEL, ModalCheck, ModalModeRow, ModesSummary, OutputRow, RecordRow,
};
use super::{Modes, ModesSpectrum};
use crate::AnalysisError;
use crate::identify::rows::Uncertain;
use crate::measurement::Measurement;
use crate::modal::{ShapeEntry, ShapedMode};
use crate::text::significant;

/// Identifies the modes of the only record of an ambient test.
pub(super) fn modes(
    measurements: &[Measurement],
    settings: &ModesSettings,
    without_hz: &[f64],
    without_harmonics: bool,
) -> Result<Modes, AnalysisError> {
    let measurement = only_record(measurements, settings)?;
    let outputs = outputs_of(&measurement.source().names);
    if outputs.is_empty() {
        return Err(AnalysisError::NoMotion);
    }
    settings.places.response_places(&outputs)?;
    let block = measurement.whole_block()?;
    let record = all_responses(&block)?;
    let engine = engine_settings(settings, without_hz, without_harmonics);
    let estimate = identify_ambient(&record, &engine)?;
    let halves = Halves::of_ambient(&record, &estimate);
    let (of_spectrum, scale) = estimate.misfit.as_ref().map(checks::spectrum_check).unzip();
    let scale = scale.unwrap_or(1.0);
    let scales: Vec<f64> = halves.error_scales.iter().map(|halves| halves.max(scale)).collect();
    let estimate = estimate.with_error_scales(&scales);
    let shapes: Vec<_> = estimate.modes.iter().map(|mode| mode.shape.shape()).collect();
    let modes: Vec<ModalModeRow> = estimate.modes.iter().map(row).collect();
    let of_fit = of_spectrum.into_iter().chain(halves.check);
    let of_modes = of_fit.chain(ambient_checks(&modes, &outputs));
    let mac = |a| shapes.iter().map(|b| indicators::mac(a, b)).collect();
    let mac_errors = estimate.mac_standard_errors();
    let summary = ModesSummary {
        records: vec![RecordRow::from_block(&block)],
        hits: Vec::new(),
        inputs: Vec::new(),
        outputs: outputs.into_iter().map(output_row).collect(),
        band_hz: estimate.band_hz,
        lines: estimate.lines,
        confidence: LEVEL,
        modes,
        mac: shapes.iter().map(|a| mac(a)).collect(),
        mac_standard_error: rows_of(&mac_errors),
        dropped: estimate.dropped.iter().map(dropped).collect(),
        harmonics: estimate.harmonics.iter().map(harmonic_row).collect(),
        variance_explained: None,
        variance_predicted: None,
        checks: checks::channel_checks(measurements)?.into_iter().chain(of_modes).collect(),
        notes: notes(&estimate).into_iter().chain(halves.note).collect(),
        diagrams: None,
        model: None,
        analysis: settings.clone(),
    };
    let data = LineData::from_open_record(None, &record, estimate.band_hz)?;
    let source = DiagramData::Ambient(estimate.stabilisation);
    Ok(Modes { summary, spectrum: spectrum(&data), source })
}

/// Returns the record; refuses several records, and settings that are not for an ambient record.
fn only_record<'a>(
    measurements: &'a [Measurement],
    settings: &ModesSettings,
) -> Result<&'a Measurement, AnalysisError> {
    let [measurement] = measurements else {
        let why = format!(
            "{} records were given: ambient records are analysed one at a time",
            measurements.len()
        );
        return Err(settings.refused("ambient", why));
    };
    settings.refuse(
        "an ambient record",
        &["near_hz", "force_at", "validate_percent", "real_shapes", "reciprocal"],
    )?;
    Ok(measurement)
}

fn engine_settings(
    settings: &ModesSettings,
    without_hz: &[f64],
    without_harmonics: bool,
) -> AmbientSettings {
    let usual = AmbientSettings::default();
    AmbientSettings {
        band_hz: settings.band_hz,
        modes: settings.modes,
        max_modes: settings.max_modes.unwrap_or(usual.max_modes),
        without_hz: without_hz.to_vec(),
        exclude_harmonics: without_harmonics,
    }
}

/// Returns the checks of the identified modes: forces with a spectral peak, and responses that no
/// mode moves.
fn ambient_checks(modes: &[ModalModeRow], outputs: &[Output]) -> Vec<ModalCheck> {
    let names: Vec<String> = outputs.iter().map(|output| output.name.clone()).collect();
    let idle = checks::response_checks(modes, &names);
    checks::force_peak_check(modes).into_iter().chain(idle).collect()
}

fn harmonic_row(harmonic: &Harmonic) -> HarmonicRow {
    HarmonicRow { frequency_hz: harmonic.frequency_hz, p_value: harmonic.p_value }
}

fn output_row(output: Output) -> OutputRow {
    OutputRow {
        unit: output.quantity.map(|quantity| quantity.unit()),
        column: output.name,
        variance_explained: None,
        variance_predicted: None,
        noise_share: None,
    }
}

fn row(mode: &AmbientMode) -> ModalModeRow {
    let (f, zeta) = (&mode.natural_frequency_hz, &mode.damping_ratio);
    let root = (1.0 - zeta.value * zeta.value).sqrt();
    let omega = TAU * f.value;
    let (shape, covariance) = (mode.shape.shape(), mode.shape.covariance());
    let error = |part: usize| covariance[(part, part)].max(0.0).sqrt();
    let entries = shape.iter().enumerate().map(|(at, value)| ShapeEntry {
        value: [value.re, value.im],
        standard_error: Some([error(at), error(shape.len() + at)]),
    });
    // The error of the damping ratio has a negligible effect on the damped frequency.
    let damped = |value: &ModalValue| {
        let scale = |x: f64| root * x;
        Uncertain {
            value: scale(value.value),
            standard_error: value.standard_error().map(scale),
            interval: value.interval().map(|interval| interval.map(scale)),
        }
    };
    let values = [uncertain(f), damped(f), uncertain(zeta)];
    let eigenvalue = [-zeta.value * omega, root * omega];
    ModalModeRow {
        mode: ShapedMode::from_pole(eigenvalue, values, entries.collect()),
        participation: Vec::new(),
        phase_collinearity: mode.mpc.value,
        phase_collinearity_standard_error: Some(mode.mpc.standard_error),
        driven_share: None,
        modal_mass: None,
        modal_mass_standard_error: None,
        mass_normalised_shape: Vec::new(),
        mass_normalised_shape_at_forces: Vec::new(),
        decay_times: Some(mode.decay_times),
    }
}

fn uncertain(value: &ModalValue) -> Uncertain {
    Uncertain {
        value: value.value,
        standard_error: value.standard_error(),
        interval: value.interval(),
    }
}

fn dropped(candidate: &DroppedCandidate) -> DroppedRow {
    let reason = match candidate.reason {
        DropReason::SmallGain { gain, needed } => small_gain(gain, needed),
        DropReason::DampingUndetermined { ratio } => format!(
            "its damping ratio is only {} times its standard error: it may be a harmonic or a chance peak",
            significant(ratio, 2)
        ),
        DropReason::OutsideBand => "it is outside of the band".into(),
        DropReason::OverDamped { .. } => "its damping is too high for a mode".into(),
        DropReason::NumberReached { number } => {
            format!("the maximum number of modes, {number}, was found before this candidate")
        }
        _ => "the likelihood has no maximum with this candidate".into(),
    };
    let DroppedCandidate { natural_frequency_hz, damping_ratio, .. } = *candidate;
    DroppedRow { frequency_hz: natural_frequency_hz, damping_ratio, reason }
}

fn notes(estimate: &AmbientEstimate) -> Vec<String> {
    let mut notes = Vec::new();
    for (number, mode) in (1..).zip(&estimate.modes) {
        let hz = significant(mode.natural_frequency_hz.value, 4);
        if mode.natural_frequency_hz.interval().is_none() {
            notes.push(format!(
                "mode {number} ({hz} Hz): the record is {} decay times long, too short for an interval; \
                 make a longer record",
                significant(mode.decay_times, 2)
            ));
        }
        if mode.harmonic.is_some() {
            notes.push(format!(
                "mode {number} ({hz} Hz) has the frequency of a sinusoid in the record: it may be a \
                 harmonic of a machine (`without_harmonics` excludes its lines)"
            ));
        }
    }
    for harmonic in &estimate.harmonics {
        notes.push(format!(
            "a sinusoid at {} Hz (p = {})",
            significant(harmonic.frequency_hz, 5),
            significant(harmonic.p_value, 2)
        ));
    }
    notes
}

/// Returns the measured responses over frequency, without a prediction: the forces are unknown.
fn spectrum(data: &LineData) -> ModesSpectrum {
    let outputs = data.outputs();
    let power = |at: usize| outputs.column(at).norm_squared() / data.len() as f64;
    let powers: Vec<f64> =
        (0..outputs.ncols()).map(|at| power(at).max(f64::MIN_POSITIVE)).collect();
    let measured = |row: usize| {
        let output = outputs.row(row);
        output.iter().zip(&powers).map(|(z, power)| z.norm_sqr() / power).sum::<f64>().sqrt()
    };
    ModesSpectrum {
        frequency_hz: data.omega().iter().map(|omega| omega / TAU).collect(),
        measured: (0..data.len()).map(measured).collect(),
        ..ModesSpectrum::default()
    }
}
