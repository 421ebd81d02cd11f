//! Modes from tables of frequency responses in closed form: their checks, comparison and export.

use std::f64::consts::{PI, TAU};

use mechid_analysis::modes::{ModalCheck, ModalModeRow, ModalTest, Properties};
use mechid_analysis::{
    Channels, HitRule, Measurement, ModalSystem, ModeSet, Modes, ModesSettings, SavedAnalysis,
    compare_modes, modes_of_responses,
};
use mechid_io::{AveragedSegments, FrequencyResponses, NodalModes, ResponseFunction};
use mechid_model::ResponseQuantity::{self, Acceleration, Displacement};
use mechid_signal::Window;
use nalgebra::{Complex, DMatrix};
use rand::SeedableRng;
use rand_chacha::ChaCha20Rng;
use rand_distr::{Distribution, StandardNormal};

type C = Complex<f64>;

/// Natural frequencies, in Hz, and damping ratios.
const MODES: [(f64, f64); 3] = [(20.0, 0.01), (41.0, 0.015), (66.0, 0.008)];

/// Mass-normalised shapes at four points, one row per mode, in 1/√kg.
const SHAPES: [[f64; 4]; 3] = [[0.3, 0.5, 0.4, 0.2], [0.4, 0.1, -0.5, -0.3], [0.5, -0.4, 0.2, 0.6]];

/// Points at which the forces act.
pub const FORCES: [usize; 2] = [0, 3];

/// Receptance at s as a 4 × 2 matrix; the frequencies of the modes are multiplied by `factors`.
pub fn receptance(s: C, factors: [f64; 3]) -> DMatrix<C> {
    DMatrix::from_fn(4, 2, |i, j| {
        let of_mode = |mode: usize| {
            let (hz, zeta) = MODES[mode];
            let omega = TAU * hz * factors[mode];
            let gain = SHAPES[mode][i] * SHAPES[mode][FORCES[j]];
            C::from(gain) / (s * s + s * (2.0 * zeta * omega) + omega * omega)
        };
        (0..3).map(of_mode).sum()
    })
}

/// A table from 5 to 90 Hz with white noise, given as a part of the RMS of each response.
fn table(
    quantity: ResponseQuantity,
    spacing_hz: f64,
    noise: f64,
    seed: u64,
    response: impl Fn(f64) -> DMatrix<C>,
) -> FrequencyResponses {
    let mut rng = ChaCha20Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let first = (5.0 / spacing_hz) as usize;
    let frequency_hz: Vec<f64> =
        (first..(90.0 / spacing_hz) as usize).map(|k| spacing_hz * k as f64).collect();
    let exact: Vec<DMatrix<C>> = frequency_hz.iter().map(|hz| response(TAU * hz)).collect();
    let mut functions = Vec::new();
    for (j, force) in FORCES.iter().enumerate() {
        for i in 0..4 {
            let power = exact.iter().map(|h| h[(i, j)].norm_sqr()).sum::<f64>();
            let level = noise * (power / exact.len() as f64 / 2.0).sqrt();
            functions.push(ResponseFunction {
                response: format!("{}+Z", i + 1),
                reference: format!("{}+Z", force + 1),
                quantity: Some(quantity),
                values: exact
                    .iter()
                    .map(|h| h[(i, j)] + C::new(normal(), normal()) * level)
                    .collect(),
                standard_error: None,
            });
        }
    }
    FrequencyResponses { file: "table".into(), frequency_hz, functions, ..Default::default() }
}

pub fn plain(factors: [f64; 3], seed: u64) -> FrequencyResponses {
    table(Displacement, 0.05, 0.01, seed, |omega| receptance(C::new(0.0, omega), factors))
}

pub fn modes(table: &FrequencyResponses) -> Modes {
    modes_of_responses(std::slice::from_ref(table), &ModesSettings::default()).unwrap()
}

