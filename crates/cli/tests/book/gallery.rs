//! Tests of the gallery pages. The measured records of the pages are stored outside the repository,
//! in a folder next to it.

use std::fs;
use std::path::{Path, PathBuf};

use super::markdown::Page;
use super::root;
use super::session::Session;

/// Largest figure of a page of the gallery, in bytes.
const LARGEST_FIGURE: u64 = 100_000;

/// Returns the folder with the record of a page; the folder has the same name as the page. Returns
/// `None` for pages without a record.
fn record_of(page: &Path) -> Option<PathBuf> {
    let folder = page.parent()?;
    let name = page.file_stem()?;
    (folder.ends_with("gallery") && name != "index")
        .then(|| root().join("../shared/data").join(name))
}

/// Copies a page's record into the reader's folder. Returns false and prints a note if the record
/// is not stored next to the project.
#[allow(clippy::print_stderr, reason = "a skipped page says so")]
pub fn has_its_record(page: &Path, session: &Session) -> bool {
    let Some(folder) = record_of(page) else { return true };
    let Ok(entries) = fs::read_dir(&folder) else {
        eprintln!("skipped: {}: there is no {}", page.display(), folder.display());
        return false;
    };
    for file in entries.map(|entry| entry.unwrap().path()) {
        session.copy(&file);
    }
    true
}

#[test]
fn a_page_says_where_its_record_is_from_and_has_a_small_figure() {
    let folder = root().join("docs/book/src/gallery");
    let pages = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let pages = pages.filter(|page| page.extension().is_some_and(|ending| ending == "md"));
    let mut records = 0;
    for path in pages.filter(|page| record_of(page).is_some()) {
        let page = Page::parse(&super::read(&path));
        let place = path.display();
        assert!(page.links.iter().any(|(_, target)| target.contains("://")), "{place}: no source");
        assert!(!page.images.is_empty(), "{place}: no figure");
        for image in &page.images {
            let size = fs::metadata(folder.join(image)).unwrap().len();
            assert!(size <= LARGEST_FIGURE, "{place}: {image} has {size} bytes");
        }
        assert!(page.anchors.contains("what-it-cannot-say"), "{place}: nothing is left open");
        records += 1;
    }
    assert_eq!(records, 6);
}
