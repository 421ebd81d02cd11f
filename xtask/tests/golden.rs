//! Today's numbers are yesterday's. On purpose changed ones: `cargo xtask reproduce-thesis --bless`.

use std::path::Path;

use xtask::thesis::reproduce;

#[test]
fn tables_and_figures_agree_with_their_golden_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let reproduction = reproduce::all(root, || ()).unwrap();
    let differences = reproduction.differences(root);
    assert!(differences.is_empty(), "{}", differences.join("\n"));
    let files = std::fs::read_dir(root.join("tests/golden")).unwrap().count();
    assert_eq!(files, reproduction.golden_files(), "a golden file without its table or figure");
}
