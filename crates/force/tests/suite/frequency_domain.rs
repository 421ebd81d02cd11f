//! The frequency-domain reconstruction, compared with harmonic motions in closed form.

use mechid_force::{
    Channel, ForceError, Measurement, Noise, frequency_domain, inner_lines, line_errors,
    relative_error, spectrum_ratio, spurious_ratio,
};
use mechid_model::{ResponseQuantity, SecondOrderSystem};
use mechid_signal::{NoiseLevel, Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix, dmatrix};

type Line = Complex<f64>;

fn rotor() -> SecondOrderSystem {
    SecondOrderSystem::new(
        dmatrix![14.8, 1.0; 0.0, 12.0],
        dmatrix![20.0, 10.0; 10.0, 30.0],
        dmatrix![40.0, 50.0; -20.0, 60.0],
    )
    .unwrap()
}

fn period() -> Sampling {
    Sampling::new(0.04, 128).unwrap()
}

const LINES: [usize; 4] = [1, 4, 5, 30];

/// Returns forces on both directions at `LINES`, and displacement, velocity and acceleration of
/// both directions by Cramer's rule.
fn harmonic(system: &SecondOrderSystem, forces: [f64; 2]) -> (Record, [Record; 3]) {
    let s = period();
    let z = || DMatrix::<Line>::zeros(s.lines(), 2);
    let (mut force, mut motion) = (z(), [z(), z(), z()]);
    for n in LINES {
        let i_omega = Complex::new(0.0, n as f64 * s.omega0());
        let d = |i, j| {
            i_omega * i_omega * system.mass()[(i, j)]
                + i_omega * system.damping()[(i, j)]
                + system.stiffness()[(i, j)]
        };
        let f = [Complex::from_polar(forces[0], n as f64), Complex::new(forces[1], 0.0)];
        let det = d(0, 0) * d(1, 1) - d(0, 1) * d(1, 0);
        let x = [(f[0] * d(1, 1) - f[1] * d(0, 1)) / det, (f[1] * d(0, 0) - f[0] * d(1, 0)) / det];
        for j in 0..2 {
            force[(n, j)] = f[j];
            motion[0][(n, j)] = x[j];
            motion[1][(n, j)] = x[j] * i_omega;
            motion[2][(n, j)] = x[j] * i_omega * i_omega;
        }
    }
    let record = |lines| Spectrum::from_lines(s, lines).unwrap().to_record().unwrap();
    (record(force), motion.map(record))
}

const QUANTITIES: [ResponseQuantity; 3] =
    [ResponseQuantity::Displacement, ResponseQuantity::Velocity, ResponseQuantity::Acceleration];

#[test]
fn every_quantity_of_every_degree_of_freedom_gives_both_forces() {
    let (force, motion) = harmonic(&rotor(), [3.0, 100.0]);
    for (quantity, record) in QUANTITIES.into_iter().zip(motion) {
        let measured = Measurement::from_record(quantity, record);
        let all = inner_lines(&measured);
        for lines in [&LINES[..], &all] {
            let found =
                frequency_domain(&rotor(), &measured, &[0, 1], lines, &Noise::Unknown).unwrap();
            let error = relative_error(found.record(), &force).unwrap();
            // The error is the condition number of the dynamic stiffness × 1e-16; the unexcited
            // lines are included.
            assert!(error < 1e-11, "{quantity}: {error:.1e}");
            let truth = Spectrum::from_record(&force);
            let ratio = spectrum_ratio(found.spectrum(), &truth, 0, &LINES).unwrap();
            assert!(ratio.iter().all(|r| (r - 1.0).abs() < 1e-11));
            let errors = line_errors(found.spectrum(), &truth, 1, &LINES).unwrap();
            assert!(errors.iter().all(|e| *e < 1e-11));
        }
    }
}

