//! Identification from tables of frequency responses. The references are receptances in closed
//! form, and fits of the records that were used to compute the tables.

use std::f64::consts::TAU;

use mechid_analysis::identify::{Band, Method, PeriodEstimator, PeriodFit, Source};
use mechid_analysis::{
    AnalysisError, Channels, FrfSettings, Identify, IdentifyResponses, Measurement,
    ResponseQuantity, frf, identify, identify_responses,
};
use mechid_checks::Subject;
use mechid_estimate::Estimate;
use mechid_io::{CoherenceFunction, FrequencyResponses, ResponseFunction};
use mechid_model::{Sdof, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Multisine, NoiseLevel, Phases, Sampling, lines, noise};
use mechid_spectra::{NoiseModel, Pooling};
use nalgebra::{Complex, dmatrix};

fn oscillator() -> SecondOrderSystem {
    Sdof::new(25.0, 188.0, 142_000.0).unwrap().system()
}

/// Two degrees of freedom with C and K that are not symmetric, as of an oil film.
fn coupled() -> SecondOrderSystem {
    let (c, k) = (dmatrix![900.0, 300.0; 200.0, 1500.0], dmatrix![3e5, 2e5; -1e5, 5e5]);
    SecondOrderSystem::new(dmatrix![20.0, 0.5; -0.3, 21.0], c, k).unwrap()
}

/// Exact responses at 5, 7 … 83 Hz to each of the forces.
fn exact(system: &SecondOrderSystem, quantity: ResponseQuantity) -> FrequencyResponses {
    let frequency_hz: Vec<f64> = (0..40).map(|k| 5.0 + 2.0 * f64::from(k)).collect();
    let at = |hz: &f64| {
        let omega = TAU * hz;
        system.receptance(omega).unwrap() * quantity.per_displacement(omega)
    };
    let all: Vec<_> = frequency_hz.iter().map(at).collect();
    let n = system.dof();
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let functions = pairs.map(|(i, j)| ResponseFunction {
        response: format!("{}", i + 1),
        reference: format!("{}", j + 1),
        quantity: Some(quantity),
        values: all.iter().map(|h| h[(i, j)]).collect(),
        standard_error: None,
    });
    let file = "table".into();
    let functions = functions.collect();
    FrequencyResponses { file, frequency_hz, functions, ..FrequencyResponses::default() }
}

fn entries(system: &SecondOrderSystem) -> Vec<f64> {
    let all = [system.mass(), system.damping(), system.stiffness()];
    all.iter().flat_map(|m| m.transpose().iter().copied().collect::<Vec<_>>()).collect()
}

#[test]
fn exact_tables_give_the_machine_whatever_was_measured() {
    for system in [oscillator(), coupled()] {
        for quantity in ResponseQuantity::ALL {
            for method in [Method::LeastSquares, Method::MaximumLikelihood] {
                let how =
                    IdentifyResponses { method: Some(method), ..IdentifyResponses::default() };
                let found = identify_responses(&[exact(&system, quantity)], &how).unwrap();
                for (p, exact) in found.estimate().parameters().zip(entries(&system)) {
                    assert!((p.value - exact).abs() < 1e-9 * exact.abs().max(1.0), "{p} {exact}");
                }
            }
        }
    }
}

