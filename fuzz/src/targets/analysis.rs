//! Calls of `mechid-analysis`: complete analyses with settings drawn at random.

use std::fmt::Display;

use mechid_analysis::bearing::Coefficients;
use mechid_analysis::frf::{Estimator, Weight};
use mechid_analysis::identify::{
    Band, Between, Derivatives, HitFit, Method, Nonlinear, OpenFit, OpenNoise, PeriodEstimator,
    PeriodFit, Refinement, SampleFit, SegmentFit, Source, SpectralFit, TermEstimator, TermFit,
    ValidationWindow,
};
use mechid_analysis::reconstruct::Method as ForceMethod;
use mechid_analysis::reconstruct::ParameterRule;
use mechid_analysis::review::Review;
use mechid_analysis::{
    FrfSettings, Identified, Identify, IdentifyBearing, Machine, Measurement, ModalSummary,
    Predict, Reconstruct, Segmentation, Window, frf, identify, identify_bearing, predict,
    reconstruct,
};
use mechid_model::Discretisation;
use mechid_signal::Record;
use mechid_spectra::Pooling;

use super::draw::{Draw, passed};

/// Longest text of a result, in bytes.
const LONGEST_TEXT: usize = 100_000;

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    let Some(first) = measurement(d)? else { return Ok(()) };
    match d.below(8) {
        0 => responses(d, &first),
        1 | 2 => force(d, &first),
        3 => bearing(d, &first),
        _ => machine(d, first),
    }
}

fn measurement(d: &mut Draw) -> Result<Option<Measurement>, String> {
    let dof = 1 + d.below(2);
    let Some(sampling) = d.sampling()? else { return Ok(None) };
    let Some(force) = d.record(sampling, dof)? else { return Ok(None) };
    let mut responses = Vec::new();
    for _ in 0..1 + d.below(3) {
        let channels = d.dof(dof).max(1);
        let Some(response) = d.record(sampling, channels)? else { return Ok(None) };
        responses.push((d.quantity(), response));
    }
    let responses: Vec<_> = responses.iter().map(|(kind, record)| (*kind, record)).collect();
    let Some(measurement) = passed(Measurement::from_records(&force, &responses))? else {
        return Ok(None);
    };
    window(d, measurement)
}

fn window(d: &mut Draw, measurement: Measurement) -> Result<Option<Measurement>, String> {
    let window = Window {
        start: if d.one_in(4) { d.size() } else { 1 },
        periods: if d.one_in(4) { Some(d.size()) } else { None },
        period: match d.below(4) {
            0 => None,
            1 => Some(d.size()),
            _ => Some(measurement.sampling().len() / (1 + d.below(4))),
        },
    };
    passed(measurement.window(window))
}

/// Returns a setting that is parsed from text, as users write it.
fn written<T: std::str::FromStr<Err: Display>>(
    d: &mut Draw,
    texts: &[&str],
) -> Result<Option<T>, String> {
    passed(d.of(texts).parse())
}

fn pooling(d: &mut Draw) -> Pooling {
    match d.below(8) {
        0 => Pooling::AllLines,
        1 => Pooling::Smooth,
        2 => Pooling::PerLine,
        3 => Pooling::Neighbours(d.size()),
        _ => Pooling::Automatic,
    }
}

fn method(d: &mut Draw) -> Option<Method> {
    d.of(&[
        None,
        Some(Method::LeastSquares),
        Some(Method::Instrumental),
        Some(Method::MaximumLikelihood),
    ])
}

fn segmentation(d: &mut Draw) -> Segmentation {
    Segmentation {
        segment: if d.one_in(3) { None } else { Some(d.size()) },
        window: d.of(&[Weight::Hann, Weight::Hamming, Weight::Blackman, Weight::Rectangular]),
        overlap_percent: if d.one_in(6) { d.ordinary() } else { d.below(100) as f64 },
    }
}

