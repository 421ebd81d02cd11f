//! Spectral lines that `mechid identify` uses if the user chooses none.

use std::fs;

use mechid::model::Sdof;
use mechid::signal::{Multisine, NoiseLevel, Phases, Sampling, noise};
use mechid_problems::exact_harmonic_periodic;
use serde_json::Value;

use super::mechid;

/// Only the lines that the force excites are used, although force and motion have noise, like that
/// of load cells and displacement probes.
#[test]
fn noise_on_the_force_does_not_look_like_force() {
    let folder = tempfile::tempdir().unwrap();
    let sampling = Sampling::new(1.0 / 128.0, 256).unwrap();
    let system = Sdof::new(25.0, 190.0, 142e3).unwrap().system();
    for (lines, first, last, count) in
        [((3..=61).step_by(2).collect::<Vec<usize>>(), 3, 61, 30), ((4..=60).collect(), 4, 60, 57)]
    {
        let clean = Multisine::flat(lines, 2.0, Phases::Schroeder).unwrap();
        let clean = clean.sample(sampling).unwrap();
        let motion = exact_harmonic_periodic(&system, &clean).unwrap();
        for periods in [1, 4] {
            for share in [1e-3, 0.01] {
                let noisy = |record: &mechid::signal::Record, seed| {
                    let record = record.repeated(periods).unwrap();
                    noise::add_white(&record, NoiseLevel::FractionOfRms(share), seed).unwrap()
                };
                let (force, x) = (noisy(&clean, 1), noisy(motion.displacement(), 2));
                let columns = [("f".into(), force.channel(0)), ("x".into(), x.channel(0))];
                let text = mechid::io::csv_text(force.sampling(), &columns);
                fs::write(folder.path().join("a.csv"), text).unwrap();
                let arguments = "identify a.csv --force f --displacement x --period 256 --json";
                let report: Value =
                    serde_json::from_str(&mechid(folder.path(), arguments)).unwrap();
                let used = &report["lines"];
                let told = [&used["first"], &used["last"], &used["count"]].map(Value::as_u64);
                assert_eq!(told, [first, last, count].map(Some), "{periods} periods, {share}");
            }
        }
    }
}
