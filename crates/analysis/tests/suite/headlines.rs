//! Headline figures and checks of a result must not contradict each other.

use std::f64::consts::TAU;

use mechid_analysis::identify::{Band, LineChoice, Method, SampleFit, Source};
use mechid_analysis::{
    AnalysisError, Channels, Identified, Identify, Measurement, ResponseQuantity, Segmentation,
    identify,
};
use mechid_checks::{Finding, Subject};
use mechid_checks::{HighestMode, UnequalPeriods};
use mechid_model::{Discretisation, Response, Sdof};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Multisine, NoiseLevel, Phases, Record, Sampling, noise};

const HZ: f64 = 60.0;

fn oscillator() -> Sdof {
    Sdof::from_modal(10.0, 0.03, HZ * TAU).unwrap()
}

/// Exact steady states under a multisine of 256 samples, with 1 % noise on every response.
fn steady(periods: usize) -> (Record, Response) {
    let period = Sampling::new(1.0 / 512.0, 256).unwrap();
    let lines = Multisine::flat(2..=100, 10.0, Phases::Random { seed: 1 }).unwrap();
    let force = lines.sample(period).unwrap();
    let exact = exact_harmonic_periodic(&oscillator().system(), &force).unwrap();
    let noisy = |record: &Record, seed| {
        let all = record.repeated(periods).unwrap();
        noise::add_white(&all, NoiseLevel::FractionOfRms(0.01), seed).unwrap()
    };
    let response = Response::new(
        noisy(exact.displacement(), 1),
        noisy(exact.velocity(), 2),
        noisy(exact.acceleration(), 3),
    );
    (force.repeated(periods).unwrap(), response.unwrap())
}

fn displacements(periods: usize) -> Measurement {
    let (force, response) = steady(periods);
    let responses = [(ResponseQuantity::Displacement, response.displacement())];
    Measurement::from_records(&force, &responses).unwrap()
}

fn from_frf() -> Identify {
    Identify::responses(Default::default(), Segmentation::default())
}

/// All kinds of identification that use periods.
fn ways() -> [Identify; 4] {
    let of = Identify::spectra;
    [Identify::default(), of(Method::MaximumLikelihood), of(Method::LeastSquares), from_frf()]
}

fn tells(found: &Identified, subject: Subject) -> bool {
    found.checks().iter().any(|check| check.subject == subject)
}

#[test]
fn of_good_data_every_figure_is_good() {
    let test = displacements(10).period(256).unwrap();
    for how in ways() {
        let found = identify(std::slice::from_ref(&test), &how).unwrap();
        let fit = &found.summary().fit;
        assert!(fit.unexplained_motion.unwrap() < 0.01, "{found}");
        assert!(found.checks().iter().all(|check| !check.is_conspicuous()), "{found}");
        assert!(tells(&found, Subject::Misfit) && found.doubts().is_empty(), "{found}");
    }
}

#[test]
fn a_wrong_period_has_no_misfit_to_show() {
    let test = displacements(10).period(250).unwrap();
    for how in ways() {
        let found = identify(std::slice::from_ref(&test), &how).unwrap();
        assert!(found.checks().iter().any(|check| check.is_bad()), "{found}");
        assert_eq!(found.summary().fit.misfit_ratio, None);
        assert!(!tells(&found, Subject::Misfit), "{found}");
    }
}

/// Eight strokes of different strengths, one second apart, so that each response decays before the
/// next stroke. The response to each half-sine is computed as a sum over 16 parts of each sampling
/// interval.
fn strokes(strengths: [f64; 8]) -> Measurement {
    const RATE: f64 = 1024.0;
    const PERIOD: usize = 1024;
    let [decay, omega] = [0.03 * HZ * TAU, HZ * TAU * (1.0_f64 - 0.03 * 0.03).sqrt()];
    let stroke = |t: f64| {
        let in_pulse = (0.0..0.008).contains(&t);
        if in_pulse { 100.0 * (std::f64::consts::PI * t / 0.008).sin() } else { 0.0 }
    };
    let one: Vec<[f64; 2]> = (0..PERIOD)
        .map(|k| {
            let t = k as f64 / RATE - 0.1;
            let part = |at: usize| {
                let tau = (at as f64 + 0.5) / (16.0 * RATE);
                let since = (t - tau).max(0.0);
                stroke(tau) * (-decay * since).exp() * (omega * since).sin()
            };
            let sum: f64 = (0..9 * 16).map(part).sum();
            [stroke(t), sum / (16.0 * RATE * 10.0 * omega)]
        })
        .collect();
    let of = |column: usize| -> Vec<f64> {
        strengths.iter().flat_map(|s| one.iter().map(move |v| s * v[column])).collect()
    };
    let sampling = Sampling::from_rate_hz(RATE, 8 * PERIOD).unwrap();
    let x = Record::from_channel(sampling, of(1)).unwrap();
    let x = noise::add_white(&x, NoiseLevel::FractionOfRms(0.01), 5).unwrap();
    let force = of(0);
    let columns = [("f", force.as_slice()), ("x", x.channel(0))];
    let channels = Channels::new("f", ResponseQuantity::Displacement, "x");
    let test = Measurement::from_columns(sampling, &columns, &channels).unwrap();
    test.period(PERIOD).unwrap()
}

