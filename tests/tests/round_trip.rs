//! Tests across several crates: simulate, write, read back, identify; the exact responses are
//! checked against another exact method.

use mechid::estimate::Unknowns;
use mechid::estimate::frequency_domain::equation_error;
use mechid::io::{Experiment, Table, TimeAxis, csv_text};
use mechid::model::{KyxSign, ResponseQuantity, SecondOrderSystem};
use mechid::signal::{Record, lines};
use mechid::spectra::FrequencyData;
use mechid_problems::{
    dissertation_bearing, dissertation_sdof, exact_foh_periodic, exact_harmonic_periodic,
};
use nalgebra::DMatrix;
use serde_json::json;

/// Experiment on a system; the force on each degree of freedom has its own spectral lines.
fn experiment(
    system: &SecondOrderSystem,
    scheme: &str,
    samples: usize,
    rate_hz: f64,
) -> Experiment {
    let dof = system.dof();
    let excitation: Vec<_> = (0..dof)
        .map(|d| json!({ "dof": d + 1, "lines": format!("{}:{dof}:60", d + 1), "amplitude": 10 }))
        .collect();
    let description = json!({
        "system": mechid::io::SystemMatrices::from(system),
        "sampling": { "samples": samples, "rate_hz": rate_hz },
        "excitation": excitation,
        "scheme": { "name": scheme },
    });
    Experiment::parse("experiment", &description.to_string()).unwrap()
}

fn largest_difference(a: &DMatrix<f64>, b: &DMatrix<f64>) -> f64 {
    (a - b).amax() / b.amax()
}

/// Compares the exact responses with the matrix exponential, which uses no receptance. The matrix
/// exponential has 32 times as many samples, and a force that is linear between them.
#[test]
fn exact_responses_agree_with_the_matrix_exponential() {
    const DENSER: usize = 32;
    for system in [dissertation_sdof().system(), dissertation_bearing(KyxSign::Minus).system()] {
        let ours = mechid::simulate(&experiment(&system, "exact", 256, 200.0)).unwrap().response;
        let dense = experiment(&system, "exact", 256 * DENSER, 200.0 * DENSER as f64);
        let judge = exact_foh_periodic(&system, &dense.force().unwrap()).unwrap();
        for (ours, other) in [
            (ours.displacement(), judge.displacement()),
            (ours.velocity(), judge.velocity()),
            (ours.acceleration(), judge.acceleration()),
        ] {
            let other = DMatrix::from_fn(256, system.dof(), |k, c| other.data()[(DENSER * k, c)]);
            // A force that is linear between samples differs from the cosine by at most (ωΔt)²/8 of
            // its amplitude: 2.7e-4 at line 60.
            assert!(largest_difference(ours.data(), &other) < 3e-4);
        }
    }
}

/// Writes the exact response of a known system to text, reads it back, and identifies the system:
/// the estimated matrices agree with the true ones to 1e-9.
#[test]
fn an_exact_record_goes_through_a_file_to_the_machine() {
    for system in [dissertation_sdof().system(), dissertation_bearing(KyxSign::Plus).system()] {
        let dof = system.dof();
        let force = experiment(&system, "exact", 256, 200.0).force().unwrap();
        let response = exact_harmonic_periodic(&system, &force).unwrap();
        let columns: Vec<(String, &[f64])> = (0..dof)
            .map(|d| (format!("f{d}"), force.channel(d)))
            .chain((0..dof).map(|d| (format!("x{d}"), response.displacement().channel(d))))
            .collect();
        let text = csv_text(force.sampling(), &columns);
        let table = Table::parse("record.csv", text.as_bytes()).unwrap();
        let read = |letter: &str| -> Record {
            let names: Vec<String> = (0..dof).map(|d| format!("{letter}{d}")).collect();
            table.record(&TimeAxis::Column("time"), &names).unwrap()
        };
        let data = FrequencyData::from_records(
            &read("f"),
            &read("x"),
            ResponseQuantity::Displacement,
            1..=60,
        )
        .unwrap();
        let found = equation_error(&data, &Unknowns::unknown_mass(dof).unwrap()).unwrap();
        let found = found.system().unwrap();
        // The error is the rounding error of the transform, multiplied by the condition number of
        // the fit, which is below 1e4.
        assert!(largest_difference(found.mass(), system.mass()) < 1e-9);
        assert!(largest_difference(found.damping(), system.damping()) < 1e-9);
        assert!(largest_difference(found.stiffness(), system.stiffness()) < 1e-9);
    }
}

/// A time-stepping scheme adds its own error to the record, and the identified system contains this
/// error: Newmark's average acceleration is the trapezoidal rule, so the response at ω is that of
/// the true system at Ω = (2/Δt) tan(ωΔt/2).
#[test]
fn newmark_is_identified_as_the_trapezoidal_rule() {
    let system = dissertation_sdof().system();
    let simulation = mechid::simulate(&experiment(&system, "newmark", 256, 40.0)).unwrap();
    let sampling = simulation.force.sampling();
    let used: Vec<usize> = lines::full(sampling).into_iter().filter(|n| *n <= 60).collect();
    let data = FrequencyData::from_records(
        &simulation.force,
        simulation.response.displacement(),
        ResponseQuantity::Displacement,
        used,
    )
    .unwrap();
    for (row, omega) in data.omega().iter().enumerate() {
        let warped = 2.0 / sampling.dt() * (0.5 * omega * sampling.dt()).tan();
        let expected = system.receptance(warped).unwrap()[(0, 0)];
        let measured = data.displacement()[(row, 0)] / data.force()[(row, 0)];
        assert!((measured - expected).norm() < 1e-10 * expected.norm(), "line {}", row + 1);
    }
    // The highest line has 1.47 rad per step, and at such steps the frequency warping changes the
    // identified mass by more than 1 %.
    let found = equation_error(&data, &Unknowns::unknown_mass(1).unwrap()).unwrap();
    assert!((found.mass()[0] / 10.0 - 1.0).abs() > 0.01);
}
