//! Calls of `mechid-force`.

use mechid_force::{
    Channel, Filter, ForceModel, ForceUnknowns, IdentifiedForce, Measurement, MotionNoise, Noise,
    Rule, Start, Tuning, channel_errors, continuous, continuous_with_noise, discretised,
    discretised_by_taylor, discretised_with_noise, frequency_domain, inner_lines, kalman,
    line_errors, regularised, relative_error, spectrum_ratio, spurious_ratio,
    with_uncertain_system,
};
use mechid_model::{Discretisation, Response, UncertainSystem};
use mechid_signal::{Sampling, Spectrum};

use super::draw::{Draw, finite, passed};

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    match d.below(4) {
        0 => complete_motion(d),
        1 | 2 => measured(d),
        _ => errors(d),
    }
}

fn found<E: std::fmt::Display>(force: Result<IdentifiedForce, E>) -> Result<(), String> {
    if let Some(force) = passed(force)? {
        finite(Ok::<_, String>(force.record().clone()))?;
    }
    Ok(())
}

fn complete_motion(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(3);
    let (Some(system), Some(sampling)) = (d.system(dof)?, d.sampling()?) else { return Ok(()) };
    let mut records = Vec::new();
    for _ in 0..3 {
        let channels = d.dof(dof);
        let Some(record) = d.record(sampling, channels)? else { return Ok(()) };
        records.push(record);
    }
    let [x, v, a] = <[_; 3]>::try_from(records).expect("three");
    let Some(motion) = passed(Response::new(x, v, a))? else { return Ok(()) };
    let levels = [0; 3].map(|_| (0..d.dof(dof)).map(|_| d.number().abs()).collect());
    let [x, v, a] = levels;
    let noise = passed(MotionNoise::new(x, v, a))?;
    let hold = d.of(&[
        Discretisation::Euler,
        Discretisation::ZeroOrderHold,
        Discretisation::FirstOrderHold,
    ]);
    let extent = d.extent();
    found(continuous(&system, &motion))?;
    found(discretised(&system, &motion, hold, extent))?;
    found(discretised_by_taylor(&system, &motion, d.below(40), extent))?;
    if let Some(noise) = noise {
        found(continuous_with_noise(&system, &motion, &noise))?;
        found(discretised_with_noise(&system, &motion, hold, extent, &noise))?;
    }
    let exact = UncertainSystem::exact(system);
    found(with_uncertain_system(&exact, |system| continuous(system, &motion)))
}

fn measurement(
    d: &mut Draw,
    dof: usize,
    sampling: Sampling,
) -> Result<Option<Measurement>, String> {
    let count = 1 + d.below(3);
    let channels = (0..count).map(|n| Channel { dof: d.dof(n % dof), quantity: d.quantity() });
    let channels: Vec<Channel> = channels.collect();
    let Some(record) = d.record(sampling, count)? else { return Ok(None) };
    passed(Measurement::new(record, channels))
}

fn measured(d: &mut Draw) -> Result<(), String> {
    let dof = 1 + d.below(3);
    let (Some(system), Some(sampling)) = (d.system(dof)?, d.sampling()?) else { return Ok(()) };
    let Some(measured) = measurement(d, dof, sampling)? else { return Ok(()) };
    let measured = if d.one_in(4) {
        let band_hz = [d.number(), d.number()];
        let Ok(banded) = measured.in_band(band_hz) else { return Ok(()) };
        banded
    } else {
        measured
    };
    let forced = if d.one_in(4) { d.indices(3) } else { vec![d.below(dof)] };
    let lines = if d.one_in(2) { inner_lines(&measured) } else { d.lines(sampling.len()) };
    let levels = (0..d.dof(measured.channels().len())).map(|_| d.number()).collect();
    let noise = d.of(&[Noise::Unknown, Noise::OutsideLines, Noise::PerChannel(levels)]);
    let start = d.of(&[Start::FromRest, Start::InMotion]);
    match d.below(3) {
        0 => found(frequency_domain(&system, &measured, &forced, &lines, &noise)),
        1 => {
            let unknowns = match d.below(3) {
                0 => ForceUnknowns::EveryLine,
                1 => ForceUnknowns::Lines(lines),
                _ => ForceUnknowns::Samples(start),
            };
            let given = d.number();
            let rule = d.of(&[Rule::Given(given), Rule::Gcv, Rule::LCurve, Rule::Likelihood]);
            let filter =
                d.of(&[Filter::Tikhonov(rule), Filter::TruncatedSvd(rule), Filter::Shrinkage]);
            let force = regularised(&system, &measured, &forced, &unknowns, filter, &noise);
            found(force.map(|found| found.force))
        }
        _ => {
            let [noise, rms] = [0; 2].map(|_| d.numbers(3));
            let model = ForceModel { order: d.below(18), corner_hz: d.number(), rms };
            let tuning = d.of(&[
                Tuning::Likelihood,
                Tuning::NoiseKnown(noise.clone()),
                Tuning::Given { noise_std: noise, model },
            ]);
            found(kalman(&system, &measured, &forced, start, &tuning).map(|found| found.force))
        }
    }
}

fn errors(d: &mut Draw) -> Result<(), String> {
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    let Some(other) = (if d.one_in(8) { d.sampling()? } else { Some(sampling) }) else {
        return Ok(());
    };
    let channels = d.below(3);
    let (Some(a), Some(b)) = (d.record(sampling, channels)?, d.record(other, channels)?) else {
        return Ok(());
    };
    passed(channel_errors(&a, &b))?;
    passed(relative_error(&a, &b))?;
    let (a, b) = (Spectrum::from_record(&a), Spectrum::from_record(&b));
    let lines = d.lines(sampling.len());
    let (channel, from) = (d.below(3), d.size());
    passed(line_errors(&a, &b, channel, &lines))?;
    passed(spectrum_ratio(&a, &b, from, &lines))?;
    passed(spurious_ratio(&a, &b, channel, from, &lines))?;
    Ok(())
}
