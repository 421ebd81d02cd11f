//! Tests of the contents of drawn figures: the SVG document is parsed.

use std::f64::consts::PI;

use mechid_plot::charts::{self, Quantity, Series};
use mechid_plot::{Axis, Curve, Figure, Legend, Panel, PlotError, Reference};
use proptest::prelude::*;

fn wave(points: usize) -> (Vec<f64>, Vec<f64>) {
    let x: Vec<f64> = (0..points).map(|k| 0.5 + k as f64 / points as f64).collect();
    let y = x.iter().map(|x| 3.0 + (9.0 * x).sin()).collect();
    (x, y)
}

fn everything() -> Figure {
    let (x, y) = wave(40);
    let upper: Vec<f64> = y.iter().map(|y| y + 0.5).collect();
    Figure::new("All kinds & <signs>")
        .columns(2)
        .panel(
            Panel::new(Axis::linear("Time", "s"), Axis::linear("K_{xx}", "N/m"))
                .title("(a)")
                .curve(Curve::line("a < b & \"c\"", &x, &y))
                .curve(Curve::band("band", &x, &y, &upper))
                .curve(Curve::points("points", &x, &y))
                .reference(Reference::horizontal("true value", 7.0)),
        )
        .panel(
            Panel::new(Axis::log10("ω", "rad/s"), Axis::log10("|H|", "m/N"))
                .curve(Curve::marked_line("marked", &x, &y))
                .curve(Curve::stems("stems", &x, &y))
                .reference(Reference::vertical("resonance", 0.8)),
        )
}

/// Returns every coordinate and every length in an SVG document.
fn coordinates(svg: &str) -> Vec<f64> {
    let document = roxmltree::Document::parse(svg).expect("the figure is XML");
    let geometry =
        ["x", "y", "width", "height", "cx", "cy", "r", "d", "dy", "font-size", "stroke-width"];
    document
        .descendants()
        .flat_map(|node| node.attributes().filter(|a| geometry.contains(&a.name())))
        .flat_map(|attribute| {
            attribute.value().split([' ', 'M', 'L', 'Z']).filter(|part| !part.is_empty())
        })
        .map(|part| part.parse::<f64>().unwrap_or(f64::NAN))
        .collect()
}

/// Names of the groups of one class.
fn groups<'a>(document: &'a roxmltree::Document<'_>, class: &str) -> Vec<&'a str> {
    document
        .descendants()
        .filter(|node| node.attribute("class") == Some(class))
        .filter_map(|node| node.children().find(|child| child.has_tag_name("title"))?.text())
        .collect()
}

#[test]
fn every_curve_and_reference_is_drawn_and_named_in_the_legend() {
    let svg = everything().to_svg().expect("draws");
    let document = roxmltree::Document::parse(&svg).expect("the figure is XML");
    let mut curves = groups(&document, "curve");
    curves.sort_unstable();
    assert_eq!(curves, ["a < b & \"c\"", "band", "marked", "points", "stems"]);
    assert_eq!(groups(&document, "reference"), ["true value", "resonance"]);
    let texts: Vec<&str> = document
        .descendants()
        .filter(|n| n.has_tag_name("text"))
        .filter_map(|n| n.text())
        .collect();
    for label in [
        "a < b & \"c\"",
        "band",
        "marked",
        "points",
        "stems",
        "true value",
        "resonance",
        "All kinds & <signs>",
    ] {
        assert_eq!(texts.iter().filter(|text| **text == label).count(), 1, "{label}");
    }
}

