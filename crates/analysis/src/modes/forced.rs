//! Fit of a test with measured forces, and its result.

use std::f64::consts::TAU;

use mechid_modal::{
    DrivingPoint, IdentifiedMode, ModalError, ModalEstimate, ModalSettings, identify_modes,
};
use mechid_signal::message;
use mechid_spectra::LineData;
use nalgebra::{Complex, DMatrix};

use super::averaged::{Sharpened, without_decay};
use super::checks::{self, prediction_checks};
use super::diagrams::{DiagramData, Forced};
use super::halves::Halves;
use super::rows::{dropped, mac, notes, row, rows_of, scaling};
use super::settings::ModesSettings;
use super::sources::{Output, Recorded};
use super::summary::{
    DroppedRow, LEVEL, ModalCheck, ModalModeRow, ModesSummary, OutputRow, RecordRow,
};
use super::tables::Tables;
use super::validation::explained;
use super::{Modes, ModesSpectrum};
use crate::AnalysisError;
use crate::hits::HitRow;
use crate::text::significant;

/// Records of a test, and the band of the fit.
pub(super) struct Test {
    pub recorded: Recorded,
    /// The same records, but with the force of the first record as a separate input; `None` if
    /// there are several forces, if there is only one record, or if the points of the force are
    /// stated.
    pub struck_apart: Option<Recorded>,
    pub band_hz: [f64; 2],
}

/// Data for the result in addition to the fit: records, channels, band, checks and notes.
struct Context {
    records: Vec<RecordRow>,
    hits: Vec<HitRow>,
    inputs: Vec<String>,
    outputs: Vec<Output>,
    driving_points: Vec<DrivingPoint>,
    band_hz: [f64; 2],
    checks: Vec<ModalCheck>,
    notes: Vec<String>,
    predicted: Option<Vec<f64>>,
    /// `true` if the data are tables of frequency responses.
    is_table: bool,
    /// Decay rate, in 1/s, that an exponential window adds to every mode.
    added_decay: Option<f64>,
}

/// Fit of the modes.
struct Fit {
    data: LineData,
    estimate: ModalEstimate,
    /// Modes of the result: without the decay of an exponential window.
    modes: Vec<IdentifiedMode>,
}

impl Test {
    /// Fits the modes to the whole records; for a validation, also fits modes to the beginning of
    /// the records only.
    pub fn modes(
        self,
        records: Vec<RecordRow>,
        mut checks: Vec<ModalCheck>,
        settings: &ModesSettings,
    ) -> Result<Modes, AnalysisError> {
        let Self { recorded, struck_apart, band_hz } = self;
        let named = |error| named(error, &recorded.inputs, &recorded.outputs);
        let data = recorded.lines(band_hz)?;
        let points = (&recorded.outputs[..], &recorded.driving_points[..]);
        let (estimate, engine, of_properties) = settings.properties.imposed(
            settings,
            points,
            engine_settings(settings),
            |engine| identify_modes(&data, engine).map_err(named),
            |estimate| estimate,
        )?;
        checks.extend(of_properties);
        let halves = Halves::new(&recorded, band_hz, &estimate, &engine);
        let estimate = estimate.with_error_scales(&halves.error_scales)?;
        checks.extend(halves.check);
        let apart = struck_apart.and_then(|apart| apart.lines(band_hz).ok());
        checks.extend(apart.and_then(|apart| checks::one_point_check(&apart, &estimate, &engine)));
        let predicted = match settings.validate {
            0.0 => None,
            share => Some(predicted(&recorded, band_hz, share, &engine)?),
        };
        let Recorded { inputs, outputs, driving_points, hits, .. } = recorded;
        let names: Vec<String> = outputs.iter().map(|output| output.name.clone()).collect();
        checks.extend(prediction_checks(predicted.as_deref().unwrap_or(&[]), &names));
        let context = Context {
            records,
            hits,
            inputs,
            outputs,
            driving_points,
            band_hz,
            checks,
            notes: halves.note.into_iter().collect(),
            predicted,
            is_table: false,
            added_decay: None,
        };
        let modes = estimate.modes().to_vec();
        context.with(Fit { data, estimate, modes }, settings)
    }
}

