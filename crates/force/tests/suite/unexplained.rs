//! The part of the measured motion that a force does not explain, compared with its definition.

use mechid_force::{
    Channel, Filter, ForceUnknowns, Measurement, Noise, Rule, Start, Tuning, Unexplained,
    frequency_domain, kalman, regularised,
};
use mechid_model::{InitialState, KyxSign, Response, ResponseQuantity, SecondOrderSystem};
use mechid_problems::{dissertation_bearing, exact_foh, exact_harmonic_periodic, random_stable};
use mechid_signal::{Multisine, Phases, Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix};

type Line = Complex<f64>;

const LINES: [usize; 4] = [1, 3, 8, 15];

fn bearing() -> SecondOrderSystem {
    dissertation_bearing(KyxSign::Minus).system()
}

/// Returns the displacement of both directions under forces of these sizes, which act at the same
/// lines.
fn displacement(sizes: [f64; 2]) -> Record {
    let sampling = Sampling::new(0.1, 64).unwrap();
    let wave = |seed: u64| {
        let multisine = Multisine::flat(LINES, 1.0, Phases::Random { seed }).unwrap();
        multisine.sample(sampling).unwrap()
    };
    let waves = [wave(1), wave(2)];
    let force = DMatrix::from_fn(64, 2, |k, i| sizes[i] * waves[i].channel(0)[k]);
    let response = exact_harmonic_periodic(&bearing(), &Record::new(sampling, force).unwrap());
    response.unwrap().displacement().clone()
}

fn measured(record: Record) -> Measurement {
    Measurement::from_record(ResponseQuantity::Displacement, record)
}

/// Displacements under a unit force on the first direction, by Cramer's rule.
fn receptance(omega: f64) -> [Line; 2] {
    let s = bearing();
    let d = |i: usize, j: usize| {
        Complex::new(
            s.stiffness()[(i, j)] - omega * omega * s.mass()[(i, j)],
            omega * s.damping()[(i, j)],
        )
    };
    let determinant = d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0);
    [d(1, 1) / determinant, -d(1, 0) / determinant]
}

fn close(found: f64, truth: f64, tolerance: f64) {
    assert!((found - truth).abs() <= tolerance * truth, "{found}, truth {truth}");
}

#[test]
fn on_lines_the_rest_is_that_of_least_squares() {
    let record = displacement([70.0, 100.0]);
    let spectrum = Spectrum::from_record(&record);
    let level = [2e-4, 5e-4];
    let noise = Noise::PerChannel(level.to_vec());
    let found = frequency_domain(&bearing(), &measured(record), &[0], &LINES, &noise).unwrap();
    // Powers of residual, measurement and prediction; each line adds half its squared amplitude.
    let mut powers = [[0.0; 3]; 2];
    for n in LINES {
        let (h, y) = (receptance(spectrum.omega(n)), [0, 1].map(|c| spectrum.line(n, c)));
        let weighted =
            |f: &dyn Fn(usize) -> Line| f(0) / level[0].powi(2) + f(1) / level[1].powi(2);
        let force = weighted(&|c| h[c].conj() * y[c]) / weighted(&|c| h[c] * h[c].conj());
        for c in 0..2 {
            let made = h[c] * force;
            for (sum, part) in powers[c].iter_mut().zip([y[c] - made, y[c], made]) {
                *sum += 0.5 * part.norm_sqr();
            }
        }
    }
    for (c, channel) in found.unexplained().unwrap().iter().enumerate() {
        let [rest, seen, made] = powers[c].map(f64::sqrt);
        close(channel.residual, rest, 1e-9);
        close(channel.motion, seen.max(made), 1e-9);
        close(channel.share(), rest / seen.max(made), 1e-9);
        // Each of the four lines, with its conjugate, has 2/64 of the power of white noise in 64
        // samples.
        close(channel.noise.unwrap(), level[c] * (8.0_f64 / 64.0).sqrt(), 1e-12);
        assert!(channel.share() > 0.01 && channel.system.is_none());
    }
}

#[test]
fn as_many_channels_as_forces_say_nothing() {
    let all = measured(displacement([70.0, 100.0]));
    let both = frequency_domain(&bearing(), &all, &[0, 1], &LINES, &Noise::Unknown).unwrap();
    assert!(both.unexplained().is_none());
    let period = ForceUnknowns::Lines(LINES.to_vec());
    let filtered =
        regularised(&bearing(), &all, &[0, 1], &period, Filter::Shrinkage, &Noise::Unknown);
    assert!(filtered.unwrap().force.unexplained().is_none());
}

#[test]
fn one_force_explains_what_one_force_made() {
    let all = measured(displacement([70.0, 0.0]));
    let found = frequency_domain(&bearing(), &all, &[0], &LINES, &Noise::Unknown).unwrap();
    for channel in found.unexplained().unwrap() {
        assert!(channel.share() < 1e-12 && channel.noise.is_none());
    }
}

#[test]
fn a_dead_sensor_is_wholly_unexplained() {
    let mut data = displacement([70.0, 0.0]).into_data();
    let size = data.column(1).norm() / 8.0;
    data.fill_column(1, 0.0);
    let sampling = Sampling::new(0.1, 64).unwrap();
    let dead = measured(Record::new(sampling, data).unwrap());
    let noise = Noise::PerChannel(vec![1e-3, 1e3]);
    let found = frequency_domain(&bearing(), &dead, &[0], &LINES, &noise).unwrap();
    let channel = found.unexplained().unwrap()[1];
    // The sensor of the first channel is much more accurate. It therefore determines the force and
    // the expected response.
    close(channel.residual, size, 1e-9);
    close(channel.share(), 1.0, 1e-12);
}