/// Asserts that frequencies and damping ratios are within five standard errors plus `bias` times
/// the damping ratio.
fn are_true(rows: &[ModalModeRow], bias: f64) {
    assert_eq!(rows.len(), MODES.len());
    for (row, (hz, zeta)) in rows.iter().zip(MODES) {
        let [f, damping] = [row.mode.row.natural_frequency_hz, row.mode.row.damping_ratio];
        let error = f.standard_error.unwrap();
        assert!((f.value - hz).abs() < 5.0 * error + bias * zeta * hz, "{f:?} {hz}");
        let error = damping.standard_error.unwrap();
        assert!((damping.value - zeta).abs() < 5.0 * error + bias * zeta, "{damping:?} {zeta}");
        assert!(error < 0.02 * zeta, "{damping:?}");
    }
}

/// Asserts that the modal masses are within 2 % of those of [`SHAPES`].
fn masses_are_true(found: &Modes) {
    for (row, shape) in found.summary().modes.iter().zip(SHAPES) {
        let largest = shape.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let mass = row.modal_mass.unwrap();
        assert!((mass * largest * largest - 1.0).abs() < 0.02, "{mass}");
    }
}

fn failed(modes: &Modes) -> Vec<&ModalCheck> {
    modes.summary().checks.iter().filter(|check| !check.passed).collect()
}

#[test]
fn a_table_gives_modes_masses_and_good_checks() {
    let found = modes(&plain([1.0; 3], 1));
    are_true(&found.summary().modes, 0.0);
    assert!(failed(&found).is_empty(), "{found}");
    masses_are_true(&found);
    let diagrams = found.diagrams().unwrap();
    let stable = diagrams.stabilisation.is_stable.iter().filter(|stable| **stable).count();
    assert!(stable > 20, "{stable}");
    let indicator = diagrams.mode_indicator.unwrap();
    assert!(indicator.is_measured && indicator.singular_values.len() == 2);
    let peak = (0..indicator.frequency_hz.len()).max_by(|a, b| {
        indicator.singular_values[0][*a].total_cmp(&indicator.singular_values[0][*b])
    });
    let peak = indicator.frequency_hz[peak.unwrap()];
    assert!(MODES.iter().any(|(hz, _)| (peak - hz).abs() < 0.2), "{peak}");
}

/// Reference: a response measured under the window e^(−σt) at the frequency ω equals the response
/// without a window at s = jω + σ.
#[test]
fn the_decay_of_an_exponential_window_is_subtracted() {
    const RATE: f64 = 2.5;
    let windowed = |omega: f64| {
        let s = C::new(RATE, omega);
        receptance(s, [1.0; 3]) * (s * s)
    };
    let mut table = table(Acceleration, 0.05, 0.01, 2, windowed);
    table.added_decay = Some(RATE);
    let found = modes(&table);
    are_true(&found.summary().modes, 0.0);
    assert!(found.summary().notes.iter().any(|note| note.contains("exponential window")));
    table.added_decay = None;
    let wrong = modes(&table).summary().modes[0].mode.row.damping_ratio.value;
    assert!(wrong > 2.0 * MODES[0].1, "{wrong}");
}

/// Reference: an average over Hann segments of a random force gives the response smoothed by |W|²,
/// where W is the spectrum of the window; this has a closed form.
#[test]
fn what_a_hann_window_blunts_is_subtracted() {
    const SPACING: f64 = 0.2;
    let weight = |lines: f64| {
        let sinc = if lines == 0.0 { 1.0 } else { (PI * lines).sin() / (PI * lines) };
        let tail = 1.0 - lines * lines;
        if tail.abs() < 1e-9 { 0.25 } else { (sinc / tail).powi(2) }
    };
    let smoothed = |omega: f64| {
        let (mut sum, mut all) = (DMatrix::zeros(4, 2), 0.0);
        for step in -256..=256 {
            let lines = f64::from(step) / 32.0;
            let there = omega + TAU * SPACING * lines;
            sum += receptance(C::new(0.0, there), [1.0; 3]) * C::from(weight(lines));
            all += weight(lines);
        }
        sum / C::from(all)
    };
    let mut table = table(Displacement, SPACING, 0.002, 3, smoothed);
    let blunt = modes(&table).summary().modes[0].mode.row.damping_ratio.value;
    assert!(blunt > 1.05 * MODES[0].1, "{blunt}");
    table.segments = Some(AveragedSegments {
        samples: 1280,
        hop: 640,
        count: 200,
        window: Some(Window::Hann),
        sample_rate_hz: 256.0,
    });
    let found = modes(&table);
    are_true(&found.summary().modes, 2e-3);
    let leakage = found.summary().checks.iter().find(|check| check.code == "leakage").unwrap();
    assert!(leakage.passed && leakage.value > 1.0, "{leakage:?}");
}

