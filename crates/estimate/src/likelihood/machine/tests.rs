//! Comparison of the coupled response and its derivative with the dense elimination of all degrees
//! of freedom.

use mechid_model::ResponseQuantity;
use mechid_model::elements::{
    Assembly, Bearing, Coefficient, Element, FreeCoefficient, Input, Instruments, Machine,
    MatrixElement, SUPPORT, Sensor, Speed,
};
use mechid_signal::Sampling;
use mechid_spectra::noise::pulse::PulseNoise;
use mechid_spectra::{LineData, Transient};
use nalgebra::{Complex, DMatrix, DVector, dmatrix};

use super::MachineModel;
use super::nominal::{Nominal, Places};
use super::state_loads::state_loads;
use crate::likelihood::limits::SEARCH_NUMBERS;
use crate::likelihood::residual::{Evaluation, Residual};
use crate::likelihood::search::LeastSquaresProblem;
use crate::likelihood::thinned::Thinned;
use crate::likelihood::weights::Weights;
use crate::likelihood::{LineResponse, ResponseModel};

const OMEGA: [f64; 4] = [20.0, 61.0, 97.0, 160.0];

fn free(start: f64) -> Coefficient {
    FreeCoefficient::from_start(start).into()
}

/// Returns an assembly with every kind of element, damping and input.
fn assembly(factors: bool) -> Assembly {
    let shaft = MatrixElement {
        dofs: ["x2", "y2", "x3", "y3"].map(str::to_owned).to_vec(),
        mass: Some((DMatrix::from_diagonal(&vec![3.0, 3.5, 2.0, 2.5].into()), 1.0.into())),
        damping: Some((DMatrix::identity(4, 4) * 4.0, 1.0.into())),
        stiffness: Some((
            dmatrix![
                3e4, 1e3, -1e4, 0.0;
                1e3, 4e4, 0.0, -2e4;
                -1e4, 0.0, 2e4, 5e2;
                0.0, -2e4, 5e2, 3e4
            ],
            if factors { free(1.1) } else { 1.0.into() },
        )),
        gyroscopic: Some((
            dmatrix![0.0, 0.3, 0.0, 0.0; -0.3, 0.0, 0.0, 0.0; 0.0, 0.0, 0.0, 0.0; 0.0, 0.0, 0.0, 0.0],
            if factors { free(0.9) } else { 1.0.into() },
        )),
    };
    let mut machine = Machine::new(["x1", "y1", "x2", "y2", "x3", "y3"])
        .with("m1", Element::mass("x1", free(2.0)))
        .with("m2", Element::mass("y1", Coefficient::Shared("m".into())))
        .with("m3", Element::mass("x3", Coefficient::Shared("m".into())))
        .with("shaft", Element::Matrices(Box::new(shaft)))
        .with(
            "film",
            Element::Bearing(Box::new(Bearing {
                at: ["x2", "y2"].map(str::to_owned),
                to: Some(["x1", "y1"].map(str::to_owned)),
                stiffness: [1.5e4, 4e3, -3e3, 2e4].map(free),
                damping: [20.0, 3.0, -2.0, 30.0].map(free),
                mass: [0.5, 0.0, 0.0, 0.4].map(free),
            })),
        )
        .with(
            "foot",
            Element::Link {
                between: ["x1", "support"].map(str::to_owned),
                stiffness: free(3e4),
                damping: free(12.0),
                loss_factor: free(0.02),
            },
        )
        .with("side", Element::spring_damper(["y1", "support"], free(4e4), 5.0))
        .with(
            "rest",
            Element::Unbalance {
                at: ["x2", "y2"].map(str::to_owned),
                real: free(1e-3),
                imaginary: free(-2e-3),
            },
        )
        .with_parameter("m", FreeCoefficient::from_start(1.5));
    if factors {
        machine.damping.alpha = free(0.3);
        machine.damping.beta = free(1e-4);
        machine.damping.loss_factor = free(0.01);
    }
    let instruments = Instruments {
        sensors: vec![
            Sensor::new("x3", ResponseQuantity::Displacement).relative_to_support(),
            Sensor { gain: 0.7, ..Sensor::new("y2", ResponseQuantity::Acceleration) },
            Sensor::new("x1", ResponseQuantity::Velocity).relative_to("x2"),
        ],
        inputs: vec![
            Input::force("x3"),
            Input::Support { name: "table".into(), quantity: ResponseQuantity::Acceleration },
            Input::Unbalance { name: "trial".into(), at: ["x3", "y3"].map(str::to_owned) },
        ],
        speed: Speed::Synchronous,
    };
    machine.assembly(&instruments).unwrap()
}

