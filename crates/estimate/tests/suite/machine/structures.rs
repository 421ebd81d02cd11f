//! Shake tables, bounds, priors, undetermined parameters, measured parts, open records, wrong
//! input.

use std::f64::consts::TAU;

use mechid_estimate::likelihood::machine::{
    Candidate, MeasuredReceptance, identify_joined, identify_machine,
};
use mechid_estimate::likelihood::{
    IntervalKind, LikelihoodError, LikelihoodEstimate, NoiseSource, Settings,
};
use mechid_model::ResponseQuantity::{Acceleration, Displacement};
use mechid_model::elements::{
    Element, FreeCoefficient, Input, Instruments, Machine, MachineError, Sensor,
};
use mechid_problems::steady_lines::eliminated;
use mechid_spectra::{LineData, LineNoise, Transient};
use nalgebra::{Complex, DMatrix, dmatrix};

use super::generator::{complex_noise, measured, random_phases};

fn free(start: f64) -> FreeCoefficient {
    FreeCoefficient::from_start(start).at_least(0.0)
}

fn omega(lines: std::ops::RangeInclusive<usize>, spacing_hz: f64) -> Vec<f64> {
    lines.map(|line| TAU * spacing_hz * line as f64).collect()
}

fn force_to_displacement(sensors: &[&str], force: &str) -> Instruments {
    Instruments {
        sensors: sensors.iter().map(|dof| Sensor::new(dof, Displacement)).collect(),
        inputs: vec![Input::force(force)],
        ..Instruments::default()
    }
}

fn identified(data: &LineData, machine: &Machine, instruments: &Instruments) -> LikelihoodEstimate {
    identify_machine(data, machine, instruments, &Settings::default()).unwrap().likelihood
}

/// Returns the deviation of a parameter from its true value, in standard errors.
fn deviation(estimate: &LikelihoodEstimate, name: &str, truth: f64) -> f64 {
    let parameter = estimate.parameter(name).unwrap();
    (parameter.value - truth) / parameter.standard_error.unwrap()
}

/// The unknown mass, springs and dampers of two storeys on a shake table are identified. The input
/// is the acceleration of the table; the roof has a sensor of absolute acceleration, the first
/// storey a sensor of relative acceleration.
#[test]
fn a_frame_on_a_shake_table() {
    let (m, k, c) = ([120.0, 100.0], [2e5, 1.5e5], [150.0, 90.0]);
    let omega = omega(5..=160, 0.1);
    let ground = random_phases(omega.len(), 1, 3);
    let stiffness = dmatrix![k[0] + k[1], -k[1]; -k[1], k[1]];
    let damping = dmatrix![c[0] + c[1], -c[1]; -c[1], c[1]];
    let mass = dmatrix![m[0], 0.0; 0.0, m[1]];
    // The table has the displacement x_g and the acceleration a. The force −M ι a, with a vector ι
    // of ones, causes the relative motion z; the absolute motion is x = z + x_g.
    let force = DMatrix::from_fn(omega.len(), 2, |row, at| -ground[(row, 0)] * m[at]);
    let relative = eliminated([&mass, &damping, &stiffness], &omega, &force);
    let outputs = DMatrix::from_fn(omega.len(), 2, |row, at| {
        let of_relative = relative[(row, at)] * -omega[row] * omega[row];
        if at == 0 { of_relative } else { of_relative + ground[(row, 0)] }
    });
    let data = measured(&omega, ground, outputs, 0.01, 5);
    let machine = Machine::new(["first", "roof"])
        .with("m1", Element::mass("first", m[0]))
        .with("m2", Element::mass("roof", free(80.0)))
        .with("s1", Element::spring_damper(["first", "support"], free(1.5e5), free(100.0)))
        .with("s2", Element::spring_damper(["first", "roof"], free(1.5e5), free(100.0)));
    let instruments = Instruments {
        sensors: vec![
            Sensor::new("first", Acceleration).relative_to_support(),
            Sensor::new("roof", Acceleration),
        ],
        inputs: vec![Input::Support { name: "table".into(), quantity: Acceleration }],
        ..Instruments::default()
    };
    let estimate = identified(&data, &machine, &instruments);
    for (name, truth) in
        [("m2", m[1]), ("s1.k", k[0]), ("s1.c", c[0]), ("s2.k", k[1]), ("s2.c", c[1])]
    {
        let z = deviation(&estimate, name, truth);
        assert!(z.abs() < 4.0, "{name}: {z}");
    }
    assert!((estimate.misfit_ratio.unwrap() - 1.0).abs() < 0.3);
}

