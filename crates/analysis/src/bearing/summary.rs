//! Result of a bearing test.

use std::f64::consts::TAU;
use std::fmt;

use mechid_bearing::{Conditions, Threshold};
use mechid_checks::limits::DISTURBED_ALONE;
use mechid_estimate::frequency_domain::LikelihoodRatio;
use mechid_io::ParameterCovariance;
use mechid_model::OilFilm;
use mechid_model::elements::Machine;
use nalgebra::DMatrix;
use serde::Serialize;

use super::element;
use super::film::{Film, NAMED};
use super::rotation::speed_of_misfit;
use super::{BearingData, IdentifyBearing, StiffnessLine};
use crate::AnalysisError;
use crate::identify::checks::CheckRow;
use crate::identify::rows::{CONFIDENCE, Uncertain, header};
use crate::identify::summary::verdict;
use crate::text::{compact, paragraph, significant, text_table};

/// Maximum ratio of amplitude to clearance for a linear film; a larger amplitude biases the
/// coefficients.
pub const LARGEST_AMPLITUDE: f64 = 0.05;

/// Half the width of an interval at 95 %, in standard errors.
const NORMAL: f64 = 1.96;

/// Relative change of the width of an interval due to the choice of the model; only a larger change
/// gets a remark.
const MOVED: f64 = 0.02;

/// Units of k, c and m.
const UNITS: [&str; 3] = ["N/m", "N·s/m", "kg"];

/// Result of a bearing test: numbers and remarks.
#[derive(Debug, Serialize)]
pub struct BearingSummary {
    /// The tests.
    pub tests: Vec<String>,
    /// The baseline tests; empty without them.
    pub baseline: Vec<String>,
    /// Speed of rotation, in Hz; `None` without rotation.
    pub rotation_hz: Option<f64>,
    /// Static load, in N, if it was given.
    pub load: Option<f64>,
    /// Level of the confidence intervals, a pure number such as 0.95.
    pub confidence: f64,
    /// Coefficients of the film, eight or twelve.
    pub coefficients: Vec<CoefficientRow>,
    /// Covariance of the coefficients.
    pub covariance: ParameterCovariance,
    /// A machine of one element, `bearing`, at the degrees of freedom x and y, for use in
    /// descriptions of machines of named elements. The prior of each coefficient is its estimate
    /// with the standard error; `None` if the standard errors are withheld.
    pub machine: Option<Machine>,
    /// Likelihood-ratio test whether the inertia of the fluid is negligible; `None` if the noise is
    /// not known.
    pub inertia_test: Option<LikelihoodRatio>,
    /// Dimensionless coefficients, if load and clearance are known.
    pub dimensionless: Option<Dimensionless>,
    /// Whirl and threshold of instability of a rigid rotor; `None` without rotation.
    pub stability: Option<StabilityRow>,
    /// Amplitude of the tests; `None` for frequency responses.
    pub amplitude: Option<Amplitude>,
    /// Ratio of residual power to noise power; 1 if the noise is not known.
    pub misfit_ratio: f64,
    /// Factor that multiplies the standard errors computed from the noise (Birge ratio): 1 if the
    /// noise explains the residual, `None` if the residual is so large that errors and intervals
    /// are withheld.
    pub error_scale: Option<f64>,
    /// Condition number of the column-scaled regressor, a ratio.
    pub condition_number: f64,
    /// Number of spectral lines, summed over the tests.
    pub lines: usize,
    /// Frequencies, in Hz, of the lines that were excluded at multiples of the rotation frequency.
    pub left_out_hz: Vec<f64>,
    /// Dynamic stiffness of the film line by line.
    pub dynamic_stiffness: Vec<StiffnessLine>,
    /// Findings on the data before the fit and on the residual after it.
    pub checks: Vec<CheckRow>,
    /// Remarks to read before using the numbers.
    pub remarks: Vec<String>,
    /// Settings of the analysis; with them it can be repeated.
    pub analysis: IdentifyBearing,
}

/// One coefficient of a film.
#[derive(Debug, Clone, Serialize)]
pub struct CoefficientRow {
    /// Name: the first index is the direction of the force, the second the direction of the motion.
    pub name: &'static str,
    /// SI unit.
    pub unit: &'static str,
    #[serde(flatten)]
    /// Estimate with its uncertainty.
    pub estimate: Uncertain,
}