/// Returns the readings under inputs and loads of the machine, by elimination of all degrees of
/// freedom.
fn naive(
    assembly: &Assembly,
    parameters: &[f64],
    omega: f64,
    input: &DVector<Complex<f64>>,
) -> DVector<Complex<f64>> {
    let n = assembly.dof();
    let all = assembly.dynamic_stiffness(parameters, omega, |_| true);
    let (mut force, mut ground) = (DVector::zeros(n), Complex::default());
    for (column, amplitude) in assembly.inputs().iter().zip(input.iter()) {
        for (at, value) in column.load(n, omega, assembly.speed()) {
            if at < n { force[at] += value * amplitude } else { ground += value * amplitude }
        }
    }
    for (parameter, load) in assembly.own_loads(omega) {
        let amplitude = parameter.map_or(1.0, |at| parameters[at]);
        load.iter().for_each(|(at, value)| force[*at] += value * amplitude);
    }
    force -= all.column(n) * ground;
    let motion = all.columns(0, n).into_owned().lu().solve(&force).unwrap();
    DVector::from_iterator(
        assembly.sensors().len(),
        assembly.sensors().iter().map(|sensor| {
            let read = |(at, weight): &(usize, f64)| {
                (if *at < n { motion[*at] } else { ground }) * *weight
            };
            let sum: Complex<f64> = sensor.entries.iter().map(read).sum();
            sum * sensor.quantity.per_displacement(omega)
        }),
    )
}

fn input() -> DVector<Complex<f64>> {
    DVector::from_vec(vec![
        Complex::new(3.0, -1.0),
        Complex::new(0.5, 0.8),
        Complex::new(2e-3, 1e-3),
    ])
}

/// Returns parameter values that differ from the initial values; the nominal machine is prepared at
/// the initial values.
fn moved(assembly: &Assembly) -> Vec<f64> {
    let start = assembly.start();
    start.iter().enumerate().map(|(at, value)| value * (1.0 + 0.2 * (at as f64).sin())).collect()
}

#[test]
fn the_coupled_response_is_that_of_the_whole_machine() {
    for (factors, open) in [(false, false), (false, true), (true, false)] {
        let assembly = assembly(factors);
        let model = MachineModel::new(&assembly, &OMEGA, None, open).unwrap();
        let parameters = moved(&assembly);
        for (row, omega) in OMEGA.into_iter().enumerate() {
            let line = model.at(&parameters, row).unwrap();
            let response = line.receptance() * input() + line.own_response().unwrap();
            let expected = naive(&assembly, &parameters, omega, &input());
            let gap = (response - &expected).norm() / expected.norm();
            assert!(gap < 1e-12, "{factors} {open} {omega}: {gap:e}");
        }
    }
}

#[test]
fn the_sensitivity_is_the_derivative_of_the_response() {
    for factors in [false, true] {
        let assembly = assembly(factors);
        let model = MachineModel::new(&assembly, &OMEGA, None, false).unwrap();
        let parameters = moved(&assembly);
        let mut sensitivity = DMatrix::zeros(3, parameters.len());
        for (row, omega) in OMEGA.into_iter().enumerate() {
            let line = model.at(&parameters, row).unwrap();
            line.sensitivity(&parameters, &input(), &DVector::zeros(0), &mut sensitivity);
            for (at, column) in sensitivity.column_iter().enumerate() {
                // The step changes the response by a millionth of its size. Relative to this
                // change, the truncation error is about 10⁻¹² and the rounding error about 10⁻¹⁰.
                let response = naive(&assembly, &parameters, omega, &input());
                let step = 1e-6 * response.norm() / column.norm();
                let at_distance = |by: f64| {
                    let mut parameters = parameters.clone();
                    parameters[at] += by;
                    naive(&assembly, &parameters, omega, &input())
                };
                let difference =
                    (at_distance(step) - at_distance(-step)) / Complex::from(2.0 * step);
                let gap = (&difference - column).norm() / difference.norm();
                let name = &assembly.parameters()[at].name;
                assert!(gap < 1e-6, "{name} at {omega}: {gap:e}");
            }
        }
    }
}

