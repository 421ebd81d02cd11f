//! Runs cases of every target, as many as fit into half a second.

use std::time::Duration;

use mechid_fuzz::{Cases, run, targets};

/// Runs cases of every target: none may panic, hang, use too much memory or violate a checked
/// property. A single test runs the targets one after the other, because the memory is measured for
/// the whole program.
#[test]
fn every_target_passes() {
    let cases = Cases {
        count: 3_000,
        first: 0,
        seed: 1998,
        // The limit is generous, because other programs may slow the computer; a hang never ends.
        time_limit: Duration::from_secs(60),
        total_time: Duration::from_millis(500),
    };
    let failures: Vec<String> = targets::all()
        .iter()
        .filter_map(|target| run(target, &cases).err())
        .map(|failure| failure.to_string())
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
