//! Least squares in the frequency domain on exact steady states.

use mechid_estimate::frequency_domain::equation_error;
use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{Matrix, ResponseQuantity, SecondOrderSystem};
use mechid_numerics::NumericsError;
use mechid_signal::{Record, Spectrum};
use mechid_spectra::SpectraError;
use mechid_spectra::{FrequencyData, Lines};
use nalgebra::{Complex, DMatrix, dmatrix};

use crate::common::{
    bearing, displacements, forces, oscillator, relative_error, sampling, synthesise,
};

/// Returns a chain of five masses with a follower force: no matrix is symmetric, and all modes are
/// stable.
fn chain() -> SecondOrderSystem {
    let k = DMatrix::from_fn(5, 5, |i: usize, j: usize| match i.abs_diff(j) {
        0 => 900.0 + 100.0 * i as f64,
        1 if i < j => -300.0,
        1 => -450.0,
        _ => 0.0,
    });
    let c = DMatrix::from_fn(5, 5, |i: usize, j: usize| match i.abs_diff(j) {
        0 => 8.0,
        1 => -1.0 - 0.2 * i as f64,
        _ => 0.1,
    });
    let m = DMatrix::from_fn(5, 5, |i, j| if i == j { 1.0 + 0.3 * i as f64 } else { 0.05 });
    let system = SecondOrderSystem::new(m, c, k).unwrap();
    assert!(system.modes().unwrap().iter().all(|m| m.eigenvalue().re < 0.0));
    system
}

/// Force and motion records of the exact steady state over one period.
fn records(system: &SecondOrderSystem, measured: ResponseQuantity) -> (Record, Record, Vec<usize>) {
    let (sampling, lines) = sampling(system);
    let omega: Vec<f64> = lines.iter().map(|&n| n as f64 * sampling.omega0()).collect();
    let force = forces(&lines, system.dof(), 50.0);
    let motion = displacements(system, &omega, &force);
    let force = synthesise(sampling, &lines, &force, ResponseQuantity::Displacement);
    (force, synthesise(sampling, &lines, &motion, measured), lines)
}

