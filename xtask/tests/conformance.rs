//! The page of published numbers is up to date. After an intended change, run `cargo xtask
//! conformance`.

use std::path::Path;

use xtask::conformance::{self, Status};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

#[test]
fn the_page_is_todays() {
    let differences = conformance::differences(root()).unwrap();
    assert!(differences.is_empty(), "{} differences, {}", differences.len(), differences[0]);
}

#[test]
fn every_row_is_met_or_explained_but_those_of_appendix_b_and_two_records() {
    let judges = conformance::judges(root()).unwrap();
    let rows: usize = judges.iter().map(|judge| judge.rows.len()).sum();
    assert!(rows >= 2300, "{rows} rows");
    for judge in &judges {
        assert!(root().join(judge.test).exists(), "{}", judge.test);
        for row in judge.rows.iter().filter(|row| row.status == Status::Open) {
            // Appendix B of the dissertation states neither the integrator nor the interpolation,
            // and appendix E states no settings, so their rows may remain open.
            let is_unstated =
                ["table B", "table E"].iter().any(|part| row.quantity.starts_with(part));
            // Known disagreements: two modes of the arm do not predict another record, and two weak
            // modes of the frame differ from those of a subspace model.
            let is_known = match judge.name {
                "CD player's arm" => row.quantity.contains("predicted"),
                "Steel subframe, two shakers" => {
                    [" 4,", " 15,"].iter().any(|mode| row.quantity.contains(mode))
                }
                _ => false,
            };
            assert!(is_unstated || is_known, "{}: {row:?}", judge.name);
        }
    }
}