fn check<'a>(modes: &'a Modes, code: &str) -> &'a ModalCheck {
    modes.summary().checks.iter().find(|check| check.code == code).unwrap()
}

#[test]
fn a_wrong_gain_and_a_wrong_sign_are_named() {
    let mut table = plain([1.0; 3], 4);
    let of_point = |function: &&mut ResponseFunction| function.response == "4+Z";
    for function in table.functions.iter_mut().filter(of_point) {
        function.values.iter_mut().for_each(|value| *value *= 1.03);
    }
    let found = modes(&table);
    assert!(!check(&found, "reciprocity").passed && check(&found, "driving_point").passed);
    for function in table.functions.iter_mut().filter(of_point) {
        function.values.iter_mut().for_each(|value| *value *= -1.0 / 1.03);
    }
    let found = modes(&table);
    let signs: Vec<_> = failed(&found).into_iter().map(|check| check.code).collect();
    assert!(signs.contains(&"driving_point") && signs.contains(&"reciprocity"), "{found}");
}

/// A sensor that measures only noise, a thousandth of its former level, is named once. On correct
/// data every sensor passes, and no check that passes has words of a failure in its text.
#[test]
fn a_sensor_that_moves_in_no_mode_is_named() {
    let right = plain([1.0; 3], 5);
    let found = modes(&right);
    let passed = found.summary().checks.iter().filter(|check| check.passed);
    let complaints = ["leave", "not measured", "negative modal", "wrong"];
    for check in passed {
        assert!(complaints.iter().all(|words| !check.text.contains(words)), "{check:?}");
    }
    let mut table = right;
    let mut rng = ChaCha20Rng::seed_from_u64(9);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    for function in table.functions.iter_mut().filter(|f| f.response == "2+Z") {
        let size = 1e-3 * function.values.iter().map(|z| z.norm()).sum::<f64>();
        let size = size / function.values.len() as f64;
        function.values.iter_mut().for_each(|z| *z = C::new(normal(), normal()) * size);
    }
    let found = modes(&table);
    let failed = failed(&found);
    assert_eq!(failed.len(), 1, "{found}");
    assert!(failed[0].code == "idle_response" && failed[0].text.contains("2+Z"), "{found}");
}

/// Reference: the closed form, with all displacements 1 ms late. The estimated shapes are complex
/// because of the delay. The check of the driving points finds the delay, and the masses are those
/// of the structure.
#[test]
fn a_delay_of_displacements_is_named_and_does_not_change_the_masses() {
    let delay = 1e-3;
    let late =
        |omega: f64| receptance(C::new(0.0, omega), [1.0; 3]) * C::new(0.0, -delay * omega).exp();
    let found = modes(&table(Displacement, 0.05, 0.01, 7, late));
    masses_are_true(&found);
    assert!(found.summary().model.as_ref().unwrap().delays.is_empty());
    let delays: Vec<_> = failed(&found).into_iter().map(|check| check.code).collect();
    assert_eq!(delays, ["delay", "delay"], "{found}");
    let text = &check(&found, "delay").text;
    let size: f64 = text.split(" is ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(
        (size / 1e3 / delay - 1.0).abs() < 0.02 && text.contains("ms late relative to"),
        "{text}"
    );
}

