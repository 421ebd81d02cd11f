//! Nonlinear systems whose force is known in closed form: the displacement is prescribed, and the
//! force follows from it.

use mechid_estimate::{EstimateError, Unknowns};
use mechid_model::{
    InitialState, Matrix, NonlinearSystem, Response, ResponseQuantity, SecondOrderSystem, Terms,
};
use mechid_nonlinear::{
    ChannelPhase, Criterion, EquationErrorOptions, ShapeConstants, SteadyExperiments,
    SteppedRecord, Weighting, distortion, equation_error, fitted_start, output_error, predict,
    select_terms,
};
use mechid_numerics::NumericsError;
use mechid_signal::{Extent, Record, Sampling, Spectrum};
use mechid_spectra::Lines;
use mechid_spectra::SpectraError;
use nalgebra::{Complex, DMatrix, dmatrix};

use crate::stepped::random_phases;

const LEN: usize = 512;

fn sampling() -> Sampling {
    Sampling::new(0.01, LEN).unwrap()
}

/// Returns x, ẋ and ẍ of `channels` multisines on odd lines up to 41; x has an RMS value of about 1
/// m.
fn prescribed(channels: usize) -> Response {
    prescribed_on(sampling(), channels)
}

fn prescribed_on(sampling: Sampling, channels: usize) -> Response {
    let lines: Vec<_> =
        (0..channels).map(|c| random_phases((1..=41).step_by(2), 0.3, 7 + c as u64)).collect();
    let record = |order: i32| {
        let mut spectrum = DMatrix::zeros(sampling.lines(), channels);
        for (channel, cosines) in lines.iter().enumerate() {
            for (n, amplitude, phase) in cosines {
                let omega = *n as f64 * sampling.omega0();
                spectrum[(*n, channel)] =
                    Complex::from_polar(*amplitude, *phase) * Complex::new(0.0, omega).powi(order);
            }
        }
        Spectrum::from_lines(sampling, spectrum).unwrap().to_record().unwrap()
    };
    Response::new(record(0), record(1), record(2)).unwrap()
}

/// Returns the force of a prescribed response on its lines below half the sampling rate, computed
/// on a grid fine enough to avoid aliasing.
fn band_limited_force(system: &NonlinearSystem) -> Record {
    const FINER: usize = 32;
    let fine = Sampling::new(sampling().dt() / FINER as f64, FINER * LEN).unwrap();
    let force = Spectrum::from_record(&system.force(&prescribed_on(fine, system.dof())).unwrap());
    let lines = force.lines().rows(0, sampling().lines()).into_owned();
    Spectrum::from_lines(sampling(), lines).unwrap().to_record().unwrap()
}

fn single(terms: &str, coefficients: Vec<f64>) -> NonlinearSystem {
    let linear = SecondOrderSystem::new(dmatrix![2.0], dmatrix![5.0], dmatrix![900.0]).unwrap();
    NonlinearSystem::new(linear, terms.parse().unwrap(), coefficients).unwrap()
}

fn coupled() -> NonlinearSystem {
    let linear = SecondOrderSystem::new(
        dmatrix![2.0, 0.0; 0.0, 1.0],
        dmatrix![5.0, -1.0; -1.0, 4.0],
        dmatrix![900.0, -300.0; -300.0, 700.0],
    );
    let terms: Terms = "kc: (x1-x2)^3, cq: x2^2 v2".parse().unwrap();
    NonlinearSystem::new(linear.unwrap(), terms, vec![120.0, 3.0]).unwrap()
}

/// Returns an experiment on lines 1 to 250, which contain the powers of the prescribed response up
/// to the sixth.
fn data(force: &Record, response: &Record, measured: ResponseQuantity) -> SteadyExperiments {
    let lines = Lines::new(sampling(), 1..=250).unwrap();
    let mut data = SteadyExperiments::new(&lines, force.channels(), measured);
    data.push(force, response).unwrap();
    data
}

fn fitted(
    data: &SteadyExperiments,
    terms: &str,
    options: &EquationErrorOptions,
) -> Result<mechid_nonlinear::NonlinearEstimate, EstimateError> {
    let unknowns = Unknowns::unknown_mass(data.dof()).unwrap();
    equation_error(data, &unknowns, &terms.parse().unwrap(), options)
}