/// Fits the modes of tables of frequency responses.
pub(super) fn modes_of_tables(
    tables: &Tables,
    band_hz: [f64; 2],
    settings: &ModesSettings,
) -> Result<Modes, AnalysisError> {
    let outputs = tables.outputs();
    let driving_points = tables.driving_points();
    let named = |error| match error {
        AnalysisError::Modal(error) => named(error, &tables.forces, &outputs),
        other => other,
    };
    let (fit, _, of_properties) = settings.properties.imposed(
        settings,
        (&outputs, &driving_points),
        engine_settings(settings),
        |engine| Sharpened::new(tables, band_hz, engine).map_err(named),
        |fit| &fit.estimate,
    )?;
    let Sharpened { data, estimate, settled } = fit;
    let scatter = if tables.is_smoothed() {
        estimate.scatter_along_shapes(&data)?
    } else {
        vec![None; estimate.modes().len()]
    };
    // The scale is at least 1: standard errors are never smaller than those for independent errors
    // of the outputs.
    let scale =
        |ratio: Option<f64>| tables.error_inflation() * ratio.unwrap_or(1.0).max(1.0).sqrt();
    let scales: Vec<f64> = scatter.into_iter().map(scale).collect();
    let estimate = estimate.with_error_scales(&scales)?;
    let decay = tables.added_decay.unwrap_or(0.0);
    let modes: Vec<IdentifiedMode> =
        estimate.modes().iter().map(|mode| without_decay(mode, decay)).collect();
    let of_tables = checks::table_checks(tables, band_hz, &modes, settled);
    let context = Context {
        records: tables.with_segments().map(|(table, _)| RecordRow::from_table(table)).collect(),
        hits: Vec::new(),
        inputs: tables.forces.clone(),
        driving_points,
        outputs,
        band_hz,
        checks: of_tables.into_iter().chain(of_properties).collect(),
        notes: notes_of_tables(tables),
        predicted: None,
        is_table: true,
        added_decay: tables.added_decay,
    };
    context.with(Fit { data, estimate, modes }, settings)
}

/// Returns the notes on tables: the effects of their windows, and the remarks of their files.
fn notes_of_tables(tables: &Tables) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(decay) = tables.added_decay {
        notes.push(format!(
            "an exponential window adds {} 1/s to the decay rate of every mode of the tables: this rate was \
             subtracted",
            significant(decay, 4)
        ));
    }
    if tables.is_smoothed() {
        notes.push(
            "averages under a window lose most of the accuracy of a record at narrow resonances; the record itself gives frequencies and damping ratios with smaller errors"
                .into(),
        );
    }
    let remarks = tables.with_segments().flat_map(|(table, _)| table.remarks.iter().cloned());
    notes.extend(remarks);
    notes
}

/// Number of candidates that a message lists.
const LISTED_CANDIDATES: usize = 3;

/// Number of channels that a message lists by their names.
pub(super) const LISTED: usize = 8;

/// Returns the error of a failed fit, with the names of channels instead of their numbers.
fn named(error: ModalError, inputs: &[String], outputs: &[Output]) -> AnalysisError {
    let list = |numbers: &[usize], name: &dyn Fn(usize) -> String| {
        message::list(numbers.iter().map(|at| name(*at)), ", ", LISTED)
    };
    match error {
        ModalError::DeadOutputs { outputs: dead } => {
            let columns = list(&dead, &|at| outputs[at].name.clone());
            AnalysisError::DeadResponses { columns }
        }
        ModalError::DeadInputs { inputs: dead } => {
            let columns = list(&dead, &|at| inputs[at].clone());
            AnalysisError::DeadForces { columns }
        }
        ModalError::NoMode { from_hz, to_hz, dropped: candidates } => {
            let in_words = |row: DroppedRow| {
                format!("{} Hz ({})", significant(row.frequency_hz, 5), row.reason)
            };
            let listed = candidates.iter().map(|candidate| in_words(dropped(candidate)));
            let listed = message::list(listed, ", ", LISTED_CANDIDATES);
            let candidates =
                if listed.is_empty() { listed } else { format!("; rejected candidates: {listed}") };
            AnalysisError::NoMode { from_hz, to_hz, candidates }
        }
        ModalError::DependentInputs { input, own_share } => {
            let preceding = list(&(0..input).collect::<Vec<_>>(), &|at| inputs[at].clone());
            AnalysisError::DependentForces {
                force: inputs[input].clone(),
                others: preceding,
                own_share,
            }
        }
        other => other.into(),
    }
}

fn engine_settings(settings: &ModesSettings) -> ModalSettings {
    let default = ModalSettings::default();
    ModalSettings {
        modes: settings.modes,
        max_modes: settings.max_modes.unwrap_or(default.max_modes),
        near_hz: settings.near_hz.clone(),
        ..default
    }
}