/// Reference: the closed form, with all accelerations 1 ms late. The delay is part of the model,
/// the masses are those of the structure, and predictions contain the delay.
#[test]
fn a_delay_of_accelerations_is_part_of_the_model() {
    let delay = 1e-3;
    let late = |omega: f64| {
        let turn = C::new(0.0, -delay * omega).exp() * (-omega * omega);
        receptance(C::new(0.0, omega), [1.0; 3]) * turn
    };
    let found = modes(&table(Acceleration, 0.05, 0.01, 7, late));
    masses_are_true(&found);
    assert!(failed(&found).is_empty(), "{found}");
    let model = found.summary().model.as_ref().unwrap();
    assert!(model.delays.iter().all(|found| (found / delay - 1.0).abs() < 1e-2), "{model:?}");
    let named = |note: &&String| note.contains("part of the model") && note.contains(" ms late");
    assert_eq!(found.summary().notes.iter().filter(named).count(), 1, "{found}");
    for hz in [20.1, 41.3, 66.2] {
        let (modelled, exact) = (model.response(TAU * hz), late(TAU * hz));
        assert!((&modelled - &exact).norm() < 0.01 * exact.norm(), "{hz}: {modelled} {exact}");
    }
}

/// Reference: H = ψψᵀ/(ω_r²(1 + jη) − ω²), whose residues have phases of −η/2 in every mode. The
/// checks must not report this phase as a delay.
#[test]
fn structural_damping_is_no_delay() {
    for seed in 0..2 {
        let structural = |omega: f64| {
            DMatrix::from_fn(4, 2, |i, j| {
                let of_mode = |mode: usize| {
                    let (hz, zeta) = MODES[mode];
                    let gain = SHAPES[mode][i] * SHAPES[mode][FORCES[j]];
                    C::from(gain) / (C::new(1.0, 2.0 * zeta) * (TAU * hz).powi(2) - omega * omega)
                };
                (0..3).map(of_mode).sum()
            })
        };
        let found = modes(&table(Displacement, 0.05, 0.01, seed, structural));
        assert!(failed(&found).is_empty(), "{seed}: {:?}", failed(&found));
    }
}

/// On correct tables the p-value of the reciprocity check is rarely small, because the check is
/// conservative.
#[test]
fn right_tables_rarely_fail_the_tests() {
    for seed in 10..16 {
        let found = modes(&plain([1.0; 3], seed));
        let named: Vec<_> = failed(&found).into_iter().map(|check| &check.text).collect();
        assert!(named.is_empty(), "{seed}: {named:?}");
    }
}

/// Returns three lists of errors, each divided by its standard error: the errors of the
/// mass-normalised shapes at the responses, of the mass-normalised shapes at the forces, and of the
/// MAC of each pair of modes. The reference is [`SHAPES`].
fn scaled_errors(found: &Modes) -> [Vec<f64>; 3] {
    let (mut of_shapes, mut at_forces, mut of_mac) = (Vec::new(), Vec::new(), Vec::new());
    let norm = |shape: &[f64; 4]| shape.iter().map(|x| x * x).sum::<f64>();
    for (at, (row, shape)) in found.summary().modes.iter().zip(SHAPES).enumerate() {
        let larger = |a: &f64, b: &f64| a.abs().total_cmp(&b.abs());
        let sign = shape.into_iter().max_by(larger).unwrap().signum();
        let ratios = |value: [f64; 2], error: Option<[f64; 2]>, truth: f64| {
            let [re, im] = error.unwrap();
            let imaginary = (im > 0.0).then(|| value[1] / im);
            std::iter::once((value[0] - sign * truth) / re).chain(imaginary)
        };
        for (entry, truth) in row.mass_normalised_shape.iter().zip(shape) {
            of_shapes.extend(ratios(entry.value, entry.standard_error, truth));
        }
        for (entry, point) in row.mass_normalised_shape_at_forces.iter().zip(FORCES) {
            at_forces.extend(ratios(entry.value, entry.standard_error, shape[point]));
        }
        for (other, another) in SHAPES[..at].iter().enumerate() {
            let product: f64 = shape.iter().zip(another).map(|(a, b)| a * b).sum();
            let truth = product * product / (norm(&shape) * norm(another));
            let error = found.summary().mac_standard_error[at][other];
            of_mac.push((found.summary().mac[at][other] - truth) / error);
        }
        assert!(row.phase_collinearity_standard_error.unwrap() < 0.05);
    }
    [of_shapes, at_forces, of_mac]
}

