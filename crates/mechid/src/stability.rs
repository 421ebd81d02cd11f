//! Comparison of time-stepping schemes: stability and accuracy for a free oscillation, step by
//! step.

use std::f64::consts::TAU;
use std::fmt;

use mechid_analysis::text::{compact, paged_table, significant};
use mechid_integrate::{
    Accuracy, IntegrateError, Matrices, Scheme, accuracy, critical_step, critical_steps,
    spectral_radius,
};
use mechid_model::Sdof;
use serde::Serialize;

/// Maximum excess over 1 of a spectral radius that counts as rounding.
const RADIUS_ROUNDING: f64 = 1e-9;

/// Maximum percentage or damping ratio that counts as zero.
const ZERO: f64 = 1e-10;

/// Scheme with a name that is short enough for the head of a column or a legend.
#[derive(Debug)]
pub struct NamedScheme {
    /// Short name.
    pub label: String,
    /// The scheme.
    pub scheme: Box<dyn Scheme>,
}

/// Machine, and the step for its simulation.
#[derive(Debug, Clone, Copy)]
pub struct SteppedMachine<'a> {
    /// M, C and K of the machine, dense or sparse.
    pub system: Matrices<'a>,
    /// Step, in s.
    pub dt: f64,
}

/// Stability and accuracy of schemes; `Display` writes tables, `Serialize` writes the same content
/// as data.
///
/// # Source
/// Dissertation section 3.4; Hughes (1987), *The Finite Element Method*, section 9.1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SchemeComparison {
    /// Damping ratio of the oscillation.
    pub damping_ratio: f64,
    /// Results, one per scheme.
    pub schemes: Vec<SchemeAccuracy>,
}

/// Stability and accuracy of one scheme.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SchemeAccuracy {
    /// Short name.
    #[serde(skip)]
    pub label: String,
    /// Name of the scheme with all its parameters.
    pub name: String,
    /// Largest stable step as a fraction of the undamped period; `None` if every step is stable.
    pub stability_limit: Option<f64>,
    /// Accuracy at each requested step.
    pub chart: Vec<StepAccuracy>,
    /// Stability for the machine, if one was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub machine: Option<MachineStability>,
}

/// Accuracy of a scheme with one step length for a free oscillation. A field is `None` if the
/// numerical response does not oscillate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StepAccuracy {
    /// Step as a fraction of the undamped period.
    pub step_over_period: f64,
    /// Spectral radius of the amplification matrix, a pure number; above 1 the response grows.
    pub spectral_radius: f64,
    /// Period elongation, as a fraction of the exact period.
    pub period_elongation: Option<f64>,
    /// Fraction of the amplitude lost in a period.
    pub amplitude_decay: Option<f64>,
    /// Damping ratio that the scheme adds.
    pub numerical_damping_ratio: Option<f64>,
}

/// Stability of a scheme for a machine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MachineStability {
    /// Largest stable step, in s; `None` if every step is stable.
    pub critical_step_s: Option<f64>,
    /// Given step, in s.
    pub step_s: f64,
    /// Spectral radius at the given step, a pure number.
    pub spectral_radius: f64,
}

