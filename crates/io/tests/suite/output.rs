//! Files appear complete or not at all.

use std::fs;
use std::path::Path;

use mechid_io::{
    BegunFile, CsvFile, IoError, OutputFile, csv_text, refuse_replaced_inputs, write_all,
};
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
    // The second file cannot be written: the first one keeps its old content, and no temporary file
    // remains.
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
    // Two outputs with the same path are refused, and the file at this path keeps its content.
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

/// Output to a pipe is held back until it is complete.
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

#[test]
fn names_of_any_length_work() {
    let folder = tempfile::tempdir().unwrap();
    // A name has at most 255 bytes.
    for name in ["a".repeat(246), "a".repeat(255), "é".repeat(127), "加".repeat(85)] {
        let path = folder.path().join(&name);
        for content in ["one", "two"] {
            let mut begun = BegunFile::begin(&path).unwrap();
            begun.append(content).unwrap();
            write_all(vec![begun], &[]).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), content);
        }
        assert_eq!(names(folder.path()), [name]);
        fs::remove_file(path).unwrap();
    }
    let long = OutputFile { path: folder.path().join("a".repeat(256)), content: vec![] };
    assert!(matches!(write_all(vec![], &[long]), Err(IoError::Write { .. })));
}

#[cfg(unix)]
#[test]
fn a_replaced_file_keeps_its_mode_and_a_read_only_one_its_content() {
    use std::os::unix::fs::PermissionsExt as _;

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let file = |content: &str| OutputFile { path: path.clone(), content: content.into() };
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
    write_all(vec![], &[file("one")]).unwrap();
    // A new file gets the permissions that other programs give to a new file in this folder.
    fs::write(folder.path().join("b"), "").unwrap();
    assert_eq!(mode(&path), mode(&folder.path().join("b")));
    for wanted in [0o600, 0o640, 0o664, 0o777] {
        fs::set_permissions(&path, fs::Permissions::from_mode(wanted)).unwrap();
        write_all(vec![], &[file("two")]).unwrap();
        assert_eq!(mode(&path), wanted);
        assert_eq!(fs::read_to_string(&path).unwrap(), "two");
    }
    fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
    let e = write_all(vec![], &[file("three")]).unwrap_err().to_string();
    assert!(e.contains("cannot write ") && e.contains("is read-only"), "{e}");
    assert_eq!((fs::read_to_string(&path).unwrap(), mode(&path)), ("two".into(), 0o444));
    assert_eq!(names(folder.path()), ["a", "b"]);
}

/// Files that a killed program abandoned are removed; the files of a running program or of another
/// user are not removed.
#[test]
fn abandoned_files_of_the_same_output_are_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let long = folder.path().join("b".repeat(255));
    let write = |name: &str| fs::write(folder.path().join(name), "left").unwrap();
    let cut = format!(".{}.17-0.tmp", "b".repeat(200));
    for name in [".a.csv.123-0.tmp", ".a.csv.99999-7.tmp", &cut] {
        write(name);
    }
    let kept =
        [".a.csv.b-0.tmp", ".a.csv.tmp", ".a.csv.5-0.tmp~", ".c.csv.123-0.tmp", "a.csv.1-0.tmp"];
    kept.iter().for_each(|name| write(name));
    let running = fs::File::create(folder.path().join(".a.csv.4-0.tmp")).unwrap();
    running.lock().unwrap();
    for path in [&path, &long] {
        write_all(vec![], &[OutputFile { path: path.clone(), content: b"new".to_vec() }]).unwrap();
    }
    let long = "b".repeat(255);
    let mut expected: Vec<&str> = kept.to_vec();
    expected.extend([".a.csv.4-0.tmp", "a.csv", &long]);
    expected.sort_unstable();
    assert_eq!(names(folder.path()), expected);
}

/// If the program ends before a file is complete, no incomplete file remains.
#[cfg(target_os = "linux")]
#[test]
fn a_file_has_no_name_before_it_is_complete() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let mut begun = BegunFile::begin(&path).unwrap();
    begun.append(vec![b'x'; 100_000]).unwrap();
    // This check needs a file system with unnamed files; the test of abandoned files covers the
    // other file systems.
    if tempfile::tempfile_in(folder.path()).is_ok() && names(folder.path()).is_empty() {
        std::mem::forget(begun);
        assert!(names(folder.path()).is_empty());
    }
}

#[test]
fn an_output_that_is_an_input_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("rec.csv"), "t,f\n").unwrap();
    fs::write(path("other.csv"), "t,f\n").unwrap();
    fs::create_dir(path("sub")).unwrap();
    fs::hard_link(path("rec.csv"), path("hard.csv")).unwrap();
    let same = ["rec.csv", "sub/../rec.csv", "hard.csv"];
    #[cfg(unix)]
    let same = {
        std::os::unix::fs::symlink("rec.csv", path("soft.csv")).unwrap();
        std::os::unix::fs::symlink(folder.path(), path("sub/up")).unwrap();
        [&same[..], &["soft.csv", "sub/up/rec.csv"]].concat()
    };
    let same: Vec<_> = same.iter().map(|name| path(name)).collect();
    for a in &same {
        for b in &same {
            let e =
                refuse_replaced_inputs(&[path("other.csv"), a.clone()], &[path("new"), b.clone()])
                    .unwrap_err();
            assert!(matches!(e, IoError::OutputIsInput { .. }), "{e}");
            assert!(e.to_string().contains("which would be lost: write to another file"), "{e}");
        }
        refuse_replaced_inputs(std::slice::from_ref(a), &[path("other.csv"), path("new")]).unwrap();
        refuse_replaced_inputs(&[path("no such file")], std::slice::from_ref(a)).unwrap();
    }
    refuse_replaced_inputs(&["/dev/null", "-"], &["/dev/null", "-", "/dev/stdout"]).unwrap();
    refuse_replaced_inputs(&[path("rec.csv")], &[std::path::PathBuf::from("-")]).unwrap();
}

/// A link to a file that does not exist yet stays a link.
#[cfg(unix)]
#[test]
fn a_dangling_link_stays_a_link() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::create_dir(at("results")).unwrap();
    std::os::unix::fs::symlink("results/new.csv", at("first")).unwrap();
    std::os::unix::fs::symlink("first", at("second")).unwrap();
    let file = OutputFile { path: at("second"), content: b"1".to_vec() };
    write_all(Vec::new(), &[file]).unwrap();
    assert_eq!(std::fs::read(at("results/new.csv")).unwrap(), b"1");
    for link in ["first", "second"] {
        assert!(std::fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
    }
    // A link in a cycle and a link into a folder that does not exist are refused.
    std::os::unix::fs::symlink("ring", at("ring")).unwrap();
    std::os::unix::fs::symlink("none/new.csv", at("lost")).unwrap();
    for link in ["ring", "lost"] {
        let file = OutputFile { path: at(link), content: b"1".to_vec() };
        assert!(write_all(Vec::new(), &[file]).is_err(), "{link}");
    }
}