/// Averages with the same coherence on all lines have noise in proportion to the response; other
/// tables have the same noise on all lines. If the table does not state its noise, the residual
/// shows the kind of noise, and the intervals contain the true values.
#[test]
fn intervals_hold_whatever_the_noise_of_a_table_follows() {
    let system = Sdof::new(5.0, 34.0, 64_000.0).unwrap().system();
    let quantity = ResponseQuantity::Acceleration;
    let sampling = Sampling::new(1.0, 160).unwrap();
    for (white, relative) in [(0.0, 0.005), (0.002, 0.0), (0.002, 0.005)] {
        let (mut held, mut kinds, mut warned) = (0, [0; 2], 0);
        for seed in 0..60 {
            let mut table = exact(&system, quantity);
            table.frequency_hz = (1..=160).map(|k| 0.25 * f64::from(k)).collect();
            let drawn = noise::white(sampling, 4, 0.5f64.sqrt(), seed).unwrap();
            let value = |(row, hz): (usize, &f64)| {
                let omega = TAU * hz;
                let h =
                    system.receptance(omega).unwrap()[(0, 0)] * quantity.per_displacement(omega);
                let z =
                    |at: usize| Complex::new(drawn.channel(at)[row], drawn.channel(at + 1)[row]);
                h + z(0) * white + z(2) * (relative * h.norm())
            };
            let values: Vec<Complex<f64>> =
                table.frequency_hz.iter().enumerate().map(value).collect();
            table.functions[0].values = values;
            let found = identify_responses(&[table], &IdentifyResponses::default()).unwrap();
            let checks = &found.summary().checks;
            warned += u32::from(checks.iter().any(|check| check.is_conspicuous()));
            for (p, exact) in found.estimate().parameters().zip(entries(&system)) {
                held += u32::from((p.value - exact).abs() < 1.96 * p.standard_error);
            }
            let is_relative = found
                .summary()
                .fit
                .noise
                .iter()
                .any(|model| matches!(model, NoiseModel::Proportional { .. }));
            kinds[usize::from(is_relative)] += 1;
        }
        // On average 171 of 180 intervals contain the true value, with a standard deviation of 3.
        assert!(held >= 161, "{white} {relative}: {held} of 180, {kinds:?}");
        assert!(kinds[usize::from(relative > 0.0)] >= 55, "{white} {relative}: {kinds:?}");
        // At a rate of 1 % for all checks of a table together, the probability of warnings for more
        // than four of 60 tables is 4e-4.
        assert!(warned <= 4, "{white} {relative}: {warned}");
    }
}

/// A delay of 2 ms moves the parameters by hundreds of their standard errors. The check must name
/// the delay, and the intervals must contain the true values.
#[test]
fn intervals_of_late_responses_include_the_delay() {
    let system = oscillator();
    let quantity = ResponseQuantity::Acceleration;
    for stated in [None, Some(1e-4)] {
        let mut table = exact(&system, quantity);
        let sampling = Sampling::new(1.0, table.frequency_hz.len()).unwrap();
        let drawn = noise::white(sampling, 2, 1e-4, 3).unwrap();
        let function = &mut table.functions[0];
        for (row, hz) in table.frequency_hz.iter().enumerate() {
            let error = Complex::new(drawn.channel(0)[row], drawn.channel(1)[row]);
            function.values[row] = function.values[row] * Complex::cis(-TAU * hz * 2e-3) + error;
        }
        function.standard_error = stated.map(|level| vec![level; table.frequency_hz.len()]);
        let found = identify_responses(&[table], &IdentifyResponses::default()).unwrap();
        let checks = found.summary().checks.iter().filter(|check| check.is_conspicuous());
        assert!(checks.map(|check| check.subject).any(|s| s == Subject::Delay), "{found}");
        for (p, exact) in found.estimate().parameters().zip(entries(&system)) {
            assert!((p.value - exact).abs() < 1.96 * p.standard_error, "{p} {exact}: {found}");
        }
        assert!(
            found.to_string().contains("the model that explains the residual (check: delay)"),
            "{found}"
        );
    }
}

