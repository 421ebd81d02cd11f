//! Noise that is not white, in few periods: its estimated spectrum, and the effect on estimates.

use std::f64::consts::TAU;

use mechid_checks::{Verdict, after_spectral_fit};
use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{output_error, output_error_pooling};
use mechid_model::{ResponseQuantity, Sdof, SecondOrderSystem};
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::{Extent, Multisine, Phases, Record, Sampling, noise};
use mechid_spectra::SpectraError;
use mechid_spectra::{FrequencyData, Lines, NoiseModel, NoiseSpectrum, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};
use rayon::prelude::*;

/// Ratio of the RMS of the noise to that of the response.
const LEVEL: f64 = 0.05;
const KIND: ResponseQuantity = ResponseQuantity::Displacement;

/// Returns the process x_k = 0.9 x_{k−1} + e_k with unit power.
fn autoregressive(len: usize, seed: u64) -> Vec<f64> {
    const BEFORE: usize = 200;
    let time = Sampling::new(1.0, len + BEFORE).unwrap();
    let mut x = noise::white(time, 1, f64::sqrt(1.0 - 0.81), seed).unwrap().channel(0).to_vec();
    (1..x.len()).for_each(|k| x[k] += 0.9 * x[k - 1]);
    x.split_off(BEFORE)
}

/// White noise of unit power.
fn white(len: usize, seed: u64) -> Vec<f64> {
    let time = Sampling::new(1.0, len).unwrap();
    noise::white(time, 1, 1.0, seed).unwrap().channel(0).to_vec()
}

/// Test of the oscillator 10 ẍ + 67 ẋ + 45000 x = F. Its natural frequency is at line 12, and the
/// force has 100 lines.
struct Rig {
    system: SecondOrderSystem,
    /// One period.
    force: Record,
    displacement: Record,
    lines: Lines,
    periods: usize,
    /// RMS of the noise, in m.
    deviation: f64,
}

impl Rig {
    fn new(periods: usize) -> Self {
        let oscillator = Sdof::new(10.0, 67.0, 45_000.0).unwrap();
        let (system, mode) = (oscillator.system(), f64::sqrt(4500.0));
        let period = Sampling::new(12.0 * TAU / (mode * 400.0), 400).unwrap();
        let multisine = Multisine::flat(1..=100, 10.0, Phases::Random { seed: 7 }).unwrap();
        let force = multisine.sample(period).unwrap();
        let exact = exact_harmonic_periodic(&system, &force).unwrap();
        let displacement = exact.displacement().clone();
        let deviation = LEVEL * displacement.column(0).norm() / f64::sqrt(400.0);
        let lines = Lines::new(period, 1..=100).unwrap();
        Self { system, force, displacement, lines, periods, deviation }
    }

    fn measure(&self, noise: impl Fn(usize, u64) -> Vec<f64>, seed: u64) -> RepeatedPeriods {
        let force = self.force.repeated(self.periods).unwrap();
        let exact = self.displacement.repeated(self.periods).unwrap();
        let noise = noise(exact.len(), seed);
        let noisy = exact.channel(0).iter().zip(noise).map(|(x, e)| x + self.deviation * e);
        let x = Record::from_channel(exact.sampling(), noisy.collect()).unwrap();
        RepeatedPeriods::new(&self.lines, &force, &x, KIND).unwrap()
    }

    /// Returns the standard errors of maximum likelihood with a known noise spectrum of unit power;
    /// `power` is a function of the phase angle per sample, in rad.
    fn bound(&self, power: impl Fn(f64) -> f64) -> Vec<f64> {
        let (period, all) = (self.lines.sampling(), self.lines.as_slice().iter());
        let samples = (period.len() * self.periods) as f64;
        let covariance = self.lines.omega().into_iter().map(|omega| {
            let variance = 4.0 * self.deviation.powi(2) * power(omega * period.dt()) / samples;
            DMatrix::from_diagonal(&vec![Complex::from(variance), Complex::from(0.0)].into())
        });
        let noise = NoiseSpectrum::new(self.lines.omega(), covariance.collect()).unwrap();
        let (force, x) = (&self.force, &self.displacement);
        let data = FrequencyData::from_records(force, x, KIND, all.copied()).unwrap();
        let data = data.with_noise(noise).unwrap();
        let fit = output_error(&data, &Unknowns::unknown_mass(1).unwrap()).unwrap();
        fit.estimate.parameters().map(|p| p.standard_error).collect()
    }

