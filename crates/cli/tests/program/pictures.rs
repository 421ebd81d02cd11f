//! Pictures of records, runs and machines. Reference: the positions of curves and marks between the
//! ticks of the axes, from closed forms.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use roxmltree::{Document, Node};

use super::{mechid, refused};

/// Vertical distance between the baseline of a tick's digits and their middle, in px.
const MIDDLE: f64 = 0.36 * 11.5;

const MACHINE: &str = r#"{"system": {"mass": 25, "natural_frequency_hz": 12, "damping_ratio": 0.05},
    "sampling": {"samples": 64, "rate_hz": 64}, "excitation": [{"dof": 1, "lines": "1:20", "amplitude": 2}],
    "periods": 2, "noise": {"force": {"snr_db": 20}, "seed": 7}}"#;

/// Returns the description of a chain of equal masses as JSON, with a wall at both ends if
/// `between_walls`.
fn chain(masses: usize, between_walls: bool) -> String {
    let matrix = |diagonal: f64, beside: f64| {
        let entry = |i: usize, j: usize| match i.abs_diff(j) {
            0 if !between_walls && (i == 0 || i == masses - 1) => diagonal + beside,
            0 => diagonal,
            1 => beside,
            _ => 0.0,
        };
        let row = |i| (0..masses).map(|j| entry(i, j)).collect::<Vec<_>>();
        format!("{:?}", (0..masses).map(row).collect::<Vec<_>>())
    };
    let mass: Vec<Vec<f64>> =
        (0..masses).map(|i| (0..masses).map(|j| f64::from(u8::from(i == j))).collect()).collect();
    let damping = if between_walls { 0.4 } else { 0.0 };
    format!(
        r#"{{"system": {{"mass": {mass:?}, "damping": {}, "stiffness": {}}}, "periods": 1,
           "sampling": {{"samples": 32, "rate_hz": 64}}, "excitation": [{{"dof": 1, "lines": "1:9", "amplitude": 1}}],
           "scheme": {{"name": "newmark"}}, "response": "from-rest"}}"#,
        matrix(damping, -0.5 * damping),
        matrix(2000.0, -1000.0)
    )
}

/// Runs a command and returns the picture that it draws.
fn drawn(folder: &Path, arguments: &str) -> String {
    let file = folder.join("drawn.svg");
    mechid(folder, &format!("{arguments} --quiet --plot drawn.svg"));
    let svg = fs::read_to_string(&file).unwrap();
    fs::remove_file(file).unwrap();
    svg
}

fn of_class<'a>(node: Node<'a, 'a>, class: &str) -> Vec<Node<'a, 'a>> {
    node.descendants().filter(|n| n.attribute("class") == Some(class)).collect()
}

fn texts(document: &Document<'_>) -> Vec<String> {
    let texts = document.descendants().filter(|n| n.has_tag_name("text"));
    texts
        .map(|n| n.descendants().filter_map(|d| d.text().filter(|_| d.is_text())).collect())
        .collect()
}

fn has(svg: &str, words: &[&str]) {
    let document = Document::parse(svg).unwrap();
    let texts = texts(&document);
    for word in words {
        assert!(texts.iter().any(|text| text == word), "no \"{word}\" in {texts:?}");
    }
}

/// Returns the coordinates of the first path in a group, in pairs.
fn path(group: Node<'_, '_>) -> Vec<(f64, f64)> {
    let path = group.descendants().find_map(|n| n.attribute("d")).unwrap();
    let numbers = path.split([' ', 'M', 'L']).filter(|part| !part.is_empty());
    let numbers: Vec<f64> = numbers.map(|n| n.parse().unwrap()).collect();
    numbers.chunks(2).map(|pair| (pair[0], pair[1])).collect()
}

/// Returns the position of the tick with this label, in px. If `anchor` is "end", the tick is on
/// the ordinate of a panel, otherwise on the lowest abscissa.
fn tick(node: Node<'_, '_>, label: &str, anchor: &str) -> f64 {
    let of = |n: &Node<'_, '_>| {
        n.has_tag_name("text")
            && n.text() == Some(label)
            && n.attribute("text-anchor") == Some(anchor)
    };
    let text = node.descendants().rfind(of).unwrap_or_else(|| panic!("no tick {label}"));
    let coordinate = |name: &str| text.attribute(name).unwrap().parse::<f64>().unwrap();
    if anchor == "end" { coordinate("y") - MIDDLE } else { coordinate("x") }
}

