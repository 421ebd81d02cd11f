//! The page of `mechid report` is complete, loads no other files, is readable, and agrees with the
//! data.
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

mod browser;
mod long;
mod receptance;

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use roxmltree::{Document, Node, ParsingOptions};

/// Runs `mechid` with these arguments and returns what it prints.
fn mechid(folder: &Path, arguments: &[&str]) -> String {
    let output =
        Command::cargo_bin("mechid").unwrap().current_dir(folder).args(arguments).output().unwrap();
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {message}");
    String::from_utf8(output.stdout).unwrap()
}

/// Writes a record of two periods: a force with the same amplitude on every line, and the steady
/// displacement of two parallel oscillators with white noise. The displacement is summed term by
/// term.
///
/// `second` is the stiffness of the second oscillator; infinity means that there is none.
fn rig(names: [&str; 3], second: f64, noise: f64) -> tempfile::TempDir {
    let mut text = format!("{}\n", names.map(|name| format!("\"{name}\"")).join(","));
    let mut random = 1_u64;
    for k in 0..512 {
        let t = f64::from(k) / 64.0;
        let (mut force, mut x) = (0.0, 0.0);
        for n in 4..=80 {
            let (omega, phase) = (TAU * f64::from(n) / 4.0, f64::from(n * n));
            force += 5.0 * (omega * t + phase).cos();
            for (m, c, stiffness) in [(2.0, 6.0, 800.0), (2.0, 20.0, second)] {
                let (re, im) = (stiffness - m * omega * omega, c * omega);
                x += 5.0 / re.hypot(im) * (omega * t + phase - im.atan2(re)).cos();
            }
        }
        // A linear congruential generator (Knuth's MMIX) gives uniform numbers, which are white
        // noise to all tests here.
        random =
            random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        x += noise * ((random >> 11) as f64 / (1_u64 << 53) as f64 - 0.5);
        writeln!(text, "{t},{force:.17e},{x:.17e}").unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rig.csv"), text).unwrap();
    folder
}

const NAMES: [&str; 3] = ["time", "F", "x"];

const USUAL: [&str; 12] = [
    "report",
    "rig.csv",
    "--force",
    "F",
    "--displacement",
    "x",
    "--period",
    "256",
    "--reconstruct-force",
    "--output",
    "page.html",
    "--quiet",
];

fn page(folder: &Path) -> String {
    fs::read_to_string(folder.join("page.html")).unwrap()
}

/// Returns the page as XML: closes the `meta` elements, because they alone have no end tag, and
/// removes the script of the figures, because it is not XML. Checks that the page has this script
/// once, and the security policy with the hash of the script.
fn closed(page: &str) -> String {
    let policy = mechid::plot::content_policy();
    let quoted = policy.replace('\'', "&#39;");
    assert!(page.contains(policy) || page.contains(&quoted), "no policy");
    let script = format!("<script>{}</script>", mechid::plot::script());
    assert_eq!(page.matches(&script).count(), 1);
    let page = page.replacen(&script, "", 1);
    let mut parts = page.split("<meta ");
    let mut text = parts.next().unwrap().to_owned();
    for part in parts {
        text += &format!("<meta {}", part.replacen('>', "/>", 1));
    }
    text
}

fn parse(text: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).unwrap()
}

fn tagged<'a>(document: &'a Document<'_>, name: &'a str) -> Vec<Node<'a, 'a>> {
    document.descendants().filter(|node| node.tag_name().name() == name).collect()
}

fn text(node: Node<'_, '_>) -> String {
    node.descendants().filter(Node::is_text).filter_map(|n| n.text()).collect()
}

/// Returns the cells of the first row whose first cell is `first`, in the table with this caption.
fn row(document: &Document<'_>, caption: &str, first: &str) -> Vec<String> {
    let tables = tagged(document, "table");
    let has = |table: &&Node<'_, '_>| text(table.first_element_child().unwrap()) == caption;
    let table = tables.iter().find(has).unwrap_or_else(|| panic!("no table \"{caption}\""));
    // The header row has no values.
    let has_values = |row: &Node<'_, '_>| row.children().any(|cell| cell.has_tag_name("td"));
    let rows = table.descendants().filter(|node| node.has_tag_name("tr") && has_values(node));
    let mut cells = rows.map(|row| row.children().map(text).collect::<Vec<_>>());
    cells.find(|cells| cells[0] == first).unwrap_or_else(|| panic!("no row \"{first}\""))
}

/// Returns headings and texts of the remarks for and against the result.
fn remarks(document: &Document<'_>) -> Vec<(String, String)> {
    let asides = tagged(document, "aside");
    asides.iter().map(|aside| (text(aside.first_element_child().unwrap()), text(*aside))).collect()
}