#[test]
fn strokes_of_unequal_strength_are_no_periods() {
    let band = LineChoice::Band(Band { low_hz: 2.0, high_hz: 150.0 });
    let unequal = |found: &Identified| {
        let mut fractions = found.checks().iter().filter_map(|check| match check.finding {
            Finding::UnequalPeriods(UnequalPeriods { fraction }) => Some(fraction),
            _ => None,
        });
        fractions.next_back()
    };
    let how = |how: Identify| how.lines(band.clone());
    let strengths = [1.0, 0.7, 1.3, 0.9, 1.2, 0.8, 0.65, 1.1];
    let mean = strengths.iter().sum::<f64>() / 8.0;
    let largest = strengths.map(|s| (s / mean - 1.0).abs()).into_iter().fold(0.0, f64::max);
    let test = strokes(strengths);
    let found = identify(std::slice::from_ref(&test), &how(Identify::default())).unwrap();
    // The fraction that the check reports is somewhat larger than the true one, because the check
    // divides by the RMS without the constant part of the pulse.
    let told = unequal(&found).unwrap();
    assert!(told > largest && told < 1.1 * largest, "{told} for {largest}");
    assert_eq!(found.summary().fit.misfit_ratio, None);
    assert!(!tells(&found, Subject::Misfit), "{found}");
    // Frequency responses may be averaged over strokes of different strength.
    let found = identify(&[test], &how(from_frf())).unwrap();
    assert_eq!(unequal(&found), None);
    let equal = identify(&[strokes([1.0; 8])], &how(Identify::default())).unwrap();
    assert_eq!(unequal(&equal), None);
    assert!(tells(&equal, Subject::Misfit), "{equal}");
}

/// Noise of a load cell differs from period to period, but causes no response, so it must not be
/// reported as a difference of the periods.
#[test]
fn noise_on_the_force_is_no_difference_of_the_periods() {
    let (force, response) = steady(10);
    let force = noise::add_white(&force, NoiseLevel::FractionOfRms(0.2), 9).unwrap();
    let responses = [(ResponseQuantity::Displacement, response.displacement())];
    let test = Measurement::from_records(&force, &responses).unwrap().period(256).unwrap();
    let found = identify(&[test], &Identify::default()).unwrap();
    let unequal = |finding: &Finding| matches!(finding, Finding::UnequalPeriods(_));
    assert!(!found.checks().iter().any(|check| unequal(&check.finding)), "{found}");
}

/// The check of the sampling step uses the highest frequency that was identified.
#[test]
fn the_highest_mode_is_that_of_the_fit() {
    let (force, response) = steady(2);
    let responses = [
        (ResponseQuantity::Displacement, response.displacement()),
        (ResponseQuantity::Velocity, response.velocity()),
    ];
    let test = Measurement::from_records(&force, &responses).unwrap();
    for between in [Discretisation::FirstOrderHold, Discretisation::ZeroOrderHold] {
        let fit = SampleFit { between_samples: Some(between), ..SampleFit::default() };
        let how = Identify::from(Source::Samples(fit));
        let found = identify(std::slice::from_ref(&test), &how).unwrap();
        let told = found.checks().iter().find_map(|check| match check.finding {
            Finding::HighestMode(HighestMode { frequency_hz, .. }) => Some(frequency_hz),
            _ => None,
        });
        let fitted = found.summary().modes[0].row.natural_frequency_hz.value;
        assert!((told.unwrap() / fitted - 1.0).abs() < 1e-12, "{told:?} {fitted}");
    }
}

/// Reference: the receptance in closed form. The result lists the lines of the fit, with their
/// standard errors, only on request.
#[test]
fn the_lines_of_a_fit_are_given_on_request() {
    let test = displacements(10).period(256).unwrap();
    let system = oscillator().system();
    for how in [from_frf(), Identify::spectra(Method::MaximumLikelihood)] {
        let mut found = identify(std::slice::from_ref(&test), &how).unwrap();
        assert!(serde_json::to_value(&found).unwrap().get("fitted_lines").is_none());
        found.add_fitted_lines().unwrap();
        let lines = found.summary().fitted_lines.as_ref().unwrap();
        assert_eq!(lines.len(), 99);
        let (mut of_noise, mut of_fit) = (0.0, 0.0_f64);
        for line in lines {
            let complex = |[re, im]: [f64; 2]| nalgebra::Complex::new(re, im);
            let [force, measured, fitted, residual] =
                [&line.force, &line.measured, &line.fitted, &line.residual].map(|v| complex(v[0]));
            assert!((measured - fitted - residual).norm() <= 1e-12 * measured.norm());
            let exact = system.receptance(TAU * line.frequency_hz).unwrap()[(0, 0)] * force;
            let error = line.measured_standard_error.as_ref().unwrap()[0];
            of_noise += (measured - exact).norm_sqr() / (2.0 * error * error) / 99.0;
            of_fit = of_fit.max((fitted - exact).norm() / line.fitted_standard_error[0]);
            // Three parameters from 198 numbers: the fit is more accurate than the measurement.
            assert!(line.fitted_standard_error[0] < error, "{line:?}");
        }
        // The mean of 198 squared errors, each divided by a squared standard error with nine
        // degrees of freedom, is about 1 ± 0.6 (four standard deviations).
        assert!((0.5..1.7).contains(&of_noise), "{of_noise}");
        assert!(of_fit < 5.0, "{of_fit}");
        assert!(
            serde_json::to_value(&found).unwrap()["fitted_lines"][98]["residual"][0][1].is_f64()
        );
    }
    let (force, response) = steady(2);
    let responses = [
        (ResponseQuantity::Displacement, response.displacement()),
        (ResponseQuantity::Velocity, response.velocity()),
    ];
    let test = Measurement::from_records(&force, &responses).unwrap();
    let refused = identify(&[test], &Identify::samples()).unwrap().add_fitted_lines();
    assert!(matches!(refused, Err(AnalysisError::Setting { setting: "fitted_lines", .. })));
}
