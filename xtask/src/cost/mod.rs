//! Cost of stepping, identification and reading as it grows with size: measured, drawn and written
//! into the book.

mod identification;
mod lab;
mod measure;
mod page;
mod samples;
mod stepping;

use std::path::Path;

use mechid::plot::{Axis, Curve, Figure, Panel};

use self::measure::Growth;

/// The sizes and the curves of one measurement.
struct Group {
    title: &'static str,
    against: &'static str,
    growths: Vec<Growth>,
}

/// Measures everything, for `seconds` at every point, and writes the figure and the page of the
/// book.
///
/// # Errors
/// A measurement that failed, or a file that could not be written.
pub fn write(root: &Path, seconds: f64) -> Result<(), String> {
    let groups = [
        Group {
            title: "A step, and preparing for it",
            against: "Degrees of freedom",
            growths: stepping::measured(seconds)?,
        },
        Group {
            title: "Identifying all of M, C and K",
            against: "Degrees of freedom",
            growths: identification::measured(seconds)?,
        },
        Group {
            title: "Long records of two degrees of freedom",
            against: "Samples",
            growths: samples::measured(seconds)?,
        },
    ];
    let lab = lab::table(&lab::program()?)?;
    let folder = root.join("docs/book/src/choose");
    let svg = figure(&groups).to_svg().map_err(|e| e.to_string())?;
    for (name, text) in [("cost.svg", svg), ("cost.md", page::text(&groups, &lab))] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|e| format!("{}: {e}", path.display()))?;
    }
    Ok(())
}

/// Measures only the laboratory tests, and writes their table into the page of the book.
///
/// # Errors
/// The errors of [`write()`], or a page without a table of laboratory tests.
pub fn write_lab(root: &Path) -> Result<(), String> {
    let path = root.join("docs/book/src/choose/cost.md");
    let failed = |e: std::io::Error| format!("{}: {e}", path.display());
    let page = std::fs::read_to_string(&path).map_err(failed)?;
    let table = lab::table(&lab::program()?)?;
    let page = page::with_lab(&page, &table).ok_or("the page has no table of tests")?;
    std::fs::write(&path, page).map_err(failed)
}

fn figure(groups: &[Group]) -> Figure {
    let panels = groups.iter().map(|group| {
        let panel = Panel::new(Axis::log10(group.against, ""), Axis::log10("Time", "s"));
        let curves = group.growths.iter().map(|growth| {
            let label = format!("{} ({})", growth.name, growth.power());
            Curve::marked_line(label, &growth.sizes, &growth.seconds)
        });
        panel.title(group.title).curves(curves)
    });
    let figure = Figure::new("How the cost grows").columns(1).size(760.0, 1080.0);
    panels.fold(figure, Figure::panel)
}