/// Returns the text of the lists of checks.
fn checks(document: &Document<'_>) -> String {
    let lists = tagged(document, "ul").into_iter();
    lists.filter(|list| list.attribute("class") == Some("checks")).map(text).collect()
}

#[test]
fn the_page_is_whole_and_stands_alone() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    mechid(folder.path(), &USUAL);
    let html = page(folder.path());
    assert!(html.starts_with("<!DOCTYPE html>"));
    let closed = closed(&html);
    let document = parse(&closed);
    let root = document.root_element();
    assert_eq!(root.attribute("lang"), Some("en"));
    assert_eq!(text(tagged(&document, "h1")[0]), "Identification of rig.csv");
    assert!(tagged(&document, "meta").iter().any(|m| m.attribute("name") == Some("viewport")));

    let figures = tagged(&document, "figure");
    let names: Vec<_> = figures.iter().filter_map(|figure| figure.attribute("id")).collect();
    let expected = [
        "force",
        "motion",
        "receptance",
        "fit",
        "residual-spectrum",
        "correlations",
        "reconstructed-force",
    ];
    assert_eq!(names, expected.map(|name| format!("figure-{name}")));
    for figure in figures {
        let svg = figure.first_element_child().unwrap();
        assert_eq!((svg.tag_name().name(), svg.attribute("role")), ("svg", Some("img")));
        let caption = text(figure.last_element_child().unwrap());
        assert_eq!(svg.first_element_child().unwrap().text(), Some(caption.as_str()));
        assert!(svg.descendants().filter(|node| node.has_tag_name("path")).count() > 2);
    }
    for table in tagged(&document, "table") {
        assert_eq!(table.parent().unwrap().attribute("class"), Some("scroll"));
        assert!(!text(table.first_element_child().unwrap()).is_empty(), "a table has a caption");
    }
    let mut ids: Vec<_> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    for link in tagged(&document, "a") {
        let target = link.attribute("href").unwrap().strip_prefix('#').unwrap();
        assert!(ids.contains(&target), "{target}");
    }
    ids.sort_unstable();
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]), "an id is there twice");

    let script = mechid::plot::script();
    assert!(!script.replacen("http://www.w3.org/2000/svg", "", 1).contains("http"));
    let html = html.replacen(script, "", 1).replacen("<script></script>", "", 1);
    let elsewhere = html.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "");
    assert!(!elsewhere.contains("http"), "the page names another place");
    for foreign in ["script", "link", "img", "iframe", "object", "base"] {
        assert!(tagged(&document, foreign).is_empty(), "{foreign}");
    }
    assert!(!html.replace("url(#", "").contains("url("));
}

/// The page states the parameters of the oscillator, the levels of the channels and the lines of
/// the force as in the closed form of the record.
#[test]
fn the_page_says_what_is_in_the_record() {
    let folder = rig(NAMES, f64::INFINITY, 0.0);
    mechid(folder.path(), &USUAL);
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    for (name, value) in [("m", 2.0), ("c", 6.0), ("k", 800.0)] {
        let found: f64 = row(&document, "Parameters", name)[1].parse().unwrap();
        assert!((found - value).abs() < 1e-9 * value, "{name} = {found}");
    }
    assert_eq!(row(&document, "The record", "Duration")[1], "8 s");
    assert_eq!(row(&document, "The record", "Line spacing")[1], "0.25 Hz");
    let channel = row(&document, "Channels over the window", "F");
    // The force has 77 lines of 5 N, so its RMS is 5 √(77/2).
    assert_eq!((channel[4].as_str(), channel[7].as_str()), ("31.02", "0 %"));
    let excitation = row(&document, "Quality of the excitation", "F");
    assert_eq!(excitation[3..], ["77", "1 to 20", "1.00", "154"]);
    assert_eq!(row(&document, "Residual of the response", "x")[3..], ["0", "0 %"]);
    assert!(checks(&document).contains("residual 1: rounding"), "{}", checks(&document));
    let force = row(&document, "Computed and measured force", "F");
    assert_eq!((&force[1], &force[2]), (&"31.02".to_owned(), &"31.02".to_owned()));
    let [(heading, _)] = &remarks(&document)[..] else { panic!("nothing speaks against it") };
    assert_eq!(heading, "Evidence for the numbers");
}

