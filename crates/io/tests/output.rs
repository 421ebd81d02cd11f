//! Files appear complete or not at all.

use std::fs;

use mechid_io::{OutputFile, write_all};

fn names(folder: &std::path::Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn all_files_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, content: &str| OutputFile {
        path: folder.path().join(name),
        content: content.into(),
    };
    write_all(&[file("a", "one"), file("b", "two")]).unwrap();
    assert_eq!(names(folder.path()), ["a", "b"]);
    // The second cannot be written: the first keeps its old content, nothing is left over.
    let error = write_all(&[file("a", "new"), file("no/such/folder", "x")]).unwrap_err();
    assert!(error.to_string().starts_with("cannot write "), "{error}");
    assert_eq!(fs::read_to_string(folder.path().join("a")).unwrap(), "one");
    assert_eq!(names(folder.path()), ["a", "b"]);
    write_all(&[file("a", "new")]).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("a")).unwrap(), "new");
    assert!(write_all(&[file("", "a folder stands there")]).is_err());
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_devices() {
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_all(&[OutputFile { path: link.clone(), content: b"new".to_vec() }]).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read_to_string(&target).unwrap(), "new");
    let null = std::path::PathBuf::from("/dev/null");
    write_all(&[OutputFile { path: null.clone(), content: b"gone".to_vec() }]).unwrap();
    assert!(!fs::metadata(&null).unwrap().is_file());
}
