//! Force identified from accelerations only, in the band in which they determine the force.

use mechid_force::{Measurement, Start, Tuning, kalman, within_band};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Extent, Multisine, NoiseLevel, Phases, Record, Sampling, noise};
use nalgebra::DMatrix;

/// Returns a row of masses of 20 kg, connected by springs; one more spring connects the first mass
/// to the ground. A single mass on a single spring would have the natural frequency `hz` and 3 % of
/// critical damping.
pub fn row(dof: usize, hz: f64) -> SecondOrderSystem {
    let omega = std::f64::consts::TAU * hz;
    let (mass, stiffness) = (20.0, 20.0 * omega * omega);
    let springs = DMatrix::from_fn(dof, dof, |i, j| match i.abs_diff(j) {
        0 if i + 1 == dof => stiffness,
        0 => 2.0 * stiffness,
        1 => -stiffness,
        _ => 0.0,
    });
    let damping = &springs * (2.0 * 0.03 / omega);
    SecondOrderSystem::new(DMatrix::identity(dof, dof) * mass, damping, springs).unwrap()
}

/// Result for one record: the identified force compared with the true force.
pub struct Found {
    pub band_hz: [f64; 2],
    /// RMS value of the error of the force within the band, in N; `size` is the RMS value of the
    /// true force.
    pub error: f64,
    pub size: f64,
    /// Share of samples whose error is at most 1.96 standard errors.
    pub held: f64,
}

/// Identifies a force of about 336 N RMS on the last mass, with lines from 0.2 to 60 Hz. The
/// accelerations are 1024 samples at 200 Hz of a steady state in closed form, with white noise of
/// `level` times the RMS value of each acceleration.
pub fn found(dof: usize, hz: f64, level: f64, seed: u64) -> Found {
    let system = row(dof, hz);
    let sampling = Sampling::new(0.005, 1024).unwrap();
    let drive = Multisine::flat(1..=307, 27.1, Phases::Random { seed: 500 + seed }).unwrap();
    let drive = drive.sample(sampling).unwrap();
    let force =
        DMatrix::from_fn(1024, dof, |k, i| if i + 1 == dof { drive.channel(0)[k] } else { 0.0 });
    let truth = Record::new(sampling, force).unwrap();
    let response = exact_harmonic_periodic(&system, &truth).unwrap();
    let level = NoiseLevel::FractionOfRms(level);
    let noisy = noise::add_white(response.acceleration(), level, seed).unwrap();
    let measured = Measurement::from_record(ResponseQuantity::Acceleration, noisy);
    let found =
        kalman(&system, &measured, &[dof - 1], Start::InMotion, &Tuning::Likelihood).unwrap().force;
    let band_hz = found.band_hz().expect("accelerations do not show all of it");
    let truth = within_band(&truth, band_hz, Extent::Open).unwrap();
    let (f, t) = (found.record().channel(dof - 1), truth.channel(dof - 1));
    let se = found.standard_error().unwrap().channel(dof - 1);
    let rms = |squares: f64| (squares / 1024.0).sqrt();
    let held = (0..1024).filter(|k| (f[*k] - t[*k]).abs() <= 1.96 * se[*k]).count();
    Found {
        band_hz,
        error: rms(f.iter().zip(t).map(|(f, t)| (f - t).powi(2)).sum()),
        size: rms(t.iter().map(|t| t * t).sum()),
        held: held as f64 / 1024.0,
    }
}

/// Prints the table of the book: machines, noise, band, error and coverage. Each row is computed
/// from `runs` records.
pub fn table(runs: u64, print: impl Fn(&str)) {
    print("| Masses | Natural frequency | Noise | Shown from | RMS error | in 95 % intervals |");
    print("|---|---|---|---|---|---|");
    for (dof, hz) in [(1, 1.0), (1, 40.0), (2, 1.0), (2, 40.0), (3, 1.0), (3, 40.0)] {
        for level in [0.001, 0.01, 0.05] {
            let all: Vec<Found> = (1..=runs).map(|seed| found(dof, hz, level, seed)).collect();
            let mean = |of: &dyn Fn(&Found) -> f64| all.iter().map(of).sum::<f64>() / runs as f64;
            let error = (mean(&|f| f.error.powi(2)) / mean(&|f| f.size.powi(2))).sqrt();
            print(&format!(
                "| {dof} | {hz} Hz | {} % | {:.2} Hz | {:.1} % | {:.1} % |",
                100.0 * level,
                mean(&|f| f.band_hz[0]),
                100.0 * error,
                100.0 * mean(&|f| f.held)
            ));
        }
    }
}