#[test]
fn exact_steady_states_give_the_machine_back() {
    for system in [oscillator(), bearing(), chain()] {
        for measured in [
            ResponseQuantity::Displacement,
            ResponseQuantity::Velocity,
            ResponseQuantity::Acceleration,
        ] {
            let (force, motion, lines) = records(&system, measured);
            let data = FrequencyData::from_records(&force, &motion, measured, lines).unwrap();
            let n = system.dof();
            let partly = Unknowns::known_mass(system.mass()).unwrap();
            let partly = partly.release(Matrix::Mass, n - 1, n - 1).unwrap();
            for unknowns in [
                Unknowns::known_mass(system.mass()).unwrap(),
                Unknowns::unknown_mass(n).unwrap(),
                partly,
            ] {
                let found = equation_error(&data, &unknowns).unwrap();
                for (found, expected) in [
                    (found.mass(), system.mass()),
                    (found.damping(), system.damping()),
                    (found.stiffness(), system.stiffness()),
                ] {
                    // The error is the rounding of the transforms times the condition number, which
                    // is up to 1e4.
                    let error = relative_error(&found, expected);
                    assert!(error < 1e-10, "{n} degrees of freedom, {measured}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn spectra_and_few_chosen_lines_do_as_well() {
    let system = bearing();
    let (force, motion, _) = records(&system, ResponseQuantity::Displacement);
    let (f, x) = (Spectrum::from_record(&force), Spectrum::from_record(&motion));
    let data = FrequencyData::from_spectra(&f, &x, ResponseQuantity::Displacement, [3, 9, 17, 40])
        .unwrap();
    let found = equation_error(&data, &Unknowns::unknown_mass(2).unwrap()).unwrap();
    assert!(relative_error(&found.stiffness(), system.stiffness()) < 1e-10);
}

#[test]
fn two_experiments_are_one_estimate() {
    // Each experiment drives one direction only.
    let system = bearing();
    let (sampling, lines) = sampling(&system);
    let omega: Vec<f64> = lines.iter().map(|&n| n as f64 * sampling.omega0()).collect();
    let experiment = |dof: usize| {
        let mut force = forces(&lines, 2, 1.0);
        force.column_mut(1 - dof).fill(Complex::default());
        let motion = displacements(&system, &omega, &force);
        FrequencyData::from_amplitudes(omega.clone(), force, motion, ResponseQuantity::Displacement)
            .unwrap()
    };
    let both = experiment(0).and(&experiment(1)).unwrap();
    let found = equation_error(&both, &Unknowns::unknown_mass(2).unwrap()).unwrap();
    assert!(relative_error(&found.damping(), system.damping()) < 1e-10);
    assert_eq!(both.len(), 2 * lines.len());
}

#[test]
fn an_unforced_direction_needs_a_known_mass() {
    // The force acts on the second direction only, as in the dissertation.
    let system = bearing();
    let (force, _, lines) = records(&system, ResponseQuantity::Displacement);
    let zero = vec![0.0; force.len()];
    let force = Record::from_channels(force.sampling(), &[&zero[..], force.channel(1)]).unwrap();
    let amplitudes = Lines::new(force.sampling(), lines.clone()).unwrap();
    let omega = amplitudes.omega();
    let amplitudes = amplitudes.read(&force).unwrap();
    let motion = displacements(&system, &omega, &amplitudes);
    let data =
        FrequencyData::from_amplitudes(omega, amplitudes, motion, ResponseQuantity::Displacement)
            .unwrap();
    let e = equation_error(&data, &Unknowns::unknown_mass(2).unwrap()).unwrap_err();
    assert!(matches!(e, EstimateError::OnlyRatios { dof: 1, .. }), "{e}");
    let found = equation_error(&data, &Unknowns::known_mass(system.mass()).unwrap()).unwrap();
    assert!(relative_error(&found.stiffness(), system.stiffness()) < 1e-10);
}

#[test]
fn parameters_that_are_not_excited_are_named_and_the_others_stay_right() {
    // The second direction does not move, so the data do not determine its parameters.
    let (w, n) = (vec![10.0, 20.0, 30.0, 40.0], 4);
    let force = forces(&[1, 2, 3, 4], 2, 1.0);
    let motion = DMatrix::from_fn(n, 2, |l, c| {
        let stiffness = Complex::new(5000.0 - 10.0 * w[l] * w[l], 180.0 * w[l]);
        if c == 0 { force[(l, 0)] / stiffness } else { Complex::default() }
    });
    let mut driven = force.clone();
    driven.column_mut(1).copy_from(&(motion.column(0) * Complex::new(7.0, 0.0)));
    let data =
        FrequencyData::from_amplitudes(w, driven, motion, ResponseQuantity::Displacement).unwrap();
    let found = equation_error(&data, &Unknowns::unknown_mass(2).unwrap()).unwrap();
    let open: Vec<String> =
        found.parameters().filter(|p| p.value.is_nan()).map(|p| p.parameter.to_string()).collect();
    assert_eq!(open, ["m12", "m22", "c12", "c22", "k12", "k22"]);
    for (name, expected) in [("m11", 10.0), ("c11", 180.0), ("k11", 5000.0), ("k21", 7.0)] {
        assert!((found.parameter(name).unwrap().value / expected - 1.0).abs() < 1e-10, "{name}");
    }
}

#[test]
fn bad_data_are_refused_with_their_numbers() {
    let system = oscillator();
    let (force, motion, _) = records(&system, ResponseQuantity::Displacement);
    let read = |lines: &[usize]| {
        FrequencyData::from_records(
            &force,
            &motion,
            ResponseQuantity::Displacement,
            lines.iter().copied(),
        )
    };
    let unknown = Unknowns::unknown_mass(1).unwrap();
    assert_eq!(read(&[]), Err(SpectraError::NoExcitedLine));
    assert_eq!(read(&[1, 128]), Err(SpectraError::LineOutOfRange { line: 128, last: 127 }));
    let e = equation_error(&read(&[5]).unwrap(), &unknown).unwrap_err();
    assert_eq!(e, EstimateError::Numerics(NumericsError::TooFewRows { rows: 2, unknowns: 3 }));

    let still = Record::from_channel(force.sampling(), vec![0.0; 256]).unwrap();
    let unforced =
        FrequencyData::from_records(&still, &motion, ResponseQuantity::Displacement, 1..=20)
            .unwrap();
    assert_eq!(equation_error(&unforced, &unknown), Err(SpectraError::NoExcitedLine.into()));

    let two = Record::from_channels(force.sampling(), &[force.channel(0), force.channel(0)]);
    let e =
        FrequencyData::from_records(&force, &two.unwrap(), ResponseQuantity::Displacement, 1..=20);
    assert!(matches!(
        e,
        Err(SpectraError::Numerics(NumericsError::Size { expected: 1, got: 2, .. }))
    ));

    let other = motion.window(0, 255).unwrap();
    let e = FrequencyData::from_records(&force, &other, ResponseQuantity::Displacement, 1..=20);
    assert!(matches!(e, Err(SpectraError::Signal(_))));

    let one = dmatrix![Complex::new(1.0, 0.0)];
    let nan = dmatrix![Complex::new(f64::NAN, 0.0)];
    let make = |w: f64, x: &DMatrix<Complex<f64>>| {
        FrequencyData::from_amplitudes(vec![w], one.clone(), x.clone(), ResponseQuantity::Velocity)
    };
    assert_eq!(make(0.0, &one), Err(SpectraError::Frequency { value: 0.0 }));
    assert!(matches!(
        make(1.0, &nan),
        Err(SpectraError::Numerics(NumericsError::NotFinite { row: 0, column: 0, .. }))
    ));
}
