//! Frequency responses of the simulated machines: the graphs of Appendix C.

use mechid::plot::{Axis, Color, Curve, Figure, Panel};
use mechid::signal::Spectrum;
use nalgebra::Complex;

use super::Plan;
use super::series::{BEARING, Reading};
use super::sweeps::slot;
use crate::thesis::case::{Case, Machine};
use crate::thesis::published::Method;

/// One curve of a frequency response: angular frequencies (rad/s) and receptances (m/N).
struct Receptance {
    omega: Vec<f64>,
    value: Vec<Complex<f64>>,
}

/// Receptance of the machine as the scheme simulates it: X(ω)/F(ω), with X the displacement of the
/// degree of freedom `dof` and F the force on the last degree of freedom.
fn simulated(
    reading: Reading,
    case: Case,
    method: Method,
    dof: usize,
) -> Result<Receptance, String> {
    let sequences = reading.sequences(case, method)?;
    let (motion, force) = (
        Spectrum::from_record(sequences.response.displacement()),
        Spectrum::from_record(&sequences.force),
    );
    let driven = force.channels() - 1;
    let lines = 1..case.nt.div_ceil(2);
    Ok(Receptance {
        omega: lines.clone().map(|n| motion.omega(n)).collect(),
        value: lines.map(|n| motion.line(n, dof) / force.line(n, driven)).collect(),
    })
}

/// The receptance of the system itself, on a grid fine enough for a smooth line.
fn exact(case: Case, dof: usize) -> Result<Receptance, String> {
    let system = case.machine.system();
    let (first, last) =
        (case.sampling().omega0(), case.sampling().omega0() * (case.nt / 2 - 1) as f64);
    let omega: Vec<f64> =
        (0..=400).map(|k| first * (last / first).powf(f64::from(k) / 400.0)).collect();
    let driven = system.dof() - 1;
    let value: Result<Vec<Complex<f64>>, String> = omega
        .iter()
        .map(|&omega| {
            Ok(system.receptance(omega).map_err(|error| error.to_string())?[(dof, driven)])
        })
        .collect();
    Ok(Receptance { omega, value: value? })
}

/// Magnitude and phase of one degree of freedom: exact, and as each scheme simulates it.
fn panels(case: Case, dof: usize, name: &str) -> Result<[Panel; 2], String> {
    let omega = || Axis::log10("Angular frequency ω", "rad/s");
    let truth = exact(case, dof)?;
    let size =
        |estimates: &Receptance| estimates.value.iter().map(|h| h.norm()).collect::<Vec<f64>>();
    let sizes = size(&truth);
    let (low, high) =
        sizes.iter().fold((f64::INFINITY, 0.0f64), |(low, high), h| (low.min(*h), high.max(*h)));
    // Near the Nyquist frequency, the curves of schemes that have a zero there fall below this
    // range.
    let mut magnitude = Panel::new(omega(), Axis::log10(name, "m/N").range(low / 5.0, high * 2.0))
        .curve(exact_look(Curve::line("exact", &truth.omega, &sizes)));
    let mut phase = Panel::new(omega(), Axis::linear("Phase", "°").step(90.0))
        .curve(exact_look(Curve::line("exact", &truth.omega, &unwrapped(&truth.value))));
    for method in Method::ALL {
        let estimates = simulated(Reading::Corrected, case, method, dof)?;
        let points =
            |y: &[f64]| Curve::points(method.name(), &estimates.omega, y).slot(slot(method));
        magnitude = magnitude.curve(points(&size(&estimates)));
        phase = phase.curve(points(&unwrapped(&estimates.value)));
    }
    Ok([magnitude, phase])
}

fn exact_look(curve: Curve) -> Curve {
    curve.color(Color::BLACK).width(1.1).slot(0)
}

/// Phases in degrees without jumps of a whole turn.
fn unwrapped(values: &[Complex<f64>]) -> Vec<f64> {
    let mut previous = 0.0;
    values
        .iter()
        .map(|value| {
            let raw = value.arg().to_degrees();
            previous = raw + 360.0 * ((previous - raw) / 360.0).round();
            previous
        })
        .collect()
}

pub(crate) fn plans() -> Vec<Plan> {
    let figure = |number: &'static str,
                  machine: Machine,
                  responses: &'static [(usize, &'static str)]| Plan {
        number,
        draw: Box::new(move || {
            let case = Case { machine, nt: 256, npi: 2.0 };
            let title = format!(
                "{number}: Frequency response as each scheme simulates it, NPI = 2, N_{{t}} = 256"
            );
            let columns: Result<Vec<[Panel; 2]>, String> =
                responses.iter().map(|(dof, name)| panels(case, *dof, name)).collect();
            let (above, below): (Vec<Panel>, Vec<Panel>) =
                columns?.into_iter().map(|[a, b]| (a, b)).unzip();
            let figure = Figure::new(title).columns(responses.len()).share_x().shared_legend();
            Ok(above.into_iter().chain(below).fold(figure, Figure::panel))
        }),
    };
    vec![
        figure("C-sdof", Machine::SDOF, &[(0, "|X/F|")]),
        figure("C-bearing", BEARING, &[(0, "|X/F_{y}|"), (1, "|Y/F_{y}|")]),
    ]
}
