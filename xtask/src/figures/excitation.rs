//! The Schroeder signal in time and frequency: figures 4.3.1, 5.2.1, 5.2.2 and those of the papers.

use mechid::plot::{Axis, Color, Curve, Figure, Panel};
use mechid::signal::Spectrum;

use super::Plan;
use super::series::BEARING;
use crate::thesis::case::{Case, Machine};

/// The dissertation does not state the NPI of these figures; NPI scales both axes without a change
/// of the shape.
const NPI: f64 = 2.0;

/// The force over its period, with the first sample of the next period to close it.
fn in_time(case: Case) -> Panel {
    let force = case.force();
    let driven = force.channel(force.channels() - 1);
    let time: Vec<f64> = (0..=case.nt).map(|k| case.sampling().time(k)).collect();
    let closed: Vec<f64> = driven.iter().chain(&driven[..1]).copied().collect();
    Panel::new(Axis::linear("Time t", "s"), Axis::linear("Force F", "N"))
        .curve(Curve::line("", &time, &closed).width(1.2))
}

fn in_frequency(case: Case) -> Panel {
    let force = case.force();
    let spectrum = Spectrum::from_record(&force);
    let lines = 0..=case.nt / 2;
    let omega: Vec<f64> = lines.clone().map(|n| spectrum.omega(n)).collect();
    let amplitude: Vec<f64> =
        lines.map(|n| spectrum.line(n, force.channels() - 1).norm()).collect();
    Panel::new(Axis::linear("Angular frequency ω", "rad/s"), Axis::linear("Amplitude |F|", "N"))
        .curve(Curve::stems("", &omega, &amplitude).color(Color::VERMILION))
}

pub(crate) fn plans() -> Vec<Plan> {
    let sdof = Case { machine: Machine::SDOF, nt: 256, npi: NPI };
    let bearing = Case { machine: BEARING, ..sdof };
    let both = |number: &'static str, case: Case| Plan {
        number,
        draw: Box::new(move || {
            let title = format!(
                "{number}: Schroeder signal, {} cosines of equal amplitude, NPI = {NPI}",
                case.nt / 2 - 1
            );
            Ok(Figure::new(title)
                .panel(in_time(case).title("(a) one period"))
                .panel(in_frequency(case).title("(b) spectrum")))
        }),
    };
    let one = |number: &'static str, what: &'static str, panel: fn(Case) -> Panel| Plan {
        number,
        draw: Box::new(move || {
            let title =
                format!("{number}: Schroeder signal {what}, N_{{t}} = {}, NPI = {NPI}", sdof.nt);
            Ok(Figure::new(title).panel(panel(sdof)))
        }),
    };
    vec![
        both("4.3.1", sdof),
        one("5.2.1", "in time", in_time),
        one("5.2.2", "in frequency", in_frequency),
        both("P1-3", bearing),
    ]
}