/// Compares schemes for an oscillation with a damping ratio, and for a machine if one is given.
/// Each of `steps` is the length of a step as a fraction of the undamped period.
///
/// ```
/// use mechid::integrate::Houbolt;
/// use mechid::{NamedScheme, compare_schemes};
///
/// let houbolt = NamedScheme { label: "Houbolt".into(), scheme: Box::new(Houbolt::default()) };
/// let compared = compare_schemes(&[houbolt], 0.0, &[0.1], None)?;
/// assert_eq!(compared.schemes[0].stability_limit, None);
/// assert!(compared.schemes[0].chart[0].amplitude_decay > Some(0.05));
/// # Ok::<(), mechid::integrate::IntegrateError>(())
/// ```
///
/// # Errors
/// [`IntegrateError`] for a damping ratio outside [0, 1), a step that is not positive, or a machine
/// to which a scheme does not apply.
pub fn compare_schemes(
    schemes: &[NamedScheme],
    damping_ratio: f64,
    steps: &[f64],
    machine: Option<SteppedMachine<'_>>,
) -> Result<SchemeComparison, IntegrateError> {
    let oscillator = Sdof::from_modal(1.0, damping_ratio, 1.0)?.system();
    let all_schemes: Vec<&dyn Scheme> = schemes.iter().map(|named| named.scheme.as_ref()).collect();
    let limits = match machine {
        Some(SteppedMachine { system, .. }) => critical_steps(&all_schemes, &system)?,
        None => vec![None; all_schemes.len()],
    };
    let compare = |(NamedScheme { label, scheme }, limit): (&NamedScheme, Option<f64>)| {
        let scheme = scheme.as_ref();
        let points = steps.iter().map(|step| accuracy(scheme, damping_ratio, *step));
        Ok(SchemeAccuracy {
            label: label.clone(),
            name: scheme.name(),
            chart: points.map(|p| p.map(StepAccuracy::from)).collect::<Result<_, _>>()?,
            stability_limit: critical_step(scheme, &oscillator)?.map(|dt| dt / TAU),
            machine: machine
                .map(|machine| MachineStability::new(scheme, machine, limit))
                .transpose()?,
        })
    };
    let schemes = schemes.iter().zip(limits).map(compare);
    let schemes = schemes.collect::<Result<_, IntegrateError>>()?;
    Ok(SchemeComparison { damping_ratio, schemes })
}

impl From<Accuracy> for StepAccuracy {
    fn from(accuracy: Accuracy) -> Self {
        Self {
            step_over_period: accuracy.step_over_period,
            spectral_radius: accuracy.spectral_radius,
            period_elongation: accuracy.period_elongation,
            amplitude_decay: accuracy.amplitude_decay,
            numerical_damping_ratio: accuracy.numerical_damping_ratio,
        }
    }
}

impl StepAccuracy {
    /// Returns `value`, or `None` if the response grows.
    fn stable(&self, value: Option<f64>) -> Option<f64> {
        value.filter(|_| self.spectral_radius <= 1.0 + RADIUS_ROUNDING)
    }
}

impl MachineStability {
    fn new(
        scheme: &dyn Scheme,
        SteppedMachine { system, dt }: SteppedMachine<'_>,
        critical_step_s: Option<f64>,
    ) -> Result<Self, IntegrateError> {
        Ok(Self {
            critical_step_s,
            step_s: dt,
            spectral_radius: spectral_radius(scheme, &system, dt)?,
        })
    }
}

/// Function that returns a quantity of a chart; `None` if the quantity is not defined.
type Quantity = fn(&StepAccuracy) -> Option<f64>;

impl fmt::Display for SchemeComparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let tables: [(&str, Quantity); 4] = [
            ("Spectral radius", |p| Some(p.spectral_radius)),
            ("Period elongation (%)", |p| p.stable(p.period_elongation).map(|e| 100.0 * e)),
            ("Amplitude decay per period (%)", |p| p.stable(p.amplitude_decay).map(|d| 100.0 * d)),
            ("Numerical damping ratio", |p| p.stable(p.numerical_damping_ratio)),
        ];
        f.write_str("–: the motion grows or does not oscillate\n\n")?;
        for (title, value) in tables {
            writeln!(f, "{title}\n{}", self.table(value))?;
        }
        let mut rows = vec![vec!["scheme".into(), "largest stable Δt/T".into()]];
        if self.schemes.iter().any(|s| s.machine.is_some()) {
            rows[0].extend(["largest stable step (s)", "ρ at the step chosen"].map(String::from));
        }
        for scheme in &self.schemes {
            let limit = |limit: Option<f64>| limit.map_or("any".into(), |v| significant(v, 6));
            let mut row = vec![scheme.name.clone(), limit(scheme.stability_limit)];
            if let Some(machine) = &scheme.machine {
                row.extend([limit(machine.critical_step_s), rounded(machine.spectral_radius)]);
            }
            rows.push(row);
        }
        f.write_str(&paged_table(&rows, 1))
    }
}

