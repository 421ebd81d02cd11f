//! The audit page says what it must, and its verdicts can say no.

use std::path::Path;

use xtask::thesis::audit;
use xtask::thesis::misprints::{CELLS, MEANS};
use xtask::thesis::published::Published;
use xtask::thesis::results::Results;
use xtask::thesis::slips::Slip;

fn page() -> String {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let published = Published::read(root).unwrap();
    let results = Results::compute(&published, || ()).unwrap();
    audit::page(&published, &results).unwrap()
}

#[test]
fn every_slip_and_misprint_is_on_the_page() {
    let page = page();
    for slip in Slip::ALL {
        assert!(page.contains(slip.name()) && page.contains(slip.done()), "{slip:?}");
    }
    for m in CELLS {
        assert!(page.contains(m.reason), "{m:?}");
    }
    for m in MEANS {
        assert!(page.contains(m.reason), "{m:?}");
    }
    for remark in audit::misprints::TEXT.iter().chain(audit::misprints::EQUATIONS) {
        assert!(remark.iter().all(|text| page.contains(text)), "{remark:?}");
    }
    for remark in audit::misprints::modal().unwrap() {
        assert!(page.contains(&remark.right), "{remark:?}");
    }
}
