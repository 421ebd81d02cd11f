//! Tables of frequency responses that another model explains better; the references are closed-form
//! receptances with seeded noise.

use std::f64::consts::TAU;

use mechid_analysis::{AnalysisError, IdentifyResponses, ResponseQuantity, identify_responses};
use mechid_checks::{Alternative, Cause, Finding, Subject};
use mechid_io::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use mechid_model::SecondOrderSystem;
use mechid_signal::{Sampling, noise};
use nalgebra::{Complex, DMatrix, DVector, dmatrix};

type Receptance<'a> = dyn Fn(f64) -> Complex<f64> + 'a;

const LINES: usize = 160;

/// Receptance of 5 kg at 18 Hz with a damping ratio of 0.03.
fn viscous(omega: f64) -> Complex<f64> {
    let resonance = TAU * 18.0;
    let damping = 2.0 * 0.03 * resonance * omega;
    (5.0 * Complex::new(resonance * resonance - omega * omega, damping)).inv()
}

/// A table of accelerances from 0.25 to 40 Hz with 0.5 % noise; if `is_stated`, the table states
/// the noise.
fn table(receptance: &Receptance<'_>, seed: u64, is_stated: bool) -> FrequencyResponses {
    table_of_lines(LINES, receptance, seed, is_stated)
}

/// A table like that of `table`, with the number of lines given, in the same band.
fn table_of_lines(
    lines: usize,
    receptance: &Receptance<'_>,
    seed: u64,
    is_stated: bool,
) -> FrequencyResponses {
    let spacing_hz = 40.0 / lines as f64;
    let frequency_hz: Vec<f64> = (1..=lines).map(|line| spacing_hz * line as f64).collect();
    let size = 0.005 / 2_f64.sqrt();
    let noise = noise::white(Sampling::new(1.0, lines).unwrap(), 2, size, seed).unwrap();
    let exact = |hz: &f64| -(TAU * hz).powi(2) * receptance(TAU * hz);
    let values = frequency_hz
        .iter()
        .map(exact)
        .enumerate()
        .map(|(row, h)| h * (1.0 + Complex::new(noise.channel(0)[row], noise.channel(1)[row])));
    let values: Vec<Complex<f64>> = values.collect();
    let standard_error = is_stated.then(|| values.iter().map(|h| h.norm() * size).collect());
    let function = ResponseFunction {
        response: "1".into(),
        reference: "1".into(),
        quantity: None,
        values,
        standard_error,
    };
    let functions = vec![function];
    FrequencyResponses { file: "table".into(), frequency_hz, functions, ..Default::default() }
}

/// Results of an identification from a table: warnings, remarks, and the parameters m, c and k.
struct Told {
    warnings: Vec<(Subject, Finding)>,
    remarks: Vec<String>,
    parameters: Vec<[f64; 2]>,
}

impl Told {
    fn of(table: FrequencyResponses, how: IdentifyResponses) -> Self {
        let quantity = Some(ResponseQuantity::Acceleration);
        let how = IdentifyResponses { quantity, ..how };
        let found = identify_responses(&[table], &how).unwrap();
        let checks = found.summary().checks.iter().filter(|check| check.is_conspicuous());
        let parameters = found.estimate().parameters().map(|p| [p.value, p.standard_error]);
        Self {
            warnings: checks.map(|check| (check.subject, check.finding.clone())).collect(),
            remarks: found.summary().remarks.clone(),
            parameters: parameters.collect(),
        }
    }

    fn warns(&self, subject: Subject) -> bool {
        self.warnings.iter().any(|(of, _)| *of == subject)
    }

    fn cause(&self) -> Option<Cause> {
        self.warnings.iter().find_map(|(_, finding)| match finding {
            Finding::Alternative(Alternative { cause, .. }) => Some(cause.clone()),
            _ => None,
        })
    }
}

fn told(receptance: &Receptance<'_>, seed: u64, is_stated: bool) -> Told {
    Told::of(table(receptance, seed, is_stated), IdentifyResponses::default())
}

/// At a rate of 1 in 100, the probability of warnings in more than 5 of 120 correct tables is
/// 0.004.
#[test]
fn right_tables_pass() {
    let warned = (0..60).flat_map(|seed| [false, true].map(|stated| told(&viscous, seed, stated)));
    let warned: Vec<_> = warned.flat_map(|told| told.warnings).collect();
    assert!(warned.len() <= 5, "{warned:?}");
}

