//! The fit of a test with measured forces, as numbers for people and programs.

use std::f64::consts::TAU;

use mechid_io::derivative;
use mechid_modal::{
    DropReason, DroppedCandidate, IdentifiedMode, ModalEstimate, ModalSettings, identify_modes,
    indicators,
};
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix, DVector, DVectorView};

use super::checks;
use super::settings::ModesSettings;
use super::sources::{Output, Part, Recorded};
use super::summary::{
    DroppedRow, LEVEL, ModalCheck, ModalModeRow, ModesSummary, OutputRow, RecordRow,
};
use super::tables::Tables;
use super::{Modes, ModesSpectrum};
use crate::AnalysisError;
use crate::hits::HitRow;
use crate::identify::rows::Uncertain;
use crate::modal::{ShapeEntry, ShapedMode};
use crate::text::{compact, significant};

/// Records of a test, and the band that is fitted.
pub(super) struct Test {
    pub recorded: Recorded,
    pub band_hz: [f64; 2],
}

/// What the result says beside the fit.
struct Told {
    records: Vec<RecordRow>,
    hits: Vec<HitRow>,
    inputs: Vec<String>,
    outputs: Vec<Output>,
    driving_points: Vec<(usize, usize)>,
    band_hz: [f64; 2],
    checks: Vec<ModalCheck>,
    predicted: Option<Vec<f64>>,
}

impl Test {
    /// Fits the modes, and once more to the beginning of the records where that was asked for.
    pub fn modes(
        self,
        records: Vec<RecordRow>,
        checks: Vec<ModalCheck>,
        settings: &ModesSettings,
    ) -> Result<Modes, AnalysisError> {
        let Self { recorded, band_hz } = self;
        let data = recorded.lines(band_hz)?;
        let estimate = identify_modes(&data, &engine_settings(settings))?;
        let predicted = match settings.validate {
            0.0 => None,
            share => Some(predicted(&recorded, band_hz, share, settings)?),
        };
        let Recorded { inputs, outputs, driving_points, hits, .. } = recorded;
        let told =
            Told { records, hits, inputs, outputs, driving_points, band_hz, checks, predicted };
        told.with(&data, &estimate, settings)
    }
}

/// Fits the modes of tables of frequency responses.
pub(super) fn of_tables(
    tables: &Tables<'_>,
    band_hz: [f64; 2],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    let data = tables.lines(band_hz)?;
    let estimate = identify_modes(&data, &engine_settings(settings))?;
    let told = Told {
        records: Vec::new(),
        hits: Vec::new(),
        inputs: tables.forces.clone(),
        outputs: tables.outputs(),
        driving_points: tables.driving_points(),
        band_hz,
        checks: Vec::new(),
        predicted: None,
    };
    told.with(&data, &estimate, settings)
}

fn engine_settings(settings: &ModesSettings) -> ModalSettings {
    let usual = ModalSettings::default();
    ModalSettings {
        modes: settings.modes,
        max_modes: settings.max_modes.unwrap_or(usual.max_modes),
        near_hz: settings.near_hz.clone(),
        ..usual
    }
}

/// Share of the variance of each output at the end of the records that a fit to their beginning
/// explains.
fn predicted(
    recorded: &Recorded,
    band_hz: [f64; 2],
    share: f64,
    settings: &ModesSettings,
) -> Result<Vec<f64>, AnalysisError> {
    let part = |from: f64, to: f64| -> Result<Recorded, AnalysisError> {
        let cut = |part: &Part| {
            let len = part.responses.len();
            let first = (from * len as f64).round() as usize;
            let samples = (to * len as f64).round() as usize - first;
            let forces = part.forces.as_ref().map(|f| f.window(first, samples)).transpose()?;
            Ok(Part { forces, responses: part.responses.window(first, samples)? })
        };
        let parts = recorded.parts.iter().map(cut).collect::<Result<_, AnalysisError>>()?;
        Ok(Recorded {
            parts,
            inputs: recorded.inputs.clone(),
            outputs: recorded.outputs.clone(),
            driving_points: Vec::new(),
            hits: Vec::new(),
        })
    };
    let fitted =
        identify_modes(&part(0.0, 1.0 - share)?.lines(band_hz)?, &engine_settings(settings))?;
    let rest = part(1.0 - share, 1.0)?.lines(band_hz)?;
    let model = fitted.synthesis(&rest)?;
    let share =
        |(measured, model): (DVectorView<'_, Complex<f64>>, DVectorView<'_, Complex<f64>>)| {
            1.0 - (measured - model).norm_squared() / measured.norm_squared()
        };
    Ok(rest.outputs().column_iter().zip(model.column_iter()).map(share).collect())
}