fn samples(d: &mut Draw) -> SampleFit {
    SampleFit {
        between_samples: d.of(&[
            None,
            Some(Discretisation::Euler),
            Some(Discretisation::ZeroOrderHold),
            Some(Discretisation::FirstOrderHold),
        ]),
        extent: if d.one_in(2) { Some(d.extent()) } else { None },
        derivatives: match d.below(6) {
            0 => Some(Derivatives::Spectral),
            1 => Some(Derivatives::SavitzkyGolay { window: d.size(), order: d.size() }),
            2 => Some(Derivatives::SavitzkyGolay { window: 7, order: 4 }),
            _ => None,
        },
        refine: d.one_in(6).then(|| Refinement {
            factor: if d.one_in(8) { d.size() } else { d.below(6) },
            interpolation: d.of(&[Between::Linear, Between::Spline, Between::BandLimited]),
        }),
    }
}

const LINES: [&str; 7] = ["all", "odd", "1,2,3", "2..5", "1:2:9", "0", "99999999999999999999"];

fn open_noise(d: &mut Draw) -> OpenNoise {
    // The settings are saved as JSON, which has only finite numbers.
    let force = d.one_in(4).then(|| {
        let mut levels = d.numbers(3);
        levels.retain(|level| level.is_finite());
        levels
    });
    OpenNoise { response: pooling(d), force }
}

fn settings(d: &mut Draw) -> Result<Option<Identify>, String> {
    let mut how = Identify::from(match d.below(8) {
        0 => Source::Samples(samples(d)),
        1 => Source::Segments(SegmentFit {
            estimator: d.of(&[Estimator::H1, Estimator::H2, Estimator::Hv]),
            segments: segmentation(d),
            method: method(d),
            ..SegmentFit::default()
        }),
        2 => Source::Open(OpenFit { noise: open_noise(d), ..OpenFit::default() }),
        3 => Source::Hits(HitFit { noise: open_noise(d), ..HitFit::default() }),
        4 => {
            const TERMS: [&str; 5] = [
                "k3: x1^3",
                "c2: |v1| v1",
                "k2: x1^2, k3: x2^3",
                "k3: (x1-x2)^3",
                "c3: sat(v1; b=1)",
            ];
            let Some(terms) = written::<Nonlinear>(d, &TERMS)? else { return Ok(None) };
            let estimator = d.of(&[TermEstimator::EquationError, TermEstimator::OutputError]);
            Source::Terms(TermFit { terms, estimator, ..TermFit::default() })
        }
        5 => {
            let likelihood = d.one_in(2).then(|| pooling(d));
            Source::Spectra(SpectralFit { likelihood, ..SpectralFit::default() })
        }
        _ => {
            let estimator = method(d).map(|method| match method {
                Method::LeastSquares => PeriodEstimator::LeastSquares,
                Method::Instrumental => PeriodEstimator::Instrumental,
                Method::MaximumLikelihood => PeriodEstimator::MaximumLikelihood(pooling(d)),
            });
            Source::Periods(PeriodFit { estimator, ..PeriodFit::default() })
        }
    });
    if d.one_in(3) {
        let Some(lines) = written(d, &LINES)? else { return Ok(None) };
        how = how.lines(lines);
    }
    if d.one_in(4) {
        let Some(mass) = written(d, &["1", "2,3", "1,unknown", "-1", "nan", "1e300,0"])? else {
            return Ok(None);
        };
        how = how.mass(mass);
    }
    Ok(Some(how))
}

/// Checks that a result has a text of at most [`LONGEST_TEXT`] bytes, and valid JSON.
fn printed<T: Display + serde::Serialize>(result: &T) -> Result<(), String> {
    let text = result.to_string();
    if text.is_empty() || text.len() > LONGEST_TEXT {
        return Err(format!("a result has a text of {} bytes", text.len()));
    }
    let json = serde_json::to_string(result).map_err(|error| error.to_string())?;
    serde_json::from_str::<serde_json::Value>(&json).map_err(|error| error.to_string())?;
    Ok(())
}