#[test]
fn coefficients_of_a_prescribed_response_come_out() {
    let terms = "k2: x^2, k3: x^3, cx: x^2 v, c3: v^3, f: x^0";
    let truth = vec![40.0, 80.0, 6.0, 0.02, 1.5];
    let system = single(terms, truth.clone());
    let response = prescribed(1);
    let force = system.force(&response).unwrap();
    let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
    for weighting in [Weighting::WhiteForce, Weighting::Response, Weighting::SmoothSpectrum] {
        let options = EquationErrorOptions { weighting, ..EquationErrorOptions::default() };
        let found = fitted(&all, terms, &options).unwrap();
        let values: Vec<f64> = found.parameters().iter().map(|p| p.estimate.value).collect();
        let expected = [vec![2.0, 5.0, 900.0], truth.clone()].concat();
        for (value, expected) in values.iter().zip(&expected) {
            // The tolerance allows for the rounding of sums over several hundred lines, with forces
            // a thousand times as large as the smallest term.
            assert!((value / expected - 1.0).abs() < 1e-9, "{value} for {expected}");
        }
        assert!(found.unexplained()[0] < 1e-9);
        assert_eq!(found.parameter("cx").unwrap().unit, "N·s/m³");
        assert!(found.parameter("k9").unwrap_err().to_string().contains("m, c, k, k2, k3"));
        let range = found.ranges()[0];
        let largest = response.displacement().data().amax();
        assert!(range[0] >= largest && range[0] < 1.1 * largest);
        // The identified restoring force is that of the system.
        let mut restoring = [0.0];
        system.restoring_force(&[0.4], &[2.0], &mut restoring);
        let surface = found.restoring_force(&[0.4], &[2.0]).unwrap();
        assert!((surface[0].value / restoring[0] - 1.0).abs() < 1e-9);
    }
}

/// The points of the restoring-force surface are the forces of the springs and dampers at the
/// prescribed response, computed in closed form.
#[test]
fn points_of_the_surface_are_those_of_the_springs_and_dampers() {
    for (system, channels) in [(single("k2: x^2, c2: v^3", vec![40.0, 0.02]), 1), (coupled(), 2)] {
        let response = prescribed(channels);
        let force = system.force(&response).unwrap();
        let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
        // The mean of x² is not on the lines of the fit, so that the comparison excludes the mean.
        let found =
            fitted(&all, &system.terms().to_string(), &EquationErrorOptions::default()).unwrap();
        let points = &found.restoring_forces(&all).unwrap()[0];
        let mut exact =
            Record::new(sampling(), DMatrix::zeros(LEN, channels)).unwrap().data().clone();
        for k in 0..LEN {
            let at = |record: &Record| record.data().row(k).iter().copied().collect::<Vec<_>>();
            let mut restoring = vec![0.0; channels];
            let (x, v) = (at(response.displacement()), at(response.velocity()));
            system.restoring_force(&x, &v, &mut restoring);
            exact.row_mut(k).iter_mut().zip(restoring).for_each(|(entry, force)| *entry = force);
        }
        let exact = Record::new(sampling(), exact).unwrap().without_mean();
        let scale = exact.data().amax();
        let measured = points.measured.without_mean();
        assert!((measured.data() - exact.data()).amax() < 1e-9 * scale);
        assert!(points.residual.data().amax() < 1e-9 * scale);
        let displacement = response.displacement().data();
        assert!((points.displacement.data() - displacement).amax() < 1e-12);
        assert!((points.velocity.data() - response.velocity().data()).amax() < 1e-9);
    }
}

/// A cubic spring can be extrapolated to one and a half times the range of the data. The
/// extrapolation is reported as poor for a spring of fifth order, and for a term that noise hides.
#[test]
fn terms_that_extrapolate_badly_are_told() {
    let response = prescribed(1);
    let with = |terms: &str, coefficients: Vec<f64>, noise: f64| {
        let force = single(terms, coefficients).force(&response).unwrap();
        let level = mechid_signal::NoiseLevel::FractionOfRms(noise);
        let force = mechid_signal::noise::add_white(&force, level, 5).unwrap();
        let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
        fitted(&all, terms, &EquationErrorOptions::default()).unwrap().extrapolations().unwrap()
    };
    for terms in ["k3: x^3", "c2: |v| v", "cx: x^2 v", "c3: v^3"] {
        let told = with(terms, vec![2.0], 1e-4);
        assert!(!told[0].is_poor(), "{told:?}");
    }
    let fifth = with("k3: x^3, k5: x^5", vec![80.0, 20.0], 1e-4);
    assert!(!fifth[0].is_poor() && fifth[1].is_poor(), "{fifth:?}");
    assert!((fifth[0].order - 3.0).abs() < 1e-9 && (fifth[1].order - 5.0).abs() < 1e-9);
    let x = response.displacement().data().amax();
    for (at, reach) in [1.0, 1.5].into_iter().enumerate() {
        let x = reach * x;
        let [k1, k3, k5] = [900.0 * x, 80.0 * x.powi(3), 20.0 * x.powi(5)];
        assert!((fifth[1].share[at] / (k5 / (k1 + k3 + k5)) - 1.0).abs() < 0.02, "{fifth:?}");
    }
    // The result omits the constant force, because this force does not grow. Noise hides the
    // damper.
    let drowned = with("f: x^0, c3: v^3", vec![1.5, 1e-4], 0.3);
    assert_eq!(drowned.len(), 1);
    assert!(drowned[0].is_poor() && !drowned[0].grows_fast(), "{drowned:?}");
    assert!(drowned[0].relative_error[1] > drowned[0].relative_error[0]);
}

