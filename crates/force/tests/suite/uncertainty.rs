//! Effect of the uncertainty of the machine on the force.

use mechid_force::{
    Filter, ForceUnknowns, Measurement, Noise, Rule, continuous, discretised, frequency_domain,
    regularised, with_uncertain_system,
};
use mechid_model::{
    Discretisation, KyxSign, Matrix, Parameter, Response, ResponseQuantity, SecondOrderSystem,
    UncertainSystem,
};
use mechid_problems::{dissertation_bearing, exact_harmonic_periodic};
use mechid_signal::{Extent, Multisine, Phases, Record, Sampling, noise};
use nalgebra::{DMatrix, DVector, dmatrix};

const LINES: [usize; 5] = [1, 2, 5, 9, 14];

fn bearing() -> SecondOrderSystem {
    dissertation_bearing(KyxSign::Minus).system()
}

fn response() -> Response {
    let sampling = Sampling::new(0.1, 64).unwrap();
    let drive = Multisine::flat(LINES, 50.0, Phases::Schroeder).unwrap().sample(sampling).unwrap();
    let force = DMatrix::from_fn(64, 2, |k, i| if i == 1 { drive.channel(0)[k] } else { 0.0 });
    exact_harmonic_periodic(&bearing(), &Record::new(sampling, force).unwrap()).unwrap()
}

fn uncertain(names: &[&str], root: &DMatrix<f64>) -> UncertainSystem {
    let parameters = names.iter().map(|name| Parameter::named(name, 2).unwrap()).collect();
    UncertainSystem::new(bearing(), parameters, root * root.transpose()).unwrap()
}

/// Machine whose uncertain entries have correlated errors of a few per cent each.
fn machine() -> UncertainSystem {
    let root = dmatrix![
        0.3, 0.0, 0.0, 0.0;
        0.2, 0.5, 0.0, 0.0;
        -0.1, 0.4, 0.8, 0.0;
        0.3, -0.2, 0.5, 1.0
    ];
    uncertain(&["m22", "c22", "k21", "k22"], &root)
}

/// Machines drawn from the covariance.
fn drawn(known: UncertainSystem, draws: usize) -> impl Iterator<Item = SecondOrderSystem> {
    let entries = known.parameters().len();
    let root = known.covariance().clone().cholesky().unwrap().l();
    let sampling = Sampling::new(1.0, draws).unwrap();
    let normal = noise::white(sampling, entries, 1.0, 77).unwrap();
    (0..draws).map(move |d| {
        let shift = &root * DVector::from_iterator(entries, normal.data().row(d).iter().copied());
        let mut matrices = Matrix::ALL.map(|which| bearing().matrix(which).clone());
        for (entry, by) in known.parameters().iter().zip(shift.iter()) {
            matrices[entry.matrix() as usize][(entry.row(), entry.column())] += by;
        }
        let [m, c, k] = matrices;
        SecondOrderSystem::new(m, c, k).unwrap()
    })
}

/// Returns the standard deviation of the force over machines drawn from the covariance.
fn scatter(find: impl Fn(&SecondOrderSystem) -> Record, draws: usize) -> DMatrix<f64> {
    let exact = find(&bearing());
    let mut sum = DMatrix::zeros(exact.len(), 2);
    for machine in drawn(machine(), draws) {
        sum += (find(&machine).data() - exact.data()).map(|e| e * e);
    }
    sum.map(|s| (s / draws as f64).sqrt())
}

fn assert_close(stated: &Record, seen: &DMatrix<f64>, tolerance: f64, what: &str) {
    let (stated, seen) = (stated.data().column(1), seen.column(1));
    let difference = (stated - seen).norm() / seen.norm();
    assert!(difference < tolerance, "{what}: {difference:.3}");
}

#[test]
fn the_stated_error_is_the_scatter_over_machines() {
    let response = response();
    let measured =
        Measurement::from_record(ResponseQuantity::Displacement, response.displacement().clone());
    // 2,000 draws determine a standard deviation to 1.6 %; second-order effects of the regularised
    // method add about as much.
    let draws = 2000;
    let found = with_uncertain_system(&machine(), |s| continuous(s, &response)).unwrap();
    let seen = scatter(|s| continuous(s, &response).unwrap().record().clone(), draws);
    assert_close(found.standard_error().unwrap(), &seen, 0.04, "continuous");

    let lines =
        |s: &SecondOrderSystem| frequency_domain(s, &measured, &[1], &LINES, &Noise::Unknown);
    let found = with_uncertain_system(&machine(), lines).unwrap();
    let seen = scatter(|s| lines(s).unwrap().record().clone(), draws);
    assert_close(found.standard_error().unwrap(), &seen, 0.04, "frequency domain");

    let held = |s: &SecondOrderSystem| {
        discretised(s, &response, Discretisation::FirstOrderHold, Extent::WholePeriod)
    };
    let found = with_uncertain_system(&machine(), held).unwrap();
    let seen = scatter(|s| held(s).unwrap().record().clone(), draws);
    assert_close(found.standard_error().unwrap(), &seen, 0.04, "discretised");
}