/// Mobilities that are read as accelerances, and a mass that changes by 2 % within the band: in
/// both cases the standard errors from the noise alone are far too small. The standard errors of
/// the result must be larger, and include the error due to the wrong model. Each interval must
/// contain the value of the machine or, if the mass changes, overlap the range between the values
/// of the two machines. Some intervals from the noise alone are too narrow for this.
#[test]
fn intervals_of_a_wrong_model_are_as_wide_as_its_error() {
    let system = oscillator();
    let quantity = ResponseQuantity::Acceleration;
    let heavier = Sdof::new(25.5, 188.0, 142_000.0).unwrap().system();
    let mobility = exact(&system, ResponseQuantity::Velocity);
    let mut changed = exact(&system, quantity);
    let upper = exact(&heavier, quantity);
    let middle = changed.frequency_hz.partition_point(|hz| *hz < 12.0);
    changed.functions[0].values[middle..].copy_from_slice(&upper.functions[0].values[middle..]);
    for (mut table, subject) in [(mobility, Subject::Alternative), (changed, Subject::Parts)] {
        let values = &mut table.functions[0].values;
        let errors: Vec<f64> = values.iter().map(|z| 1e-3 * z.norm()).collect();
        for ((value, error), z) in values.iter_mut().zip(&errors).zip(normal(errors.len(), 5)) {
            *value += z * *error;
        }
        table.functions[0].standard_error =
            Some(errors.iter().map(|error| error / 2_f64.sqrt()).collect());
        table.functions[0].quantity = Some(quantity);
        let found = identify_responses(&[table], &IdentifyResponses::default()).unwrap();
        let checks = found.summary().checks.iter().filter(|check| check.is_conspicuous());
        assert!(checks.map(|check| check.subject).any(|other| other == subject), "{found}");
        let scale = found.summary().fit.error_scale;
        assert!(scale > 3.0, "{found}");
        let mut missed = 0;
        let machines = entries(&system).into_iter().zip(entries(&heavier));
        for (p, (one, other)) in found.estimate().parameters().zip(machines) {
            let other = if subject == Subject::Parts { other } else { one };
            let distance = (p.value - one).abs().min((p.value - other).abs());
            let [low, high] = p.interval(0.95).unwrap();
            assert!(low < one.max(other) && high > one.min(other), "{p} {one} {other}: {found}");
            missed += usize::from(distance > 1.96 * p.standard_error / scale);
        }
        assert!(missed > 0, "{found}");
        let text = found.to_string();
        assert!(text.contains("times those of the noise alone"), "{text}");
    }
}

/// Reference: a response measured under a window exp(−σt) at the frequency ω equals the response of
/// the machine at s = iω + σ. This is tested for every measured quantity.
#[test]
fn the_decay_that_a_window_adds_is_taken_off() {
    let sigma = 4.3;
    for system in [oscillator(), coupled()] {
        for quantity in ResponseQuantity::ALL {
            let mut table = exact(&system, quantity);
            let n = system.dof();
            for (at, hz) in table.frequency_hz.iter().enumerate() {
                let s = Complex::new(sigma, TAU * hz);
                let dynamic = system.mass().map(|m| s * s * m)
                    + system.damping().map(|c| s * c)
                    + system.stiffness().map(Complex::from);
                let order = match quantity {
                    ResponseQuantity::Displacement => 0,
                    ResponseQuantity::Velocity => 1,
                    ResponseQuantity::Acceleration => 2,
                };
                let response = dynamic.lu().try_inverse().unwrap() * s.powi(order);
                for (number, function) in table.functions.iter_mut().enumerate() {
                    function.values[at] = response[(number / n, number % n)];
                }
            }
            let how = IdentifyResponses::default();
            let worst = |table: &FrequencyResponses| {
                let found = identify_responses(std::slice::from_ref(table), &how).unwrap();
                let pairs = found.estimate().parameters().zip(entries(&system));
                pairs.map(|(p, exact)| (p.value / exact - 1.0).abs()).fold(0.0, f64::max)
            };
            assert!(worst(&table) > 0.1, "a table that does not state its window");
            table.added_decay = Some(sigma);
            assert!(worst(&table) < 1e-8, "{quantity}: {}", worst(&table));
        }
    }
    // Known entries in `structure` are values of the machine, but the window adds the decay rate σ
    // to the data. The damping of the data is c + 2σm; a known damping therefore needs a known
    // mass.
    let mut table = exact(&oscillator(), ResponseQuantity::Displacement);
    table.added_decay = Some(sigma);
    let known = |form: &str| {
        let how = IdentifyResponses { structure: form.parse().unwrap(), ..Default::default() };
        identify_responses(std::slice::from_ref(&table), &how)
    };
    assert_eq!(known("m=25").unwrap().estimate().mass()[(0, 0)], 25.0);
    let error = known("c=188").unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { setting: "structure", .. }), "{error}");
    let other = exact(&oscillator(), ResponseQuantity::Displacement);
    let error = identify_responses(&[table.clone(), other], &Default::default()).unwrap_err();
    assert!(matches!(error, AnalysisError::Setting { .. }), "{error}");
}