#[test]
fn noise_leaves_what_its_level_says() {
    let clean = displacement([70.0, 0.0]);
    let level = [2e-3, 5e-3];
    let (runs, mut sum) = (400, 0.0);
    for seed in 0..runs {
        let white = noise::white(clean.sampling(), 2, 1.0, seed).unwrap();
        let data =
            DMatrix::from_fn(64, 2, |k, c| clean.channel(c)[k] + level[c] * white.channel(c)[k]);
        let noisy = measured(Record::new(clean.sampling(), data).unwrap());
        let noise = Noise::PerChannel(level.to_vec());
        let found = frequency_domain(&bearing(), &noisy, &[0], &LINES, &noise).unwrap();
        let channels = found.unexplained().unwrap();
        sum += channels.iter().map(|c| (c.residual / c.noise.unwrap()).powi(2)).sum::<f64>();
    }
    // With two channels and one force, one of two complex numbers per line remains as the residual.
    // χ² with eight degrees of freedom, divided by eight, has a standard deviation of 1/2; its mean
    // over 400 runs has a standard deviation of 0.025.
    let mean = sum / runs as f64;
    assert!((mean - 1.0).abs() < 0.1, "{mean}");
}

/// Returns a measurement of the displacement of the first, the velocity of the second and the
/// acceleration of the third degree of freedom.
fn mixed(response: &Response) -> Measurement {
    let quantities = [
        ResponseQuantity::Displacement,
        ResponseQuantity::Velocity,
        ResponseQuantity::Acceleration,
    ];
    let records = [response.displacement(), response.velocity(), response.acceleration()];
    let columns: Vec<_> =
        records.iter().enumerate().map(|(dof, record)| record.column(dof).into_owned()).collect();
    let channels =
        quantities.into_iter().enumerate().map(|(dof, quantity)| Channel { dof, quantity });
    let record = Record::new(response.sampling(), DMatrix::from_columns(&columns)).unwrap();
    Measurement::new(record, channels.collect()).unwrap()
}

/// Checks that the residual is the measured motion minus the motion that the force causes from
/// rest, computed in closed form.
fn is_rest_of(
    system: &SecondOrderSystem,
    force: &Record,
    measured: &Measurement,
    found: &[Unexplained],
) {
    let made = exact_foh(system, force, &InitialState::rest(system.dof())).unwrap();
    let made = mixed(&made);
    for (c, channel) in found.iter().enumerate() {
        let (seen, made) = (measured.record().column(c), made.record().column(c));
        let size = (seen.len() as f64).sqrt();
        assert!(channel.share() > 0.02, "{}", channel.share());
        close(channel.residual, (seen - made).norm() / size, 1e-6);
        close(channel.motion, seen.norm().max(made.norm()) / size, 1e-6);
    }
}

#[test]
fn on_open_records_the_rest_is_that_of_the_motion_which_the_force_makes() {
    let system = random_stable(3, 4);
    let sampling = Sampling::new(0.01, 120).unwrap();
    let wave = |k: usize, i: usize| ((0.3 + 0.1 * i as f64) * k as f64 + 0.2).sin();
    let force = DMatrix::from_fn(120, 3, wave);
    let response =
        exact_foh(&system, &Record::new(sampling, force).unwrap(), &InitialState::rest(3)).unwrap();
    let measured = mixed(&response);
    let filter = Filter::Tikhonov(Rule::Given(1e-3));
    let extent = ForceUnknowns::Samples(Start::FromRest);
    let found =
        regularised(&system, &measured, &[0], &extent, filter, &Noise::Unknown).unwrap().force;
    is_rest_of(&system, found.record(), &measured, found.unexplained().unwrap());
    let found = kalman(&system, &measured, &[0], Start::FromRest, &Tuning::Likelihood).unwrap();
    let channels = found.force.unexplained().unwrap();
    // The smoother returns displacement and velocity; the residual of these channels is the
    // measured value minus the smoothed one.
    for (c, (channel, described)) in channels.iter().zip(measured.channels()).enumerate() {
        let found = match described.quantity {
            ResponseQuantity::Displacement => &found.displacement,
            ResponseQuantity::Velocity => &found.velocity,
            ResponseQuantity::Acceleration => continue,
        };
        let rest = measured.record().column(c) - found.column(described.dof);
        close(channel.residual, rest.norm() / 120f64.sqrt(), 1e-9);
    }
    assert!(channels.iter().all(|c| c.noise.is_none()));
}

/// The machine already moves at the first sample. The estimated initial state and the force
/// together explain the whole motion.
#[test]
fn a_motion_at_the_start_is_no_rest() {
    let system = random_stable(3, 4);
    let sampling = Sampling::new(0.01, 120).unwrap();
    let start = InitialState::new(vec![1e-3; 3].into(), vec![0.2, -0.1, 0.3].into()).unwrap();
    let force = DMatrix::from_fn(120, 3, |k, i| if i == 0 { (0.3 * k as f64).sin() } else { 0.0 });
    let response = exact_foh(&system, &Record::new(sampling, force).unwrap(), &start).unwrap();
    let extent = ForceUnknowns::Samples(Start::InMotion);
    let filter = Filter::Tikhonov(Rule::Given(1e-7));
    let found =
        regularised(&system, &mixed(&response), &[0], &extent, filter, &Noise::Unknown).unwrap();
    for channel in found.force.unexplained().unwrap() {
        assert!(channel.share() < 1e-4, "{}", channel.share());
    }
}