#[test]
fn velocity_and_acceleration_will_do_for_odd_terms() {
    let system = single("k3: x^3", vec![80.0]);
    let response = prescribed(1);
    let force = system.force(&response).unwrap();
    for (measured, record) in [
        (ResponseQuantity::Velocity, response.velocity()),
        (ResponseQuantity::Acceleration, response.acceleration()),
    ] {
        let options = EquationErrorOptions::default();
        let found = fitted(&data(&force, record, measured), "k3: x^3", &options).unwrap();
        let value = found.parameter("k3").unwrap().estimate.value;
        assert!((value / 80.0 - 1.0).abs() < 1e-8, "{value}");
    }
}

#[test]
fn a_spring_between_two_degrees_of_freedom_is_one_parameter() {
    let (system, response) = (coupled(), prescribed(2));
    let force = system.force(&response).unwrap();
    let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
    let found =
        fitted(&all, &system.terms().to_string(), &EquationErrorOptions::default()).unwrap();
    assert_eq!(found.parameters().len(), 14);
    let recovered = found.system().unwrap();
    for (value, expected) in recovered.coefficients().iter().zip(system.coefficients()) {
        assert!((value / expected - 1.0).abs() < 1e-9);
    }
    for matrix in Matrix::ALL {
        let gap = recovered.linear().matrix(matrix) - system.linear().matrix(matrix);
        assert!(gap.amax() < 1e-9 * system.linear().matrix(matrix).amax());
    }
}

#[test]
fn phase_delay_and_bend_are_found_by_variable_projection() {
    let terms = "k3: x^3, cs: v^3/(1 + (v/30)^2)";
    let system = single(terms, vec![80.0, 0.003]);
    let response = prescribed(1);
    let force = band_limited_force(&system);
    let channels = ChannelPhase { delay: 4e-4, cubic: 1.2, quintic: 2.5 };
    // Both records must contain the effect of the measuring channels. `as_measured` applies it to
    // the response only; for the force, a correction with opposite delay and phase applies it.
    let measured = channels.as_measured(response.displacement()).unwrap();
    let undo = ChannelPhase { delay: -4e-4, cubic: -1.2, quintic: -2.5 };
    let (seen, _) = undo.correct(&force, &measured).unwrap();
    let all = data(&seen, &measured, ResponseQuantity::Displacement);
    let shape = ShapeConstants { laws: true, delay: true, phase: true };
    let options = EquationErrorOptions { weighting: Weighting::WhiteForce, shape };
    let found = fitted(&all, "k3: x^3, cs: v^3/(1 + (v/20)^2)", &options).unwrap();
    for (name, expected) in [
        ("m", 2.0),
        ("c", 5.0),
        ("k", 900.0),
        ("k3", 80.0),
        ("cs", 0.003),
        ("cs.b", 30.0),
        ("delay", 4e-4),
        ("p3", 1.2),
        ("p5", 2.5),
    ] {
        let value = found.parameter(name).unwrap().estimate.value;
        // The tolerance allows for the error of the finite differences, and for the step at which
        // the search ends.
        assert!((value / expected - 1.0).abs() < 1e-5, "{name} = {value}");
    }
    assert_eq!(found.covariance().nrows(), found.parameters().len());
}

#[test]
fn a_prescribed_response_is_predicted_and_fitted() {
    let (system, response) = (coupled(), prescribed(2));
    let force = system.force(&response).unwrap();
    let first = |record: &Record| record.data().row(0).transpose();
    let begin = InitialState::new(first(response.displacement()), first(response.velocity()));
    let found = predict(&system, &force, Extent::WholePeriod, &begin.unwrap()).unwrap();
    let gap = |found: &Record, expected: &Record| {
        (found.data() - expected.data()).amax() / expected.data().amax()
    };
    // The refinement of the time step ends at an error of about 10⁻⁵.
    assert!(gap(found.displacement(), response.displacement()) < 1e-4);
    assert!(gap(found.acceleration(), response.acceleration()) < 1e-3);

    // The record is a window from the middle of the period. Its initial state is estimated from
    // displacements only; the result is compared far from the ends of the window.
    let part = |record: &Record| record.window(50, 300).unwrap();
    let (push, seen) = (part(&force), part(response.displacement()));
    let start = fitted_start(&system, &push, &[(ResponseQuantity::Displacement, &seen)]).unwrap();
    let open = predict(&system, &push, Extent::Open, &start).unwrap();
    let inner = |record: &Record| record.window(50, 200).unwrap();
    assert!(gap(&inner(open.displacement()), &inner(&seen)) < 1e-2);

    // The output-error fit starts from an equation-error estimate and returns the true parameters.
    let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
    let begin = fitted(&all, "kc: (x1-x2)^3, cq: x2^2 v2", &EquationErrorOptions::default());
    let record = SteppedRecord {
        force: force.clone(),
        response: response.displacement().clone(),
        extent: Extent::WholePeriod,
        periods: 1,
    };
    let fit = output_error(&[record], ResponseQuantity::Displacement, &begin.unwrap()).unwrap();
    for (value, expected) in [("kc", 120.0), ("cq", 3.0), ("k11", 900.0), ("m22", 1.0)]
        .map(|(name, expected)| (fit.estimate.parameter(name).unwrap().estimate.value, expected))
    {
        assert!((value / expected - 1.0).abs() < 1e-3, "{value} for {expected}");
    }
    assert!(fit.rmse.iter().all(|rmse| *rmse < 1e-4));
}