/// Frequency responses of sixteen noisy periods in a text file and in a universal file: the fits of
/// the periods and of both files agree.
#[test]
fn a_record_and_its_table_agree() {
    let period = Sampling::from_rate_hz(128.0, 128).unwrap();
    let force = Multisine::flat(lines::band(period, 3.0, 40.0), 2.0, Phases::Schroeder).unwrap();
    let force = force.sample(period).unwrap();
    let exact = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let (force, x) = (force.repeated(16).unwrap(), exact.displacement().repeated(16).unwrap());
    let x = noise::add_white(&x, NoiseLevel::FractionOfRms(0.05), 7).unwrap();
    let responses = [(ResponseQuantity::Displacement, &x)];
    let test = Measurement::from_records(&force, &responses).unwrap().period(128).unwrap();
    // The noise is estimated line by line; the coherence of the table is also computed line by
    // line.
    let estimator = Some(PeriodEstimator::MaximumLikelihood(Pooling::PerLine));
    let how = Identify::from(Source::Periods(PeriodFit { estimator, ..PeriodFit::default() }));
    let of_record = identify(std::slice::from_ref(&test), &how).unwrap();
    let table = frf(&test, &FrfSettings::default()).unwrap();

    let text = FrequencyResponses::parse("a.csv", table.csv().as_bytes()).unwrap();
    let quantity = Some(ResponseQuantity::Displacement);
    let how = IdentifyResponses { quantity, ..IdentifyResponses::default() };
    let of_text = identify_responses(&[text], &how).unwrap();

    let universal = table.to_responses(&["7+Z".into()]).unwrap().to_universal_file().unwrap();
    let universal = FrequencyResponses::parse("a.unv", universal.as_bytes()).unwrap();
    let how = IdentifyResponses { averages: Some(16.0), ..IdentifyResponses::default() };
    let of_universal = identify_responses(&[universal], &how).unwrap();
    assert_eq!(of_universal.summary().points, ["7+Z"]);

    for found in [of_text.estimate(), of_universal.estimate()] {
        for (a, b) in of_record.estimate().parameters().zip(found.parameters()) {
            let apart = (a.value - b.value).abs() / a.standard_error;
            // The two fits estimate the noise from 15 deviations, on different lines. Their weights
            // therefore differ at random, which moves an estimate by about 1/√15 of its standard
            // error.
            assert!(apart < 0.8, "{a} against {b}");
            // The standard errors of the record are 7 % larger, because they allow for uncertain
            // weights. Both standard errors are known to about 15 %, because they depend on few
            // lines.
            let ratio = a.standard_error / b.standard_error;
            assert!((0.8..1.35).contains(&ratio), "{ratio}");
        }
    }
    let checks = &of_universal.summary().checks;
    assert!(!checks.is_empty() && checks.iter().all(|check| !check.is_conspicuous()));
}

/// The channels are named after points of a universal file, such as `12+Z`. The CSV table and the
/// universal file keep these points; points given by the caller replace them in the universal file.
#[test]
fn points_in_names_of_channels_are_kept() {
    let sampling = Sampling::from_rate_hz(128.0, 1024).unwrap();
    let force = noise::white(sampling, 1, 1.0, 3).unwrap();
    let force = force.channel(0).to_vec();
    let half: Vec<f64> = force.iter().map(|f| 0.5 * f).collect();
    let columns = [("3+Z", &force[..]), ("12+Z", &force[..]), ("7-X", &half[..])];
    let points = |force: &str, responses: &str, given: &[String]| {
        let channels = Channels::new(force, ResponseQuantity::Acceleration, responses);
        let named = [(force, columns[0].1), columns[1], columns[2]];
        let test = Measurement::from_columns(sampling, &named, &channels).unwrap();
        let table = frf(&test, &FrfSettings::default()).unwrap();
        let text = FrequencyResponses::parse("a.csv", table.csv().as_bytes()).unwrap();
        let universal = table.to_responses(given).unwrap().to_universal_file().unwrap();
        let universal = FrequencyResponses::parse("a.unv", universal.as_bytes()).unwrap();
        [text, universal].map(|table| {
            let functions = table.functions.iter();
            let pairs: Vec<String> =
                functions.map(|f| format!("{}/{}", f.response, f.reference)).collect();
            let coherence = table.coherence.iter().map(|c| c.response.clone());
            (pairs, coherence.collect::<Vec<_>>())
        })
    };
    let named = points("3+Z", "12+Z,7-X", &[]);
    for (pairs, coherence) in &named {
        assert_eq!(pairs, &["12+Z/3+Z", "7-X/3+Z"]);
        assert_eq!(coherence, &["12+Z", "7-X"]);
    }
    let [text, universal] = points("3+Z", "12+Z,7-X", &["1+Y".into(), "2+Y".into()]);
    assert_eq!((&text, &universal.0[1]), (&named[0], &"2+Y/1+Y".to_owned()));
    // The name of the force is not a point here; therefore all channels are numbered.
    let [text, universal] = points("hammer", "12+Z,7-X", &[]);
    assert_eq!((&text.0[1], &universal.0[1]), (&"2/1".to_owned(), &"2+X/1+X".to_owned()));
}

