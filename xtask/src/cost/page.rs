//! The page of the book about computing time.

use std::fmt::Write as _;

use super::Group;
use super::measure::Growth;

const BEGIN: &str = "# What it costs

This page shows how the computation time grows with the number of degrees of freedom and of samples.
`measure-cost`, a task of `cargo xtask`, writes this page and its figure; the times are those of the computer on which it ran last.
On other computers the times differ, but the slopes of the curves are nearly the same.
Each point is the shortest of several runs, because other programs can only lengthen a run.

![Time over degrees of freedom and over samples](cost.svg)

The exponent of n in the tables is fitted to the larger half of the sizes.

";

const END: &str = "A dense step has two products of matrix and vector and one solution with the factors, n² operations each; its preparation is a factorisation, n³ operations.
A step of a chain or a grid uses the non-zero entries of the matrices and of their factors. Their number is \
proportional to n for a chain, and to n log n for a grid with minimum-degree ordering.
Least squares factors the rows once for all equations; maximum likelihood searches for the parameters of each equation \
separately, and computes the common part of the equations once.
For long records the time is proportional to the number of samples, apart from the constant cost of a run.
A time that grows faster than in proportion shows that the numbers no longer fit into the caches of the processor, or that other programs ran.
";

/// Returns a sentence about the load of the computer, if the system reports the load.
fn load() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let average = std::fs::read_to_string("/proc/loadavg").ok();
    let average = average.as_deref().and_then(|text| text.split_whitespace().next());
    average.map_or(String::new(), |load| {
        format!(
            "At the end of the run, on average {load} programs competed for the {cores} processors.\n\n"
        )
    })
}

/// Heading and text of the tests of a laboratory, above their table.
const LAB: &str = "## Tests of a laboratory

The table shows the time and memory that the program needs with its default settings, on simulated records; `measure-cost --lab` \
measures only this table.

";

/// Heading below the table of the laboratory tests.
const AFTER_LAB: &str = "## What the numbers follow from\n\n";

/// Returns the page with a new table of the laboratory tests; `None` if the page has no such table.
pub fn with_lab(page: &str, table: &str) -> Option<String> {
    let (before, others) = page.split_once(LAB)?;
    let (_, after) = others.split_once(AFTER_LAB)?;
    Some(format!("{before}{LAB}{table}\n{AFTER_LAB}{after}"))
}

pub fn text(groups: &[Group], lab: &str) -> String {
    let mut text = BEGIN.to_owned() + &load();
    for group in groups {
        let _ = writeln!(text, "| {} | n from | to | time at the last | grows as |", group.title);
        text.push_str("|---|---|---|---|---|\n");
        for growth in &group.growths {
            text.push_str(&row(growth));
        }
        text.push('\n');
    }
    text + LAB + lab + "\n" + AFTER_LAB + END
}

fn row(growth: &Growth) -> String {
    let (sizes, last) = (&growth.sizes, growth.seconds[growth.seconds.len() - 1]);
    let (from, to) = (grouped(sizes[0]), grouped(sizes[sizes.len() - 1]));
    format!("| {} | {from} | {to} | {} | {} |\n", growth.name, with_unit(last), growth.power())
}

/// A time with two digits and a unit.
fn with_unit(seconds: f64) -> String {
    let (value, unit) = match seconds {
        s if s < 1e-6 => (1e9 * s, "ns"),
        s if s < 1e-3 => (1e6 * s, "µs"),
        s if s < 1.0 => (1e3 * s, "ms"),
        s => (s, "s"),
    };
    let places = if value < 9.95 { 1 } else { 0 };
    format!("{value:.places$} {unit}")
}

/// A whole number with commas.
fn grouped(value: f64) -> String {
    let digits = format!("{value:.0}");
    let first = digits.len() % 3;
    let mut text = digits[..first].to_owned();
    for chunk in digits.as_bytes()[first..].chunks(3) {
        if !text.is_empty() {
            text.push(',');
        }
        text.extend(chunk.iter().map(|b| char::from(*b)));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_takes_the_place_of_the_one_before() {
        let page = text(&[], "old\n");
        let changed = with_lab(&page, "new\n").unwrap();
        assert_eq!(changed, page.replace("old", "new"));
        assert_eq!(with_lab("no table", "new"), None);
    }

    #[test]
    fn numbers_are_told_shortly() {
        let texts = [2.34e-8, 9.96e-6, 0.5, 12.3].map(with_unit);
        assert_eq!(texts, ["23 ns", "10 µs", "500 ms", "12 s"]);
        let grouped = [2.0, 100.0, 1000.0, 22_500.0, 3e6].map(grouped);
        assert_eq!(grouped, ["2", "100", "1,000", "22,500", "3,000,000"]);
    }
}