impl Told {
    fn with(
        self,
        data: &LineData,
        estimate: &ModalEstimate,
        settings: &ModesSettings,
    ) -> Result<Modes, AnalysisError> {
        let names: Vec<String> = self.outputs.iter().map(|output| output.name.clone()).collect();
        let explained = estimate.variance_explained();
        let mut rows = self.checks;
        rows.extend(checks::of_outputs(&explained, &names));
        let modes: Vec<ModalModeRow> = estimate
            .modes()
            .iter()
            .map(|mode| row(mode, &self.outputs, &self.driving_points))
            .collect();
        let mean = |shares: &[f64]| shares.iter().sum::<f64>() / shares.len().max(1) as f64;
        let outputs = self.outputs.iter().enumerate().map(|(at, output)| OutputRow {
            column: output.name.clone(),
            unit: output.quantity.map(|quantity| quantity.unit()),
            variance_explained: Some(explained[at]),
            variance_predicted: self.predicted.as_ref().map(|shares| shares[at]),
            noise_share: Some(estimate.noise_levels()[at] / rms(data, at)),
        });
        let summary = ModesSummary {
            records: self.records,
            hits: self.hits,
            inputs: self.inputs,
            outputs: outputs.collect(),
            band_hz: self.band_hz,
            lines: data.len(),
            confidence: LEVEL,
            mac: mac(estimate.modes()),
            modes,
            dropped: estimate.dropped().iter().map(dropped).collect(),
            harmonics: Vec::new(),
            variance_explained: Some(mean(&explained)),
            variance_predicted: self.predicted.as_deref().map(mean),
            checks: rows,
            notes: notes(estimate),
            analysis: settings.clone(),
        };
        Ok(Modes { summary, spectrum: spectrum(data, estimate)? })
    }
}

fn row(mode: &IdentifiedMode, outputs: &[Output], points: &[(usize, usize)]) -> ModalModeRow {
    let entries = |values: &[Complex<f64>], errors: &[Complex<f64>], scale: Complex<f64>| {
        let of = |(value, error): (&Complex<f64>, &Complex<f64>)| {
            let value = value / scale;
            let size = scale.norm();
            let standard_error = Some([error.re / size, error.im / size]);
            ShapeEntry { value: [value.re, value.im], standard_error }
        };
        values.iter().zip(errors).map(of).collect::<Vec<_>>()
    };
    let largest = mode.participation.iter().copied().max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let scale = largest.filter(|z| z.norm() > 0.0).unwrap_or(Complex::from(1.0));
    let modal_mass = points.iter().filter_map(|&(input, output)| {
        let power = derivative(outputs[output].quantity?) as i32;
        Some((mode.residue(output, input).norm(), mode.modal_mass(output, input, power).re))
    });
    // The driving point that moves most in this mode determines the mass best.
    let modal_mass = modal_mass.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, mass)| mass);
    let values = [
        uncertain(&mode.natural_frequency_hz),
        damped_frequency(mode),
        uncertain(&mode.damping_ratio),
    ];
    let shape = entries(&mode.shape, &mode.shape_standard_error, Complex::from(1.0));
    ModalModeRow {
        mode: ShapedMode::from_pole([mode.pole.re, mode.pole.im], values, shape),
        participation: entries(&mode.participation, &mode.participation_standard_error, scale),
        phase_collinearity: indicators::mpc(&vector(&mode.shape)),
        driven_share: mode.driven_share,
        modal_mass,
        decay_times: None,
    }
}

/// f√(1 − ζ²), with its standard error to first order.
fn damped_frequency(mode: &IdentifiedMode) -> Uncertain {
    let (f, zeta) = (&mode.natural_frequency_hz, &mode.damping_ratio);
    let root = (1.0 - zeta.value * zeta.value).sqrt();
    let slope = -f.value * zeta.value / root;
    let variance = (root * f.standard_error).powi(2)
        + (slope * zeta.standard_error).powi(2)
        + 2.0 * root * slope * mode.frequency_damping_covariance;
    normal(root * f.value, variance.max(0.0).sqrt())
}

/// Value with a normal interval: the noise is averaged over many lines.
fn uncertain(value: &mechid_modal::Uncertain) -> Uncertain {
    normal(value.value, value.standard_error)
}