#[test]
fn the_line_passes_through_its_points() {
    // The axes have fixed ranges, so the ends of this line must be at two corners of the frame.
    let axis = || Axis::linear("", "").range(0.0, 1.0);
    let figure = Figure::new("").panel(Panel::new(axis(), axis()).curve(Curve::line(
        "",
        &[0.0, 0.25, 1.0],
        &[0.0, 0.25, 1.0],
    )));
    let svg = figure.to_svg().expect("draws");
    let document = roxmltree::Document::parse(&svg).expect("the figure is XML");
    let curve =
        document.descendants().find(|n| n.attribute("class") == Some("curve")).expect("a curve");
    let data = curve.children().find_map(|n| n.attribute("d")).expect("a path");
    let path: Vec<f64> = data.split([' ', 'M', 'L']).filter_map(|part| part.parse().ok()).collect();
    let clip = document.descendants().find(|n| n.has_tag_name("clipPath")).expect("a clip");
    let frame = clip.first_element_child().expect("a frame");
    let get = |name: &str| {
        frame.attribute(name).and_then(|value| value.parse::<f64>().ok()).expect("a number")
    };
    let (left, top, width, height) = (get("x"), get("y"), get("width"), get("height"));
    let expected =
        [left, top + height, left + 0.25 * width, top + 0.75 * height, left + width, top];
    for (drawn, expected) in path.iter().zip(expected) {
        // Coordinates are written with two decimals.
        assert!((drawn - expected).abs() <= 0.011, "{path:?}");
    }
    assert_eq!(path.len(), 6);
}

#[test]
fn the_same_description_gives_the_same_bytes() {
    let (first, second) = (everything(), everything());
    assert_eq!(first.to_svg().expect("draws"), second.to_svg().expect("draws"));
    let bitmaps = [first.to_png(1.5).expect("draws"), second.to_png(1.5).expect("draws")];
    assert_eq!(bitmaps[0], bitmaps[1]);
}

#[test]
fn a_bitmap_has_the_size_asked_for_and_something_on_it() {
    let figure = everything().size(640.0, 400.0);
    let bytes = figure.to_png(1.5).expect("draws");
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("is PNG");
    assert_eq!((reader.info().width, reader.info().height), (960, 600));
    let mut pixels = vec![0; reader.output_buffer_size().expect("fits")];
    reader.next_frame(&mut pixels).expect("decodes");
    let dark = pixels.chunks(4).filter(|pixel| pixel[0] < 100).count();
    // The frames of two panels alone have some 4,000 dark pixels; a blank or black sheet would be
    // outside these limits.
    assert!((4_000..200_000).contains(&dark), "{dark} dark pixels");
    assert!(matches!(figure.to_png(1e-4), Err(PlotError::BitmapSize { .. })));
    assert!(matches!(figure.to_png(f64::NAN), Err(PlotError::BitmapSize { .. })));
    assert!(matches!(figure.to_png(1e3), Err(PlotError::BitmapSize { .. })));
}

#[test]
fn text_in_the_bitmap_is_set_without_system_fonts() {
    let with = Figure::new("Title").panel(
        Panel::new(Axis::linear("", ""), Axis::linear("", "")).curve(Curve::line(
            "",
            &[0.0, 1.0],
            &[0.0, 1.0],
        )),
    );
    let svg = with.to_svg().expect("draws");
    let without = svg.replace(">Title</text>", "></text>");
    assert_ne!(svg, without);
    let bitmaps = [svg, without].map(|svg| mechid_plot::svg_to_png(&svg, 1.0).expect("draws"));
    assert_ne!(bitmaps[0], bitmaps[1], "the title leaves ink");
}