/// Returns the data of a mass of 2 kg on springs with a total stiffness of 2e4 N/m and with this
/// damping.
fn oscillator(damping: f64, seed: u64) -> LineData {
    let omega = omega(10..=110, 0.25);
    // The seed differs from that of the noise, which must not be coherent with the force.
    let force = random_phases(omega.len(), 1, 6000 + seed);
    let [m, c, k] = [dmatrix![2.0], dmatrix![damping], dmatrix![2e4]];
    let all = eliminated([&m, &c, &k], &omega, &force);
    measured(&omega, force, all, 0.02, seed)
}

#[test]
fn a_bound_is_active_and_its_interval_one_sided() {
    let machine = Machine::new(["x"]).with("m", Element::mass("x", 2.0)).with(
        "foot",
        Element::spring_damper(["x", "support"], free(1.8e4), free(5.0).at_least(3.0)),
    );
    let data = oscillator(2.0, 1);
    let estimate = identified(&data, &machine, &force_to_displacement(&["x"], "x"));
    let damper = estimate.parameter("foot.c").unwrap();
    assert!(damper.at_bound && damper.standard_error.is_none());
    assert_eq!((damper.value, damper.interval[0]), (3.0, 3.0));
    assert_eq!(damper.interval_kind, IntervalKind::OneSided);
    assert!(damper.interval[1] > 3.0 && damper.interval[1] < 3.5, "{:?}", damper.interval);
}

/// The effect of the damper is small compared with the noise, so its interval comes from the
/// profile likelihood. For 40 seeds, these intervals contain the truth as often as stated.
#[test]
fn profile_intervals_of_weak_parameters_hold() {
    let machine = Machine::new(["x"])
        .with("m", Element::mass("x", 2.0))
        .with("foot", Element::spring_damper(["x", "support"], free(1.8e4), free(1.0)));
    let instruments = force_to_displacement(&["x"], "x");
    let mut held = 0;
    let mut profiles = 0;
    for seed in 0..40 {
        let omega = omega(10..=60, 0.1);
        let force = random_phases(omega.len(), 1, 6000 + seed);
        let [m, c, k] = [dmatrix![2.0], dmatrix![5.0], dmatrix![2e4]];
        // Far below the resonance the damper has little effect.
        let data =
            measured(&omega, force.clone(), eliminated([&m, &c, &k], &omega, &force), 0.06, seed);
        let estimate = identified(&data, &machine, &instruments);
        let damper = estimate.parameter("foot.c").unwrap();
        profiles += usize::from(damper.interval_kind != IntervalKind::Wald);
        held += usize::from((damper.interval[0]..=damper.interval[1]).contains(&5.0));
    }
    // The probability that fewer than 34 of 40 intervals of 95 % contain the truth is 0.003.
    assert!(held >= 34 && profiles >= 35, "{held} {profiles}");
}

#[test]
fn a_wrong_prior_is_reported_and_a_right_one_shares() {
    let machine = |mean: f64| {
        let stiffness = free(1.8e4).with_prior(mean, 100.0);
        Machine::new(["x"])
            .with("m", Element::mass("x", 2.0))
            .with("foot", Element::spring_damper(["x", "support"], stiffness, free(10.0)))
    };
    let instruments = force_to_displacement(&["x"], "x");
    let prior = |mean: f64| {
        let estimate = identified(&oscillator(12.0, 4), &machine(mean), &instruments);
        estimate.parameter("foot.k").unwrap().prior.unwrap()
    };
    let (right, wrong) = (prior(2.005e4), prior(2.05e4));
    assert!(right.p_value.unwrap() > 0.05 && wrong.p_value.unwrap() < 1e-4, "{right:?} {wrong:?}");
    assert!(right.share > 0.0 && right.share < 0.2, "{right:?}");
}

