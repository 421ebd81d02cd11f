//! Calls of `mechid-integrate`.

use mechid_integrate::{
    AllowUnstable, Bathe, CentralDifference, Connection, GeneralisedAlpha, Houbolt,
    MatrixExponential, Newmark, NonlinearElement, RungeKutta4, Scheme, SelectedDofs,
    SystemWithForces, WilsonTheta, accuracy, critical_step, integrate, integrate_function,
    integrate_periodic, integrate_selected, periodic_orbit, spectral_radius,
};
use mechid_model::{Response, ResponseQuantity, StateTransition};

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

fn element(d: &mut Draw) -> Result<Option<NonlinearElement>, String> {
    let at = if d.one_in(2) {
        Connection::to_ground(d.size())
    } else {
        Connection::between(d.below(3), d.below(3))
    };
    let [a, b] = [0; 2].map(|_| d.number());
    match d.below(4) {
        0 => passed(at.spring(&d.numbers(4))),
        1 => passed(at.damper(&d.numbers(4))),
        2 => passed(at.gap(a, b)),
        _ => passed(at.friction(a, b)),
    }
}

fn motion<E: std::fmt::Display>(response: Result<Response, E>) -> Result<(), String> {
    if let Some(response) = passed(response)? {
        for quantity in [ResponseQuantity::Displacement, ResponseQuantity::Acceleration] {
            finite(Ok::<_, String>(response.quantity(quantity).clone()))?;
        }
    }
    Ok(())
}