fn machine(d: &mut Draw, first: Measurement) -> Result<(), String> {
    let Some(how) = settings(d)? else { return Ok(()) };
    let saved = serde_json::to_string(&how).map_err(|error| error.to_string())?;
    let repeated: Identify = serde_json::from_str(&saved).map_err(|error| error.to_string())?;
    if repeated != how {
        return Err(format!("settings change when they are saved: {saved}"));
    }
    let mut records = vec![first];
    if d.one_in(4) {
        records.extend(measurement(d)?);
    }
    let Some(mut identified) = passed(identify(&records, &how))? else { return Ok(()) };
    passed(identified.compared())?;
    passed(Review::new(&identified, d.one_in(2)))?;
    if let Some(other) = measurement(d)? {
        let samples = ValidationWindow { start: None, samples: d.one_in(3).then(|| d.size()) };
        if let Some(other) = passed(identified.validation_window(other, &samples))? {
            passed(identified.add_validation(&other))?;
        }
    }
    printed(&identified)?;
    used(d, &identified, &records[0])
}

/// Computes the modes of an identified machine, and predicts the response of a record with it.
fn used(d: &mut Draw, identified: &Identified, record: &Measurement) -> Result<(), String> {
    let Some(machine) = passed(identified.machine())? else { return Ok(()) };
    if let Some(modes) = passed(ModalSummary::from_machine(&machine))? {
        printed(&modes)?;
    }
    let how = Predict { settle: d.one_in(3).then(|| d.size()) };
    if let Some(predicted) = passed(predict(record, &machine, &how))? {
        printed(&predicted)?;
        if let Some(response) = predicted.response() {
            finite(response.displacement())?;
        }
    }
    Ok(())
}

fn finite(record: &Record) -> Result<(), String> {
    match record.data().iter().all(|v| v.is_finite()) {
        true => Ok(()),
        false => Err("a result is not finite".into()),
    }
}

fn responses(d: &mut Draw, record: &Measurement) -> Result<(), String> {
    let mut how = FrfSettings {
        estimator: d.of(&[Estimator::H1, Estimator::H2, Estimator::Hv]),
        segments: segmentation(d),
        ..FrfSettings::default()
    };
    if d.one_in(3) {
        let Some(lines) = written(d, &LINES)? else { return Ok(()) };
        how.lines = lines;
    }
    let Some(table) = passed(frf(record, &how))? else { return Ok(()) };
    printed(&table)
}

fn force(d: &mut Draw, record: &Measurement) -> Result<(), String> {
    let dof = record.channels().force.len();
    let Some(system) = d.system(dof)? else { return Ok(()) };
    let how = Reconstruct {
        method: d.of(&[
            ForceMethod::Auto,
            ForceMethod::Continuous,
            ForceMethod::Discretised,
            ForceMethod::FrequencyDomain,
            ForceMethod::Shrinkage,
            ForceMethod::Tikhonov,
            ForceMethod::TruncatedSvd,
            ForceMethod::Kalman,
        ]),
        forced: if d.one_in(3) { d.indices(2) } else { Vec::new() },
        lines: None,
        band_hz: d.one_in(4).then(|| Band { low_hz: d.number(), high_hz: d.number() }),
        at_rest: d.one_in(2),
        noise: if d.one_in(3) { d.numbers(4) } else { Vec::new() },
        rule: match d.below(5) {
            0 => ParameterRule::Gcv,
            1 => ParameterRule::LCurve,
            2 => ParameterRule::Given(d.number()),
            _ => ParameterRule::Likelihood,
        },
    };
    let Some(force) = passed(reconstruct(record, &Machine::known(system), &how))? else {
        return Ok(());
    };
    finite(force.force().record())?;
    printed(&force)
}

fn bearing(d: &mut Draw, record: &Measurement) -> Result<(), String> {
    let some = |d: &mut Draw| d.one_in(2).then(|| d.number());
    let how = IdentifyBearing {
        stator_mass: if d.one_in(4) { d.number() } else { 1.0 + d.below(9) as f64 },
        rotation_hz: some(d),
        load: some(d),
        coefficients: d.of(&[Coefficients::Automatic, Coefficients::Eight, Coefficients::Twelve]),
        ..IdentifyBearing::default()
    };
    let mut tests = vec![record.clone()];
    tests.extend(measurement(d)?);
    let Some(data) = passed(mechid_analysis::BearingData::from_records(&tests, &how))? else {
        return Ok(());
    };
    let Some(film) = passed(identify_bearing(&data, None, &how))? else { return Ok(()) };
    printed(&film)
}
