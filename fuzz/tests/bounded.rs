//! Cases of every target, as many as fit into three seconds.

use std::time::Duration;

use mechid_fuzz::{Cases, run, targets};

/// One test, one target after the other: the memory that is counted is that of the whole program.
#[test]
fn no_target_breaks_a_promise() {
    let cases = Cases {
        count: 3_000,
        first: 0,
        seed: 1998,
        // Generous, for machines that do other work: a hang takes for ever.
        time_limit: Duration::from_secs(60),
        total_time: Duration::from_secs(3),
    };
    let failures: Vec<String> = targets::all()
        .iter()
        .filter_map(|target| run(target, &cases).err())
        .map(|failure| failure.to_string())
        .collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
