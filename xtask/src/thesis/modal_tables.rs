//! Appendix E: modal parameters of the two-mass system of Steffen & Rade (1991).
//!
//! Step size and forced mass of the identified rows are not printed. Ours are stated in
//! [`SETTING`]; only the theoretical rows can be judged to the digit.

use mechid::estimate::Unknowns;
use mechid::estimate::time_domain::TimeDomain;
use mechid::integrate::{Newmark, RungeKutta4, Scheme, integrate_periodic};
use mechid::model::{Discretisation, Mode, Response, SecondOrderSystem, npi_sampling};
use mechid::signal::{Extent, Multisine, Phases, Record, lines};
use mechid_problems::steffen_rade;
use nalgebra::{Complex, DMatrix};

use super::published::{Cell, Method, Published};
use super::verdict::{Verdict, compare};

/// Settings that the text does not state.
pub const SETTING: &str = "Nt = 2048, amplitude 1 N on the first mass, NPI = 20 on the larger damped frequency, RK4 with a linear mid-step force";

/// A printed modal parameter and ours.
#[derive(Debug, Clone)]
pub struct ModalRow {
    /// Printed cell.
    pub cell: Cell,
    /// Computed value; if the value is identified, by the dissertation's estimator.
    pub value: Complex<f64>,
    /// Verdict of the comparison.
    pub verdict: Verdict,
    /// Reason of a misprint.
    pub reason: Option<&'static str>,
    /// Value identified by our best estimator, without the bias of Euler's rule; `None` if the
    /// value is not identified.
    pub best: Option<Complex<f64>>,
}

/// Tables E1, E2 and the reproduced table of Steffen & Rade.
///
/// # Errors
/// The message of the estimation that fails.
pub fn rows(table: &str, published: &Published) -> Result<Vec<ModalRow>, String> {
    let theory = modal(&steffen_rade())?;
    let scheme: Option<Box<dyn Scheme>> = match table {
        "E1" => Some(Box::new(RungeKutta4::LINEAR)),
        "E2" => Some(Box::new(Newmark::AVERAGE_ACCELERATION)),
        _ => None,
    };
    let identified = scheme
        .map(|s| {
            let [euler, best] = [Discretisation::Euler, Discretisation::FirstOrderHold]
                .map(|d| identify(s.as_ref(), d));
            Ok::<_, String>((euler?, best?))
        })
        .transpose()?;
    Ok(published
        .table(table)
        .map(|cell| match (cell.method, &identified) {
            (Method::Theoretical, _) => judged(cell, &theory, None),
            (_, Some((euler, best))) => judged(cell, euler, Some(best)),
            (_, None) => judged(cell, &theory, None),
        })
        .collect())
}

/// Damped frequency (Hz), damping ratio and y2/y1 of both modes, slower first.
pub type Modal = [[Complex<f64>; 3]; 2];

fn modal(system: &SecondOrderSystem) -> Result<Modal, String> {
    let modes = system.modes().map_err(|e| e.to_string())?;
    let of = |mode: &Mode| {
        let shape = mode.shape();
        let real = |v| Complex::new(v, 0.0);
        [real(mode.damped_frequency_hz()), real(mode.damping_ratio()), shape[1] / shape[0]]
    };
    match modes.as_slice() {
        [slow, fast] => Ok([of(slow), of(fast)]),
        other => Err(format!("two oscillating modes expected, {} found", other.len())),
    }
}

fn identify(scheme: &dyn Scheme, discretisation: Discretisation) -> Result<Modal, String> {
    let (force, motion) = simulate(scheme, 20.0)?;
    identified(&force, motion.displacement(), motion.velocity(), discretisation)
}

/// The true modal parameters.
///
/// # Errors
/// The message of the eigenvalue solver.
pub fn theory() -> Result<Modal, String> {
    modal(&steffen_rade())
}

/// Returns the force on the first mass and the resulting motion, with the settings of [`SETTING`]
/// except NPI.
///
/// # Errors
/// The message of the integrator.
pub fn simulate(scheme: &dyn Scheme, npi: f64) -> Result<(Record, Response), String> {
    let system = steffen_rade();
    let words = |e: &dyn std::fmt::Display| e.to_string();
    let modes = system.modes().map_err(|e| words(&e))?;
    let fastest = modes.iter().map(Mode::damped_frequency).fold(0.0, f64::max);
    let sampling = npi_sampling(npi, 2048, fastest).map_err(|e| words(&e))?;
    let signal = Multisine::flat(lines::full(sampling), 1.0, Phases::SchroederBinary)
        .and_then(|m| m.sample(sampling))
        .map_err(|e| words(&e))?;
    let data = DMatrix::from_fn(2048, 2, |k, c| if c == 0 { signal.channel(0)[k] } else { 0.0 });
    let force = Record::new(sampling, data).map_err(|e| words(&e))?;
    let motion = integrate_periodic(scheme, &system, &force).map_err(|e| words(&e))?;
    Ok((force, motion))
}

/// The modal parameters by least squares over the whole period.
///
/// # Errors
/// The message of the estimator.
pub fn identified(
    force: &Record,
    displacement: &Record,
    velocity: &Record,
    discretisation: Discretisation,
) -> Result<Modal, String> {
    let words = |e: &dyn std::fmt::Display| e.to_string();
    let unknowns = Unknowns::known_mass(steffen_rade().mass()).map_err(|e| words(&e))?;
    let fit = TimeDomain::new(discretisation, Extent::WholePeriod)
        .fit(displacement, velocity, force, &unknowns)
        .map_err(|e| words(&e))?;
    modal(&fit.estimate().system().map_err(|e| words(&e))?)
}

fn judged(cell: &Cell, ours: &Modal, best: Option<&Modal>) -> ModalRow {
    let mode = usize::from(cell.parameter.starts_with("mode2"));
    let quantity = ["damped_frequency_hz", "damping_factor", "eigenvector_ratio"]
        .iter()
        .position(|q| cell.parameter.ends_with(q))
        .unwrap_or(0);
    let value = ours[mode][quantity];
    let swapped = quantity == 1
        && compare_complex(ours[1 - mode][quantity], &cell.estimate) == Verdict::ToTheDigit;
    let plain = compare_complex(value, &cell.estimate);
    let (verdict, reason) = if swapped && plain == Verdict::Unexplained {
        (Verdict::Misprint, Some("the damping factors of the two modes are interchanged"))
    } else {
        (plain, None)
    };
    let best = best.map(|b| b[mode][quantity]);
    ModalRow { cell: cell.clone(), value, verdict, reason, best }
}

/// Compares the real and the imaginary part of a number with their printed digits; `printed` is
/// `a`, `a+bi` or `a+bj`.
fn compare_complex(value: Complex<f64>, printed: &str) -> Verdict {
    let Some(body) = printed.strip_suffix(['i', 'j']) else { return compare(value.re, printed) };
    let Some(split) = body.rfind(['+', '-']).filter(|at| *at > 0) else {
        return Verdict::Unexplained;
    };
    let (re, im) = (&body[..split], body[split..].trim_start_matches('+'));
    compare(value.re, re).max(compare(value.im, im))
}