fn near(value: f64, truth: f64) {
    assert!((value - truth).abs() < 0.6, "{value} px, truth {truth} px");
}

#[test]
fn a_resonance_is_marked_and_stands_where_it_belongs() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("one.json"), MACHINE).unwrap();
    let svg = drawn(folder.path(), "modes one.json");
    has(&svg, &["Receptance (m/N)", "Phase (°)", "Frequency (Hz)", "natural frequency, 12 Hz"]);
    let document = Document::parse(&svg).unwrap();
    let panels = of_class(document.root(), "panel");
    let (ten, twenty) = (tick(panels[1], "10", "middle"), tick(panels[1], "20", "middle"));
    let at = |hz: f64| ten + (twenty - ten) * (hz / 10.0).log2();
    let curve = |panel: usize| path(of_class(panels[panel], "curve")[0]);
    for panel in &panels {
        near(path(of_class(*panel, "reference")[0])[0].0, at(12.0));
    }
    let highest = curve(0).into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap();
    near(highest.0, at(12.0 * (1.0 - 2.0 * 0.05f64.powi(2)).sqrt()));
    // A factor of 10 in the receptance is one decade of its axis.
    let (static_y, peak) = (curve(0)[0].1, 1.0 / (2.0 * 0.05 * (1.0 - 0.05f64.powi(2)).sqrt()));
    let first = 1.0 / ((1.0 - 0.04f64).powi(2) + (2.0 * 0.05 * 0.2f64).powi(2)).sqrt();
    let labels = panels[0].descendants().filter(|n| n.has_tag_name("tspan"));
    let labels = labels.filter_map(|n| n.parent()).filter(|n| n.text() == Some("10"));
    let decades: Vec<f64> = labels.map(|n| n.attribute("y").unwrap().parse().unwrap()).collect();
    near(static_y - highest.1, (decades[0] - decades[1]) * (peak / first).log10());
    // At the natural frequency the phase between force and motion is 90°.
    let turned = tick(panels[1], "−90", "end");
    let nearest =
        curve(1).into_iter().min_by(|a, b| (a.1 - turned).abs().total_cmp(&(b.1 - turned).abs()));
    near(nearest.unwrap().0, at(12.0));
}

#[test]
fn every_pair_of_two_and_the_driving_points_of_many_are_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: String| fs::write(folder.path().join(name), text).unwrap();
    write("two.json", chain(2, true));
    write("eight.json", chain(8, true));
    write("free.json", chain(2, false));
    let svg = drawn(folder.path(), "modes two.json");
    // Two equal masses on three equal springs have the frequencies √(k/m) and √(3 k/m).
    let marks = "natural frequencies, 5.0329, 8.7173 Hz";
    has(&svg, &["x1 / F1", "x1 / F2 = x2 / F1", "x2 / F2", marks]);
    let svg = drawn(folder.path(), "modes eight.json");
    has(
        &svg,
        &["eight.json, driving points 1 to 6 of 8", "x1 / F1", "x6 / F6", "natural frequencies"],
    );
    let document = Document::parse(&svg).unwrap();
    for panel in of_class(document.root(), "panel") {
        assert_eq!(of_class(panel, "curve").len(), 6);
        assert_eq!(of_class(panel, "reference").len(), 8);
    }
    // The phase of a chain without damping and without walls at its ends jumps between 0 and −180°.
    let svg = drawn(folder.path(), "modes free.json");
    has(&svg, &["natural frequency, 7.1176 Hz", "0", "−180"]);
    let texts = texts(&Document::parse(&svg).unwrap());
    assert!(!texts.iter().any(|t| t == "180" || t == "−360"), "{texts:?}");
}

