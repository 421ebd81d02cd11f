//! Machines with nonlinear terms through the doors of the analysis. The response is prescribed and the
//! force follows from the equation of motion in closed form.

use mechid_analysis::identify::{Fit, Method, Nonlinear, SampleFit};
use mechid_analysis::{
    AnalysisError, Channels, Identify, Machine, Measurement, ModalSummary, Predict, Reconstruct,
    ResponseQuantity, identify, predict, reconstruct,
};
use mechid_estimate::nonlinear::{ShapeConstants, Weighting};
use mechid_model::{NonlinearSystem, Response, Sdof};
use mechid_signal::{Record, Sampling, Spectrum, noise};
use nalgebra::{Complex, DMatrix};

const PERIOD: usize = 256;

/// Mass, damping, stiffness, and 8·10⁴ x² and 4·10⁶ x³ beside them.
fn machine() -> NonlinearSystem {
    let linear = Sdof::new(10.0, 40.0, 5000.0).unwrap().system();
    NonlinearSystem::new(linear, "k2: x1^2, k3: x1^3".parse().unwrap(), vec![8e4, 4e6]).unwrap()
}

/// Two periods of a displacement on odd lines up to 21, of some centimetres, and the force it takes:
/// its lines end at 63.
fn steady_state() -> (Record, Record) {
    let sampling = Sampling::new(0.02, PERIOD).unwrap();
    let record = |order: i32| {
        let mut lines = DMatrix::zeros(sampling.lines(), 1);
        for n in (1..=21).step_by(2) {
            let omega = n as f64 * sampling.omega0();
            let phase = 0.7 * (n * n) as f64;
            lines[(n, 0)] = Complex::from_polar(0.01, phase) * Complex::new(0.0, omega).powi(order);
        }
        Spectrum::from_lines(sampling, lines).unwrap().to_record().unwrap()
    };
    let response = Response::new(record(0), record(1), record(2)).unwrap();
    // The mean of the force stays: x² pushes one way.
    let force = machine().force(&response).unwrap();
    (force.repeated(2).unwrap(), response.displacement().repeated(2).unwrap())
}

fn test_of(force: &Record, displacement: &Record) -> Measurement {
    let responses = [(ResponseQuantity::Displacement, displacement)];
    Measurement::from_records(force, &responses).unwrap()
}

fn how() -> Identify {
    Identify::default().nonlinear("k2: x1^2, k3: x1^3".parse().unwrap())
}

#[test]
fn a_spring_that_hardens_is_identified_saved_and_predicted() {
    let (force, x) = steady_state();
    let test = test_of(&force, &x).period(PERIOD).unwrap();
    let mut found = identify(std::slice::from_ref(&test), &how()).unwrap();
    for (name, value) in [("m", 10.0), ("c", 40.0), ("k", 5000.0), ("k2", 8e4), ("k3", 4e6)] {
        let got = found.nonlinear().unwrap().parameter(name).unwrap().found.value;
        assert!((got / value - 1.0).abs() < 1e-9, "{name} = {got}");
    }
    assert!(found.validate(&test).unwrap().channels[0].fit_percent > 99.99);
    found.add_validation(&test).unwrap();
    let text = found.to_string();
    for part in [
        "nonlinear terms: k2: x1^2, k3: x1^3",
        "before the fit: nonlinear: cubic stiffness of x1 (hardening)",
        "N/m³",
        "mode of small amplitude",
        "motion the model leaves unexplained",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }

    // What was saved is read back, with the covariance of its linear part.
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("machine.json");
    std::fs::write(&path, serde_json::to_string(&found).unwrap()).unwrap();
    let read = Machine::read(&path).unwrap();
    let part = read.nonlinear.as_ref().unwrap();
    assert_eq!(part.system.terms(), machine().terms());
    for (read, truth) in part.system.coefficients().iter().zip([8e4, 4e6]) {
        assert!((read / truth - 1.0).abs() < 1e-9);
    }
    assert_eq!(read.uncertain.parameters().len(), 3);
    let own = found.machine().unwrap().nonlinear.unwrap();
    assert_eq!((own.system.terms(), own.channels), (part.system.terms(), part.channels));

    let steady = predict(&test, &read, &Predict::default()).unwrap();
    assert!(steady.summary().channels[0].nrmse < 1e-4, "{steady}");
    // An open record: its start, which is not at rest, from the first samples.
    let open = predict(&test_of(&force, &x), &read, &Predict { settle: Some(100) }).unwrap();
    assert!(open.summary().channels[0].nrmse < 1e-2, "{open}");
    assert_eq!((open.summary().first_judged, open.columns().len()), (101, 1));
    // The linear part alone does not predict it.
    let linear = Machine { nonlinear: None, ..read.clone() };
    let blind = predict(&test, &linear, &Predict::default()).unwrap();
    assert!(blind.summary().channels[0].nrmse > 0.05, "{blind}");

    let modes = ModalSummary::of(&read).unwrap().to_string();
    assert!(modes.contains("small amplitudes; the nonlinear terms are k2: x1^2"), "{modes}");
    let refused = reconstruct(&test, &read, &Reconstruct::auto()).unwrap_err();
    assert!(matches!(refused, AnalysisError::NonlinearMachine { .. }), "{refused}");
}