    /// Returns the smallest and the largest share of 95 % intervals that contain the truth, and the
    /// largest ratio of the scatter to the bound.
    fn judge(&self, pooling: Pooling, bound: &[f64], runs: u64) -> [f64; 3] {
        let unknowns = Unknowns::unknown_mass(1).unwrap();
        let fits: Vec<_> = (0..runs)
            .into_par_iter()
            .map(|seed| {
                let periods = self.measure(autoregressive, seed);
                let data = match self.periods {
                    1 => periods.mean(),
                    _ => periods.mean_with_noise(pooling),
                };
                output_error_pooling(&data.unwrap(), &unknowns, pooling).unwrap().estimate
            })
            .collect();
        let [mut least, mut largest, mut scatter] = [1.0f64, 0.0, 0.0];
        for (at, (parameter, bound)) in unknowns.free().iter().zip(bound).enumerate() {
            let truth = self.system.matrix(parameter.matrix())[(0, 0)];
            let found: Vec<_> = fits.iter().map(|e| e.parameters().nth(at).unwrap()).collect();
            let held = found.iter().filter(|p| {
                let [low, high] = p.interval(0.95).unwrap();
                (low..=high).contains(&truth)
            });
            let share = held.count() as f64 / runs as f64;
            let power: f64 = found.iter().map(|p| (p.value - truth).powi(2)).sum();
            (least, largest) = (least.min(share), largest.max(share));
            scatter = scatter.max((power / runs as f64).sqrt() / bound);
        }
        [least, largest, scatter]
    }
}

/// The 95 % intervals contain the truth in 91 to 95 % of the runs. The coverage is not always 95 %,
/// because the mode has few lines, and the noise spectrum begins to fall at these lines. For a
/// coverage of 92 %, the probability that fewer than 85 % of 150 intervals contain the truth is
/// 0.002. Standard deviations of 150 runs have an uncertainty of 6 %. If the noise is assumed
/// white, about 70 to 76 % of the intervals contain the truth.
#[test]
fn intervals_hold_under_coloured_noise_of_few_periods() {
    for periods in [1, 2, 4] {
        let rig = Rig::new(periods);
        let ar = |angle: f64| 0.19 / (1.81 - 1.8 * angle.cos());
        let bound = rig.bound(ar);
        let [least, largest, scatter] = rig.judge(Pooling::Automatic, &bound, 150);
        assert!(least > 0.85 && largest < 0.985, "{periods} periods: {least} to {largest}");
        assert!(scatter < 1.2, "{periods} periods: {scatter} times the bound");
        let [least, ..] = rig.judge(Pooling::AllLines, &bound, 60);
        assert!(least < 0.85, "white, {periods} periods: {least}");
    }
}

#[test]
fn the_noise_model_is_chosen_from_the_scatter() {
    let models = |rig: &Rig, noise: &(dyn Fn(usize, u64) -> Vec<f64> + Sync)| -> Vec<NoiseModel> {
        let chosen = |seed| {
            let found = rig.measure(noise, seed).noise(Pooling::Automatic).unwrap();
            found.models()[0].clone()
        };
        (0..100).into_par_iter().map(chosen).collect()
    };
    let share = |models: &[NoiseModel], of: &dyn Fn(&NoiseModel) -> bool| {
        models.iter().filter(|model| of(model)).count()
    };
    for periods in [2, 8] {
        let rig = Rig::new(periods);
        let of_white = models(&rig, &white);
        let count = share(&of_white, &|model| *model == NoiseModel::White);
        assert!(count >= 85, "{periods} periods: {count} of 100 white");
        let coloured = models(&rig, &autoregressive);
        let count = share(&coloured, &|m| matches!(m, NoiseModel::Smooth { order: 1.., .. }));
        assert!(count >= 80, "{periods} periods: {count} of 100 smooth");
        // A sine whose amplitude is five times the RMS of the noise; its frequency is 0.3 line
        // spacings above line 50.
        let spacing_hz = rig.lines.sampling().line_spacing_hz();
        let period = rig.lines.sampling().len() as f64;
        let disturbed = |len: usize, seed| {
            let angle = TAU * 50.3 / period;
            let sine = move |k: usize| 5.0 * (angle * k as f64 + seed as f64).sin();
            white(len, seed).into_iter().enumerate().map(|(k, e)| e + sine(k)).collect()
        };
        let found = models(&rig, &disturbed);
        let count = share(&found, &|model| match model {
            NoiseModel::Smooth { bands_hz, .. } => bands_hz.iter().any(|[low, high]| {
                (low - 0.5 * spacing_hz..high + 0.5 * spacing_hz).contains(&(50.3 * spacing_hz))
            }),
            _ => false,
        });
        assert!(count >= 90, "{periods} periods: {count} of 100 with the disturbance");
    }
}