#[test]
fn wrong_input_is_named() {
    let panel =
        |curve: Curve| Panel::new(Axis::log10("f", "Hz"), Axis::linear("x", "m")).curve(curve);
    let draw = |panel: Panel| Figure::new("F").panel(panel).to_svg().expect_err("is refused");
    assert!(matches!(Figure::new("F").to_svg(), Err(PlotError::NoPanels { .. })));
    assert!(matches!(
        draw(Panel::new(Axis::linear("", ""), Axis::linear("", ""))),
        PlotError::NoCurves { panel: 0, .. }
    ));
    assert!(matches!(draw(panel(Curve::line("c", &[], &[]))), PlotError::EmptyCurve { .. }));
    assert!(matches!(
        draw(panel(Curve::line("c", &[1.0], &[1.0, 2.0]))),
        PlotError::LengthMismatch { x_len: 1, y_len: 2, .. }
    ));
    assert!(matches!(
        draw(panel(Curve::band("c", &[1.0, 2.0], &[1.0, 2.0], &[3.0]))),
        PlotError::LengthMismatch { x_len: 2, y_len: 1, .. }
    ));
    assert!(matches!(
        draw(panel(Curve::line("c", &[1.0, 2.0], &[1.0, f64::NAN]))),
        PlotError::NonFinite { coordinate: 'y', index: 1, .. }
    ));
    assert!(matches!(
        draw(panel(Curve::line("c", &[1.0, 0.0], &[1.0, 2.0]))),
        PlotError::NotPositive { coordinate: 'x', index: 1, .. }
    ));
    let good = || Curve::line("c", &[1.0, 2.0], &[1.0, 2.0]);
    assert!(matches!(
        draw(panel(good()).reference(Reference::vertical("r", -1.0))),
        PlotError::Reference { .. }
    ));
    let bad_axis =
        Panel::new(Axis::log10("f", "Hz").range(0.0, 1.0), Axis::linear("x", "m")).curve(good());
    assert!(matches!(draw(bad_axis), PlotError::Range { .. }));
    let huge = Curve::line("c", &[1.0, 2.0], &[-f64::MAX, f64::MAX]);
    assert!(matches!(draw(panel(huge)), PlotError::Range { .. }));
    let tiny = Figure::new("F").panel(panel(good())).size(50.0, 30.0).to_svg();
    assert!(matches!(tiny, Err(PlotError::Size { .. })));
    let endless = Figure::new("F").panel(panel(good())).size(f64::INFINITY, 300.0).to_svg();
    assert!(matches!(endless, Err(PlotError::Size { .. })));
}

#[test]
fn files_are_chosen_by_their_ending_and_replaced_whole() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    let figure = everything();
    figure.save(path("a.svg")).expect("saves");
    std::fs::write(path("b.PNG"), "old").expect("writes");
    figure.save(path("b.PNG")).expect("replaces");
    assert_eq!(
        std::fs::read_to_string(path("a.svg")).expect("reads"),
        figure.to_svg().expect("draws")
    );
    assert_eq!(std::fs::read(path("b.PNG")).expect("reads"), figure.to_png(2.0).expect("draws"));
    assert!(matches!(figure.save(path("c.pdf")), Err(PlotError::Extension { .. })));
    assert!(matches!(figure.save(path("none/d.svg")), Err(PlotError::Write { .. })));
    let mut names: Vec<_> = std::fs::read_dir(folder.path())
        .expect("lists")
        .map(|e| e.expect("entry").file_name())
        .collect();
    names.sort();
    assert_eq!(names, ["a.svg", "b.PNG"], "no temporary file stays behind");
}

#[test]
fn a_crowded_panel_gets_its_legend_above() {
    // Noise fills the panel: no corner is free, so the legend must not be inside the frame.
    let x: Vec<f64> = (0..4000).map(f64::from).collect();
    let y: Vec<f64> = x.iter().map(|x| (x * 12.9898).sin()).collect();
    let panel = Panel::new(Axis::linear("x", ""), Axis::linear("y", ""))
        .curve(Curve::line("noise", &x, &y));
    let top_of = |legend: Legend| {
        let svg = Figure::new("").panel(panel.clone().legend(legend)).to_svg().expect("draws");
        let document = roxmltree::Document::parse(&svg).expect("XML");
        let clip = document
            .descendants()
            .find(|n| n.has_tag_name("clipPath"))
            .and_then(|n| n.first_element_child());
        let frame = clip.and_then(|n| n.attribute("y")?.parse::<f64>().ok()).expect("a frame");
        let label =
            document.descendants().find(|n| n.has_tag_name("text") && n.text() == Some("noise"));
        (frame, label.and_then(|n| n.attribute("y")?.parse::<f64>().ok()))
    };
    let (frame, label) = top_of(Legend::Auto);
    assert!(label.expect("a legend") < frame);
    let (unshifted, hidden) = top_of(Legend::Hidden);
    assert!(hidden.is_none() && unshifted < frame);
}

