//! Calls of `mechid-model` and `mechid-bearing`.

use mechid_bearing::{Bore, Conditions, FiniteBearing, Mesh, ShortBearing, ShortFilm, Threshold};
use mechid_model::{
    Discretisation, JournalBearing, KyxSign, NonlinearSystem, OilFilm, Parameter, Response,
    ResponseQuantity, Sdof, SecondOrderSystem, SparseSystem, StateTransition, Term, Terms,
    UncertainSystem, npi_sampling, triplets,
};
use mechid_numerics::{RealSchur, linear_algebra};
use nalgebra::Complex;

use super::draw::{Draw, finite, passed};

/// Texts of nonlinear terms, valid and invalid.
const TERMS: [&str; 12] = [
    "k3: x1^3",
    "k2: x1^2, k3: x1^3",
    "c2: |v1| v1",
    "k3: (x1 - x2)^3",
    "d: v1^3/(1 + v1^2/0.1^2)",
    "k3: x1^99999999999",
    "k3: x9^2",
    ": x1^3",
    "k3 x1^3",
    "k2: x1^2, k2: x1^2",
    "c: x1^2 v1",
    "",
];

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    match d.below(7) {
        0 => one_degree_of_freedom(d),
        1 => systems(d),
        2 => matrices(d),
        3 => nonlinear(d),
        4 => names(d),
        5 => sparse(d),
        _ => bearings(d),
    }
}

fn one_degree_of_freedom(d: &mut Draw) -> Result<(), String> {
    let [a, b, c, x, v] = [0; 5].map(|_| d.number());
    let made = if d.one_in(2) { Sdof::from_modal(a, b, c) } else { Sdof::new(a, b, c) };
    let Some(oscillator) = passed(made)? else { return Ok(()) };
    let _ = (oscillator.poles(), oscillator.damping_ratio(), oscillator.critical_damping());
    let _ = (oscillator.dynamic_stiffness(x), oscillator.impulse_response(x));
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let force = Complex::new(d.number(), d.number());
    for response in [
        oscillator.free_response(sampling, x, v),
        oscillator.harmonic_response(sampling, force, a, x, v),
        oscillator.harmonic_steady_state(sampling, force, a),
        oscillator.step_response(sampling, a, x, v),
    ] {
        motion(response)?;
    }
    if let Some(force) = d.record(sampling, 1)? {
        motion(oscillator.held_force_response(&force, x, v))?;
        motion(oscillator.linear_force_response(&force, x, v))?;
    }
    passed(npi_sampling(a, d.size(), b))?;
    Ok(())
}

/// Checks that all numbers of a motion are finite.
fn motion<E: std::fmt::Display>(response: Result<Response, E>) -> Result<(), String> {
    if let Some(response) = passed(response)? {
        for quantity in [
            ResponseQuantity::Displacement,
            ResponseQuantity::Velocity,
            ResponseQuantity::Acceleration,
        ] {
            finite(Ok::<_, String>(response.quantity(quantity).clone()))?;
        }
    }
    Ok(())
}

fn systems(d: &mut Draw) -> Result<(), String> {
    let dof = d.below(4);
    let Some(system) = d.system(dof)? else { return Ok(()) };
    let frequencies = d.numbers(4);
    for omega in &frequencies {
        let _ = system.dynamic_stiffness(*omega);
        passed(system.receptance(*omega))?;
    }
    passed(system.receptances(&frequencies))?;
    passed(system.eigenvalues())?;
    for mode in passed(system.modes())?.unwrap_or_default() {
        let _ = (mode.natural_frequency(), mode.damping_ratio(), mode.damped_frequency_hz());
    }
    let dt = d.number();
    let _ = (system.state_matrix(), StateTransition::force_input(&system, dt));
    let _ = StateTransition::rate(&system, dt);
    let (rows, inputs) = (d.dof(dof), d.below(3));
    passed(StateTransition::exact(&system, dt, &d.matrix(rows, inputs)))?;
    let _ = StateTransition::taylor(&system, dt, d.below(30));
    let unknown: Vec<Parameter> = Parameter::all(system.dof()).collect();
    let count = d.dof(unknown.len());
    let covariance = d.matrix(count, count);
    if let Some(uncertain) = passed(UncertainSystem::new(system, unknown.clone(), covariance))? {
        let _: Vec<f64> = unknown.iter().map(|p| uncertain.standard_error(*p)).collect();
    }
    Ok(())
}

fn matrices(d: &mut Draw) -> Result<(), String> {
    let (rows, columns) = (d.below(6), d.below(6));
    let any = d.matrix(rows, columns);
    passed(linear_algebra::svd(any.clone()))?;
    passed(linear_algebra::singular_values(any.clone()))?;
    passed(linear_algebra::exponential(&any))?;
    passed(linear_algebra::hermitian_eigen(any.clone()))?;
    if let Some(schur) = passed(RealSchur::new(any))? {
        let _ = schur.eigenvalues();
    }
    Ok(())
}