/// A truncation keeps the same components if the machine changes by a thousandth. If the threshold
/// were equal to a singular value, the smallest change of the machine could exclude the component
/// of this singular value.
#[test]
fn a_truncation_is_not_at_the_mercy_of_the_machine() {
    let measured =
        Measurement::from_record(ResponseQuantity::Displacement, response().displacement().clone());
    let noise = Noise::Unknown;
    let extent = ForceUnknowns::Lines(LINES.to_vec());
    let ask = |s: &SecondOrderSystem, rule| {
        regularised(s, &measured, &[1], &extent, Filter::TruncatedSvd(rule), &noise)
    };
    let chosen = ask(&bearing(), Rule::Likelihood).unwrap();
    assert_eq!(chosen.unknowns, 2.0 * LINES.len() as f64);
    let given = Rule::Given(chosen.parameter.unwrap());
    let found = with_uncertain_system(&machine(), |s| ask(s, given).map(|f| f.force));
    let found = found.unwrap();
    let lines = |s: &SecondOrderSystem| frequency_domain(s, &measured, &[1], &LINES, &noise);
    let whole = with_uncertain_system(&machine(), lines).unwrap();
    assert_close(
        found.standard_error().unwrap(),
        whole.standard_error().unwrap().data(),
        1e-6,
        "truncated",
    );
}

/// For one force and two channels, the uncertainty of the system gives an expected residual. It
/// agrees with the RMS value of the residuals that an exact record has with machines drawn from the
/// covariance.
#[test]
fn the_rest_that_the_machine_explains_is_that_of_machines_drawn() {
    let measured =
        Measurement::from_record(ResponseQuantity::Displacement, response().displacement().clone());
    let noise = Noise::PerChannel(vec![1e-3, 2e-3]);
    // If the force acts on the second direction only, the first row of the equation of motion gives
    // the ratio of the two displacements.
    let uncertain = uncertain(&["c11", "k12"], &dmatrix![0.2, 0.0; 0.3, 0.4]);
    let rests = |s: &SecondOrderSystem| -> Vec<f64> {
        let found = frequency_domain(s, &measured, &[1], &LINES, &noise).unwrap();
        found.unexplained().unwrap().iter().map(|channel| channel.residual).collect()
    };
    let found =
        with_uncertain_system(&uncertain, |s| frequency_domain(s, &measured, &[1], &LINES, &noise));
    let found = found.unwrap();
    let draws = 2000;
    let mut sums = [0.0; 2];
    for machine in drawn(uncertain, draws) {
        for (sum, rest) in sums.iter_mut().zip(rests(&machine)) {
            *sum += rest * rest;
        }
    }
    for (channel, sum) in found.unexplained().unwrap().iter().zip(sums) {
        let seen = (sum / draws as f64).sqrt();

        assert!(channel.residual < 1e-9 * seen);
        let ratio = channel.system.unwrap() / seen;
        // The limits allow for the accuracy of 2,000 draws and for second-order effects.
        assert!((ratio - 1.0).abs() < 0.04, "{ratio:.3}");
    }
}

#[test]
fn both_uncertainties_add_in_variance() {
    let response = response();
    let measured =
        Measurement::from_record(ResponseQuantity::Displacement, response.displacement().clone());
    let find = |s: &SecondOrderSystem| {
        let filter = Filter::Tikhonov(Rule::Given(1e-6));
        let noise = Noise::PerChannel(vec![0.01, 0.01]);
        regularised(s, &measured, &[1], &ForceUnknowns::Lines(LINES.to_vec()), filter, &noise)
            .map(|found| found.force)
    };
    let noise_only = find(&bearing()).unwrap();
    let both = with_uncertain_system(&machine(), find).unwrap();
    let certain =
        |s: &SecondOrderSystem| frequency_domain(s, &measured, &[1], &LINES, &Noise::Unknown);
    let machine_only = with_uncertain_system(&machine(), certain).unwrap();
    for k in 0..64 {
        let at = |force: &mechid_force::IdentifiedForce| {
            force.standard_error().unwrap().channel(1)[k].powi(2)
        };
        let (sum, total) = (at(&noise_only) + at(&machine_only), at(&both));
        // `machine_only` weights the channels by their size, the other two results weight them by
        // their noise. The variances therefore agree to 2 % only.
        assert!((sum - total).abs() < 0.02 * total, "sample {k}: {sum} {total}");
    }
}