/// Returns the share of the variance of each output that a fit to the beginning of the records
/// predicts at their end.
fn predicted(
    recorded: &Recorded,
    band_hz: [f64; 2],
    share: f64,
    engine: &ModalSettings,
) -> Result<Vec<f64>, AnalysisError> {
    let beginning = recorded.between(0.0, 1.0 - share)?;
    let fitted = identify_modes(&beginning.lines(band_hz)?, engine)?;
    let end = recorded.between(1.0 - share, 1.0)?.lines(band_hz)?;
    let model = fitted.synthesis(&end)?;
    Ok(explained(end.outputs(), &model))
}

impl Context {
    fn with(mut self, fit: Fit, settings: &ModesSettings) -> Result<Modes, AnalysisError> {
        let Fit { data, estimate, modes: reported } = fit;
        let names: Vec<String> = self.outputs.iter().map(|output| output.name.clone()).collect();
        let explained = estimate.variance_explained();
        let mut rows = std::mem::take(&mut self.checks);
        rows.extend(checks::mode_checks(
            &reported,
            &self.inputs,
            &self.outputs,
            &self.driving_points,
            estimate.delays(),
            settings.properties.reciprocal,
        ));
        let modes = self.mode_rows(&estimate, &reported);
        rows.extend(checks::output_checks(&explained, &modes, &names));
        let mut model = estimate.model().clone();
        for term in &mut model.terms {
            term.pole[0] += self.added_decay.unwrap_or(0.0);
        }
        let noise = |at: usize| estimate.noise_levels()[at] / rms(&data, at);
        let outputs =
            (0..self.outputs.len()).map(|at| self.output_row(at, explained[at], noise(at)));
        let outputs = outputs.collect();
        let summary = ModesSummary {
            records: self.records,
            hits: self.hits,
            inputs: self.inputs,
            outputs,
            band_hz: self.band_hz,
            lines: data.len(),
            confidence: LEVEL,
            mac: mac(&reported),
            mac_standard_error: rows_of(&estimate.mac_standard_errors()),
            modes,
            dropped: estimate.dropped().iter().map(dropped).collect(),
            harmonics: Vec::new(),
            variance_explained: Some(mean(&explained)),
            variance_predicted: self.predicted.as_deref().map(mean),
            checks: rows,
            notes: notes(&estimate, &self.outputs).into_iter().chain(self.notes).collect(),
            diagrams: None,
            model: Some(model),
            analysis: settings.clone(),
        };
        let spectrum = spectrum(&data, &estimate)?;
        let quantities = self.outputs.iter().map(|output| output.quantity).collect();
        let (is_table, added_decay) = (self.is_table, self.added_decay);
        let source = DiagramData::Forced(Box::new(Forced {
            data,
            estimate,
            is_table,
            quantities,
            added_decay,
        }));
        Ok(Modes { summary, spectrum, source })
    }

    /// Returns the rows of the modes. The modal masses come from the fitted modes, whose damping
    /// includes the decay of an exponential window.
    fn mode_rows(
        &self,
        estimate: &ModalEstimate,
        reported: &[IdentifiedMode],
    ) -> Vec<ModalModeRow> {
        let collinearities = estimate.phase_collinearities().into_iter();
        let of_mode = |(at, (mode, collinearity)): (usize, (&IdentifiedMode, _))| {
            row(mode, collinearity, scaling(estimate, at, &self.outputs, &self.driving_points))
        };
        reported.iter().zip(collinearities).enumerate().map(of_mode).collect()
    }

    /// Returns the row of an output, given the share of its variance that the modes explain, and
    /// the ratio of its noise to its RMS value.
    fn output_row(&self, at: usize, explained: f64, noise: f64) -> OutputRow {
        let output = &self.outputs[at];
        OutputRow {
            column: output.name.clone(),
            unit: output.quantity.map(|quantity| quantity.unit()),
            variance_explained: Some(explained),
            variance_predicted: self.predicted.as_ref().map(|shares| shares[at]),
            noise_share: Some(noise),
        }
    }
}

/// Returns the mean of the shares of all outputs.
fn mean(shares: &[f64]) -> f64 {
    shares.iter().sum::<f64>() / shares.len().max(1) as f64
}

/// Returns the RMS of an output over the lines, never zero.
fn rms(data: &LineData, output: usize) -> f64 {
    let power = data.outputs().column(output).norm_squared() / data.len() as f64;
    power.sqrt().max(f64::MIN_POSITIVE)
}

/// Returns the measured and modelled response of the first record at each frequency: the root of
/// the sum of the squares of all outputs, each divided by its RMS value.
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