fn nonlinear(d: &mut Draw) -> Result<(), String> {
    let text = d.of(&TERMS);
    passed(text.parse::<Term>())?;
    let Some(terms) = passed(text.parse::<Terms>())? else { return Ok(()) };
    let dof = 1 + d.below(3);
    passed(terms.check_dof(dof))?;
    for term in terms.iter() {
        let (x, v) = (d.number(), d.number());
        let _ = (term.law().value(x, v), term.law().slopes(x, v), term.law().dimension());
        let _ = term.with_constants(&d.numbers(3));
        passed(terms.and(term.clone()))?;
    }
    let count = d.dof(terms.len());
    let coefficients = (0..count).map(|_| d.number()).collect();
    let Some(linear) = d.system(dof)? else { return Ok(()) };
    let Some(system) = passed(NonlinearSystem::new(linear, terms, coefficients))? else {
        return Ok(());
    };
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let [x, v, a] = [0; 3].map(|_| d.record(sampling, dof));
    if let (Some(x), Some(v), Some(a)) = (x?, v?, a?)
        && let Some(response) = passed(Response::new(x, v, a))?
    {
        finite(system.force(&response))?;
    }
    Ok(())
}

fn names(d: &mut Draw) -> Result<(), String> {
    let name = d.of(&["m11", "c21", "kxy", "k", "", "k99", "ké", "m1_2", "k18446744073709551616"]);
    passed(Parameter::named(name, d.size().min(1 << 20)))?;
    passed(name.parse::<ResponseQuantity>())?;
    passed(name.parse::<Discretisation>())?;
    let matrix = d.of(&[
        mechid_model::Matrix::Mass,
        mechid_model::Matrix::Damping,
        mechid_model::Matrix::Stiffness,
    ]);
    passed(Parameter::new(matrix, d.size(), d.size(), d.size()))?;
    Ok(())
}

fn sparse(d: &mut Draw) -> Result<(), String> {
    let dof = d.below(5);
    let mut made = Vec::new();
    for _ in 0..3 {
        let entries: Vec<_> =
            (0..d.below(12)).map(|_| (d.below(6), d.below(6), d.number())).collect();
        let Some(matrix) = passed(triplets(d.dof(dof), entries))? else { return Ok(()) };
        made.push(matrix);
    }
    let [mass, damping, stiffness] = <[_; 3]>::try_from(made).expect("three");
    passed(SparseSystem::new(mass, damping, stiffness))?;
    Ok(())
}

fn bearings(d: &mut Draw) -> Result<(), String> {
    let [kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy] = [0; 8].map(|_| d.number());
    let film = OilFilm { kxx, kxy, kyx, kyy, cxx, cxy, cyx, cyy };
    let mass = d.number();
    passed(JournalBearing::new(mass, film, d.of(&[KyxSign::Plus, KyxSign::Minus])))?;
    if let Some(threshold) = passed(Threshold::new(&film, mass))? {
        passed(threshold.speed(mass))?;
        let rows = d.below(10);
        passed(threshold.standard_errors(&d.matrix(rows, rows)))?;
    }
    let [diameter, length, clearance, viscosity, omega] = [0; 5].map(|_| d.number());
    let conditions = Conditions { diameter, length, clearance, viscosity, omega };
    passed(conditions.sommerfeld_number(kxx))?;
    passed(conditions.load(kxx))?;
    if let Some(coefficients) = passed(conditions.coefficients(&film, kyy))? {
        passed(conditions.film(&coefficients, kyy))?;
        passed(Threshold::from_coefficients(&coefficients))?;
    }
    if let Some(film) = passed(ShortFilm::new(conditions))? {
        passed(film.force([kxx, kxy], [cxx, cxy]))?;
    }
    let share = if d.one_in(2) { d.number() } else { 0.1 * d.below(11) as f64 };
    if let Some(bearing) = passed(ShortBearing::new(length))? {
        passed(bearing.at_eccentricity(share))?;
        passed(bearing.equilibrium(share))?;
    }
    let bore = match d.below(3) {
        0 => Some(Bore::plain()),
        1 => passed(Bore::two_axial_grooves(share))?,
        _ => passed(Bore::elliptical(share, kxx))?,
    };
    let ratio = if d.one_in(2) { d.number() } else { 0.5 };
    if let Some(bore) = bore
        && let Some(bearing) = passed(FiniteBearing::new(bore, ratio))?
    {
        let mesh = Mesh { along: d.size(), across: d.size() };
        passed(bearing.clone().with_mesh(mesh))?;
        if let Some(bearing) = passed(bearing.with_mesh(Mesh { along: 16, across: 4 }))? {
            passed(bearing.equilibrium(share))?;
        }
    }
    Ok(())
}

/// Returns a valid system of one degree of freedom for the other targets.
pub fn oscillator() -> SecondOrderSystem {
    Sdof::new(2.0, 5.0, 8_000.0).expect("a machine").system()
}
