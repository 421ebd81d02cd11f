//! Tests of the reports on parts of the data that disagree, and on fits that do not determine the
//! machine.

use mechid_analysis::identify::{OpenFit, Source};
use mechid_analysis::{
    AnalysisError, Identified, Identify, Measurement, ResponseQuantity, identify,
};
use mechid_checks::{DataPart, Finding, OmittedTerm, PartsAgreement, Power, Subject};
use mechid_model::{Matrix, Parameter, SecondOrderSystem};
use mechid_problems::machines::{Support, chain};
use mechid_problems::{FaultyOscillator, exact_harmonic_periodic};
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::DMatrix;

const KIND: ResponseQuantity = ResponseQuantity::Displacement;
const SAMPLES: usize = 2048;
const PERIOD: usize = 512;

fn sampling(samples: usize) -> Sampling {
    Sampling::new(0.002, samples).unwrap()
}

fn measured([force, response]: [Record; 2], seed: u64) -> Measurement {
    let noisy = noise::add_white(&response, NoiseLevel::FractionOfRms(0.01), seed + 1000).unwrap();
    Measurement::from_records(&force, &[(KIND, &noisy)]).unwrap()
}

fn random(machine: &FaultyOscillator, seed: u64) -> Measurement {
    let both = machine.measure(sampling(SAMPLES), 4 * SAMPLES, SAMPLES, 0.35, seed);
    measured(both.unwrap(), seed)
}

fn periods(machine: &FaultyOscillator, seed: u64) -> Measurement {
    let both = machine.measure(sampling(8 * PERIOD), PERIOD, 4 * PERIOD, 0.35, seed);
    measured(both.unwrap(), seed).period(PERIOD).unwrap()
}

fn open(records: &[Measurement]) -> Identified {
    identify(records, &Identify::from(Source::Open(OpenFit::default()))).unwrap()
}

fn agreement(found: &Identified) -> &PartsAgreement {
    let all = found.checks().iter().find(|check| check.subject == Subject::Parts);
    match &all.expect("parts are compared").finding {
        Finding::PartsAgreement(parts) => parts,
        other => panic!("{other}"),
    }
}

fn holds(found: &Identified, name: &str, value: f64) -> bool {
    let [low, high] = found.estimate().parameter(name).unwrap().interval(0.95).unwrap();
    (low..=high).contains(&value)
}

#[test]
fn parts_of_a_linear_machine_agree_and_nothing_is_scaled() {
    let machine = FaultyOscillator::linear();
    let both = [open(&[random(&machine, 1)]), open(&[random(&machine, 2), random(&machine, 3)])];
    let spectra = identify(&[periods(&machine, 4)], &Identify::default()).unwrap();
    for found in both.iter().chain([&spectra]) {
        assert!(!agreement(found).p_value.is_significant(), "{found}");
        assert_eq!(found.summary().fit.error_scale, 1.0);
    }
}

/// One of two records has 2 % more mass. The records agree in k and c, and the mass of each differs
/// by 1 % from the mean.
#[test]
fn a_weight_added_for_one_record_is_named_and_in_the_interval() {
    let linear = FaultyOscillator::linear();
    let heavier = FaultyOscillator { mass: 1.01 * linear.mass, ..linear };
    let lighter = FaultyOscillator { mass: 0.99 * linear.mass, ..linear };
    let found = open(&[random(&heavier, 5), random(&lighter, 6)]);
    let parts = agreement(&found);
    assert!(parts.p_value.adjusted < 1e-6, "{found}");
    assert!(matches!(parts.part, DataPart::Records { .. }), "{found}");
    assert_eq!(parts.parameter, "m");
    let difference = (parts.by_part - parts.by_others).abs();
    assert!((difference / (0.02 * linear.mass) - 1.0).abs() < 0.2, "{found}");
    let scale = found.summary().fit.error_scale;
    assert!(scale > 3.0 && holds(&found, "m", linear.mass), "{found}");
    // The result has the same errors as the estimate.
    let mass = found.estimate().parameter("m").unwrap();
    let row = &found.summary().parameters[0];
    assert_eq!(row.estimate.standard_error, Some(mass.standard_error));
    let text = found.to_string();
    assert!(
        text.contains("times those of the noise alone") && text.contains("(see parts)"),
        "{text}"
    );
}

#[test]
fn a_stiffness_that_drifts_is_seen_in_time() {
    let linear = FaultyOscillator::linear();
    let drifting = FaultyOscillator { drift: 0.02, ..linear };
    let found = open(&[random(&drifting, 7)]);
    let parts = agreement(&found);
    assert!(parts.p_value.is_significant(), "{found}");
    assert!(matches!(parts.part, DataPart::Time { .. }), "{found}");
    assert!(found.summary().fit.error_scale > 1.5, "{found}");
    assert!(holds(&found, "k", linear.stiffness), "{found}");
    let found = identify(&[periods(&drifting, 8)], &Identify::default()).unwrap();
    assert!(agreement(&found).p_value.is_significant(), "{found}");
    assert!(
        found.summary().fit.error_scale > 1.5 && holds(&found, "k", linear.stiffness),
        "{found}"
    );
}

