//! The page of the book.

use std::fmt::Write as _;

use super::Group;
use super::measure::Growth;

const BEGIN: &str = "# What it costs

How time grows with degrees of freedom and with samples, on the machine that `measure-cost`, \
a task of `cargo xtask`, ran on last.
It writes this page and its figure; other machines have other times and nearly the same slopes.
Each point is the shortest of several runs; what else the machine did can only have added to it.

![Time over degrees of freedom and over samples](cost.svg)

The power of n is fitted to the larger half of the sizes.

";

const END: &str = "A dense step has two products and a solve, n² each; its preparation is a factorisation, n³.
A step of a chain or a grid goes through the non-zero entries and those of the factors: n of a chain, \
n log n of a grid in the order of minimum degree.
Least squares factors the rows once for all equations; maximum likelihood searches every equation by itself \
with what they have in common computed once.
Over samples everything is linear beyond what a run costs at all.
Where time grows faster than that, the numbers have left the caches of the processor, or others used it.
";

/// Load of the machine, if the system reports it.
fn load() -> String {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let average = std::fs::read_to_string("/proc/loadavg").ok();
    let average = average.as_deref().and_then(|text| text.split_whitespace().next());
    average.map_or(String::new(), |load| {
        format!(
            "At the end of the run {load} programs on average wanted its {cores} processors.\n\n"
        )
    })
}

/// Heading of the tests of a laboratory, up to their table.
const LAB: &str = "## Tests of a laboratory

The program as it is called with its defaults, on records that it makes itself; `measure-cost --lab` \
measures these alone.

";

/// Heading after them.
const AFTER_LAB: &str = "## What the numbers follow from\n\n";

/// Returns the page with another table of the tests of a laboratory; `None` if it has none.
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
