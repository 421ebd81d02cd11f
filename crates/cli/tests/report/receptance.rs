//! The receptance after a fit in the time domain, read from the picture.

use super::{NAMES, USUAL, closed, mechid, page, parse, rig, row, tagged};

fn number(text: Option<&str>) -> f64 {
    text.unwrap().parse().unwrap()
}

/// Reference: a record without noise, so that the fit finds the exact oscillator. Every measured
/// line must then lie on the curve of the machine, in both panels.
#[test]
fn lines_of_whole_periods_lie_on_the_curve_of_the_machine() {
    let folder = rig(NAMES, f64::INFINITY, 0.0);
    let time = ["--domain", "time", "--derivatives", "spectral"];
    mechid(folder.path(), &[&USUAL[..8], &time, &["--output", "page.html"]].concat());
    let closed = closed(&page(folder.path()));
    let document = parse(&closed);
    for (name, value) in [("m", 2.0), ("c", 6.0), ("k", 800.0)] {
        let found: f64 = row(&document, "Parameters", name)[1].parse().unwrap();
        assert!((found - value).abs() < 1e-6 * value, "{name} = {found}");
    }
    let figures = tagged(&document, "figure");
    let figure = figures.iter().find(|f| f.attribute("id") == Some("figure-receptance")).unwrap();
    let curves = figure.descendants().filter(|node| node.attribute("class") == Some("curve"));
    let curves: Vec<_> = curves.collect();
    let mut markers = 0;
    for panel in curves.chunks(2) {
        let path = panel[1].descendants().find(|node| node.has_tag_name("path")).unwrap();
        let points = path.attribute("d").unwrap().trim_start_matches('M').split('L');
        let curve: Vec<(f64, f64)> = points
            .map(|point| point.split_once(' ').unwrap())
            .map(|(x, y)| (x.parse().unwrap(), y.parse().unwrap()))
            .collect();
        for circle in panel[0].descendants().filter(|node| node.has_tag_name("circle")) {
            let (x, y) = (number(circle.attribute("cx")), number(circle.attribute("cy")));
            let right = curve.partition_point(|(at, _)| *at < x).clamp(1, curve.len() - 1);
            let ((x0, y0), (x1, y1)) = (curve[right - 1], curve[right]);
            let on_curve = y0 + (y1 - y0) * (x - x0) / (x1 - x0);
            // The tolerance is one pixel; even near the peak, the drawn polyline is less than one
            // pixel from the exact curve.
            assert!((y - on_curve).abs() < 1.0, "{x}: {y} {on_curve}");
            markers += 1;
        }
    }
    // There are 77 lines, each with a magnitude and a phase.
    assert_eq!((curves.len(), markers), (4, 154));
}
