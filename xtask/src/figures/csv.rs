//! The numbers of a figure as a table.

use mechid::plot::Figure;

/// Significant digits written: enough for a comparison to 1e-9, and no more than a change of
/// compiler leaves alone.
const DIGITS: usize = 12;

/// One row for each drawn point: panel, curve, abscissa, ordinate. A reference line is a curve of one point.
///
/// # Errors
/// The words of the CSV writer.
pub fn table(figure: &Figure) -> Result<String, String> {
    let words = |error: &dyn std::fmt::Display| error.to_string();
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer
        .write_record(["panel", "curve", "x_quantity", "x", "y_quantity", "y"])
        .map_err(|e| words(&e))?;
    for panel in figure.panels() {
        let (x_caption, y_caption) = (panel.x_axis().caption(), panel.y_axis().caption());
        for curve in panel.data() {
            for (x, y) in curve.x().iter().zip(curve.y()) {
                let row =
                    [panel.name(), curve.label(), &x_caption, &number(*x), &y_caption, &number(*y)];
                writer.write_record(row).map_err(|e| words(&e))?;
            }
        }
        for line in panel.references() {
            let value = number(line.value());
            let (x, y) =
                if line.is_horizontal() { ("", value.as_str()) } else { (value.as_str(), "") };
            writer
                .write_record([panel.name(), line.label(), &x_caption, x, &y_caption, y])
                .map_err(|e| words(&e))?;
        }
    }
    let bytes = writer.into_inner().map_err(|e| words(&e))?;
    String::from_utf8(bytes).map_err(|e| words(&e))
}

/// The value to [`DIGITS`] significant digits, in the shortest form.
fn number(value: f64) -> String {
    let rounded = format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value);
    format!("{:?}", rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use mechid::plot::{Axis, Curve, Panel, Reference};

    use super::*;

    #[test]
    fn every_point_and_every_reference_is_a_row() {
        let panel = Panel::new(Axis::linear("t", "s"), Axis::linear("F", "N"))
            .title("a, b")
            .curve(Curve::line("c", &[0.0, 1.0 / 3.0], &[-0.0, 2e-20]))
            .reference(Reference::horizontal("truth", 5.0));
        let text = table(&Figure::new("").panel(panel)).unwrap();
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(
            rows,
            [
                "\"a, b\",c,t (s),0.0,F (N),0.0",
                "\"a, b\",c,t (s),0.333333333333,F (N),2e-20",
                "\"a, b\",truth,t (s),,F (N),5.0"
            ]
        );
    }
}