#[test]
fn the_right_terms_are_chosen_and_named() {
    let system = single("k3: x^3, c2: v^3", vec![80.0, 0.02]);
    let response = prescribed(1);
    let force = system.force(&response).unwrap();
    // The force is rounded to multiples of 0.05 N; the rounding errors are used instead of noise.
    let rounded = force.data().map(|f| (f / 0.05).round() * 0.05);
    let force = Record::new(force.sampling(), rounded).unwrap();
    let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let candidates: Terms =
        "k2: x^2, k5: x^5, k3: x^3, cx: x^2 v, c2: v^3, k4: x^4".parse().unwrap();
    let select = |criterion| {
        let weighting = Weighting::WhiteForce;
        select_terms(&all, &unknowns, &Terms::none(), &candidates, criterion, weighting)
    };
    let found = select(Criterion::Information).unwrap();
    let mut names: Vec<&str> = found.terms.iter().map(|term| term.name()).collect();
    names.sort_unstable();
    assert_eq!(names, ["c2", "k3"]);
    assert_eq!(found.steps.len(), 3);
    assert!(found.refused.is_some());
    assert_eq!(
        select(Criterion::HeldOut),
        Err(SpectraError::TooFewAverages { got: 1, needed: 3 }.into())
    );

    let lines = Lines::new(sampling(), 1..=250).unwrap();
    let seen = distortion(
        &lines,
        &[[&force, response.displacement()]],
        ResponseQuantity::Displacement,
        &unknowns,
    );
    let kind = seen.unwrap().kinds[0].name.clone();
    assert!(kind.contains("cubic"), "{kind}");
}

#[test]
fn what_cannot_be_told_apart_is_named() {
    let system = single("k3: x^3", vec![80.0]);
    let response = prescribed(1);
    let force = system.force(&response).unwrap();
    let all = data(&force, response.displacement(), ResponseQuantity::Displacement);
    let options = EquationErrorOptions::default();
    let error = fitted(&all, "a: x^3, b: x^3", &options).unwrap_err();
    assert!(
        matches!(&error, EstimateError::Undetermined { parameters, .. } if parameters == "a, b")
    );
    let wrong = fitted(&all, "a: x2^3", &options).unwrap_err();
    assert!(matches!(wrong, EstimateError::Model(_)), "{wrong}");
    let still = Record::new(force.sampling(), force.data() * 0.0).unwrap();
    let none = data(&still, response.displacement(), ResponseQuantity::Displacement);
    assert!(matches!(fitted(&none, "", &options), Err(EstimateError::OnlyRatios { dof: 1, .. })));
    let empty = SteadyExperiments::new(
        &Lines::new(sampling(), 1..=9).unwrap(),
        1,
        ResponseQuantity::Displacement,
    );
    assert!(matches!(
        fitted(&empty, "", &options),
        Err(EstimateError::Numerics(NumericsError::TooFewRows { .. }))
    ));
}

/// The prediction returns an error if the response grows without bound, as with this softening
/// spring, or if the system is too stiff for the time step.
#[test]
fn a_system_that_lets_go_is_told() {
    let system = single("k3: x^3", vec![-5e4]);
    let force = Record::from_fn(sampling(), |t| 2000.0 * (3.0 * t).sin()).unwrap();
    let at_rest = InitialState::rest(1);
    let error = predict(&system, &force, Extent::Open, &at_rest).unwrap_err();
    assert_eq!(error, EstimateError::Diverged { len: LEN });
    let stiff = SecondOrderSystem::new(dmatrix![1e-9], dmatrix![0.0], dmatrix![900.0]).unwrap();
    let stiff = NonlinearSystem::new(stiff, Terms::none(), vec![]).unwrap();
    let error = predict(&stiff, &force, Extent::Open, &at_rest).unwrap_err();
    assert!(matches!(error, EstimateError::TooStiff { .. }));
}
