//! The page of `mechid report`: whole, alone, readable, and true.
#![allow(clippy::print_stderr, reason = "a skipped test says so")]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process;

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

/// A folder with a record of two periods: a force of equal lines, the steady displacement of two
/// oscillators side by side, summed term by term, and white noise.
///
/// `second` is the stiffness of the second oscillator; infinity for none.
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
        // A uniform number from a linear congruence (Knuth's MMIX): white to the eye of any test.
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

/// The page as XML: of the elements that HTML never closes it has `meta` only.
fn closed(page: &str) -> String {
    let mut parts = page.split("<meta");
    let mut text = parts.next().unwrap().to_owned();
    for part in parts {
        text += &format!("<meta{}", part.replacen('>', "/>", 1));
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

/// The cells of the first row of a table that begins with `first`.
fn row(document: &Document<'_>, caption: &str, first: &str) -> Vec<String> {
    let tables = tagged(document, "table");
    let has = |table: &&Node<'_, '_>| text(table.first_element_child().unwrap()) == caption;
    let table = tables.iter().find(has).unwrap_or_else(|| panic!("no table \"{caption}\""));
    let rows = table.descendants().filter(|node| node.has_tag_name("tr"));
    let mut cells = rows.map(|row| row.children().map(text).collect::<Vec<_>>());
    cells.find(|cells| cells[0] == first).unwrap_or_else(|| panic!("no row \"{first}\""))
}

fn remarks(document: &Document<'_>) -> String {
    text(tagged(document, "aside")[0])
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

    let elsewhere = html.replace("http://www.w3.org/2000/svg", "").replace("http-equiv", "");
    assert!(!elsewhere.contains("http"), "the page names another place");
    for foreign in ["script", "link", "img", "iframe", "object", "base"] {
        assert!(tagged(&document, foreign).is_empty(), "{foreign}");
    }
    assert!(!html.replace("url(#", "").contains("url("));
}

/// Judge: the oscillator summed in the record, and its period.
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
    // 77 lines of 5 N: RMS 5 √(77/2).
    assert_eq!((channel[4].as_str(), channel[7].as_str()), ("31.02", "0 %"));
    let excitation = row(&document, "Quality of the excitation", "1");
    assert_eq!(excitation[3..], ["77", "1 to 20", "1.00", "154"]);
    assert_eq!(row(&document, "Is the residual noise?", "1")[5], "rounding only");
    let force = row(&document, "Force found and force measured", "1");
    assert_eq!((&force[1], &force[2]), (&"31.02".to_owned(), &"31.02".to_owned()));
    assert!(remarks(&document).starts_with("No remarks"), "{}", remarks(&document));
}

/// Judge: white noise is white, and a mode that the model has not is not.
#[test]
fn a_missing_mode_shows_in_the_residual() {
    let likely = [&USUAL[..], &["--method", "maximum-likelihood"]].concat();
    for (second, verdict) in [(f64::INFINITY, "as noise"), (9000.0, "correlated")] {
        let folder = rig(NAMES, second, 4e-3);
        mechid(folder.path(), &likely);
        let closed = closed(&page(folder.path()));
        let document = parse(&closed);
        assert_eq!(row(&document, "Is the residual noise?", "1")[5], verdict);
        assert_eq!(remarks(&document).contains("not white"), verdict == "correlated");
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
    assert_eq!(row(&document, "Channels over the window", hostile[1])[1], "force");
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

/// The open record has no receptance to draw; everything else is there.
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
    assert_eq!(tagged(&document, "figure").len(), 6);
    let force = row(&document, "Force found and force measured", "1");
    let difference: f64 = force[4].strip_suffix(" %").unwrap().parse().unwrap();
    // Noise of a hundredth on motion of which the inertia is the greater part.
    assert!(difference > 0.5 && difference < 5.0, "{difference}");
}

/// What a browser shows of the page in a frame of this width, in px, and what it complains of; nothing
/// if there is no browser.
///
/// A frame, because the window of a browser has a least width.
fn browse(folder: &Path, width: u32) -> Option<(String, String)> {
    let measure = "<script>addEventListener('load', () => {
        const beyond = [...document.querySelectorAll('body, body *')].filter(e =>
            e.getBoundingClientRect().right > innerWidth + 0.5 && !e.closest('.scroll > *, svg *'));
        parent.postMessage([innerWidth, document.documentElement.scrollWidth,
            ...beyond.map(e => e.tagName)].join(' '), '*');
    })</script>";
    // The copy may run the script of the test; the policy still forbids to load anything.
    let allowed = page(folder)
        .replace("default-src 'none';", "default-src 'none'; script-src 'unsafe-inline';")
        .replace("</body>", &format!("{measure}</body>"));
    fs::write(folder.join("copy.html"), allowed).unwrap();
    let frame = format!(
        "<!DOCTYPE html><title>frame</title><script>addEventListener('message', e => {{
            document.querySelector('output').textContent = e.data;
        }})</script><output></output>
        <iframe src=\"copy.html\" width=\"{width}\" height=\"900\"></iframe>"
    );
    fs::write(folder.join("frame.html"), frame).unwrap();
    let browsers = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
    let output = browsers.iter().find_map(|browser| {
        process::Command::new(browser)
            .args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars"])
            .args(["--enable-logging=stderr", "--virtual-time-budget=5000", "--dump-dom"])
            .arg(format!("--user-data-dir={}", folder.join(format!("profile{width}")).display()))
            .arg("--window-size=1400,1000")
            .arg(format!("file://{}", folder.join("frame.html").display()))
            .output()
            .ok()
    })?;
    let messages = String::from_utf8_lossy(&output.stderr);
    let console = messages.lines().filter(|line| line.contains("CONSOLE")).collect();
    let dom = String::from_utf8(output.stdout).unwrap();
    let seen = dom.split("<output>").nth(1).and_then(|s| s.split("</output>").next());
    Some((seen.unwrap_or(&dom).to_owned(), console))
}

#[test]
fn a_browser_shows_it_without_complaint_on_screen_and_telephone() {
    let folder = rig(NAMES, f64::INFINITY, 1e-3);
    let long = "long_name_of_a_column_without_any_place_to_break_it_".repeat(3);
    let record = fs::read_to_string(folder.path().join("rig.csv")).unwrap();
    let record = record.replacen("\"F\"", &format!("\"{long}\""), 1);
    fs::write(folder.path().join("rig.csv"), record).unwrap();
    let mut arguments = USUAL.to_vec();
    arguments[3] = &long;
    mechid(folder.path(), &[&arguments[..], &["--title", &long]].concat());
    for width in [390, 1280] {
        let Some((seen, console)) = browse(folder.path(), width) else {
            eprintln!("skipped: no Chromium on this machine");
            return;
        };
        assert_eq!(console, "", "the browser complains");
        assert_eq!(seen, format!("{width} {width}"), "wider than the window");
    }
}
