//! Calls of `mechid-signal`.

use mechid_signal::excitation::{HalfSine, Harmonic, Impulse, Prbs, Random, Sweep, SweepLaw};
use mechid_signal::multi_input::{self, Mixing};
use mechid_signal::noise::{self, Colour, NoiseLevel};
use mechid_signal::{
    CrestSearch, Interpolation, Interpolator, Multisine, Phases, Record, RunningStatistics,
    Sampling, Spectrum, clipping, driven_lines, lines, measures, phases, repetition, resample,
};

use super::draw::{Draw, finite, passed};

pub fn calls(bytes: &[u8]) -> Result<(), String> {
    let d = &mut Draw::new(bytes);
    let Some(sampling) = d.sampling()? else { return Ok(()) };
    match d.below(7) {
        0 => excitations(d, sampling),
        1 => multisine(d, sampling),
        2 => records(d, sampling),
        3 => noises(d, sampling),
        4 => between_samples(d, sampling),
        5 => spectra(d, sampling),
        _ => samples(d, sampling),
    }
}

fn excitations(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let [a, b, c, e] = [0; 4].map(|_| d.number());
    let at = d.number();
    if let Some(pulse) = passed(HalfSine::new(a, b, c))? {
        let _ = (pulse.momentum(), pulse.value(at));
        finite(pulse.sample(sampling))?;
    }
    if let Some(tone) = passed(Harmonic::new(a, b, c))? {
        let _ = tone.value(at);
        finite(tone.sample(sampling))?;
    }
    if let Some(impulse) = passed(Impulse::new(a, b))? {
        finite(impulse.sample(sampling))?;
    }
    if let Some(sequence) = passed(Prbs::new(d.below(40) as u32, a, d.size()))? {
        if sequence.period() <= 1 << 12 {
            let _ = sequence.chips();
        }
        finite(sequence.sample(sampling))?;
    }
    let seed = d.seed();
    for random in [Random::white(a, seed), Random::band_limited(a, b, c, seed)] {
        if let Some(random) = passed(random)? {
            finite(random.sample(sampling))?;
            if let Some(burst) = passed(random.burst(e))? {
                finite(burst.sample(sampling))?;
            }
        }
    }
    let law = d.of(&[SweepLaw::Linear, SweepLaw::Logarithmic]);
    if let Some(sweep) = passed(Sweep::new(a, b, c, e, law))? {
        let _ = (sweep.frequency_hz(at), sweep.value(at));
        if let Some(sweep) = passed(sweep.with_ramps(at))? {
            finite(sweep.sample(sampling))?;
        }
    }
    Ok(())
}

fn multisine(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let chosen = d.lines(sampling.len());
    let amplitudes: Vec<f64> = chosen.iter().map(|_| d.number()).collect();
    let law = d.below(5);
    let phases = match law {
        0 => Phases::Schroeder,
        1 => Phases::SchroederBinary,
        2 => Phases::Random { seed: d.seed() },
        3 => Phases::Zero,
        _ => Phases::Given(d.numbers(6)),
    };
    let _ = phases::schroeder(&chosen, &amplitudes);
    let ordinary = d.ordinary();
    let made = match d.below(2) {
        0 => Multisine::new(chosen, amplitudes, phases.clone()),
        _ => Multisine::flat(chosen, ordinary, phases.clone()),
    };
    let Some(made) = passed(made)? else { return Ok(()) };
    let _ = (made.peak(), made.rms(), made.value(d.number(), d.number()));
    passed(made.crest_factor())?;
    finite(made.sample(sampling))?;
    passed(made.spectrum(sampling))?;
    let level = d.number();
    passed(made.clone().with_peak(level))?;
    passed(made.clone().with_rms(level))?;
    passed(made.clone().with_phases(phases))?;
    if made.lines().last().is_some_and(|n| *n < 64) {
        passed(CrestSearch { starts: d.below(2), seed: d.seed() }.minimise(&made))?;
    }
    let mixing = d.of(&[Mixing::Dft, Mixing::Hadamard]);
    passed(multi_input::orthogonal(&vec![made; d.below(5)], mixing))?;
    Ok(())
}