#[test]
fn a_run_is_drawn_as_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("one.json"), MACHINE).unwrap();
    let svg = drawn(folder.path(), "simulate one.json --output run.csv");
    has(&svg, &["run.csv", "Time (s)", "Force (N)", "Displacement (m)", "Velocity (m/s)"]);
    has(&svg, &["Acceleration (m/s²)"]);
    let document = Document::parse(&svg).unwrap();
    let panels = of_class(document.root(), "panel");
    assert_eq!(panels.len(), 4);
    let table = mechid::io::Table::read(folder.path().join("run.csv")).unwrap();
    let force = table.column("force").unwrap();
    let (zero, ten) = (tick(panels[0], "0", "end"), tick(panels[0], "10", "end"));
    let (start, second) = (tick(panels[3], "0.0", "middle"), tick(panels[3], "1.0", "middle"));
    let points = path(of_class(panels[0], "curve")[0]);
    assert_eq!(points.len(), 128);
    for (k, ((x, y), force)) in points.iter().zip(force).enumerate() {
        near(*x, start + (second - start) * k as f64 / 64.0);
        near(*y, zero + (ten - zero) * force / 10.0);
    }
    fs::write(folder.path().join("eight.json"), chain(8, true)).unwrap();
    let svg = drawn(folder.path(), "simulate eight.json --output run.csv");
    has(
        &svg,
        &["run.csv, the first 4 of 8 degrees of freedom", "Force 1 (N)", "Acceleration 4 (m/s²)"],
    );
}

/// Writes a record of 2 sin(2π·k/50) + 0.5 sin(2π·3k/50) + 1 at 100 Hz, with ten other columns.
fn record(folder: &Path) {
    let mut text = String::from("t,Force [kN],x_mm,c3,c4,c5,c6,c7,c8,c9,c10\n");
    for k in 0..300 {
        let turn = std::f64::consts::TAU * f64::from(k) / 50.0;
        let force = 2.0 * turn.sin() + 0.5 * (3.0 * turn).sin() + 1.0;
        let t = f64::from(k) / 100.0;
        writeln!(text, "{t},{force},{}{}", (-4.0 * t).exp(), ",5".repeat(8)).unwrap();
    }
    fs::write(folder.join("timed.csv"), &text).unwrap();
    fs::write(folder.join("other.csv"), text.replacen("t,F", "clock,F", 1)).unwrap();
}

#[test]
fn a_record_is_drawn_over_time_and_by_frequency() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let svg = drawn(folder.path(), "info timed.csv --columns 2,x_mm,c3");
    has(&svg, &["timed.csv", "2 Force [kN]", "Value (kN)", "Amplitude (kN)", "Amplitude (mm)"]);
    has(&svg, &["period of 50 samples", "Hann window, no period", "constant"]);
    has(&svg, &["Time in the window (s)", "Frequency (Hz)"]);
    let document = Document::parse(&svg).unwrap();
    let panels = of_class(document.root(), "panel");
    assert_eq!(panels.len(), 6);
    let (zero, one) = (tick(panels[0], "0", "end"), tick(panels[0], "1", "end"));
    let points = path(of_class(panels[0], "curve")[0]);
    assert_eq!(points.len(), 300);
    near(points[0].1, one);
    let largest = points.iter().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let closed = |k: f64| {
        let turn = std::f64::consts::TAU * k / 50.0;
        2.0 * turn.sin() + 0.5 * (3.0 * turn).sin() + 1.0
    };
    let peak = (0..50).map(|k| closed(f64::from(k))).fold(0.0, f64::max);
    near(largest, zero + (one - zero) * peak);
    // The lines at 2 and 6 Hz have the amplitudes 2 and 0.5.
    let (none, fifty) = (tick(panels[5], "0", "middle"), tick(panels[5], "50", "middle"));
    let (tenth, whole) = (tick(panels[1], "0.1", "end"), tick(panels[1], "1", "end"));
    let stems = of_class(panels[1], "curve")[0];
    let stems: Vec<Vec<(f64, f64)>> = stems
        .descendants()
        .filter_map(|n| n.attribute("d"))
        .flat_map(|d| d.split('M').filter(|stem| !stem.is_empty()))
        .map(|stem| {
            let numbers = stem.split([' ', 'L']).filter(|part| !part.is_empty());
            let numbers: Vec<f64> = numbers.map(|n| n.parse().unwrap()).collect();
            numbers.chunks(2).map(|pair| (pair[0], pair[1])).collect()
        })
        .filter(|line: &Vec<(f64, f64)>| line[1].1 < tenth)
        .collect();
    assert_eq!(stems.len(), 2);
    for (stem, (hz, amplitude)) in stems.iter().zip([(2.0, 2.0f64), (6.0, 0.5)]) {
        near(stem[0].0, none + (fifty - none) * hz / 50.0);
        near(stem[1].1, whole + (whole - tenth) * amplitude.log10());
    }
}