/// Three periods give two deviations per line, so neighbouring lines share their noise levels. The
/// mean square of 180 ratios of error to standard error has an expected value of about 1; it
/// scatters by about 0.15, because the errors of one record are correlated.
#[test]
fn tables_of_three_periods_know_their_noise() {
    let period = Sampling::from_rate_hz(128.0, 128).unwrap();
    let force = Multisine::flat(lines::band(period, 3.0, 40.0), 2.0, Phases::Schroeder).unwrap();
    let force = force.sample(period).unwrap();
    let exact = exact_harmonic_periodic(&oscillator(), &force).unwrap();
    let (force, x) = (force.repeated(3).unwrap(), exact.displacement().repeated(3).unwrap());
    let squares = |seed: u64| -> Vec<f64> {
        let x = noise::add_white(&x, NoiseLevel::FractionOfRms(0.02), seed).unwrap();
        let responses = [(ResponseQuantity::Displacement, &x)];
        let test = Measurement::from_records(&force, &responses).unwrap().period(128).unwrap();
        let table = frf(&test, &FrfSettings::default()).unwrap();
        let text = FrequencyResponses::parse("a.csv", table.csv().as_bytes()).unwrap();
        let found = identify_responses(&[text], &IdentifyResponses::default()).unwrap();
        let each = found.estimate().parameters().zip(entries(&oscillator()));
        each.map(|(p, exact)| ((p.value - exact) / p.standard_error).powi(2)).collect()
    };
    let all: Vec<f64> = (0..60).flat_map(squares).collect();
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    assert!((0.55..1.5).contains(&mean), "{mean}");
}

/// Numbers with a complex normal distribution and E|z|² = 1.
fn normal(count: usize, seed: u64) -> Vec<Complex<f64>> {
    let both = noise::white(Sampling::new(1.0, count).unwrap(), 2, 0.5_f64.sqrt(), seed).unwrap();
    (0..count).map(|k| Complex::new(both.channel(0)[k], both.channel(1)[k])).collect()
}

/// Share of the 95 % intervals that contain the true value, over all parameters.
fn coverage(
    system: &SecondOrderSystem,
    runs: u64,
    how: &IdentifyResponses,
    measure: &dyn Fn(FrequencyResponses, u64) -> FrequencyResponses,
) -> f64 {
    let truth = entries(system);
    let scaled = std::cell::Cell::new(0);
    let inside = |estimate: &Estimate| {
        let holds = |(p, exact): (mechid_estimate::Estimated, &f64)| {
            let [low, high] = p.interval(0.95).unwrap();
            usize::from((low..=high).contains(exact))
        };
        estimate.parameters().zip(&truth).map(holds).sum::<usize>()
    };
    let all = (0..runs).map(|seed| {
        let table = measure(exact(system, ResponseQuantity::Acceleration), seed);
        let found = identify_responses(&[table], how).unwrap();
        scaled.set(scaled.get() + u64::from(found.summary().fit.error_scale > 1.0));
        inside(found.estimate())
    });
    let share = all.sum::<usize>() as f64 / (runs as usize * truth.len()) as f64;
    // The data are correct; therefore at most 2 % of the fits may scale the standard errors by the
    // residual.
    assert!(50 * scaled.get() <= runs, "{} of {runs}", scaled.get());
    share
}