#[test]
fn modes_beyond_the_degrees_of_freedom_are_told() {
    let modes = [(7.0, 0.01, 1.0), (15.0, 0.02, 0.8), (22.0, 0.015, 1.2), (31.0, 0.01, 0.7)];
    let four = |omega: f64| -> Complex<f64> {
        let mode = |(hz, ratio, size): (f64, f64, f64)| {
            let own = TAU * hz;
            size / Complex::new(own * own - omega * omega, 2.0 * ratio * own * omega)
        };
        modes.into_iter().map(mode).sum()
    };
    for seed in 0..3 {
        for is_stated in [false, true] {
            let told = told(&four, seed, is_stated);
            assert!(told.warns(Subject::Whiteness), "{:?}", told.warnings);
            assert_eq!(told.warns(Subject::Misfit), is_stated);
            assert!(told.remarks.iter().any(|remark| remark.contains("mechid modes")));
            assert_eq!(told.cause(), None);
        }
    }
}

/// A driving point with two modes far apart, fitted with one degree of freedom. The fit finds the
/// lower mode; the check of whiteness must warn, but must not name a damping law or a delay as the
/// cause.
#[test]
fn a_second_mode_is_not_taken_for_damping_or_a_delay() {
    for (hz, size) in [(26.0, 0.2), (33.0, 0.5), (60.0, 0.3)] {
        let both = |omega: f64| {
            let own = TAU * hz;
            let second = size / Complex::new(own * own - omega * omega, 0.02 * own * omega);
            viscous(omega) + second
        };
        let told = told(&both, 3, false);
        assert!(told.warns(Subject::Whiteness), "{hz}: {:?}", told.warnings);
        assert_eq!(told.cause(), None, "{hz}");
    }
}

#[test]
fn a_late_response_is_told_by_its_delay() {
    for (delay, is_stated) in [(2e-3, false), (2e-3, true), (-5e-4, false)] {
        let late = |omega: f64| viscous(omega) * Complex::cis(-omega * delay);
        for seed in 0..3 {
            let told = told(&late, seed, is_stated);
            let Some(Cause::Delay { seconds }) = told.cause() else {
                panic!("{:?}", told.warnings)
            };
            assert!((seconds / delay - 1.0).abs() < 0.1, "{seconds}");
            assert!(told.warns(Subject::Delay));
        }
    }
}

#[test]
fn structural_damping_is_told_by_its_loss_factor() {
    let structural = |omega: f64| {
        let square = (TAU * 18.0_f64).powi(2);
        (5.0 * Complex::new(square - omega * omega, 0.3 * square)).inv()
    };
    for (seed, is_stated) in [(0, false), (1, true), (2, false)] {
        let told = told(&structural, seed, is_stated);
        let Some(Cause::StructuralDamping { loss_factor }) = told.cause() else {
            panic!("{:?}", told.warnings)
        };
        assert!((loss_factor - 0.3).abs() < 0.01, "{loss_factor}");
    }
}

#[test]
fn another_quantity_is_told() {
    let powers = [(ResponseQuantity::Velocity, 1), (ResponseQuantity::Displacement, 2)];
    for (quantity, power) in powers {
        let other = |omega: f64| viscous(omega) / Complex::new(0.0, omega).powi(power);
        for (seed, is_stated) in [(0, false), (1, true)] {
            let told = told(&other, seed, is_stated);
            let stated = ResponseQuantity::Acceleration;
            assert_eq!(told.cause(), Some(Cause::Quantity { quantity, stated }));
        }
    }
}

/// Tables whose magnitudes are given in decibels: the check must name decibels as the cause,
/// whether the magnitudes are all below one, all above one, or below and above one.
#[test]
fn decibels_read_as_magnitudes_are_told() {
    for gain in [1e-3, 1e6, 1.0, 5.0, 50.0] {
        let mut levels = table(&viscous, 4, false);
        for value in &mut levels.functions[0].values {
            let level = 20.0 * (gain * value.norm()).log10();
            *value = Complex::from_polar(1.0, value.arg()) * level;
        }
        let told = Told::of(levels, IdentifyResponses::default());
        assert_eq!(told.cause(), Some(Cause::Decibels), "{gain}: {:?}", told.warnings);
    }
}

