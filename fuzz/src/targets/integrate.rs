//! Calls of `mechid-integrate`.

use mechid_integrate::{
    AllowUnstable, Bathe, CentralDifference, GeneralisedAlpha, Houbolt, MatrixExponential, Newmark,
    RungeKutta4, Scheme, SelectedDofs, SystemWithForces, TermForces, WilsonTheta, accuracy,
    critical_step, integrate, integrate_function, integrate_periodic, integrate_selected,
    periodic_orbit, spectral_radius,
};
use mechid_model::{Response, ResponseQuantity, StateTransition, Terms};

use super::draw::{Draw, finite, passed};

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    let Some(scheme) = scheme(d)? else { return Ok(()) };
    let scheme = scheme.as_ref();
    passed(accuracy(scheme, d.number(), d.number()))?;
    let dof = 1 + d.below(3);
    let Some(system) = d.system(dof)? else { return Ok(()) };
    passed(critical_step(scheme, &system))?;
    passed(spectral_radius(scheme, &system, d.number()))?;
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let channels = d.dof(dof);
    let (Some(force), Some(start)) = (d.record(sampling, channels)?, d.start(dof)?) else {
        return Ok(());
    };
    match d.below(5) {
        0 => motion(integrate(scheme, &system, &force, &start)),
        1 => motion(integrate_periodic(scheme, &system, &force)),
        2 => {
            let (forced, observed) = (d.indices(3), d.indices(3));
            let selected = SelectedDofs { forced: &forced, observed: &observed };
            motion(integrate_selected(scheme, &system, selected, &force, &start))
        }
        3 => {
            let level = d.number();
            motion(integrate_function(scheme, &system, sampling, &start, |t, force| {
                force.fill(level * t);
            }))
        }
        _ => {
            let Some(element) = element(d)? else { return Ok(()) };
            let Some(system) = passed(SystemWithForces::new(&system).with(element))? else {
                return Ok(());
            };
            motion(integrate(scheme, &system, &force, &start))?;
            motion(integrate(&AllowUnstable(scheme), &system, &force, &start))?;
            passed(periodic_orbit(scheme, &system, &force, &start, d.below(4)))?;
            let _ = StateTransition::rate(&super::model::oscillator(), sampling.dt());
            Ok(())
        }
    }
}

fn scheme(d: &mut Draw) -> Result<Option<Box<dyn Scheme>>, String> {
    fn boxed<T: Scheme + 'static>(
        made: Result<T, mechid_integrate::IntegrateError>,
    ) -> Result<Option<Box<dyn Scheme>>, String> {
        Ok(passed(made)?.map(|scheme| Box::new(scheme) as Box<dyn Scheme>))
    }
    let [a, b] = [0; 2].map(|_| if d.one_in(2) { 0.1 * d.below(20) as f64 } else { d.number() });
    match d.below(10) {
        0 => boxed(Newmark::new(a, b)),
        1 => boxed(WilsonTheta::new(a)),
        2 => boxed(GeneralisedAlpha::new(a)),
        3 => boxed(GeneralisedAlpha::hilber_hughes_taylor(a)),
        4 => boxed(GeneralisedAlpha::wood_bossak_zienkiewicz(a)),
        5 => boxed(Bathe::new(a)),
        6 => boxed(Ok(CentralDifference::default())),
        7 => boxed(Ok(Houbolt::default())),
        8 => boxed(Ok(d.of(&[MatrixExponential::HELD, MatrixExponential::LINEAR]))),
        _ => boxed(Ok(d.of(&[RungeKutta4::HELD, RungeKutta4::LINEAR]))),
    }
}

fn element(d: &mut Draw) -> Result<Option<TermForces>, String> {
    let [i, j] = [0; 2].map(|_| 1 + d.below(3));
    let (x, v) = if d.one_in(2) {
        (format!("x{i}"), format!("v{i}"))
    } else {
        (format!("(x{i}-x{j})"), format!("(v{i}-v{j})"))
    };
    let [a, b] = [0; 2].map(|_| d.number());
    let text = match d.below(4) {
        0 => format!("k2: {x}^2, k3: {x}^3"),
        1 => format!("c2: |{v}| {v}, c3: {v}^3"),
        2 => format!("k2: {x}^2, g: gap({x}, {a})"),
        _ => format!("k2: {x}^2, f: tanh({v}/{a})"),
    };
    let Some(terms) = passed(text.parse::<Terms>())? else { return Ok(None) };
    passed(TermForces::new(&terms, &[b, d.number()]))
}

fn motion<E: std::fmt::Display>(response: Result<Response, E>) -> Result<(), String> {
    if let Some(response) = passed(response)? {
        for quantity in [ResponseQuantity::Displacement, ResponseQuantity::Acceleration] {
            finite(Ok::<_, String>(response.quantity(quantity).clone()))?;
        }
    }
    Ok(())
}