/// Dimensionless coefficients: k c/W, c c Ω/W, m c Ω²/W with the clearance c and the load W.
#[derive(Debug, Clone, Serialize)]
pub struct Dimensionless {
    /// Coefficients, a ratio each; without rotation only the stiffnesses.
    pub coefficients: Vec<CoefficientRow>,
    /// Sommerfeld number μ N L D (R/c)²/W, dimensionless; `None` if size or viscosity are unknown.
    pub sommerfeld_number: Option<f64>,
}

/// Whirl of a rigid rotor on this film.
#[derive(Debug, Clone, Serialize)]
pub struct StabilityRow {
    /// Ratio of the whirl frequency to the speed of rotation at the threshold; `None` if no rotor
    /// becomes unstable.
    pub whirl_frequency_ratio: Option<Uncertain>,
    /// Mass per bearing above which a rigid rotor is unstable at this speed and load, in kg; `None`
    /// if there is no such mass.
    pub critical_mass: Option<Uncertain>,
}

/// Amplitude of the housing relative to the shaft.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Amplitude {
    /// Largest displacement from the mean position, in m.
    pub largest_displacement: f64,
    /// Ratio of the largest displacement to the clearance; `None` if the clearance is unknown.
    pub over_clearance: Option<f64>,
}

impl Amplitude {
    /// Returns a note if the housing moves too far for a linear film.
    fn remark(self) -> Option<String> {
        let ratio = self.over_clearance.filter(|ratio| *ratio > LARGEST_AMPLITUDE)?;
        Some(format!(
            "the housing moves by up to {} of the clearance. Above {LARGEST_AMPLITUDE} of the clearance the film \
             is not linear, and the coefficients depend on the amplitude: use smaller forces",
            significant(ratio, 2)
        ))
    }
}

/// Returns the coefficients of the film; `uncertain` makes an estimate from a value and its
/// variance.
fn coefficients(
    film: &Film,
    uncertain: &dyn Fn(f64, f64) -> Result<Uncertain, AnalysisError>,
) -> Result<Vec<CoefficientRow>, AnalysisError> {
    let row = |at: usize| {
        let mut estimate = uncertain(film.values()[at], film.covariance()[(at, at)])?;
        if let Some(interval) = film.interval_after_choice(at, CONFIDENCE) {
            estimate.interval = estimate.interval.map(|_| interval);
        }
        Ok(CoefficientRow { name: NAMED[at], unit: UNITS[at / 4], estimate })
    };
    (0..film.values().len()).map(row).collect()
}

/// Returns the covariance of the coefficients of the film.
fn covariance(film: &Film) -> ParameterCovariance {
    let names = NAMED[..film.values().len()].iter().map(|name| (*name).to_owned()).collect();
    ParameterCovariance::new(names, film.covariance(), film.degrees_of_freedom)
}

impl BearingSummary {
    pub(super) fn new(
        tests: &BearingData,
        baseline: Option<&BearingData>,
        film: &Film,
        lines: Vec<StiffnessLine>,
        checks: Vec<CheckRow>,
        how: &IdentifyBearing,
    ) -> Result<Self, AnalysisError> {
        let error_scale = (film.excess <= DISTURBED_ALONE).then(|| film.excess.sqrt());
        let uncertain = |value: f64, variance: f64| match error_scale {
            None => Ok(Uncertain::known(value)),
            Some(_) => Uncertain::from_estimate(&mechid_numerics::Uncertain {
                value,
                standard_error: variance.max(0.0).sqrt(),
                degrees_of_freedom: film.degrees_of_freedom,
            }),
        };
        let amplitude = tests.largest_displacement.map(|largest_displacement| Amplitude {
            largest_displacement,
            over_clearance: how.size.clearance.map(|c| largest_displacement / c),
        });
        let coefficients = coefficients(film, &uncertain)?;
        let mut summary = Self {
            tests: tests.names.clone(),
            baseline: baseline.map(|b| b.names.clone()).unwrap_or_default(),
            rotation_hz: how.rotation_hz,
            load: how.load,
            confidence: CONFIDENCE,
            machine: element::machine(&coefficients),
            coefficients,
            covariance: covariance(film),
            inertia_test: film.inertia,
            dimensionless: None,
            stability: None,
            amplitude,
            misfit_ratio: film.fit.misfit_ratio,
            error_scale,
            condition_number: film.fit.estimate.condition(),
            lines: tests.data.len(),
            left_out_hz: tests.left_out_hz.clone(),
            dynamic_stiffness: lines,
            checks,
            remarks: tests.remarks.clone(),
            analysis: how.clone(),
        };
        summary.remarks.extend(baseline.iter().flat_map(|b| b.remarks.iter().cloned()));
        summary.remarks.extend(summary.interval_remarks(tests, film));
        summary.dimensionless = summary.scaled()?;
        summary.stability = match how.rotation_hz {
            Some(hz) => summary.whirl(film, TAU * hz, &uncertain)?,
            None => None,
        };
        summary.remarks.extend(amplitude.and_then(Amplitude::remark));
        Ok(summary)
    }

