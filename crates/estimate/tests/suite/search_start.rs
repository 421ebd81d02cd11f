//! Tests that the search by maximum likelihood finds the best minimum, even if most lines are only
//! noise.

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{output_error, output_error_near};
use mechid_model::ResponseQuantity;
use mechid_problems::exact_harmonic_periodic;
use mechid_problems::machines::{Test, repeated, series};
use mechid_signal::excitation::Random;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use mechid_spectra::frf::{Frf, FrfEstimator, Segments};
use mechid_spectra::{FrequencyData, Lines, Pooling, RepeatedPeriods};
use nalgebra::{Complex, DMatrix};

use crate::common::{oscillator, relative_error};

/// Output error finds M, C and K, although the accelerances of the upper half of the lines are only
/// noise, like lines above the band of a random excitation. The coherence of these lines is low, so
/// they have hardly any weight in the initial estimates and in the search.
#[test]
fn lines_beyond_the_excitation_do_not_lead_the_search_astray() {
    let system = oscillator();
    let natural = system.modes().unwrap().last().unwrap().natural_frequency();
    let omega: Vec<f64> = (1..=200).map(|n| f64::from(n) * natural / 25.0).collect();
    let averages = 60.0;
    let mut coherence = DMatrix::zeros(omega.len(), 1);
    let response = omega.iter().enumerate().map(|(at, &w)| {
        let exact = -w * w * system.receptance(w).unwrap()[(0, 0)];
        let level = if at < 100 { 1e-3 } else { 300.0 } / system.mass()[(0, 0)];
        let error = Complex::from_polar(level, (at * at) as f64);
        let measured = exact + error;
        coherence[(at, 0)] = 1.0 / (1.0 + level * level * (averages - 1.0) / measured.norm_sqr());
        DMatrix::from_element(1, 1, measured)
    });
    let response = response.collect();
    let frf =
        Frf::new(omega.clone(), response, coherence, averages, ResponseQuantity::Acceleration)
            .unwrap();
    let fit = output_error(&frf.data(&[0]).unwrap(), &Unknowns::unknown_mass(1).unwrap()).unwrap();
    let truth = [system.mass()[(0, 0)], system.damping()[(0, 0)], system.stiffness()[(0, 0)]];
    for (found, truth) in fit.estimate.parameters().zip(truth) {
        let error = (found.value - truth).abs();
        assert!(
            error < 4.0 * found.standard_error,
            "{} = {}, truth {truth}",
            found.parameter,
            found.value
        );
        assert!(error < 0.01 * truth, "{} = {}, truth {truth}", found.parameter, found.value);
    }
}

/// The random force ends at a third of the band. Above this frequency, the frequency responses are
/// noise divided by a very small force. A search that relied on these lines would find a machine
/// that is far too soft, for every segment length.
#[test]
fn lines_of_next_to_no_force_do_not_lead_the_search_astray() {
    let system = oscillator();
    let sampling = Sampling::new(0.02, 1 << 14).unwrap();
    for seed in 0..5 {
        let strong = Random::band_limited(20.0, 0.0, 8.0, seed).unwrap().sample(sampling).unwrap();
        let weak = noise::white(sampling, 1, 1e-4, 100 + seed).unwrap();
        let force = Record::new(sampling, strong.data() + weak.data()).unwrap();
        let motion = exact_harmonic_periodic(&system, &force).unwrap();
        let level = NoiseLevel::FractionOfRms(0.01);
        let motion = noise::add_white(motion.displacement(), level, seed).unwrap();
        for len in [128, 256, 512, 1024] {
            let frf = Frf::estimate(
                &force,
                &motion,
                ResponseQuantity::Displacement,
                Segments::hann(len),
                1..len / 2,
                FrfEstimator::H1,
            )
            .unwrap();
            let fit = output_error(&frf.data(&[0]).unwrap(), &Unknowns::unknown_mass(1).unwrap());
            let found = fit.unwrap().estimate;
            let error = relative_error(&found.mass(), system.mass());
            // The remaining error is the leakage of short segments.
            assert!(error < 0.05, "{seed} {len}: m = {}", found.mass()[(0, 0)]);
        }
    }
}

/// Four periods of a test with white noise on the displacement.
fn measured(test: &Test, level: f64, seed: u64) -> FrequencyData {
    let level = NoiseLevel::FractionOfRms(level);
    let motion = repeated(&test.displacement, 4).unwrap();
    let motion = noise::add_white(&motion, level, seed).unwrap();
    let lines = Lines::new(test.force.sampling(), test.lines.iter().copied()).unwrap();
    let force = repeated(&test.force, 4).unwrap();
    RepeatedPeriods::new(&lines, &force, &motion, ResponseQuantity::Displacement)
        .and_then(|periods| periods.mean_with_noise(Pooling::AllLines))
        .unwrap()
}

/// The search finds a minimum as low as a search from the true machine, for chains with soft
/// springs, free chains and chains with one force. For these chains, an earlier search found wrong
/// minima or did not end. The last chain has several minima whose residuals are as small as the
/// noise. The example `search_study` has 200 chains.
#[test]
fn the_search_finds_a_minimum_as_low_as_one_from_the_true_machine() {
    for (index, level) in [(11, 7e-4), (22, 5e-3), (24, 1.3e-2), (34, 3.4e-3), (111, 1.24e-2)] {
        let test = series(index).unwrap();
        let data = measured(&test, level, index);
        let unknowns = match test.mass_known {
            true => Unknowns::known_mass(test.system.mass()),
            false => Unknowns::unknown_mass(test.system.dof()),
        };
        let unknowns = unknowns.unwrap();
        let fit = output_error(&data, &unknowns).unwrap();
        let best = output_error_near(&data, &unknowns, Some(&test.system)).unwrap();
        assert!(fit.misfit_ratio <= best.misfit_ratio * (1.0 + 1e-6), "{index}: {fit:?}");
        assert!((fit.misfit_ratio - 1.0).abs() < 0.3, "{index}: {}", fit.misfit_ratio);
    }
}
