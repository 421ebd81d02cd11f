//! A measured oscillator: the Schroeder record of the Silverbox benchmark.
//!
//! Wigren & Schoukens, "Three free data sets for development and benchmarking in nonlinear system
//! identification", ECC 2013. The data are not part of the project; without them this test passes.

use mechid_estimate::Unknowns;
use mechid_estimate::frequency_domain::{equation_error, output_error};
use mechid_model::ResponseQuantity;
use mechid_problems::silverbox::schroeder;
use mechid_signal::Record;
use mechid_spectra::{FrequencyData, Lines};

#[test]
fn the_measured_oscillator_has_its_known_frequency_and_damping() {
    let Some(record) = schroeder() else { return };
    // The window is one period after the transient has decayed; the offset of the sensors is the
    // mean of the whole record.
    let period = record.without_mean().window(10584, 1024).unwrap();
    let channel =
        |c: usize| Record::from_channel(period.sampling(), period.channel(c).to_vec()).unwrap();
    let (force, motion) = (channel(0), channel(1));
    let odd: Vec<usize> = (1..=335).step_by(2).collect();
    assert_eq!(Lines::excited(&force, 0.1).unwrap().as_slice(), odd);
    let data =
        FrequencyData::from_records(&force, &motion, ResponseQuantity::Displacement, odd).unwrap();
    let unknowns = Unknowns::unknown_mass(1).unwrap();
    let found = equation_error(&data, &unknowns).unwrap().system().unwrap();
    let mode = &found.modes().unwrap()[0];
    let natural_hz = mode.natural_frequency() / std::f64::consts::TAU;
    // The tolerances are those of the printed digits of the published values.
    assert!((natural_hz - 72.38).abs() < 0.05, "{natural_hz} Hz");
    assert!((mode.damping_ratio() - 0.0471).abs() < 0.0005, "ζ = {}", mode.damping_ratio());

    // Maximum likelihood and equation error weight the lines differently, and a linear model does
    // not explain the cubic spring. The estimate of maximum likelihood is therefore close to the
    // published value, but not equal.
    let likely = output_error(&data, &unknowns).unwrap().estimate.system().unwrap();
    let mode = &likely.modes().unwrap()[0];
    let natural_hz = mode.natural_frequency() / std::f64::consts::TAU;
    assert!((natural_hz - 72.38).abs() < 2.0, "{natural_hz} Hz");
}