#[test]
fn charts_draw_what_they_are_given() {
    let (x, y) = wave(64);
    let series = [Series::new("Newmark", &x, &y), Series::new("Houbolt", &x, &y)];
    let figures = [
        charts::time_and_spectrum("t", Quantity::new("Force", "N"), series[0], series[1]),
        charts::sweep("s", Axis::linear("NPI", ""), Quantity::new("K", "N/m"), &series, Some(5.0)),
        charts::stability("ρ", &series),
    ];
    for (figure, curves) in figures.into_iter().zip([2, 2, 2]) {
        let svg = figure.to_svg().expect("draws");
        let document = roxmltree::Document::parse(&svg).expect("XML");
        assert_eq!(
            document.descendants().filter(|n| n.attribute("class") == Some("curve")).count(),
            curves
        );
    }
}

#[test]
fn numbers_too_small_for_a_scale_are_drawn_as_zero() {
    for y in [vec![3.98506063583514e-309], vec![0.0, 5e-324], vec![-2e-300, 1e-300]] {
        let x = vec![0.0; y.len()];
        let panel = Panel::new(Axis::linear("q", "u"), Axis::linear("q", "u"));
        let svg = Figure::new("f").panel(panel.curve(Curve::line("l", &x, &y))).to_svg().unwrap();
        assert!(coordinates(&svg).iter().all(|value| value.is_finite()), "{y:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// For any finite numbers, all geometry is finite and the document is valid XML.
    #[test]
    fn geometry_is_finite(
        points in prop::collection::vec((-1e12f64..1e12, -1e-9f64..1e9), 1..40),
        log in any::<bool>(),
        range in prop::option::of((-1e3f64..0.0, 1e-3f64..1e3)),
    ) {
        let x: Vec<f64> = points.iter().map(|p| if log { p.0.abs() + 1e-30 } else { p.0 }).collect();
        let y: Vec<f64> = points.iter().map(|p| p.1).collect();
        let mut ordinate = Axis::linear("y", "m");
        if let Some((low, high)) = range {
            ordinate = ordinate.range(low, high);
        }
        let abscissa = if log { Axis::log10("x", "s") } else { Axis::linear("x", "s") };
        let figure = Figure::new("p").panel(
            Panel::new(abscissa, ordinate).curve(Curve::marked_line("m", &x, &y)).curve(Curve::stems("s", &x, &y)),
        );
        let svg = figure.to_svg().expect("finite numbers draw");
        prop_assert!(coordinates(&svg).iter().all(|value| value.is_finite() && value.abs() <= 1e6 * PI));
    }

    /// For any numbers, a figure is drawn or an error states the reason.
    #[test]
    fn no_numbers_make_it_panic(
        points in prop::collection::vec((prop::num::f64::ANY, prop::num::f64::ANY), 0..12),
        scales in any::<(bool, bool)>(),
        range in prop::option::of((prop::num::f64::ANY, prop::num::f64::ANY)),
        step in prop::option::of(prop::num::f64::ANY),
        size in prop::option::of((prop::num::f64::ANY, prop::num::f64::ANY)),
    ) {
        let axis = |log: bool| if log { Axis::log10("q", "u") } else { Axis::linear("q", "u") };
        let (x, y): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        let mut ordinate = axis(scales.1);
        if let Some((low, high)) = range {
            ordinate = ordinate.range(low, high);
        }
        if let Some(step) = step {
            ordinate = ordinate.step(step);
        }
        let panel = Panel::new(axis(scales.0), ordinate)
            .curve(Curve::line("line", &x, &y))
            .curve(Curve::points("points", &x, &y));
        let mut figure = Figure::new("f").panel(panel);
        if let Some((width, height)) = size {
            figure = figure.size(width, height);
        }
        if let Ok(svg) = figure.to_svg() {
            prop_assert!(coordinates(&svg).iter().all(|value| value.is_finite()));
        }
    }
}

#[test]
fn figures_of_one_document_share_no_id() {
    let document = format!(
        "<body>{}{}</body>",
        everything().to_inline_svg("first", "One & two").unwrap(),
        everything().to_inline_svg("a\"b", "Two").unwrap()
    );
    let document = roxmltree::Document::parse(&document).expect("the figures are XML");
    let ids: Vec<&str> = document.descendants().filter_map(|node| node.attribute("id")).collect();
    let used: Vec<&str> = document
        .descendants()
        .filter_map(|node| node.attribute("clip-path")?.strip_prefix("url(#")?.strip_suffix(')'))
        .collect();
    assert_eq!(ids, ["firstclip0", "firstclip1", "a-bclip0", "a-bclip1"]);
    assert_eq!(ids, used);
    let svg = document.root_element().first_element_child().unwrap();
    assert_eq!(svg.first_element_child().unwrap().text(), Some("One & two"));
}

/// Ordinates of the corners of the only faded area, px.
fn band(svg: &str) -> Vec<f64> {
    let document = roxmltree::Document::parse(svg).expect("the figure is XML");
    let faded = document.descendants().find(|node| node.attribute("opacity") == Some("0.22"));
    let area = faded
        .expect("a band")
        .descendants()
        .find_map(|node| node.attribute("points").or(node.attribute("d")).map(str::to_owned));
    let numbers = area.expect("its outline");
    let numbers = numbers.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-');
    let numbers: Vec<f64> = numbers.filter_map(|text| text.parse().ok()).collect();
    numbers.chunks(2).map(|point| point[1]).collect()
}

/// The same relative errors must give the same band, in px, for levels in decibels on a linear axis
/// as for magnitudes on a logarithmic axis.
#[test]
fn an_error_has_the_same_band_on_every_scale() {
    let x: Vec<f64> = (1..=50).map(f64::from).collect();
    let y: Vec<f64> = x.iter().map(|x| 1e-6 * (2.0 + (0.3 * x).sin())).collect();
    let error: Vec<f64> = y.iter().map(|y| 0.08 * y).collect();
    let level: Vec<f64> = y.iter().map(|y| 20.0 * y.log10()).collect();
    let of_level = vec![mechid_plot::NEPER * 0.08; 50];
    let ends = [1e-7, 1e-5];
    let draw = |axis: Axis, [low, high]: [f64; 2], y: &[f64], error: &[f64]| {
        let panel = Panel::new(Axis::linear("Frequency", "Hz"), axis.range(low, high));
        let curve = Curve::line("", &x, y).standard_error(error);
        Figure::new("").panel(panel.curve(curve).legend(Legend::Hidden)).to_svg().unwrap()
    };
    let levels = ends.map(|end| 20.0 * f64::log10(end));
    let logarithmic = band(&draw(Axis::log10("Receptance", "m/N"), ends, &y, &error));
    let decibel = Axis::linear("Receptance", "dB re 1 m/N");
    let decibel = band(&draw(decibel, levels, &level, &of_level));
    assert!(logarithmic.len() >= 100 && logarithmic.len() == decibel.len());
    for (a, b) in logarithmic.iter().zip(&decibel) {
        assert!((a - b).abs() < 0.02, "{a} {b}");
    }
}

#[test]
fn rounding_does_not_spread_a_logarithmic_axis() {
    let panel = Panel::new(Axis::linear("Frequency", "Hz"), Axis::log10("Receptance", "m/N"))
        .curve(Curve::line("a", &[1.0, 2.0], &[1e-4, 1e-6]))
        .curve(Curve::line("b", &[1.0, 2.0], &[3e-22, 1e-21]));
    let svg = Figure::new("").panel(panel).to_svg().unwrap();
    assert!(svg.contains("−16") && !svg.contains("−20"), "{svg}");
}