#[test]
fn springs_in_series_and_side_by_side_are_named() {
    let data = oscillator(12.0, 7);
    let instruments = force_to_displacement(&["x"], "x");
    let foot = Element::spring_damper(["x", "support"], 0.0, free(10.0));
    let beside = Machine::new(["x"])
        .with("m", Element::mass("x", 2.0))
        .with("c", foot.clone())
        .with("k3", Element::spring(["x", "support"], free(1.2e4)))
        .with("k4", Element::spring(["x", "support"], free(0.7e4)));
    let estimate = identified(&data, &beside, &instruments);
    assert_eq!(estimate.combinations.len(), 1);
    assert_eq!(
        estimate.combinations[0].to_string(),
        "the data do not determine k3 and k4 separately, but only their sum k3 + k4"
    );
    let k3 = estimate.parameter("k3").unwrap();
    assert!(k3.standard_error.is_none() && k3.interval_kind == IntervalKind::Open);
    assert!(deviation(&estimate, "c", 12.0).abs() < 4.0);
    let series = Machine::new(["x", "between"])
        .with("m", Element::mass("x", 2.0))
        .with("none", Element::mass("between", 0.0))
        .with("c", foot)
        .with("k3", Element::spring(["x", "between"], free(6e4)))
        .with("k4", Element::spring(["between", "support"], free(2.8e4)));
    let estimate = identified(&data, &series, &instruments);
    assert_eq!(
        estimate.combinations[0].to_string(),
        "the data do not determine k3 and k4 separately, but only their series sum 1/(1/k3 + 1/k4)"
    );
    let values = ["k3", "k4"].map(|name| estimate.parameter(name).unwrap().value);
    let sum = values.iter().map(|k| k.recip()).sum::<f64>().recip();
    assert!((sum / 2e4 - 1.0).abs() < 0.01, "{sum}");
    // A sensor between the two springs makes both stiffnesses identifiable; a second sensor on the
    // mass does not.
    let estimate = identify_machine(&data, &series, &instruments, &Settings::default()).unwrap();
    let candidates = ["x", "between"].map(|dof| Candidate::Sensor(Sensor::new(dof, Displacement)));
    let gains = estimate.rank_candidates(&data, &series, &instruments, &candidates).unwrap();
    assert_eq!((gains[0].name.as_str(), gains[0].newly_determined), ("between", 1));
    assert_eq!(gains[1].newly_determined, 0);
    assert!(gains[0].standard_errors.iter().all(Option::is_some));
}

/// The spring and the damper that join two free chains of four masses at their ends are identified
/// from the receptances of the chains and a test of the assembly.
#[test]
fn a_joint_between_two_measured_parts() {
    let omega = omega(20..=400, 0.1);
    let (joint_k, joint_c) = (5e4, 12.0);
    let part = |scale: f64| -> [DMatrix<f64>; 3] {
        let link = |at: usize| scale * (4e4 + 1e4 * at as f64);
        let mut stiffness = DMatrix::zeros(4, 4);
        for at in 0..3 {
            let mut block = stiffness.view_mut((at, at), (2, 2));
            block += dmatrix![1.0, -1.0; -1.0, 1.0] * link(at);
        }
        [DMatrix::identity(4, 4) * scale, &stiffness * 2e-4, stiffness]
    };
    let parts = [part(1.0), part(1.6)];
    let whole = |joined: bool| -> [DMatrix<f64>; 3] {
        let mut all = [0, 1, 2].map(|which| {
            let mut matrix = DMatrix::zeros(8, 8);
            matrix.view_mut((0, 0), (4, 4)).copy_from(&parts[0][which]);
            matrix.view_mut((4, 4), (4, 4)).copy_from(&parts[1][which]);
            matrix
        });
        if joined {
            for (which, value) in [(1, joint_c), (2, joint_k)] {
                let mut block = all[which].view_mut((3, 3), (2, 2));
                block += dmatrix![1.0, -1.0; -1.0, 1.0] * value;
            }
        }
        all
    };
    // Receptances of the free parts at their ends, with 0.2 % noise.
    let ends = [0, 3, 4, 7];
    let [m, c, k] = whole(false);
    let mut receptance: Vec<DMatrix<Complex<f64>>> = vec![DMatrix::zeros(4, 4); omega.len()];
    for (column, dof) in ends.into_iter().enumerate() {
        let mut force = DMatrix::zeros(omega.len(), 8);
        force.column_mut(dof).fill(Complex::new(1.0, 0.0));
        let all = eliminated([&m, &c, &k], &omega, &force);
        for (row, table) in receptance.iter_mut().enumerate() {
            for (at, end) in ends.into_iter().enumerate() {
                table[(at, column)] = all[(row, end)];
            }
        }
    }
    let variance: Vec<DMatrix<f64>> =
        receptance.iter().map(|table| table.map(|h| (0.002 * h.norm()).powi(2))).collect();
    for (row, table) in receptance.iter_mut().enumerate() {
        let noise = complex_noise(4, 4, 900 + row as u64);
        *table += noise.zip_map(&variance[row], |z, v| z * v.sqrt());
    }
    let force = random_phases(omega.len(), 1, 5);
    let mut forces = DMatrix::zeros(omega.len(), 8);
    forces.column_mut(0).copy_from(&force.column(0));
    let [m, c, k] = whole(true);
    let outputs = eliminated([&m, &c, &k], &omega, &forces).select_columns(&[0, 7]);
    let data = measured(&omega, force, outputs, 0.002, 8);
    let mut machine = Machine::new(["a1", "a4", "b1", "b4"])
        .with("joint", Element::spring_damper(["a4", "b1"], free(2e4), free(5.0)));
    machine.measured = machine.dofs.clone();
    let part = MeasuredReceptance { receptance, variance: Some(variance) };
    let instruments = force_to_displacement(&["a1", "b4"], "a1");
    let settings = Settings::default();
    let estimate = identify_joined(&data, &machine, &instruments, &part, &settings).unwrap();
    let estimate = estimate.likelihood;
    for (name, truth) in [("joint.k", joint_k), ("joint.c", joint_c)] {
        let p = estimate.parameter(name).unwrap();
        let z = deviation(&estimate, name, truth);
        assert!(z.abs() < 4.0 && p.standard_error.unwrap() < 0.05 * truth, "{name}: {z} {p:?}");
    }
    let ratio = estimate.misfit_ratio.unwrap();
    assert!((ratio - 1.0).abs() < 0.25, "{ratio}");
}

