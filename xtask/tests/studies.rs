//! The intervals have their stated coverage, in the short form of the studies. After an intended
//! change, run `cargo xtask studies`.

use std::path::Path;

use xtask::studies::binomial::LOSS;
use xtask::studies::{Coverage, alarms, differences, short, short_power};

#[test]
fn a_loss_of_coverage_is_noticed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let all = short(0).unwrap();
    let coverages: Vec<Coverage> = all.into_iter().map(|(coverage, _)| coverage).collect();
    let alarms_now = alarms(&coverages).unwrap();
    assert!(alarms_now.is_empty(), "{}", alarms_now.join("\n"));
    let differences = differences(root, &coverages).unwrap();
    assert!(differences.is_empty(), "{}", differences.join("\n"));
    // The same experiments, but the number of intervals that contain the true value is reduced by 2
    // % of the number of experiments.
    let lost = coverages.into_iter().map(|of| {
        let containing_truth = of.containing_truth - (LOSS * of.experiments as f64) as u64;
        Coverage { containing_truth, ..of }
    });
    let lost: Vec<Coverage> = lost.collect();
    assert!(alarms(&lost).unwrap().len() * 2 > lost.len(), "{lost:?}");
    assert!(short_power().unwrap() > 0.95);
}