fn records(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let channels = d.below(3);
    let Some(record) = d.record(sampling, channels)? else { return Ok(()) };
    finite(record.window(d.size(), d.size()))?;
    finite(record.period_mean(d.size()))?;
    finite(record.repeated(d.size()))?;
    let _ = record.without_mean();
    let Some(other) = d.sampling()? else { return Ok(()) };
    let rows = d.below(20);
    passed(Record::new(other, d.matrix(rows, 2)))?;
    if let Some(other) = d.record(other, 1)? {
        passed(record.check_same_sampling(&other))?;
    }
    for n in 0..channels {
        passed(measures::crest_factor(&record, n))?;
        passed(measures::relative_peak_factor(&record, n))?;
    }
    passed(measures::crest_factor(&record, d.size()))?;
    passed(measures::relative_peak_factor(&record, d.size()))?;
    passed(driven_lines(&record, d.size()))?;
    Ok(())
}

fn noises(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let value = d.number();
    let level = d.of(&[
        NoiseLevel::StandardDeviation(value),
        NoiseLevel::SnrDb(value),
        NoiseLevel::FractionOfRms(value),
    ]);
    let exponent = d.number();
    let colour = d.of(&[Colour::White, Colour::PowerLaw { exponent }]);
    let (channels, seed) = (d.below(4), d.seed());
    finite(noise::white(sampling, channels, value, seed))?;
    finite(noise::coloured(sampling, channels, value, colour, seed))?;
    if let Some(record) = d.record(sampling, channels)? {
        finite(noise::add_white(&record, level, seed))?;
        finite(noise::add(&record, level, colour, seed))?;
    }
    Ok(())
}

fn between_samples(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let channels = d.below(3);
    let Some(record) = d.record(sampling, channels)? else { return Ok(()) };
    let rule = d.of(&[
        Interpolation::Linear,
        Interpolation::NaturalSpline,
        Interpolation::NotAKnotSpline,
        Interpolation::Pchip,
        Interpolation::BandLimited,
    ]);
    if let Some(curve) = passed(Interpolator::new(&record, rule))? {
        passed(curve.value(d.number(), d.size()))?;
    }
    finite(resample::refine(&record, d.size(), rule))?;
    if let Some(other) = d.sampling()? {
        finite(resample::resample(&record, other, rule))?;
    }
    Ok(())
}

fn spectra(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let rows = if d.one_in(4) { d.below(40) } else { sampling.lines() };
    let lines = d.matrix(rows, 2);
    passed(Spectrum::from_lines(sampling, lines.map(|v| nalgebra::Complex::new(v, -v))))?;
    let Some(record) = d.record(sampling, 2)? else { return Ok(()) };
    let spectrum = Spectrum::from_record(&record);
    finite(spectrum.to_record())?;
    let (channel, level) = (d.size(), d.number());
    passed(measures::effective_band(&spectrum, channel, level))?;
    passed(measures::persistent_excitation_order(&spectrum, channel, level))?;
    let chosen = d.lines(sampling.len());
    passed(measures::spectral_flatness(&spectrum, channel, chosen))?;
    passed(Multisine::from_spectrum(&spectrum, channel))?;
    Ok(())
}

fn samples(d: &mut Draw, sampling: Sampling) -> Result<(), String> {
    let most = d.below(80);
    let values = d.numbers(most);
    let _ = (clipping(&values), repetition(&values));
    let _ = (measures::peak(&values), measures::rms(&values));
    let _ = measures::aperiodic_autocorrelation(&values);
    let _ = measures::circular_autocorrelation(&values);
    if let Some(mut all) = passed(RunningStatistics::from_samples(&values))? {
        passed(all.push(&d.numbers(9)))?;
        passed(all.merge(&RunningStatistics::default()))?;
        let _ = (all.crest_factor(), all.standard_deviation(), all.mean(), all.rms());
    }
    let [low, high] = [0; 2].map(|_| d.number());
    let _ = (lines::band(sampling, low, high), lines::full(sampling));
    let chosen = d.lines(sampling.len());
    passed(lines::interleaved(&chosen, d.size()))?;
    let _ = lines::random_odd(d.below(99), d.below(9), d.seed());
    let _ = (lines::special_odd(d.below(99)), lines::odd_odd(d.below(99)));
    passed(Sampling::from_rate_hz(low, d.size()))?;
    passed(sampling.with_len(d.size()))?;
    Ok(())
}