#[test]
fn bad_descriptions_are_refused_by_name() {
    let data = oscillator(12.0, 1);
    let refused = |machine: Machine, instruments: Instruments| match identify_machine(
        &data,
        &machine,
        &instruments,
        &Settings::default(),
    ) {
        Err(LikelihoodError::Machine(error)) => error,
        other => panic!("{other:?}"),
    };
    let with_mass = || Machine::new(["x"]).with("m", Element::mass("x", 2.0));
    let read = || force_to_displacement(&["x"], "x");
    let foot = |k: FreeCoefficient| Element::spring(["x", "support"], k);
    let error = refused(with_mass().with("k9", Element::spring(["x", "z"], free(1.0))), read());
    assert!(
        matches!(error, MachineError::UnknownDof { ref name, ref dof, .. } if name == "k9" && dof == "z")
    );
    let contradictory = free(2.0).at_least(3.0).at_most(1.0);
    let error = refused(with_mass().with("k1", foot(contradictory)), read());
    assert!(matches!(error, MachineError::Bounds { ref name, .. } if name == "k1"));
    let error = refused(with_mass().with("k1", foot(free(2.0).at_least(3.0))), read());
    assert!(matches!(error, MachineError::StartOutside { .. }));
    let error = refused(with_mass().with("k1", foot(FreeCoefficient::default())), read());
    assert!(matches!(error, MachineError::NoStart { .. }));
    let error = refused(Machine::new(["x"]).with("k1", foot(free(2.0))), read());
    assert!(error.to_string().contains("\"x\" has no mass (it belongs to \"k1\")"), "{error}");
    let error =
        refused(with_mass().with("k1", foot(free(2.0))), force_to_displacement(&["nowhere"], "x"));
    assert!(matches!(error, MachineError::UnknownDof { what: "sensor", .. }));
    let error = refused(with_mass().with("k1", foot(free(f64::NAN))), read());
    assert!(matches!(error, MachineError::NotFinite { .. }));
    let settings = Settings { confidence: 1.0, ..Settings::default() };
    let machine = with_mass().with("k1", foot(free(2e4)));
    let result = identify_machine(&data, &machine, &read(), &settings);
    assert!(matches!(result, Err(LikelihoodError::Setting { name: "confidence", .. })));
    // The two machines below are described correctly. The first has no unknown, and the data of the
    // second have the wrong size: each of these faults has a separate error.
    let known = with_mass().with("k1", Element::spring(["x", "support"], 2e4));
    let result = identify_machine(&data, &known, &read(), &Settings::default());
    assert_eq!(result.unwrap_err(), LikelihoodError::NoParameter);
    let two = force_to_displacement(&["x"], "x");
    let two = Instruments {
        sensors: [
            two.sensors.clone(),
            vec![Sensor { name: "again".into(), ..Sensor::new("x", Displacement) }],
        ]
        .concat(),
        ..two
    };
    let result = identify_machine(
        &data,
        &with_mass().with("k1", foot(free(2e4))),
        &two,
        &Settings::default(),
    );
    assert!(matches!(result, Err(LikelihoodError::Size { expected: 2, got: 1, .. })));
}