/// With a correct model the residual has the power of the noise; if the model lacks a mode, the
/// residual has more power, and the page reports this.
#[test]
fn a_missing_mode_shows_in_the_residual() {
    let likely = [&USUAL[..], &["--method", "maximum-likelihood"]].concat();
    for second in [f64::INFINITY, 9000.0] {
        let folder = rig(NAMES, second, 4e-3);
        mechid(folder.path(), &likely);
        let closed = closed(&page(folder.path()));
        let document = parse(&closed);
        let is_missing = second.is_finite();
        assert_eq!(checks(&document).contains("good misfit"), !is_missing);
        let remarks = remarks(&document);
        // A note for or against the fit compares the power of the residual with the power of the
        // noise.
        for (heading, text) in &remarks {
            let bad = heading.starts_with("Before");
            assert_eq!(text.contains("exceeds the noise"), bad && is_missing, "{text}");
            assert_eq!(text.contains("× the noise power"), bad == is_missing, "{text}");
        }
        assert_eq!(remarks.len(), if is_missing { 2 } else { 1 });
    }
}

#[test]
fn names_of_others_stay_text() {
    let hostile = ["time", "<script>alert(1)</script>", "x\"\" onload=\"\"alert(2)"];
    let folder = rig(hostile, f64::INFINITY, 1e-3);
    let title = "</title><script>alert(3)</script><p onclick='x'>&amp;";
    fs::rename(folder.path().join("rig.csv"), folder.path().join("R&D 'rig'.csv")).unwrap();
    let arguments = [
        "report",
        "R&D 'rig'.csv",
        "--force",
        hostile[1],
        "--displacement",
        "x\" onload=\"alert(2)",
        "--period",
        "256",
        "--title",
        title,
        "--output",
        "page.html",
    ];
    mechid(folder.path(), &arguments);
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    assert!(tagged(&document, "script").is_empty());
    let handlers = document.descendants().flat_map(|node| node.attributes());
    assert_eq!(handlers.filter(|a| a.name().starts_with("on")).count(), 0);
    assert_eq!(text(tagged(&document, "h1")[0]), title);
    assert_eq!(text(tagged(&document, "title")[0]), title);
    // Text in brackets, including angle brackets, is not part of a name.
    let shown = "alert(1)";
    assert_eq!(row(&document, "Channels over the window", shown)[1], "force");
    let command = text(tagged(&document, "code")[0]);
    assert_eq!(shlex::split(&command).unwrap()[1..], arguments);
}

#[test]
fn the_command_on_the_page_writes_the_page_again() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    let with_title = [&USUAL[..], &["--title", "it's \"the\" rig"]].concat();
    mechid(folder.path(), &with_title);
    let first = page(folder.path());
    let closed = closed(&first);
    let command = shlex::split(&text(tagged(&parse(&closed), "code")[0])).unwrap();
    fs::remove_file(folder.path().join("page.html")).unwrap();
    let arguments: Vec<&str> = command[1..].iter().map(String::as_str).collect();
    mechid(folder.path(), &arguments);
    assert_eq!(page(folder.path()), first);
}

#[test]
fn programs_get_the_report_of_identify_and_the_place_of_the_page() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    let arguments = [&USUAL[..11], &["--json"]].concat();
    let mut printed: serde_json::Value =
        serde_json::from_str(&mechid(folder.path(), &arguments)).unwrap();
    let identify = [&["identify"], &USUAL[1..8], &["--json"]].concat();
    let identified: serde_json::Value =
        serde_json::from_str(&mechid(folder.path(), &identify)).unwrap();
    assert_eq!(printed.as_object_mut().unwrap().remove("html").unwrap(), "page.html");
    assert_eq!(printed, identified);
}

/// The page of an open record has all seven figures; the receptance is averaged over segments.
#[test]
fn an_open_record_has_its_page_too() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = tempfile::tempdir().unwrap();
    fs::copy(root.join("examples/machine.csv"), folder.path().join("rig.csv")).unwrap();
    let arguments = [
        "report",
        "rig.csv",
        "--force",
        "force",
        "--displacement",
        "displacement",
        "--velocity",
        "velocity",
        "--acceleration",
        "acceleration",
        "--domain",
        "time",
        "--reconstruct-force",
        "--output",
        "page.html",
    ];
    mechid(folder.path(), &arguments);
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    let figures = tagged(&document, "figure");
    let receptance =
        figures.iter().find(|figure| figure.attribute("id") == Some("figure-receptance"));
    assert!(text(*receptance.unwrap()).contains("by H1 from segments of 64 samples"));
    assert_eq!(figures.len(), 7);
    let force = row(&document, "Computed and measured force", "force");
    let difference: f64 = force[4].strip_suffix(" %").unwrap().parse().unwrap();
    // Noise of 1 % on the motion gives an error of about 1 % in the force, because the force is
    // mostly inertia.
    assert!(difference > 0.5 && difference < 5.0, "{difference}");
}

