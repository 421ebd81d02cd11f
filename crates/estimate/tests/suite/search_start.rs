//! Where the search by maximum likelihood starts when most lines are nothing but noise.

use crate::common::{oscillator, relative_error};
use mechid_estimate::frequency_domain::output_error;
use mechid_estimate::{Frf, FrfEstimator, Segments, Unknowns};
use mechid_model::ResponseQuantity;
use mechid_problems::exact_harmonic_periodic;
use mechid_signal::excitation::Random;
use mechid_signal::{NoiseLevel, Record, Sampling, noise};
use nalgebra::{Complex, DMatrix};

/// Accelerances of which the upper half is nothing but noise, as above the band of a random
/// excitation: by the coherence they weigh next to nothing, in the start of the search as in its end.
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

/// Displacements of a random force that leaves off at a third of the band: noise alone, divided by
/// next to no force, beyond it, on every segment length a machine far too soft.
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
            // What is left is the leakage of short segments.
            assert!(error < 0.05, "{seed} {len}: m = {}", found.mass()[(0, 0)]);
        }
    }
}