/// A residual that exceeds the noise widens the intervals, even if the parts of the data agree.
#[test]
fn a_residual_beyond_the_noise_widens_the_intervals() {
    let hiding = FaultyOscillator { hidden_mass: 1.0, ..FaultyOscillator::linear() };
    let found = identify(&[periods(&hiding, 9)], &Identify::default()).unwrap();
    let misfit = found.checks().iter().find_map(|check| match &check.finding {
        Finding::Misfit(misfit) => Some(misfit.ratio),
        _ => None,
    });
    let scale = found.summary().fit.error_scale;
    assert!(scale >= misfit.unwrap().sqrt() && scale > 3.0, "{found}");
}

/// The response is noise and has no relation to the force; the identification must refuse it.
#[test]
fn a_response_that_is_noise_is_no_result() {
    let [force, _] =
        FaultyOscillator::linear().measure(sampling(SAMPLES), SAMPLES, SAMPLES, 0.35, 10).unwrap();
    let alone = noise::white(sampling(SAMPLES), 1, 1e-4, 11).unwrap();
    let record = Measurement::from_records(&force, &[(KIND, &alone)]).unwrap();
    let open = Identify::from(Source::Open(OpenFit::default()));
    let refused = match identify(&[record], &open) {
        Err(refused) => refused,
        Ok(found) => panic!("{found}"),
    };
    assert!(matches!(refused, AnalysisError::NothingDetermined { .. }), "{refused}");
    assert!(refused.to_string().starts_with("the data do not determine the machine: "));
}

/// The intervals must include the effect of a term that is missing in the model, even if all parts
/// of the data agree.
#[test]
fn a_term_that_the_model_leaves_out_is_named_and_counted() {
    let linear = FaultyOscillator::linear();
    let rubbing = FaultyOscillator { friction: 5.0, ..linear };
    let hardening = FaultyOscillator { cubic: 1e8, ..linear };
    let cases = [
        (rubbing, Power::VelocitySign, "c", linear.damping),
        (hardening, Power::Cube, "k", linear.stiffness),
    ];
    for (machine, expected, name, value) in cases {
        for found in [
            identify(&[periods(&machine, 12)], &Identify::default()).unwrap(),
            open(&[random(&machine, 13)]),
        ] {
            let left_out = found.checks().iter().find_map(|check| match &check.finding {
                Finding::TermLeftOut(term) => Some(term),
                _ => None,
            });
            let left_out = left_out.expect("a term");
            let is_expected = matches!(left_out.term, OmittedTerm::Nonlinear { power, dof: 0, other: None } if power == expected);
            assert!(is_expected, "{found}");
            let shift = left_out.changes.iter().find(|c| c.parameter.to_string() == name).unwrap();
            let estimated = found.estimate().parameter(name).unwrap();
            assert!(estimated.standard_error > 0.9 * shift.by.abs(), "{found}");
            assert!(holds(&found, name, value), "{found}");
        }
    }
}

/// Chain of three masses with a force on the first, and an additional damper from the first mass to
/// the third.
fn bridged_chain(damper: f64, seed: u64) -> (SecondOrderSystem, Measurement) {
    let held = chain(3, Support::Fixed, 0.02, 1);
    let mut damping = held.damping().clone();
    for (row, column) in [(0, 2), (2, 0)] {
        damping[(row, row)] += damper;
        damping[(row, column)] -= damper;
    }
    let system =
        SecondOrderSystem::new(held.mass().clone(), damping, held.stiffness().clone()).unwrap();
    let period = Sampling::from_rate_hz(128.0, 1024).unwrap();
    let force = noise::white(period, 1, 50.0, seed).unwrap();
    let mut data = DMatrix::zeros(period.len(), 3);
    data.column_mut(0).copy_from_slice(force.channel(0));
    let force = Record::new(period, data).unwrap();
    let response = exact_harmonic_periodic(&system, &force).unwrap();
    let repeated = |record: &Record| record.repeated(8).unwrap();
    let noisy = noise::add_white(
        &repeated(response.displacement()),
        NoiseLevel::FractionOfRms(0.01),
        seed + 1,
    );
    let record = Measurement::from_records(&repeated(&force), &[(KIND, &noisy.unwrap())]).unwrap();
    (system, record.period(1024).unwrap())
}

/// An entry that the structure sets to zero is tested like other missing terms.
#[test]
fn an_entry_that_the_structure_leaves_out_is_named_and_counted() {
    let how = Identify { structure: "chain".parse().unwrap(), ..Identify::default() };
    let left_out = |found: &Identified| {
        found.checks().iter().find_map(|check| match &check.finding {
            Finding::TermLeftOut(term) => Some(term.term),
            _ => None,
        })
    };
    let (_, right) = bridged_chain(0.0, 20);
    let found = identify(&[right], &how).unwrap();
    assert!(left_out(&found).is_none(), "{found}");
    let (system, wrong) = bridged_chain(2.0, 21);
    let found = identify(&[wrong], &how).unwrap();
    let expected = Parameter::new(Matrix::Damping, 0, 2, 3).unwrap();
    assert_eq!(left_out(&found), Some(OmittedTerm::KnownEntry { entry: expected }), "{found}");
    for (name, value) in [("c11", system.damping()[(0, 0)]), ("c33", system.damping()[(2, 2)])] {
        assert!(holds(&found, name, value), "{found}");
    }
}