/// Returns the modes of a table; the fit imposes real shapes and reciprocity.
fn with_properties(table: &FrequencyResponses) -> Modes {
    let properties = Properties { real_shapes: true, reciprocal: true };
    let settings = ModesSettings { properties, ..ModesSettings::default() };
    modes_of_responses(std::slice::from_ref(table), &settings).unwrap()
}

/// Reference: the masses of [`SHAPES`], whose damping is proportional. On correct tables both
/// properties (real shapes and reciprocity) pass their checks, the intervals of the masses contain
/// the true values, and their standard errors become smaller. The standard errors of scaled shapes
/// and of the MAC agree with the scatter. A phase error of one sensor contradicts real shapes, and
/// a wrong gain contradicts reciprocity; a contradicted property is not imposed.
#[test]
fn known_properties_of_a_structure_are_imposed_unless_the_modes_contradict_them() {
    let noisy = |seed: u64, change: &dyn Fn(usize) -> C| {
        let mut table = table(Acceleration, 0.1, 0.2, seed, |omega| {
            let s = C::new(0.0, omega);
            receptance(s, [1.0; 3]) * (s * s)
        });
        for (at, function) in table.functions.iter_mut().enumerate() {
            function.values.iter_mut().for_each(|value| *value *= change(at % 4));
        }
        table
    };
    let (mut failed_checks, mut inside, mut ratios) = (0, 0, Vec::new());
    let (mut of_shapes, mut at_forces, mut of_mac) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 0..20 {
        let table = noisy(seed, &|_| C::from(1.0));
        let (free, imposed) = (modes(&table), with_properties(&table));
        failed_checks += ["real_shapes", "reciprocity"]
            .into_iter()
            .filter(|code| !check(&imposed, code).passed)
            .count();
        let [shapes, forces, mac] = scaled_errors(&free);
        of_shapes.extend(shapes);
        at_forces.extend(forces);
        of_mac.extend(mac);
        let rows = free.summary().modes.iter().zip(&imposed.summary().modes);
        for ((free, imposed), shape) in rows.zip(SHAPES) {
            let largest = shape.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
            let [before, error] = [free, imposed].map(|row| row.modal_mass_standard_error.unwrap());
            let mass = imposed.modal_mass.unwrap();
            inside += usize::from((mass - 1.0 / (largest * largest)).abs() < 1.96 * error);
            ratios.push(error / before);
        }
    }
    assert!(failed_checks <= 1, "{failed_checks} of 40");
    // The limit is three standard deviations below the expected number, 57 of 60 intervals that
    // contain the true value.
    assert!(inside >= 52, "{inside} of 60");
    let rms =
        |ratios: &[f64]| (ratios.iter().map(|r| r * r).sum::<f64>() / ratios.len() as f64).sqrt();
    // The limits are three standard deviations of the RMS of 420 and of 60 ratios.
    assert!(of_shapes.len() == 420 && (0.9..1.1).contains(&rms(&of_shapes)), "{of_shapes:?}");
    // The ratios at the two points of a mode are correlated, so all ratios together count as only
    // 100 independent ones. The limits are three standard deviations of the RMS of 100 independent
    // ratios.
    assert!(at_forces.len() >= 180 && (0.79..1.21).contains(&rms(&at_forces)), "{at_forces:?}");
    assert!(of_mac.len() == 60 && (0.73..1.27).contains(&rms(&of_mac)), "{of_mac:?}");
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!(mean < 0.95 && ratios.iter().all(|ratio| *ratio < 1.02), "{mean}, {ratios:?}");

    let table = noisy(30, &|point| C::from_polar(1.0, if point == 1 { 0.1 } else { 0.0 }));
    let phased = with_properties(&table);
    assert!(!check(&phased, "real_shapes").passed && check(&phased, "reciprocity").passed);
    let table = noisy(31, &|point| C::from(if point == 3 { 1.1 } else { 1.0 }));
    let wrong_gain = with_properties(&table);
    assert!(check(&wrong_gain, "real_shapes").passed && !check(&wrong_gain, "reciprocity").passed);
    let settings = ModesSettings {
        properties: Properties { reciprocal: true, ..Properties::default() },
        ..ModesSettings::default()
    };
    let mut table = noisy(32, &|_| C::from(1.0));
    table.functions.truncate(4);
    let error = modes_of_responses(&[table], &settings).unwrap_err().to_string();
    assert!(error.contains("`reciprocal`") && error.contains("there are 1"), "{error}");
}