/// With many lines, the responses are computed again for the Jacobian instead of being stored. This
/// gives the same Jacobian as stored responses.
#[test]
fn the_jacobian_does_not_depend_on_what_is_kept() {
    let assembly = assembly(true);
    let start = assembly.start();
    let omega: Vec<f64> = (1..90).map(|line| 2.0 * f64::from(line)).collect();
    let model = MachineModel::new(&assembly, &omega, None, true).unwrap();
    let open = Transient::Open { sample_interval: 0.01 };
    let random = |rows: usize, columns: usize| {
        DMatrix::from_fn(rows, columns, |row, column| {
            Complex::cis((7 * row * row + 3 * column + row * column) as f64)
        })
    };
    let record = |from: usize, to: usize| {
        let lines = to - from;
        LineData::new(omega[from..to].to_vec(), random(lines, 3), random(lines, 3), open).unwrap()
    };
    let data = record(0, 70).followed_by(&record(70, 89)).unwrap();
    let weights = Weights::from_variances(&data, &DMatrix::from_element(89, 3, 0.1));
    let residual = Residual { model: &model, data: &data, weights: &weights, priors: &[] };
    let kept = residual.evaluate(&start).unwrap();
    assert!(kept.records.is_some());
    let again = Evaluation { records: None, residual: kept.residual.clone() };
    let [kept, again] =
        [kept, again].map(|evaluation| residual.linearised(&start, evaluation).unwrap());
    assert!(kept.jacobian.norm() > 0.0);
    assert_eq!((kept.residual, kept.jacobian), (again.residual, again.jacobian));
}

/// With noise on two pulses of an input, Jᵀr is half the gradient of the sum of squares.
#[test]
fn the_gradient_includes_the_errors_of_pulses() {
    let assembly = assembly(true);
    let at = moved(&assembly);
    let omega: Vec<f64> = (1..60).map(|line| 2.0 * f64::from(line)).collect();
    let model = MachineModel::new(&assembly, &omega, None, true).unwrap();
    let open = Transient::Open { sample_interval: 0.01 };
    let random = |rows: usize, columns: usize, scale: f64| {
        DMatrix::from_fn(rows, columns, |row, column| {
            Complex::cis((7 * row * row + 3 * column + row * column) as f64) * scale
        })
    };
    let pulse = |samples: std::ops::Range<usize>| PulseNoise {
        rows: 0..omega.len(),
        sampling: Sampling::new(0.01, 400).unwrap(),
        channel: 0,
        deviation: 2.0,
        samples,
    };
    let lines = omega.len();
    let data =
        LineData::new(omega.clone(), random(lines, 3, 1.0), random(lines, 3, 1e-4), open).unwrap();
    let data = data.with_pulse_noise(&[pulse(10..16), pulse(200..207)]).unwrap();
    let weights = Weights::from_variances(&data, &DMatrix::from_element(lines, 3, 1e-10));
    let residual = Residual { model: &model, data: &data, weights: &weights, priors: &[] };
    let linearised = residual.linearise(&at).unwrap();
    assert_eq!(linearised.residual.len(), residual.len() + residual.amplitudes());
    let gradient = linearised.jacobian.tr_mul(&linearised.residual) * 2.0;
    let cost = |parameters: &[f64]| residual.evaluate(parameters).unwrap().residual.norm_squared();
    let without = data.clone().without_pulse_noise();
    let bare = Residual { model: &model, data: &without, weights: &weights, priors: &[] };
    let of_bare = bare.evaluate(&at).unwrap().residual.norm_squared();
    assert!(cost(&at) < 0.99 * of_bare, "{} {of_bare}", cost(&at));
    for (index, name) in assembly.parameters().iter().map(|p| &p.name).enumerate() {
        // The step changes the sum of squares by about 10¹⁰ times the rounding error of this sum.
        let length = linearised.jacobian.column(index).norm();
        let step = 1e-5 * linearised.residual.norm() / length;
        let moved = |by: f64| {
            let mut parameters = at.clone();
            parameters[index] += by;
            cost(&parameters)
        };
        let difference = (moved(step) - moved(-step)) / (2.0 * step);
        let scale = length * linearised.residual.norm();
        assert!((difference - gradient[index]).abs() < 1e-5 * scale, "{name}: {difference}");
    }
}