    /// Returns remarks about intervals that the residual or the choice of twelve coefficients has
    /// changed, and about a speed of rotation that would explain the misfit.
    fn interval_remarks(&self, tests: &BearingData, film: &Film) -> Vec<String> {
        let mut remarks = Vec::new();
        match self.error_scale {
            None => remarks.push(format!(
                "the residual power is {} × the noise power, so the coefficients do not describe the tests, and \
                 have no standard errors and intervals",
                significant(film.excess, 3)
            )),
            Some(scale) if scale > 1.0 => remarks.push(format!(
                "the standard errors that follow from the noise were multiplied by {0}, because the residual is \
                 {0} × the noise",
                significant(scale, 3)
            )),
            Some(_) => {}
        }
        let is_moved = |at: usize| {
            film.interval_after_choice(at, CONFIDENCE).is_some_and(|interval| {
                let error = film.covariance()[(at, at)].sqrt();
                let width = interval[1] - interval[0];
                (width / (2.0 * NORMAL * error) - 1.0).abs() > MOVED
            })
        };
        if self.error_scale.is_some() && (0..film.values().len()).any(is_moved) {
            remarks.push(
                "twelve coefficients were chosen by a significance test, which favours large mass coefficients; \
                 the intervals include this effect. If `coefficients` twelve is set, there \
                 is no such test, and the intervals are narrower"
                    .into(),
            );
        }
        let speed = if self.error_scale.is_none() { speed_of_misfit(tests) } else { None };
        if let Some([low, high]) = speed {
            remarks.push(format!(
                "the tests agree if the lines at multiples of a frequency from {} to {} Hz are left out: if the \
                 shaft rotates at this frequency, run-out of the shaft disturbs these lines; state the speed \
                 (`rotation_hz`)",
                compact(low, 3),
                compact(high, 3)
            ));
        }
        remarks
    }

    fn scaled(&self) -> Result<Option<Dimensionless>, AnalysisError> {
        let size = &self.analysis.size;
        let (Some(load), Some(clearance)) = (self.load, size.clearance) else { return Ok(None) };
        let omega = self.rotation_hz.map(|hz| TAU * hz);
        let unit = |kind: usize| match (kind, omega) {
            (0, _) => Some(load / clearance),
            (kind, Some(omega)) => Some(load / clearance / omega.powi(kind as i32)),
            (_, None) => None,
        };
        let rows = self.coefficients.iter().enumerate().filter_map(|(at, row)| {
            let unit = unit(at / 4)?;
            let Uncertain { value, standard_error, interval } = row.estimate;
            let estimate = Uncertain {
                value: value / unit,
                standard_error: standard_error.map(|error| error / unit),
                interval: interval.map(|interval| interval.map(|end| end / unit)),
            };
            Some(CoefficientRow { name: row.name, unit: "–", estimate })
        });
        let coefficients = rows.collect();
        let sommerfeld_number = match (size.diameter, size.length, size.viscosity, omega) {
            (Some(diameter), Some(length), Some(viscosity), Some(omega)) => {
                let conditions = Conditions { diameter, length, clearance, viscosity, omega };
                Some(conditions.sommerfeld_number(load)?)
            }
            _ => None,
        };
        Ok(Some(Dimensionless { coefficients, sommerfeld_number }))
    }

