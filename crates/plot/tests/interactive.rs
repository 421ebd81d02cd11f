//! Tests of the data that an interactive figure contains for its script: the drawn figure is
//! parsed.

use mechid_plot::charts::{FrequencyResponse, bode};
use mechid_plot::{
    Axis, Curve, DrawnMode, Figure, FigureSet, Panel, Reference, ShapeDrawing, content_policy,
    matrix_of_squares, page_of, script,
};
use roxmltree::Document;
use serde_json::Value;

const HOSTILE: &str = "</metadata></svg><script>alert(1)</script>\" onload=\"alert(2) ]]> &amp; '";

fn metadata(svg: &str) -> Value {
    let document = Document::parse(svg).expect("the figure is XML");
    let mut found = document.descendants().filter(|node| node.has_tag_name("metadata"));
    let text = found.next().and_then(|node| node.text()).expect("numbers for the script");
    assert!(found.next().is_none());
    assert!(document.descendants().all(|node| !node.has_tag_name("script")));
    serde_json::from_str(text).expect("JSON")
}

#[test]
fn names_stay_text() {
    let x = [1.0, 2.0, 3.0];
    let panel = Panel::new(Axis::linear(HOSTILE, HOSTILE), Axis::linear(HOSTILE, HOSTILE))
        .title(HOSTILE)
        .curve(Curve::line(HOSTILE, &x, &x).notes(vec![HOSTILE.to_owned(); 3]))
        .reference(Reference::horizontal(HOSTILE, 2.0));
    let figure = Figure::new(HOSTILE).panel(panel);
    let data = metadata(&figure.to_interactive_svg(HOSTILE, HOSTILE).unwrap());
    let panel = &data["v"][0]["p"][0];
    for text in [&panel["t"], &panel["x"]["l"], &panel["c"][0]["n"], &panel["c"][0]["i"][2]] {
        assert_eq!(text, HOSTILE);
    }
    // A page must contain only one script, the script of the library.
    let set = FigureSet::new([(HOSTILE.to_owned(), figure.clone()), ("b".to_owned(), figure)]);
    let shape = ShapeDrawing {
        points: vec![(HOSTILE.to_owned(), [0.0; 3]), ("b".to_owned(), [1.0, 0.0, 0.0])],
        lines: vec![[0, 1]],
        modes: vec![DrawnMode {
            name: HOSTILE.to_owned(),
            short_name: HOSTILE.to_owned(),
            displacement: vec![[[1.0, 0.0]; 3]; 2],
        }],
    };
    let drawings = [set.draw("a", HOSTILE).unwrap(), shape.draw(HOSTILE)];
    let page = page_of(HOSTILE, &drawings);
    assert_eq!(page.matches("<script").count(), 1);
    assert!(page.contains(&format!("<script>{}</script>", script())));
    assert!(page.contains(content_policy()) && content_policy().starts_with("default-src 'none';"));
    assert!(!page.contains(" onload=\"alert"), "{page}");
    assert_eq!(metadata(&drawings[1].svg)["modes"][0]["n"], HOSTILE);
}

#[test]
fn a_response_carries_each_list_once_and_its_phase() {
    let hz: Vec<f64> = (1..=4096).map(|k| 0.25 * f64::from(k)).collect();
    let magnitude: Vec<f64> = hz.iter().map(|hz| 1e-9 * (2.0 + hz.sin())).collect();
    let phase_deg: Vec<f64> = hz.iter().map(|hz| 180.0 * hz.cos()).collect();
    let error = vec![1e-11; 4096];
    let one = |name| FrequencyResponse {
        name,
        frequency: &hz,
        magnitude: &magnitude,
        phase_deg: &phase_deg,
        standard_error: &error,
    };
    let axes = (Axis::linear("Frequency", "Hz"), Axis::log10("Receptance", "m/N"));
    let figure = bode("", axes.0, axes.1, &[one("a")], &[one("b")]);
    let svg = figure.to_interactive_svg("", "").unwrap();
    let data = metadata(&svg);
    let lists: Vec<&str> =
        data["a"].as_array().unwrap().iter().map(|list| list.as_str().unwrap()).collect();
    assert_eq!(lists.len(), 4, "frequencies, magnitudes, phases, errors");
    assert_eq!(lists[0], "e 0.25 1024.0 4096");
    let panels = data["v"][0]["p"].as_array().unwrap();
    assert_eq!((&panels[0]["q"], &panels[1]["q"]), (&"m".into(), &"p".into()));
    assert_eq!(panels[0]["c"][0]["p"], panels[0]["c"][1]["p"]);
    // The script draws the phase from the curves of the magnitude.
    assert!(panels[1]["c"].as_array().unwrap().is_empty());
    // A point has 4 bytes for the magnitude, 3 bytes for the phase and 2 bytes for the error; as
    // base64 text, these 9 bytes are 12 characters.
    assert!(lists.iter().map(|list| list.len()).sum::<usize>() < 4096 * 14, "{}", svg.len());
}

#[test]
fn a_long_record_keeps_its_extremes() {
    let time: Vec<f64> = (0..1_000_000).map(f64::from).collect();
    let mut values: Vec<f64> = time.iter().map(|t| (0.37 * t).sin()).collect();
    values[123_456] = 50.0;
    let panel = Panel::new(Axis::linear("Time", "s"), Axis::linear("x", "m"));
    let figure = Figure::new("").panel(panel.curve(Curve::line("", &time, &values)));
    let svg = figure.to_interactive_svg("", "").unwrap();
    assert!(svg.len() < 150_000, "{} bytes", svg.len());
    let data = metadata(&svg);
    assert_eq!(data["v"][0]["p"][0]["c"][0]["of"], 1_000_000);
    let list = data["a"][1].as_str().unwrap();
    // The scale is 32, the largest power of two below the largest value, 50.
    assert!(list.starts_with("f 32.0 "), "{}", &list[..20]);
}

#[test]
fn what_cannot_be_drawn_is_an_empty_sheet() {
    let drawing = |points: usize, lines: Vec<[usize; 2]>, value: f64| ShapeDrawing {
        points: (0..points).map(|k| (k.to_string(), [k as f64, 0.0, 0.0])).collect(),
        lines,
        modes: vec![DrawnMode { displacement: vec![[[value, 0.0]; 3]; 2], ..DrawnMode::default() }],
    };
    assert!(drawing(2, vec![[0, 1]], 1.0).draw("").svg.contains("metadata"));
    for wrong in
        [drawing(2, vec![[0, 2]], 1.0), drawing(3, vec![], 1.0), drawing(2, vec![], f64::NAN)]
    {
        assert!(!wrong.draw("").svg.contains("metadata"));
    }
    assert!(!ShapeDrawing::default().draw("").svg.contains("metadata"));
    assert!(FigureSet::new([]).draw("", "").is_err());
}

#[test]
fn a_matrix_has_a_square_and_a_number_for_each_entry() {
    let svg = matrix_of_squares(&[vec![1.0, 0.25], vec![0.25, 1.0]], "MAC");
    let document = Document::parse(&svg).unwrap();
    let texts: Vec<&str> = document
        .descendants()
        .filter(|n| n.has_tag_name("text"))
        .filter_map(|n| n.text())
        .collect();
    assert_eq!(texts.iter().filter(|text| **text == "0.25").count(), 2);
    assert_eq!(texts.iter().filter(|text| **text == "1.00").count(), 2);
    // The drawing has five rectangles: the sheet and four squares.
    assert_eq!(document.descendants().filter(|n| n.has_tag_name("rect")).count(), 5);
}