/// The share of intervals that contain the true value, in 500 runs with 12 parameters, scatters by
/// about 0.4 %.
#[test]
fn intervals_from_standard_errors_hold() {
    let measure = |mut table: FrequencyResponses, seed: u64| {
        let count = table.frequency_hz.len();
        for (at, function) in table.functions.iter_mut().enumerate() {
            // The noise grows towards low frequencies, as for an accelerometer below its range.
            let size = |row: usize| 1e-4 * (1.0 + 20.0 / (1.0 + row as f64));
            for (row, z) in normal(count, 10 * seed + at as u64).into_iter().enumerate() {
                function.values[row] += z * size(row);
            }
            let errors = (0..count).map(|row| size(row) / 2_f64.sqrt()).collect();
            function.standard_error = Some(errors);
        }
        table
    };
    let share = coverage(&coupled(), 500, &IdentifyResponses::default(), &measure);
    assert!((0.935..=0.965).contains(&share), "{share}");
}

/// The table has the averages of 64 noisy frequency responses, and their coherence; the force has
/// no noise. From 93.5 to 96.5 % of the 95 % intervals must contain the true value.
#[test]
fn intervals_from_coherence_hold() {
    let measure = |mut table: FrequencyResponses, seed: u64| {
        let (averages, level) = (64_usize, 4e-3);
        let count = table.frequency_hz.len();
        let draws = normal(count * averages, seed);
        let function = &mut table.functions[0];
        let mut coherence = Vec::new();
        for row in 0..count {
            let h = function.values[row];
            let each: Vec<_> =
                (0..averages).map(|k| h + draws[row * averages + k] * level).collect();
            let mean = each.iter().sum::<Complex<f64>>() / averages as f64;
            let power = each.iter().map(|z| z.norm_sqr()).sum::<f64>() / averages as f64;
            function.values[row] = mean;
            coherence.push(mean.norm_sqr() / power);
        }
        let (response, reference) = ("1".to_owned(), Some("1".to_owned()));
        table.coherence.push(CoherenceFunction { response, reference, values: coherence });
        table
    };
    let how = IdentifyResponses { averages: Some(64.0), ..IdentifyResponses::default() };
    let share = coverage(&oscillator(), 1000, &how, &measure);
    assert!((0.935..=0.965).contains(&share), "{share}");
}

#[test]
fn what_a_table_lacks_is_told() {
    let table = exact(&coupled(), ResponseQuantity::Velocity);
    let refused = |table: &FrequencyResponses, how: &IdentifyResponses| {
        identify_responses(std::slice::from_ref(table), how).unwrap_err().to_string()
    };
    let usual = IdentifyResponses::default();
    let mut nameless = table.clone();
    nameless.functions.iter_mut().for_each(|f| f.quantity = None);
    assert!(refused(&nameless, &usual).contains("does not say what was measured"));
    let other = Some(ResponseQuantity::Acceleration);
    let told = refused(&table, &IdentifyResponses { quantity: other, ..usual.clone() });
    assert!(told.contains("table states velocity, not acceleration"), "{told}");
    let mut gap = table.clone();
    gap.functions.remove(2);
    assert_eq!(
        refused(&gap, &usual),
        "table has no response at 2 to a force at 1: every point needs a response to every force, and \
         every force needs a response at its point (choose `points`)"
    );
    // If only point 2 is chosen, no response is missing from the table; the model then has one
    // degree of freedom instead of two.
    let alone = IdentifyResponses { points: vec!["2".into()], ..usual.clone() };
    assert_eq!(identify_responses(&[gap], &alone).unwrap().estimate().dof(), 1);
    let mut coherent = table.clone();
    for response in ["1", "2"] {
        let (response, values) = (response.to_owned(), vec![0.9; 40]);
        coherent.coherence.push(CoherenceFunction { response, reference: None, values });
    }
    assert!(refused(&coherent, &usual).contains("state their number of independent averages"));
    let band = Some(Band { low_hz: 100.0, high_hz: 200.0 });
    let how = IdentifyResponses { band, ..usual.clone() };
    assert!(matches!(identify_responses(&[table], &how), Err(AnalysisError::EmptyBand { .. })));
    assert!(matches!(identify_responses(&[], &usual), Err(AnalysisError::NoRecord)));
}