    /// Returns the threshold of instability; adds a remark if the coefficients have no threshold.
    fn whirl(
        &mut self,
        film: &Film,
        omega: f64,
        uncertain: &dyn Fn(f64, f64) -> Result<Uncertain, AnalysisError>,
    ) -> Result<Option<StabilityRow>, AnalysisError> {
        let [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy] = std::array::from_fn(|at| film.values()[at]);
        let film_at = OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy };
        let threshold = match Threshold::new(&film_at, omega) {
            Ok(threshold) => threshold,
            Err(error) => {
                self.remarks.push(format!("no threshold of instability: {error}"));
                return Ok(None);
            }
        };
        let covariance: DMatrix<f64> = film.covariance().view((0, 0), (8, 8)).into_owned();
        let errors = threshold.standard_errors(&covariance)?;
        let with_error = |value: Option<f64>, error: Option<f64>| {
            value.zip(error).map(|(value, error)| uncertain(value, error * error)).transpose()
        };
        Ok(Some(StabilityRow {
            whirl_frequency_ratio: with_error(
                threshold.whirl_frequency_ratio(),
                errors.whirl_frequency_ratio,
            )?,
            critical_mass: with_error(threshold.critical_mass(), errors.critical_mass)?,
        }))
    }

    fn text(&self) -> String {
        let mut text = self.tests.join(", ");
        if let Some(hz) = self.rotation_hz {
            text += &format!(": {} Hz rotation", compact(hz, 6));
        }
        if let Some(load) = self.load {
            text += &format!(", {} N load", compact(load, 6));
        }
        if !self.baseline.is_empty() {
            text += &format!("\nminus the baseline {}", self.baseline.join(", "));
        }
        text += &format!(
            "\nmaximum likelihood on f − M a = H d, M = {} kg; {} lines{}\n\n",
            compact(self.analysis.stator_mass, 6),
            self.lines,
            match self.left_out_hz.len() {
                0 => String::new(),
                count => format!(", {count} excluded at multiples of the rotation frequency"),
            }
        );
        let table = |what: &str, rows: &[CoefficientRow]| {
            let mut cells = vec![header(what)];
            cells.extend(rows.iter().map(|row| {
                let mut cells = vec![row.name.to_owned()];
                cells.extend(self.cells(&row.estimate));
                cells.push(row.unit.into());
                cells
            }));
            text_table(&cells)
        };
        text += &table("coefficient", &self.coefficients);
        if let Some(scaled) = &self.dimensionless {
            text.push('\n');
            text += &table("dimensionless", &scaled.coefficients);
            if let Some(number) = scaled.sommerfeld_number {
                text += &format!("Sommerfeld number  {}\n", significant(number, 4));
            }
        }
        if let Some(stability) = &self.stability {
            text.push('\n');
            text += &self.stability_table(stability);
        }
        text.push('\n');
        text += &self.fit_lines();
        text += &format!("\n{}", verdict(&self.checks));
        text + &paragraph(self.remarks.iter().map(|remark| format!("note: {remark}")))
    }

    fn stability_table(&self, stability: &StabilityRow) -> String {
        let mut rows = vec![header("rigid rotor")];
        for (name, value, unit) in [
            ("whirl frequency ratio", &stability.whirl_frequency_ratio, "–"),
            ("critical mass per bearing", &stability.critical_mass, "kg"),
        ] {
            let mut row = vec![name.to_owned()];
            match value {
                Some(value) => row.extend(self.cells(value)),
                None => row.push("none: stable".into()),
            }
            row.resize(4, String::new());
            row.push(unit.into());
            rows.push(row);
        }
        text_table(&rows)
    }

    /// Returns value, standard error and interval.
    pub(super) fn cells(&self, estimate: &Uncertain) -> [String; 3] {
        match self.error_scale {
            Some(_) => estimate.cells(),
            None => [significant(estimate.value, 6), "withheld".into(), String::new()],
        }
    }

    fn fit_lines(&self) -> String {
        let mut rows = vec![
            vec!["residual power / noise power".into(), significant(self.misfit_ratio, 3)],
            vec!["condition number".into(), significant(self.condition_number, 3)],
        ];
        if let Some(test) = &self.inertia_test {
            let LikelihoodRatio { statistic, restrictions, p_value } = test;
            let cell = format!(
                "{} with {restrictions} coefficients, p = {}",
                significant(*statistic, 3),
                significant(*p_value, 2)
            );
            rows.push(vec!["likelihood-ratio test of the inertia".into(), cell]);
        }
        if let Some(amplitude) = &self.amplitude {
            let part = amplitude.over_clearance.map_or(String::new(), |part| {
                format!(" ({} of the clearance)", significant(part, 2))
            });
            let cell = format!("{} m{part}", significant(amplitude.largest_displacement, 3));
            rows.push(vec!["largest relative displacement".into(), cell]);
        }
        text_table(&rows)
    }
}

impl fmt::Display for BearingSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text())
    }
}