fn normal(value: f64, standard_error: f64) -> Uncertain {
    let half = NORMAL_95 * standard_error;
    Uncertain::new(value, standard_error, [value - half, value + half])
}

/// Half width of the 95 % interval of a normal distribution, in standard deviations.
const NORMAL_95: f64 = 1.959_963_984_540_054;

fn mac(modes: &[IdentifiedMode]) -> Vec<Vec<f64>> {
    let shapes: Vec<_> = modes.iter().map(|mode| vector(&mode.shape)).collect();
    let row = |a| shapes.iter().map(|b| indicators::mac(a, b)).collect();
    shapes.iter().map(row).collect()
}

fn vector(shape: &[Complex<f64>]) -> DVector<Complex<f64>> {
    DVector::from_column_slice(shape)
}

fn dropped(candidate: &DroppedCandidate) -> DroppedRow {
    let reason = match candidate.reason {
        DropReason::Insignificant { gain, required } => format!(
            "it improves the fit by {} (−2 log L) where {} is needed",
            significant(gain, 3),
            significant(required, 3)
        ),
        DropReason::UndeterminedDamping { standard_error } => format!(
            "its damping ratio is not above zero: ± {} %",
            significant(100.0 * standard_error, 2)
        ),
        DropReason::TooDamped => {
            "it is too damped for a mode: the response of modes outside of the band".into()
        }
        DropReason::OutsideBand => "it left the band".into(),
        DropReason::Twin { other_hz } => format!(
            "its shape is that of the mode at {} Hz, within whose width it lies",
            significant(other_hz, 5)
        ),
        DropReason::Undriven { ratio } => format!(
            "forces that were not measured drive it: {} times the measured ones",
            significant(ratio, 2)
        ),
        DropReason::BeyondNumber { .. } => "`modes` asks for fewer, and others explain more".into(),
        _ => "it is no mode of the record".into(),
    };
    let DroppedCandidate { frequency_hz, damping_ratio, .. } = *candidate;
    DroppedRow { frequency_hz, damping_ratio, reason }
}

/// Share of unmeasured forces from which a mode is told to be driven by them.
const NOTED_UNMEASURED: f64 = 0.01;

fn notes(estimate: &ModalEstimate) -> Vec<String> {
    let mut notes = Vec::new();
    for (number, mode) in (1..).zip(estimate.modes()) {
        let hz = significant(mode.natural_frequency_hz.value, 4);
        if mode.near_edge {
            notes.push(format!(
                "mode {number} ({hz} Hz) is at an edge of the band: choose a wider one (`band_hz`) if the \
                 forces reach further"
            ));
        }
        if let Some(share) = mode.driven_share.filter(|share| 1.0 - share > NOTED_UNMEASURED) {
            notes.push(format!(
                "{} % of the motion of mode {number} ({hz} Hz) answers forces that were not measured; its \
                 intervals allow for that",
                compact(100.0 * (1.0 - share), 2)
            ));
        }
    }
    notes
}

/// RMS of an output over the lines, which is not zero.
fn rms(data: &LineData, output: usize) -> f64 {
    let power = data.outputs().column(output).norm_squared() / data.len() as f64;
    power.sqrt().max(f64::MIN_POSITIVE)
}

/// Measured and explained responses of the first record, all outputs together.
fn spectrum(data: &LineData, estimate: &ModalEstimate) -> Result<ModesSpectrum, AnalysisError> {
    let modelled: DMatrix<Complex<f64>> = estimate.synthesis(data)?;
    let outputs = data.outputs();
    let rows = data.records().first().map_or(0..0, |(rows, _)| rows.clone());
    let scale: Vec<f64> = (0..outputs.ncols()).map(|at| rms(data, at)).collect();
    let sum = |value: &dyn Fn(usize) -> f64| {
        scale.iter().enumerate().map(|(at, s)| value(at) / (s * s)).sum::<f64>().sqrt()
    };
    let mut spectrum = ModesSpectrum::default();
    for row in rows {
        spectrum.frequency_hz.push(data.omega()[row] / TAU);
        spectrum.measured.push(sum(&|at| outputs[(row, at)].norm_sqr()));
        spectrum.modelled.push(sum(&|at| modelled[(row, at)].norm_sqr()));
        spectrum.residual.push(sum(&|at| (outputs[(row, at)] - modelled[(row, at)]).norm_sqr()));
    }
    Ok(spectrum)
}