#[test]
fn one_channel_anywhere_gives_one_force_anywhere() {
    for (forces, forced) in [([5.0, 0.0], 0), ([0.0, 5.0], 1)] {
        let (force, motion) = harmonic(&rotor(), forces);
        for (quantity, record) in QUANTITIES.into_iter().zip(&motion) {
            for dof in 0..2 {
                let channel = Record::from_channel(period(), record.channel(dof).to_vec()).unwrap();
                let measured = Measurement::new(channel, vec![Channel { dof, quantity }]).unwrap();
                let found =
                    frequency_domain(&rotor(), &measured, &[forced], &LINES, &Noise::Unknown)
                        .unwrap();
                let error = relative_error(found.record(), &force).unwrap();
                assert!(error < 1e-11, "{quantity} of {dof} for {forced}: {error:.1e}");
            }
        }
    }
}

#[test]
fn a_force_sought_where_none_acts_is_seen_as_spurious() {
    // With the wrong stiffness, the method finds a force on the unforced direction.
    let (force, [x, ..]) = harmonic(&rotor(), [0.0, 100.0]);
    let wrong = SecondOrderSystem::new(
        rotor().mass().clone(),
        rotor().damping().clone(),
        dmatrix![40.0, 50.0 * 1.1; -20.0, 60.0],
    )
    .unwrap();
    let measured = Measurement::from_record(ResponseQuantity::Displacement, x.clone());
    let found = frequency_domain(&wrong, &measured, &[0, 1], &LINES, &Noise::Unknown).unwrap();
    let spurious =
        spurious_ratio(found.spectrum(), &Spectrum::from_record(&force), 0, 1, &LINES).unwrap();
    let motion = Spectrum::from_record(&x);
    for (n, ratio) in LINES.into_iter().zip(spurious) {
        // F̂x − Fx = ΔKxy·Y, relative to a force of 100 N.
        let expected = 5.0 * motion.line(n, 1).norm() / 100.0;
        assert!((ratio - expected).abs() < 1e-12, "line {n}");
    }
}

#[test]
fn lines_the_machine_does_not_transmit_are_named() {
    let (_, [x, v, a]) = harmonic(&rotor(), [3.0, 100.0]);
    let unknown = Noise::Unknown;
    for (quantity, record) in
        [(ResponseQuantity::Velocity, v.clone()), (ResponseQuantity::Acceleration, a)]
    {
        let measured = Measurement::from_record(quantity, record);
        for forced in [&[0, 1][..], &[1]] {
            let error =
                frequency_domain(&rotor(), &measured, forced, &[3, 0], &unknown).unwrap_err();
            assert!(matches!(error, ForceError::NotTransmitted { line: 0, .. }), "{error}");
        }
    }
    // The two machines are not coupled, so a force on one machine does not move the other machine.
    let apart = SecondOrderSystem::new(
        DMatrix::identity(2, 2),
        DMatrix::identity(2, 2),
        dmatrix![4.0, 0.0; 0.0, 9.0],
    )
    .unwrap();
    let first = Record::from_channel(period(), x.channel(0).to_vec()).unwrap();
    let measured = Measurement::from_record(ResponseQuantity::Displacement, first);
    let error = frequency_domain(&apart, &measured, &[1], &[2], &unknown).unwrap_err();
    assert!(matches!(error, ForceError::NotTransmitted { line: 2, dof: 1, .. }), "{error}");
    let undamped = SecondOrderSystem::new(
        dmatrix![1.0],
        dmatrix![0.0],
        dmatrix![(2.0 * period().omega0()).powi(2)],
    )
    .unwrap();
    let velocity = Measurement::new(
        measured.record().clone(),
        vec![Channel { dof: 0, quantity: ResponseQuantity::Velocity }],
    )
    .unwrap();
    // If all degrees of freedom are measured, the dynamic stiffness itself is used, which is zero
    // at the resonance.
    assert!(frequency_domain(&undamped, &velocity, &[0], &[2], &unknown).is_ok());
    // With more channels than forces, the inverse of the dynamic stiffness is needed, which does
    // not exist at an undamped resonance.
    let both = Record::new(period(), v.data().clone()).unwrap();
    let twice = vec![Channel { dof: 0, quantity: ResponseQuantity::Velocity }; 2];
    let twice = Measurement::new(both, twice).unwrap();
    let error = frequency_domain(&undamped, &twice, &[0], &[2], &unknown).unwrap_err();
    assert!(matches!(error, ForceError::Resonance { line: 2, .. }), "{error}");
}