/// For a long table, other models are first tried on only some of the lines. The same model must be
/// found on these lines as on all lines.
#[test]
fn long_tables_are_told_apart_too() {
    let structural = |omega: f64| {
        let square = (TAU * 18.0_f64).powi(2);
        (5.0 * Complex::new(square - omega * omega, 0.3 * square)).inv()
    };
    let late = |omega: f64| viscous(omega) * Complex::cis(-omega * 2e-3);
    let velocity = |omega: f64| viscous(omega) / Complex::new(0.0, omega);
    let long = |receptance: &Receptance<'_>, is_stated| {
        let table = table_of_lines(10 * LINES, receptance, 1, is_stated);
        Told::of(table, IdentifyResponses::default())
    };
    for is_stated in [false, true] {
        let right = long(&viscous, is_stated);
        assert!(right.warnings.is_empty(), "{:?}", right.warnings);
        assert!(matches!(
            long(&structural, is_stated).cause(),
            Some(Cause::StructuralDamping { .. })
        ));
        assert!(matches!(long(&late, is_stated).cause(), Some(Cause::Delay { .. })));
        let of_velocity = long(&velocity, is_stated).cause();
        assert!(matches!(of_velocity, Some(Cause::Quantity { .. })), "{of_velocity:?}");
    }
}

/// Receptances of a chain of three masses with 1 % noise, stated as another quantity: the search
/// fails, and the error must name the quantity of the table. With the right quantity, no check
/// warns.
#[test]
fn another_quantity_is_named_if_the_search_fails() {
    let mass = DMatrix::from_diagonal(&DVector::from_vec(vec![1.1, 2.3, 0.7]));
    let stiffness = dmatrix![2.1e4, -9e3, 0.0; -9e3, 2.4e4, -1.5e4; 0.0, -1.5e4, 1.5e4];
    let damping = &stiffness * 2e-4 + &mass * 0.3;
    let system = SecondOrderSystem::new(mass, damping, stiffness).unwrap();
    let frequency_hz: Vec<f64> = (1..=300).map(|line| 0.12 * line as f64).collect();
    let exact: Vec<DMatrix<Complex<f64>>> =
        frequency_hz.iter().map(|hz| system.receptance(TAU * hz).unwrap()).collect();
    let function = |response: usize, force: usize| {
        let sampling = Sampling::new(1.0, exact.len()).unwrap();
        let level = exact.iter().map(|h| h[(response, force)].norm()).sum::<f64>() / 300.0;
        let seed = (3 * response + force) as u64;
        let noise = noise::white(sampling, 2, 0.01 * level / 2_f64.sqrt(), seed).unwrap();
        let noise = |row: usize| Complex::new(noise.channel(0)[row], noise.channel(1)[row]);
        let values = exact.iter().enumerate();
        ResponseFunction {
            response: (response + 1).to_string(),
            reference: (force + 1).to_string(),
            quantity: None,
            values: values.map(|(row, h)| h[(response, force)] + noise(row)).collect(),
            standard_error: None,
        }
    };
    let functions = (0..9).map(|at| function(at / 3, at % 3)).collect();
    let table =
        FrequencyResponses { file: "table".into(), frequency_hz, functions, ..Default::default() };
    let stated = |quantity: ResponseQuantity| {
        let how = IdentifyResponses { quantity: Some(quantity), ..Default::default() };
        identify_responses(std::slice::from_ref(&table), &how)
    };
    let right = stated(ResponseQuantity::Displacement).unwrap();
    assert!(right.summary().checks.iter().all(|check| !check.is_conspicuous()), "{right}");
    for quantity in [ResponseQuantity::Velocity, ResponseQuantity::Acceleration] {
        let error = stated(quantity).unwrap_err();
        assert!(matches!(error, AnalysisError::Unfit { .. }), "{error:?}");
        assert!(error.to_string().contains("displacement per force"), "{error}");
    }
}

#[test]
fn a_table_without_phase_is_told() {
    let mut magnitudes = table(&viscous, 5, false);
    magnitudes.functions[0].values.iter_mut().for_each(|value| *value = value.norm().into());
    let told = Told::of(magnitudes, IdentifyResponses::default());
    let is_named = |(_, finding): &(Subject, Finding)| matches!(finding, Finding::ConstantPhase(_));
    assert!(told.warnings.iter().any(is_named), "{:?}", told.warnings);
}

/// Parameters and their errors equal those of the same table without a coherence, because a
/// coherence of one gives no information on the noise.
#[test]
fn a_coherence_of_one_states_no_noise() {
    let silent = told(&viscous, 6, false);
    for coherence in [1.0, 1.0 - 1e-8] {
        for averages in [Some(10.0), None] {
            let mut coherent = table(&viscous, 6, false);
            let (response, reference) = ("1".to_owned(), Some("1".to_owned()));
            let values = vec![coherence; LINES];
            coherent.coherence.push(CoherenceFunction { response, reference, values });
            let told = Told::of(coherent, IdentifyResponses { averages, ..Default::default() });
            assert_eq!(told.parameters, silent.parameters);
            assert!(told.remarks.iter().any(|remark| remark.contains("a coherence of 1")));
            assert!(told.warnings.is_empty(), "{:?}", told.warnings);
        }
    }
}