#[test]
fn columns_beyond_eight_and_the_time_are_left_out_and_told() {
    let folder = tempfile::tempdir().unwrap();
    record(folder.path());
    let told = mechid(folder.path(), "info timed.csv --plot a.png");
    assert!(
        told.contains("to draw others, choose them with --columns: 10 \"c9\", 11 \"c10\"\n"),
        "{told}"
    );
    assert!(fs::read(folder.path().join("a.png")).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
    let svg = drawn(folder.path(), "info timed.csv");
    assert_eq!(of_class(Document::parse(&svg).unwrap().root(), "panel").len(), 16);
    has(&svg, &["2 Force [kN]", "9 c8"]);
    assert!(!svg.contains(">1 t<"), "time is drawn over time");
    has(
        &drawn(folder.path(), "info timed.csv --columns 3 --period 150"),
        &["period of 150 samples"],
    );
    // The name `clock` does not mark a column as the time axis, so this column is shown as a
    // channel.
    let svg = drawn(folder.path(), "info other.csv --columns clock,2 --start 101");
    has(&svg, &["1 clock", "Sample", "Frequency (cycles/sample)", "120", "300"]);
}

#[test]
fn what_cannot_be_drawn_is_refused_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
    write("one.json", MACHINE);
    write("free.json", r#"{"system": {"mass": 3, "damping": 0, "stiffness": 0}}"#);
    write("time.csv", "time\n0\n1\n2\n3\n");
    let before = fs::read_dir(folder.path()).unwrap().count();
    for (arguments, words) in [
        ("modes one.json --plot x.txt", "must end in .svg, .png or .html"),
        ("simulate one.json --output y.csv --plot x.txt", "must end in .svg, .png or .html"),
        ("info time.csv --plot x.txt", "must end in .svg, .png or .html"),
        ("modes free.json --plot x.svg", "free.json: nothing to plot: the machine has no natural"),
        ("info time.csv --plot x.svg", "time.csv: nothing to plot: no column other than time"),
        ("simulate one.json --output y.csv --plot missing/x.svg", "missing/x.svg"),
        ("modes one.json --plot missing/x.svg", "missing/x.svg"),
    ] {
        let message = refused(folder.path(), arguments);
        assert!(message.contains(words), "{arguments}: {message}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), before, "{arguments}");
    }
    for command in ["modes one.json", "simulate one.json --output y.csv"] {
        mechid(folder.path(), &format!("{command} --plot a.PNG"));
        let png = fs::read(folder.path().join("a.PNG")).unwrap();
        assert!(png.starts_with(b"\x89PNG\r\n\x1a\n"), "{command}");
    }
}

/// Every page has the command that writes it again; a force has the name of its column, and a file
/// is shown without its folder, except in the command.
#[test]
fn pages_name_their_command_and_call_files_and_forces_by_their_names() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let write = |name: &str, text: &str| fs::write(folder.join(name), text).unwrap();
    write("one.json", MACHINE);
    fs::create_dir(folder.join("day")).unwrap();
    mechid(folder, "simulate one.json --output run.csv --quiet");
    let text = fs::read_to_string(folder.join("run.csv")).unwrap();
    write("day/run.csv", &text.replacen("force", "shaker", 1));
    let columns = "--force shaker --displacement displacement --period 64";
    let json = mechid(folder, &format!("identify day/run.csv {columns} --json"));
    write("day/rig.json", &json);
    let system = "--system day/rig.json --displacement displacement --period 64";
    for command in [
        format!("identify day/run.csv {columns}"),
        format!("frf day/run.csv {columns}"),
        format!("force day/run.csv {system}"),
        "info day/run.csv".into(),
        "modes day/rig.json".into(),
        "simulate one.json --output again.csv".into(),
        "stability".into(),
        "multisine --samples 64 --rate 64 --lines 1:9".into(),
    ] {
        let command = format!("{command} --quiet --plot page.html");
        mechid(folder, &command);
        let page = fs::read_to_string(folder.join("page.html")).unwrap();
        let (above, below) = page.split_once("How to repeat it</h2>").expect(&command);
        assert!(below.contains(&format!("<code>mechid {command}</code>")), "{command}: {below}");
        assert!(!above.contains("day/"), "{command}");
        if command.starts_with("force") {
            assert!(above.contains("Amplitude of shaker") && !above.contains("Force 1"));
            assert!(above.contains("<h1>Force in the record of run.csv</h1>"), "{above}");
        }
    }
}