/// The page shows every fitted record and a validation record. Reference for the quality of the
/// prediction: the noise that was added to the exact motion, which is computed in closed form.
#[test]
fn several_records_and_one_that_was_not_fitted_are_on_the_page() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    let other = rig(NAMES, f64::INFINITY, 4e-2);
    fs::copy(other.path().join("rig.csv"), folder.path().join("noisy.csv")).unwrap();
    let again = rig(NAMES, f64::INFINITY, 1.1e-3);
    fs::copy(again.path().join("rig.csv"), folder.path().join("again.csv")).unwrap();
    let arguments = [&USUAL[..], &["again.csv", "--validate", "noisy.csv"]].concat();
    mechid(folder.path(), &arguments);
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    let names: Vec<String> = tagged(&document, "h3").into_iter().map(text).collect();
    // Each record has sections for data, excitation, residual and force.
    assert_eq!(names, ["rig.csv", "again.csv"].repeat(4));
    let figures = tagged(&document, "figure");
    let ids: Vec<&str> = figures.iter().filter_map(|f| f.attribute("id")).collect();
    for name in ["force", "motion", "fit", "residual-spectrum", "reconstructed-force"] {
        assert!(ids.contains(&format!("figure-{name}").as_str()), "{name}");
        assert!(ids.contains(&format!("figure-{name}-2").as_str()), "{name}");
    }
    assert_eq!(ids.iter().filter(|id| **id == "figure-validation").count(), 1);
    let fit = &row(&document, "Prediction of the responses", "x")[1];
    let fit: f64 = fit.strip_suffix(" %").unwrap().parse().unwrap();
    // The standard deviation of a uniform random number is the width of its range divided by √12.
    let motion: f64 = row(&document, "Channels over the window", "x")[4].parse().unwrap();
    let noise = 4e-2 / 12f64.sqrt();
    let expected = 100.0 * (1.0 - noise / motion.hypot(noise));
    assert!((fit - expected).abs() < 2.0, "{fit} {expected}");
    let remarks = remarks(&document);
    let (_, merits) = remarks.iter().find(|(heading, _)| heading.starts_with("Evidence")).unwrap();
    assert!(merits.contains("noisy.csv, samples 1 to 512"), "{merits}");
    // Validation on the fitted samples proves little; validation on other samples of the same
    // record counts as evidence.
    for (more, proves) in [
        (&["--validate", "rig.csv"][..], false),
        (&["--validate", "rig.csv:257", "--periods", "1"], true),
    ] {
        mechid(folder.path(), &[&USUAL[..], more].concat());
        assert_eq!(page(folder.path()).contains("of every response is predicted"), proves);
        assert_eq!(page(folder.path()).contains("agreement proves little"), !proves);
    }
}

/// The page of a record that is averaged over segments has the spectral lines of a segment, not of
/// the whole record. Reference: the exact response of an oscillator to sines with no whole number
/// of periods in a segment.
#[test]
fn a_record_in_segments_has_its_page_too() {
    let (m, c, k) = (2.0, 6.0, 800.0);
    let mut text = String::from("time,F,x\n");
    for sample in 0..4096 {
        let t = f64::from(sample) / 64.0;
        let (mut force, mut x) = (0.0, 0.0);
        for n in 1..=400 {
            let (omega, phase) = (TAU * 0.0251 * f64::from(n), f64::from(n * n));
            let (re, im) = (k - m * omega * omega, c * omega);
            force += (omega * t + phase).cos();
            x += (omega * t + phase - im.atan2(re)).cos() / re.hypot(im);
        }
        writeln!(text, "{t},{force:.17e},{x:.17e}").unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("rig.csv"), text).unwrap();
    let segments =
        ["--from-frf", "h1", "--segment", "512", "--band-hz", "1:8", "--reconstruct-force"];
    let arguments = [&USUAL[..6], &segments[..], &["--output", "page.html"]].concat();
    mechid(folder.path(), &arguments);
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    for (name, value) in [("m", m), ("c", c), ("k", k)] {
        let found: f64 = row(&document, "Parameters", name)[1].parse().unwrap();
        assert!((found - value).abs() < 0.05 * value, "{name} = {found}");
    }
    assert_eq!(row(&document, "The record", "Segments")[1], "of 512 samples");
    assert_eq!(row(&document, "The record", "Line spacing")[1], "0.125 Hz");
    let percent = |cell: &str| cell.strip_suffix(" %").unwrap().parse::<f64>().unwrap();
    let left = row(&document, "Residual of the response", "x");
    assert!(percent(&left[4]) < 5.0, "{left:?}");
    let force = row(&document, "Computed and measured force", "F");
    assert!(percent(&force[4]) < 20.0, "{force:?}");
    assert_eq!(tagged(&document, "figure").len(), 6);
}