#[test]
fn output_error_takes_noise_on_the_response() {
    let (force, x) = steady_state();
    let x = noise::add_white(&x, noise::NoiseLevel::FractionOfRms(0.01), 3).unwrap();
    let test = test_of(&force, &x).period(PERIOD).unwrap();
    let likely =
        Identify { fit: Fit::Spectra { method: Some(Method::MaximumLikelihood) }, ..how() };
    let found = identify(&[test], &likely).unwrap();
    let cubic = found.nonlinear().unwrap().parameter("k3").unwrap().found;
    assert!((cubic.value - 4e6).abs() < 4.0 * cubic.standard_error, "{cubic:?}");
    assert!(cubic.standard_error < 0.05 * 4e6, "{cubic:?}");
}

#[test]
fn a_force_alone_is_enough_for_a_prediction() {
    let (force, x) = steady_state();
    let channels = Channels { force: vec!["f".into()], ..Channels::default() };
    let columns = [("f", force.channel(0))];
    let test = Measurement::from_columns(force.sampling(), &columns, &channels).unwrap();
    let found = identify(&[test_of(&force, &x).period(PERIOD).unwrap()], &how()).unwrap();
    let machine = found.machine().unwrap();
    let at_rest = predict(&test, &machine, &Predict::default()).unwrap();
    assert!(at_rest.summary().channels.is_empty());
    assert_eq!(at_rest.response().displacement().channel(0)[0], 0.0);
    let settle = Predict { settle: Some(10) };
    let refused = predict(&test, &machine, &settle).unwrap_err().to_string();
    assert!(refused.contains("`settle`"), "{refused}");
    let periods = test_of(&force, &x).period(PERIOD).unwrap();
    assert!(predict(&periods, &machine, &settle).unwrap_err().to_string().contains("steady state"));
}

#[test]
fn what_nonlinear_terms_cannot_be_fitted_to_is_refused() {
    let (force, x) = steady_state();
    let test = test_of(&force, &x).period(PERIOD).unwrap();
    for fit in
        [Fit::Samples(SampleFit::default()), Fit::Spectra { method: Some(Method::Instrumental) }]
    {
        let error = identify(std::slice::from_ref(&test), &Identify { fit, ..how() }).unwrap_err();
        assert!(matches!(error, AnalysisError::Setting { setting: "nonlinear", .. }), "{error}");
    }
    let other = Identify::default().nonlinear("k3: x2^3".parse().unwrap());
    assert!(identify(&[test], &other).unwrap_err().to_string().contains("degrees of freedom"));
}

#[test]
fn settings_of_terms_survive_json() {
    let how = Identify::default().nonlinear(Nonlinear {
        terms: "c3: v1^3/(1 + (v1/20)^2)".parse().unwrap(),
        search: ShapeConstants { laws: true, delay: false, phase: true },
        weighting: Weighting::SmoothSpectrum,
    });
    let saved = serde_json::to_string(&how).unwrap();
    assert_eq!(serde_json::from_str::<Identify>(&saved).unwrap(), how, "{saved}");
    assert!(!serde_json::to_string(&Identify::default()).unwrap().contains("nonlinear"));
}
