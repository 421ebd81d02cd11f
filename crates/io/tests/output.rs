//! Files appear complete or not at all.

use std::fs;
use std::path::Path;

use mechid_io::{BegunFile, CsvFile, OutputFile, csv_text, write_all};
use mechid_signal::Sampling;

fn names(folder: &Path) -> Vec<String> {
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
    write_all(vec![], &[file("a", "one"), file("b", "two")]).unwrap();
    assert_eq!(names(folder.path()), ["a", "b"]);
    // The second cannot be written: the first keeps its old content, nothing is left over.
    let error = write_all(vec![], &[file("a", "new"), file("no/such/folder", "x")]).unwrap_err();
    assert!(error.to_string().starts_with("cannot write "), "{error}");
    assert_eq!(fs::read_to_string(folder.path().join("a")).unwrap(), "one");
    assert_eq!(names(folder.path()), ["a", "b"]);
    write_all(vec![], &[file("a", "new")]).unwrap();
    assert_eq!(fs::read_to_string(folder.path().join("a")).unwrap(), "new");
    assert!(write_all(vec![], &[file("", "a folder stands there")]).is_err());
}

#[test]
fn a_file_begun_takes_its_name_with_the_others_or_not_at_all() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let file = |name: &str| OutputFile { path: path(name), content: b"whole".to_vec() };
    fs::write(path("a"), "old").unwrap();
    let begun = |words: &[&str]| {
        let mut begun = BegunFile::begin(path("a")).unwrap();
        words.iter().for_each(|word| begun.append(word).unwrap());
        begun
    };
    drop(begun(&["given ", "up"]));
    assert_eq!(names(folder.path()), ["a"]);
    let error = write_all(vec![begun(&["new"])], &[file("no/such/folder")]).unwrap_err();
    assert!(error.to_string().contains("folder"), "{error}");
    // One path for two files: neither is written over the other.
    let error = write_all(vec![begun(&["new"])], &[file("a")]).unwrap_err();
    assert!(error.to_string().contains("cannot write "), "{error}");
    assert_eq!(
        (names(folder.path()), fs::read(path("a")).unwrap()),
        (vec!["a".into()], b"old".into())
    );
    write_all(vec![begun(&["piece ", "by ", "piece"])], &[file("b")]).unwrap();
    assert_eq!(names(folder.path()), ["a", "b"]);
    assert_eq!(fs::read_to_string(path("a")).unwrap(), "piece by piece");
    assert_eq!(fs::read_to_string(path("b")).unwrap(), "whole");
    assert!(BegunFile::begin(path("no/such/folder")).is_err());
    assert!(BegunFile::begin(folder.path()).is_err());
}

#[test]
fn rows_come_out_as_they_do_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let sampling = Sampling::new(0.1, 10_000).unwrap();
    let columns: [Vec<f64>; 2] =
        [3.0, 7.0].map(|by| (1..=10_000).map(|k| 1.0 / (by * f64::from(k))).collect());
    let names = ["x", "a \"quoted\", name"];
    let mut file = CsvFile::begin(&path, sampling, &names).unwrap();
    for rows in [0..1, 1..1, 1..7000, 7000..10_000] {
        file.append(&[&columns[0][rows.clone()], &columns[1][rows]]).unwrap();
    }
    write_all(vec![file.finish().unwrap()], &[]).unwrap();
    let named: Vec<(String, &[f64])> =
        names.iter().zip(&columns).map(|(name, c)| ((*name).into(), c.as_slice())).collect();
    let text = csv_text(sampling, &named);
    assert!(
        text.starts_with("time,x,\"a \"\"quoted\"\", name\"\n0.0,0.3333333333333333,"),
        "{text}"
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
}

#[cfg(unix)]
#[test]
fn links_stay_links_and_devices_devices() {
    let folder = tempfile::tempdir().unwrap();
    let (target, link) = (folder.path().join("target"), folder.path().join("link"));
    fs::write(&target, "old").unwrap();
    std::os::unix::fs::symlink(&target, &link).unwrap();
    write_all(vec![], &[OutputFile { path: link.clone(), content: b"new".to_vec() }]).unwrap();
    assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    assert_eq!(fs::read_to_string(&target).unwrap(), "new");
    let null = std::path::PathBuf::from("/dev/null");
    write_all(vec![], &[OutputFile { path: null.clone(), content: b"gone".to_vec() }]).unwrap();
    assert!(!fs::metadata(&null).unwrap().is_file());
}

/// What goes into a pipe waits until it is complete.
#[cfg(target_os = "linux")]
#[test]
fn a_pipe_gets_all_of_a_file_or_nothing() {
    use std::io::Read as _;
    use std::os::fd::AsRawFd as _;

    let (mut reader, writer) = std::io::pipe().unwrap();
    let path = format!("/proc/self/fd/{}", writer.as_raw_fd());
    let begun = |words: &str| {
        let mut begun = BegunFile::begin(&path).unwrap();
        begun.append(words).unwrap();
        begun
    };
    drop(begun("given up"));
    write_all(vec![begun("all of it")], &[]).unwrap();
    drop(writer);
    let mut text = String::new();
    reader.read_to_string(&mut text).unwrap();
    assert_eq!(text, "all of it");
}
