//! Computing time of the modal identification as a function of the numbers of outputs, lines and
//! modes. The last printed lines compare two large cases with their goals.
//!
//! The identification chooses the order. Every case prints how many of its modes were found, so
//! that a shorter time due to missing modes is visible.
#![allow(clippy::print_stdout, reason = "the lines are the result")]

#[path = "../tests/suite/generator.rs"]
mod generator;

use std::hint::black_box;
use std::time::Instant;

use criterion::{Criterion, criterion_group, criterion_main};
use mechid_modal::{ModalSettings, identify_modes};

/// Returns the shortest time of `repeats` identifications, in seconds, and the number of modes that
/// were found.
fn seconds(case: &generator::Case, repeats: usize) -> (f64, usize) {
    let data = case.lines(1);
    let mut modes = 0;
    let times = (0..repeats).map(|_| {
        let start = Instant::now();
        let estimate = black_box(identify_modes(&data, &ModalSettings::default()).unwrap());
        modes = estimate.modes().len();
        start.elapsed().as_secs_f64()
    });
    (times.fold(f64::INFINITY, f64::min), modes)
}

/// Prints the time for each size, and the exponent of its growth from one size to the next.
fn slopes(what: &str, sizes: &[usize], case: impl Fn(usize) -> generator::Case) {
    let mut before: Option<(usize, f64)> = None;
    for &size in sizes {
        let case = case(size);
        let (seconds, modes) = seconds(&case, 3);
        let slope = before.map_or(String::new(), |(other, then)| {
            let slope = (seconds / then).ln() / (size as f64 / other as f64).ln();
            format!(", grows as {what}^{slope:.2}")
        });
        let all = case.in_band().len();
        println!("{size:6} {what}: {seconds:.3} s, {modes} of {all} modes{slope}");
        before = Some((size, seconds));
    }
}

fn outputs(_: &mut Criterion) {
    slopes("outputs", &[7, 14, 28, 56], |outputs| generator::large([outputs, 2], 8192, 16));
}

fn lines(_: &mut Criterion) {
    slopes("samples", &[4096, 8192, 16384, 32768], |samples| {
        generator::large([14, 2], samples, 16)
    });
}

fn goals(_: &mut Criterion) {
    for (outputs, inputs, samples, modes, goal) in
        [(28, 2, 8523, 16, 5.0), (100, 3, 20_000, 40, 30.0)]
    {
        let (seconds, count) = seconds(&generator::large([outputs, inputs], samples, modes), 1);
        println!(
            "{outputs} x {inputs} x {samples}: {seconds:.2} s, {count} of {modes} modes, \
             {goal} s at most"
        );
    }
}

criterion_group!(benches, outputs, lines, goals);
criterion_main!(benches);