/// If two forces act on alternate lines, the first steps of a search use lines of both forces. If a
/// short record is fitted together with a long one, the first steps also use lines of the short
/// record.
#[test]
fn first_steps_have_lines_of_every_force_and_record() {
    let assembly = assembly(false);
    for thinning in 2..=6 {
        // A line has three complex outputs, which are six real numbers.
        let lines = (thinning * SEARCH_NUMBERS * assembly.parameters().len()).div_ceil(6);
        let omega: Vec<f64> = (1..=lines).map(|line| line as f64).collect();
        let model = MachineModel::new(&assembly, &omega, None, false).unwrap();
        let part = |from: usize, to: usize| {
            let zeros = DMatrix::zeros(to - from, 3);
            let part = omega[from..to].to_vec();
            LineData::new(part, zeros.clone(), zeros, Transient::None).unwrap()
        };
        let data = part(0, lines - 20).followed_by(&part(lines - 20, lines)).unwrap();
        let weights = Weights::from_variances(&data, &DMatrix::from_element(lines, 3, 1.0));
        let residual = Residual { model: &model, data: &data, weights: &weights, priors: &[] };
        let rows = Thinned::new(&residual).rows;
        assert!(rows.is_sorted_by(|a, b| a < b) && *rows.last().unwrap() < lines);
        let expected = lines as f64 / thinning as f64;
        assert!((rows.len() as f64 / expected - 1.0).abs() < 0.1, "{} of {lines}", rows.len());
        for line_of_force in 0..2 {
            let share = rows.iter().filter(|row| *row % 2 == line_of_force).count();
            assert!(share * 10 > rows.len() * 4, "{share} of {}, every {thinning}", rows.len());
        }
        assert!(rows.iter().filter(|row| **row >= lines - 20).count() >= 20 / thinning);
    }
}

/// In a machine with more degrees of freedom than state loads, every load causes the same sensor
/// response as its component in the space of the state loads. This is also true for unknowns far
/// from the initial values.
#[test]
fn state_loads_contain_every_load_to_which_a_sensor_responds() {
    let n = 40;
    let mut machine = Machine::new((0..n).map(|at| format!("x{at}")));
    let dofs = machine.dofs.clone();
    for (at, dof) in dofs.iter().enumerate() {
        let before = if at == 0 { SUPPORT } else { &dofs[at - 1] };
        let stiffness = match at {
            0 | 20 => FreeCoefficient::from_start(2e6).into(),
            _ => Coefficient::Known(2e6 + 1e5 * (at as f64).sin()),
        };
        let link = Element::spring_damper([before, dof], stiffness, 200.0);
        machine = machine.with(&format!("s{at}"), link).with(dof, Element::mass(dof, 1.0));
    }
    let instruments = Instruments {
        sensors: vec![Sensor::new(&dofs[30], ResponseQuantity::Displacement)],
        inputs: vec![Input::force(&dofs[10])],
        ..Instruments::default()
    };
    let assembly = machine.assembly(&instruments).unwrap();
    let omega: Vec<f64> = (1..200).map(|line| 4.0 * f64::from(line)).collect();
    let places = Places::new(&assembly, None);
    let nominal = Nominal::new(&assembly, None, &places);
    let loads = state_loads(&nominal, &assembly, &places, &omega).unwrap();
    // The state loads must be fewer than the 40 degrees of freedom, because a free chain has only
    // about 11 modes below 800 rad/s, the end of the band.
    assert!((10..36).contains(&loads.ncols()), "{}", loads.ncols());
    for parameters in [[2e6, 2e6], [5e5, 4e6], [1e7, 1e5]] {
        let mut all = DMatrix::zeros(400, n);
        for line in 0..200 {
            let omega = 3.7 + 3.99 * line as f64;
            let stiffness = assembly.dynamic_stiffness(&parameters, omega, |_| true);
            // `row` is the row of the inverse dynamic stiffness for the sensor at degree of freedom
            // 30.
            let mut unit = DVector::zeros(n);
            unit[30] = Complex::from(1.0);
            let row = stiffness.columns(0, n).transpose().lu().solve(&unit).unwrap();
            let response = (&row / Complex::from(row.norm())).transpose();
            all.row_mut(2 * line).copy_from(&response.map(|z| z.re));
            all.row_mut(2 * line + 1).copy_from(&response.map(|z| z.im));
        }
        let space = (&all * &loads).qr().q();
        for of_each in all.column_iter() {
            let rest = of_each - &space * space.tr_mul(&of_each);
            let gap = rest.norm() / of_each.norm();
            assert!(gap < 1e-4, "{parameters:?}: {gap:e}");
        }
    }
}