impl SchemeComparison {
    /// Returns a table with one row per step and one column per scheme.
    fn table(&self, value: Quantity) -> String {
        let mut header = vec!["Δt/T".to_owned()];
        header.extend(self.schemes.iter().map(|s| s.label.clone()));
        let mut rows = vec![header];
        let steps = self.schemes.first().map_or(&[][..], |s| s.chart.as_slice());
        for (k, step) in steps.iter().enumerate() {
            let mut row = vec![compact(step.step_over_period, 6)];
            row.extend(self.schemes.iter().map(|s| value(&s.chart[k]).map_or("–".into(), rounded)));
            rows.push(row);
        }
        paged_table(&rows, 1)
    }
}

/// Writes five digits; rounding errors are written as zero.
fn rounded(value: f64) -> String {
    if value.abs() < ZERO { "0".into() } else { significant(value, 5) }
}

/// Chart of stability and accuracy that is usual in textbooks.
#[cfg(feature = "report")]
mod figure {
    use mechid_plot::{Axis, Curve, Figure, Panel, Reference};

    use super::{NamedScheme, StepAccuracy, compare_schemes};
    use crate::integrate::IntegrateError;

    /// Draws the spectral radius, the period elongation (%) and the amplitude decay (%) of schemes
    /// against the step as a fraction of the undamped period, for an oscillation with the given
    /// damping ratio.
    ///
    /// # Errors
    /// As [`compare_schemes`].
    ///
    /// # Source
    /// Bathe (1996), *Finite Element Procedures*, section 9.4, with the same figures.
    pub fn stability_figure(
        schemes: &[NamedScheme],
        damping_ratio: f64,
    ) -> Result<Figure, IntegrateError> {
        let log = |k: i32| 10f64.powf(-2.0 + 3.0 * f64::from(k) / 300.0);
        let wide: Vec<f64> = (0..=300).map(log).collect();
        let narrow: Vec<f64> = (1..=160).map(|k| 0.0025 * f64::from(k)).collect();
        let step = "Step over natural period Δt/T";
        let mut panels = [
            // Only radii around and below 1 are compared, so the curve of an unstable scheme is cut
            // off.
            Panel::new(
                Axis::log10(step, ""),
                Axis::linear("Spectral radius ρ", "").range(0.0, 1.6),
            )
            .reference(Reference::horizontal("limit of stability", 1.0)),
            Panel::new(
                Axis::linear(step, "").range(0.0, 0.4),
                Axis::linear("Period elongation", "%").range(-20.0, 60.0),
            ),
            Panel::new(
                Axis::linear(step, "").range(0.0, 0.4),
                Axis::linear("Amplitude decay per period", "%").range(-10.0, 80.0),
            ),
        ];
        let far = compare_schemes(schemes, damping_ratio, &wide, None)?.schemes;
        let near = compare_schemes(schemes, damping_ratio, &narrow, None)?.schemes;
        for (slot, (far, near)) in far.iter().zip(&near).enumerate() {
            let quantities: [(&[StepAccuracy], super::Quantity); 3] = [
                (&far.chart, |p| Some(p.spectral_radius).filter(|r| *r < 2.0)),
                (&near.chart, |p| p.stable(p.period_elongation).map(|e| 100.0 * e)),
                (&near.chart, |p| p.stable(p.amplitude_decay).map(|d| 100.0 * d)),
            ];
            for (panel, (points, value)) in panels.iter_mut().zip(quantities) {
                let drawn = points.iter().filter_map(|p| Some((p.step_over_period, value(p)?)));
                let (x, y): (Vec<f64>, Vec<f64>) = drawn.unzip();
                if !x.is_empty() {
                    *panel = panel.clone().curve(Curve::line(&far.label, &x, &y).slot(slot));
                }
            }
        }
        let title = match damping_ratio {
            0.0 => "Time-stepping schemes on an undamped oscillation".to_owned(),
            zeta => format!("Time-stepping schemes on an oscillation of damping ratio {zeta}"),
        };
        Ok(panels.into_iter().fold(Figure::new(title), Figure::panel).shared_legend())
    }
}

#[cfg(feature = "report")]
pub use figure::stability_figure;
