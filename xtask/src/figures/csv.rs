//! The numbers of a figure as a table.

use mechid::plot::{Curve, Figure, Panel};

/// Significant digits written: enough for a comparison to 1e-9, and few enough not to depend on the
/// compiler.
const DIGITS: usize = 12;

/// One row for each abscissa of each panel, one column for each curve and each horizontal
/// reference line; a curve that has no point at an abscissa leaves its cell empty.
///
/// # Errors
/// The message of the CSV writer.
pub fn table(figure: &Figure) -> Result<String, String> {
    let columns = columns(figure);
    let mut writer = csv::Writer::from_writer(Vec::new());
    let header = ["panel", "x"].into_iter().chain(columns.iter().map(String::as_str));
    writer.write_record(header).map_err(|error| error.to_string())?;
    for panel in figure.panels() {
        for group in same_abscissae(panel) {
            for row in rows(panel, &group, &columns) {
                writer.write_record(row).map_err(|error| error.to_string())?;
            }
        }
    }
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}

/// Names of all curves and horizontal lines, each once, in order of appearance.
fn columns(figure: &Figure) -> Vec<String> {
    let mut columns: Vec<String> = Vec::new();
    for panel in figure.panels() {
        let curves = panel.data().iter().map(|curve| name(panel, curve));
        let lines = panel.references().iter().filter(|line| line.is_horizontal());
        for name in curves.chain(lines.map(|line| line.label().to_owned())) {
            if !columns.contains(&name) {
                columns.push(name);
            }
        }
    }
    columns
}

/// A curve without a legend has the name of its axis.
fn name(panel: &Panel, curve: &Curve) -> String {
    if curve.label().is_empty() { panel.y_axis().caption() } else { curve.label().to_owned() }
}

/// Returns the curves of a panel in groups with the same abscissae.
fn same_abscissae(panel: &Panel) -> Vec<Vec<&Curve>> {
    let mut groups: Vec<Vec<&Curve>> = Vec::new();
    for curve in panel.data() {
        match groups.iter_mut().find(|group| group[0].x() == curve.x()) {
            Some(group) => group.push(curve),
            None => groups.push(vec![curve]),
        }
    }
    groups
}

fn rows(panel: &Panel, group: &[&Curve], columns: &[String]) -> Vec<Vec<String>> {
    let title = [panel.name(), &panel.y_axis().caption(), &panel.x_axis().caption()].join("; ");
    let cell = |column: &String, at: usize| {
        let curve =
            group.iter().find(|curve| name(panel, curve) == *column).map(|curve| curve.y()[at]);
        let line = || {
            let mut lines = panel.references().iter().filter(|line| line.is_horizontal());
            lines.find(|line| line.label() == column).map(|line| line.value())
        };
        curve.or_else(line).map_or_else(String::new, number)
    };
    let row = |(at, x): (usize, &f64)| {
        let values = columns.iter().map(|column| cell(column, at));
        [title.clone(), number(*x)].into_iter().chain(values).collect()
    };
    group[0].x().iter().enumerate().map(row).collect()
}

/// The value to [`DIGITS`] significant digits, in the shortest form.
fn number(value: f64) -> String {
    let rounded = format!("{value:.*e}", DIGITS - 1).parse().unwrap_or(value);
    format!("{:?}", rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use mechid::plot::{Axis, Reference};

    use super::*;

    #[test]
    fn every_abscissa_is_a_row_and_every_curve_a_column() {
        let panel = Panel::new(Axis::linear("t", "s"), Axis::linear("F", "N"))
            .title("a, b")
            .curve(Curve::line("c", &[0.0, 1.0 / 3.0], &[-0.0, 2e-20]))
            .curve(Curve::line("d", &[0.0, 1.0 / 3.0], &[1.0, 2.0]))
            .curve(Curve::line("", &[7.0], &[8.0]))
            .reference(Reference::horizontal("truth", 5.0));
        let text = table(&Figure::new("").panel(panel)).unwrap();
        assert_eq!(
            text.lines().collect::<Vec<_>>(),
            [
                "panel,x,c,d,F (N),truth",
                "\"a, b; F (N); t (s)\",0.0,0.0,1.0,,5.0",
                "\"a, b; F (N); t (s)\",0.333333333333,2e-20,2.0,,5.0",
                "\"a, b; F (N); t (s)\",7.0,,,8.0,5.0",
            ]
        );
    }
}