#[test]
fn impossible_requests_are_refused_with_their_numbers() {
    let (_, [x, ..]) = harmonic(&rotor(), [3.0, 100.0]);
    let both = Measurement::from_record(ResponseQuantity::Displacement, x.clone());
    let first = Record::from_channel(period(), x.channel(0).to_vec()).unwrap();
    let one = Measurement::from_record(ResponseQuantity::Displacement, first.clone());
    let ask = |measured: &Measurement, forced: &[usize], lines: &[usize], noise: &Noise| {
        frequency_domain(&rotor(), measured, forced, lines, noise).unwrap_err()
    };
    let unknown = Noise::Unknown;
    assert_eq!(
        ask(&one, &[0, 1], &[1], &unknown),
        ForceError::MoreForcesThanMeasurements { forces: 2, measurements: 1 }
    );
    assert_eq!(ask(&both, &[], &[1], &unknown), ForceError::NoForcedDof);
    assert_eq!(ask(&both, &[2], &[1], &unknown), ForceError::NoSuchDof { dof: 2, dofs: 2 });
    assert_eq!(ask(&both, &[1, 1], &[1], &unknown), ForceError::RepeatedDof { dof: 1 });
    assert_eq!(ask(&both, &[1], &[], &unknown), ForceError::NoLines);
    assert_eq!(ask(&both, &[1], &[65], &unknown), ForceError::NoSuchLine { line: 65, last: 64 });
    assert_eq!(ask(&both, &[1], &[4, 4], &unknown), ForceError::RepeatedLine { line: 4 });
    assert_eq!(
        ask(&both, &[1], &[4], &Noise::PerChannel(vec![0.1])),
        ForceError::ChannelCount { record: 2, described: 1 }
    );
    assert_eq!(
        ask(&both, &[1], &[4], &Noise::PerChannel(vec![0.1, 0.0])),
        ForceError::NotPositive { what: "noise level", value: 0.0 }
    );
    assert_eq!(
        ask(&both, &[1], &inner_lines(&both), &Noise::OutsideLines),
        ForceError::TooFewOutsideLines { outside: 0, needed: 8 }
    );
    assert_eq!(
        Measurement::new(first, vec![]).unwrap_err(),
        ForceError::ChannelCount { record: 1, described: 0 }
    );
}

#[test]
fn the_standard_error_is_the_scatter_over_noise() {
    let (force, [x, ..]) = harmonic(&rotor(), [0.0, 100.0]);
    let level = NoiseLevel::FractionOfRms(0.03);
    let sigma: Vec<f64> = x.data().column_iter().map(|c| 0.03 * c.norm() / 128f64.sqrt()).collect();
    let (mut seen, mut stated, mut measured_level) = (0.0, 0.0, 0.0);
    let draws = 200;
    for seed in 0..draws {
        let noisy = noise::add_white(&x, level, seed).unwrap();
        let measured = Measurement::from_record(ResponseQuantity::Displacement, noisy);
        let find =
            |noise: &Noise| frequency_domain(&rotor(), &measured, &[1], &LINES, noise).unwrap();
        let found = find(&Noise::PerChannel(sigma.clone()));
        seen += (found.record().data() - force.data()).norm_squared();
        stated += found.standard_error().unwrap().data().norm_squared();
        let outside = find(&Noise::OutsideLines);
        measured_level += outside.standard_error().unwrap().data().norm_squared();
    }
    // 200 draws of 8 real amplitudes determine a standard deviation to 1.8 %.
    assert!(((seen / stated).sqrt() - 1.0).abs() < 0.06, "{:.3}", (seen / stated).sqrt());
    // 59 lines without force determine the noise level of one draw to 6 %, and the mean over 200
    // draws far better.
    let ratio = (measured_level / stated).sqrt();
    assert!((ratio - 1.0).abs() < 0.02, "{ratio:.3}");
}