#[test]
fn a_force_that_drives_nothing_is_named() {
    let mut table = plain([1.0; 3], 5);
    let mut rng = ChaCha20Rng::seed_from_u64(6);
    for function in table.functions.iter_mut().filter(|function| function.reference == "4+Z") {
        for value in &mut function.values {
            let part = |rng: &mut ChaCha20Rng| -> f64 { StandardNormal.sample(rng) };
            *value = C::new(part(&mut rng), part(&mut rng)) * 1e-6;
        }
    }
    let found = modes(&table);
    let idle: Vec<_> = failed(&found).into_iter().filter(|c| c.code == "idle_force").collect();
    assert!(idle.len() == 1 && idle[0].text.contains("force 4+Z"), "{found}");
}

/// Reference: the second mode of the second structure is 1 % higher, and everything else is the
/// same.
#[test]
fn a_comparison_names_the_mode_that_changed() {
    let first = modes(&plain([1.0; 3], 7));
    let second = modes(&plain([1.0, 1.01, 1.0], 8));
    let [a, b] = [&first, &second].map(|modes| ModeSet::from_summary(modes.summary()).unwrap());
    let comparison = compare_modes(&a, &b).unwrap();
    assert_eq!(comparison.points.len(), 4);
    assert_eq!(comparison.pairs.len(), 3);
    for (at, pair) in comparison.pairs.iter().enumerate() {
        assert_eq!((pair.first, pair.second), (at + 1, at + 1));
        assert!(pair.mac > 0.9999, "{}", pair.mac);
        let p = pair.natural_frequency_hz.p_value.unwrap();
        assert_eq!(p < 0.01, at == 1, "{pair:?}");
        assert!(pair.damping_ratio.unwrap().p_value.unwrap() > 0.01, "{pair:?}");
        assert!(pair.shape_p_value.unwrap() > 0.01, "{pair:?}");
    }
    let text = comparison.to_string();
    assert!(text.contains("modes 2 – 2: different frequency"), "{text}");
    // A saved result is compared like the result itself; results without a common point are
    // refused.
    let saved = ModeSet::from_json("saved", serde_json::to_value(&second).unwrap()).unwrap();
    assert_eq!(compare_modes(&a, &saved).unwrap().pairs.len(), 3);
    let mut elsewhere = saved;
    elsewhere.points.iter_mut().for_each(|point| point.push('x'));
    let error = compare_modes(&a, &elsewhere).unwrap_err();
    assert_eq!(error.code(), "analysis.no-common-point");
}