/// The noise is the closed-form response to an unmeasured force whose period is four times as long
/// as the record. The noise model finds this force, and the tests of the residual then rarely warn.
/// With a smooth noise spectrum instead, the tests warn in at least a third of the runs.
#[test]
fn an_unmeasured_force_is_found_and_is_no_cause_for_warnings() {
    const RUNS: u64 = 24;
    let rig = Rig::new(4);
    let response = |len: usize, seed: u64| -> Vec<f64> {
        let all = rig.lines.sampling().with_len(4 * len).unwrap();
        let force = Record::from_channel(all, autoregressive(4 * len, seed)).unwrap();
        let exact = exact_harmonic_periodic(&rig.system, &force).unwrap();
        let x = exact.displacement().column(0);
        // The added white noise has a tenth of the RMS of this response.
        let unit = x.norm() / (x.len() as f64).sqrt();
        let part = x.rows(len, len).into_owned() / unit;
        part.iter().zip(white(len, seed + 1_000)).map(|(x, e)| x + 0.1 * e).collect()
    };
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let judged: Vec<[bool; 3]> = (0..RUNS)
        .into_par_iter()
        .map(|seed| {
            let periods = rig.measure(response, seed);
            let first = periods.mean_with_noise(Pooling::Automatic).unwrap();
            let fit = output_error(&first, &unknowns).unwrap();
            let machine = fit.estimate.system().unwrap();
            let noise = periods.noise_with_system(Pooling::Automatic, &machine).unwrap();
            let is_found = matches!(noise.models(), [NoiseModel::UnmeasuredForce { .. }]);
            let again = periods.mean().unwrap().with_noise(noise).unwrap();
            let warns = |data: &FrequencyData| {
                let estimate = output_error(data, &unknowns).unwrap().estimate;
                let (records, extent) = (std::slice::from_ref(data), Extent::WholePeriod);
                let left = after_spectral_fit(records, &estimate, extent).unwrap();
                left.records[0].findings().iter().any(|one| one.verdict() != Verdict::Good)
            };
            [is_found, warns(&again), warns(&first)]
        })
        .collect();
    let count = |at: usize| judged.iter().filter(|run| run[at]).count();
    let [found, warned, smooth_warned] = [0, 1, 2].map(count);
    assert!(found >= 22, "{found} of {RUNS}");
    assert!(warned <= 3 && smooth_warned >= 8, "{warned} and {smooth_warned} of {RUNS} warn");
}

#[test]
fn single_samples_of_a_line_make_no_spectrum() {
    let one = Rig::new(1).measure(white, 1).mean().unwrap();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let refused = output_error_pooling(&one, &unknowns, Pooling::PerLine).unwrap_err();
    let expected = SpectraError::TooFewAverages { got: 1, needed: 2 };
    assert_eq!(refused, expected.into());
}

#[test]
fn poolings_are_read_as_they_are_written() {
    let all = [
        ("auto", Pooling::Automatic),
        ("white", Pooling::AllLines),
        ("smooth", Pooling::Smooth),
        ("neighbours:4", Pooling::Neighbours(4)),
        ("per-line", Pooling::PerLine),
    ];
    for (text, pooling) in all {
        assert_eq!(text.parse(), Ok(pooling));
        assert_eq!(pooling.to_string(), text);
    }
    for text in ["", "neighbours", "neighbours:", "neighbours:-1", "pink"] {
        assert!(text.parse::<Pooling>().is_err(), "{text}");
    }
}