/// The force has noise, too (errors in variables), and there are fewer sensors than degrees of
/// freedom: the errors agree with the standard errors.
#[test]
fn noisy_forces_are_allowed_for() {
    let omega = omega(10..=200, 0.25);
    let exact = random_phases(omega.len(), 1, 3);
    let m = dmatrix![2.0, 0.0; 0.0, 1.5];
    let k = dmatrix![5e4, -2e4; -2e4, 2e4];
    let c = dmatrix![12.0, -4.0; -4.0, 4.0];
    let mut forces = exact.clone().insert_columns(1, 1, Complex::default());
    forces.column_mut(0).copy_from(&exact.column(0));
    let all = eliminated([&m, &c, &k], &omega, &forces);
    let machine = Machine::new(["x1", "x2"])
        .with("m1", Element::mass("x1", 2.0))
        .with("m2", Element::mass("x2", 1.5))
        .with("s1", Element::spring_damper(["x1", "support"], free(2e4), free(6.0)))
        .with("s2", Element::spring_damper(["x1", "x2"], free(3e4), free(6.0)));
    let instruments = force_to_displacement(&["x2"], "x1");
    let truth = [("s1.k", 3e4), ("s1.c", 8.0), ("s2.k", 2e4), ("s2.c", 4.0)];
    let mut squares = Vec::new();
    for seed in 0..12 {
        let outputs = all.columns(1, 1).into_owned();
        let clean = measured(&omega, exact.clone(), outputs, 0.01, 50 + seed);
        let variance_y = clean.noise().unwrap().covariance()[0][(0, 0)];
        let inputs = &exact + complex_noise(omega.len(), 1, 80 + seed) * Complex::from(0.03);
        let covariance =
            DMatrix::from_diagonal(&vec![variance_y, Complex::from(0.03 * 0.03)].into());
        let noise = LineNoise::new(vec![covariance; omega.len()]).unwrap();
        let data = LineData::new(omega.clone(), inputs, clean.outputs().clone(), Transient::None);
        let data = data.unwrap().with_noise(noise).unwrap();
        let estimate = identified(&data, &machine, &instruments);
        squares.extend(truth.map(|(name, truth)| deviation(&estimate, name, truth).powi(2)));
    }
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    // The mean of 48 squares with a mean of 1 each is between 0.5 and 1.7 with a probability of
    // 0.998.
    assert!((0.5..1.7).contains(&mean), "{mean}");
}

/// Open records are windows of a far longer period, and the intervals agree with the errors. If the
/// records are assumed to be periods, the error of a damper is more than five times as large.
#[test]
fn open_records_of_one_sensor() {
    let settings = Settings { noise: NoiseSource::WhiteResidual, starts: 1, ..Settings::default() };
    let instruments = super::open::instruments(&["x2"]);
    let squares = |data: &LineData| -> f64 {
        let estimate = identify_machine(data, &super::open::machine(), &instruments, &settings);
        let estimate = estimate.unwrap().likelihood;
        let of = |(name, truth): (&str, f64)| deviation(&estimate, name, truth).powi(2);
        super::open::TRUTH.map(of).iter().sum::<f64>() / 4.0
    };
    let rig = super::open::rig();
    let data: Vec<LineData> = (0..12).map(|seed| super::open::data(&rig, seed, &[1])).collect();
    let mean = data.iter().map(squares).sum::<f64>() / data.len() as f64;
    // The 48 squares have a mean of 1 each; the squares of one record are correlated.
    assert!((0.4..1.9).contains(&mean), "{mean}");
    let errors = |data: &LineData| {
        let estimate = identify_machine(data, &super::open::machine(), &instruments, &settings);
        let damper = estimate.unwrap().likelihood.parameter("s2.c").unwrap().value;
        (damper - 8.0).abs()
    };
    let closed = |data: &LineData| {
        let (inputs, outputs) = (data.inputs().clone(), data.outputs().clone());
        LineData::new(data.omega().to_vec(), inputs, outputs, Transient::None).unwrap()
    };
    let sums = data[..3].iter().map(|data| [errors(data), errors(&closed(data))]);
    let [open, period] = sums.fold([0.0, 0.0], |sum, one| [sum[0] + one[0], sum[1] + one[1]]);
    assert!(period > 5.0 * open, "{period} {open}");
}