/// A misspelt field is refused. A list of names is refused if its length differs from the number of
/// entries of each shape.
#[test]
fn frequencies_and_shapes_alone_are_read_strictly() {
    let set = |text: &str| ModeSet::from_json("model", serde_json::from_str(text).unwrap());
    let shape = r#""shape": [{"value": [1, 0]}, {"value": [0.5, 0]}]"#;
    let mode = format!(r#"{{"natural_frequency_hz": {{"value": 12}}, {shape}}}"#);
    let right = set(&format!(r#"{{"modes": [{mode}], "response_names": ["a", "b"]}}"#)).unwrap();
    assert_eq!(right.points, ["a", "b"]);
    assert_eq!(set(&format!(r#"{{"modes": [{mode}]}}"#)).unwrap().points, ["1", "2"]);
    for (wrong, word) in [
        (format!(r#"{{"modes": [{mode}], "points": ["a", "b"]}}"#), "\"points\""),
        (format!(r#"{{"modes": [{mode}], "response_names": ["a"]}}"#), "1 names"),
        (r#"{"modes": [{"frequency_hz": {"value": 12}, "shape": []}]}"#.into(), "\"frequency_hz\""),
        (r#"{"modes": {"test": {"forced": {}}}}"#.into(), "its modes are not a list"),
    ] {
        let error = set(&wrong).unwrap_err();
        assert_eq!(error.code(), "analysis.saved-modes");
        assert!(error.to_string().contains(word), "{error}");
        let as_system = ModalSystem::from_json("model", serde_json::from_str(&wrong).unwrap());
        let error = as_system.unwrap_err().to_string();
        assert!(!error.contains("missing field") && !error.contains("`modes`"), "{error}");
    }
}

/// Reference: the exact shapes of a model with more nodes and directions than the test; one sensor
/// of the test points against its direction.
#[test]
fn a_finite_element_model_is_compared_at_the_common_points() {
    let mut file = String::new();
    for (number, ((hz, _), shape)) in (1..).zip(MODES.iter().zip(SHAPES)) {
        file += "    -1\n    55\nmodel\nNONE\nNONE\nNONE\nNONE\n";
        file += &format!("{:10}{:10}{:10}{:10}{:10}{:10}\n", 1, 2, 2, 8, 2, 3);
        file += &format!("{:10}{:10}{:10}{number:10}\n", 2, 4, 1);
        file += &format!("{:13.5e}{:13.5e}{:13.5e}{:13.5e}\n", hz * 1.02, 1.0, 0.0, 0.0);
        for (node, value) in (1..).zip(shape) {
            file += &format!("{node:10}\n{:13.5e}{:13.5e}{:13.5e}\n", 0.0, 0.1, value);
        }
        file += &format!("{:10}\n{:13.5e}{:13.5e}{:13.5e}\n    -1\n", 9, 0.0, 0.1, 0.3);
    }
    let nodal = NodalModes::parse("model.unv", &file).unwrap();
    assert_eq!(nodal.points.len(), 10, "{:?}", nodal.points);
    let mut test = ModeSet::from_summary(modes(&plain([1.0; 3], 9)).summary()).unwrap();
    test.points[3] = "4-Z".into();
    test.modes.truncate(2);
    let model = ModeSet::from_nodal(&nodal).unwrap();
    let comparison = compare_modes(&test, &model).unwrap();
    assert_eq!(comparison.points, ["1+Z", "2+Z", "3+Z", "4-Z"]);
    // If the sign of the fourth entry is wrong, the shapes differ; if it is right, they agree.
    assert!(comparison.mac[0][0] < 0.95, "{:?}", comparison.mac);
    test.points[3] = "4+Z".into();
    let comparison = compare_modes(&test, &model).unwrap();
    assert_eq!((comparison.pairs.len(), comparison.only_second.len()), (2, 1));
    for (at, pair) in comparison.pairs.iter().enumerate() {
        assert!(pair.mac > 0.9999 && pair.damping_ratio.is_none(), "{pair:?}");
        let difference = pair.natural_frequency_hz.difference;
        assert!((difference / MODES[at].0 - 0.02).abs() < 1e-4, "{difference}");
    }
}

/// Reference: the measured table. The fitted responses, written to a universal file and read back,
/// must agree with this table except for its noise.
#[test]
fn the_synthesis_is_read_back_from_a_universal_file() {
    let measured = plain([1.0; 3], 11);
    let found = modes(&measured);
    let text = found.synthesis().unwrap().to_universal_file().unwrap();
    let read = FrequencyResponses::parse("synthesis.unv", text.as_bytes()).unwrap();
    assert_eq!(read.functions.len(), 8);
    for function in &read.functions {
        assert_eq!(function.quantity, Some(Displacement));
        let of_pair = |f: &&ResponseFunction| {
            f.response == function.response && f.reference == function.reference
        };
        let original = measured.functions.iter().find(of_pair).unwrap();
        let power = |values: &mut dyn Iterator<Item = C>| values.map(|z| z.norm_sqr()).sum::<f64>();
        let pairs = original.values.iter().zip(&function.values);
        let rest = power(&mut pairs.map(|(a, b)| a - b));
        assert!(rest < 2e-4 * power(&mut original.values.iter().copied()), "{rest}");
    }
}

fn hammer(file: &str) -> std::path::PathBuf {
    std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(file)
}

/// Reference: the structure of the examples with modes at 12 Hz and 31 Hz; one of the two
/// accelerometers shows both modes.
#[test]
fn a_modal_test_is_an_analysis_of_many_records() {
    let analysis = SavedAnalysis {
        channels: Channels {
            force: vec!["force".into()],
            acceleration: vec!["a1".into(), "a2".into()],
            ..Channels::default()
        },
        modes: Some(ModesSettings {
            test: ModalTest::Forced { hits: Some(HitRule::default()) },
            band_hz: Some([2.0, 100.0]),
            ..ModesSettings::default()
        }),
        ..SavedAnalysis::default()
    };
    let row = analysis.row("hammer", || analysis.open(hammer("hammer-1.csv")));
    assert_eq!(row.error, None);
    let frequencies: Vec<f64> = row.modes.iter().map(|mode| mode.natural_frequency_hz).collect();
    assert_eq!(frequencies.len(), 2, "{frequencies:?}");
    assert!((frequencies[0] - 12.0).abs() < 0.01 && (frequencies[1] - 31.0).abs() < 0.01);
    assert!(row.unexplained_motion.unwrap() < 0.05 && row.parameters.is_empty());
    let saved = serde_json::to_string(&analysis).unwrap();
    assert_eq!(serde_json::from_str::<SavedAnalysis>(&saved).unwrap(), analysis);
    let without = SavedAnalysis { channels: Channels::default(), ..analysis };
    assert!(without.check().is_err());
}

#[test]
fn modes_predict_a_record_that_was_not_fitted() {
    let settings = ModesSettings {
        test: ModalTest::Forced { hits: Some(HitRule::default()) },
        band_hz: Some([2.0, 100.0]),
        ..ModesSettings::default()
    };
    let channels = Channels::new("force", Acceleration, "a1");
    let open = |file: &str| Measurement::open(hammer(file), &channels).unwrap();
    let mut found = mechid_analysis::modes(&[open("hammer-1.csv")], &settings).unwrap();
    let same = found.predict(&[open("hammer-1.csv")]).unwrap()[0];
    // In the second record the hammer struck another point, so the fit to the first record does not
    // predict the second record.
    let other = found.predict(&[open("hammer-2.csv")]).unwrap()[0];
    assert!(same > 0.999 && other < 0.9, "{same} {other}");
    found.add_validation(&[open("hammer-1.csv")]).unwrap();
    assert_eq!(found.summary().variance_predicted, Some(same));
    assert!(check(&found, "predicted").passed);
}

/// A test of two records with hits at different points, so each half of the test has one force. The
/// modes of the halves must agree.
#[test]
fn the_halves_of_a_roving_hammer_test_agree() {
    let mut settings = ModesSettings {
        test: ModalTest::Forced { hits: Some(HitRule::default()) },
        band_hz: Some([2.0, 100.0]),
        ..ModesSettings::default()
    };
    settings.places.forces = vec!["1".into(), "2".into()];
    let channels = Channels::new("force", Acceleration, "a1");
    let records = ["hammer-1.csv", "hammer-2.csv"]
        .map(|file| Measurement::open(hammer(file), &channels).unwrap());
    let found = mechid_analysis::modes(&records, &settings).unwrap();
    let halves = check(&found, "halves");
    assert!(halves.passed && halves.text.contains("of the hits agree"), "{}", halves.text);
}
