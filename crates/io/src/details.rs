//! Details of a measurement that its file states: sensors, operator, date, place, comment.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use crate::limits::DETAILS_BYTES;

/// Names of details: as headers spell them, in lower case, and as a page shows them.
const NAMES: [(&str, &str); 26] = [
    ("comment", "Comment"),
    ("comments", "Comment"),
    ("customer", "Customer"),
    ("date", "Date"),
    ("description", "Description"),
    ("engineer", "Operator"),
    ("experiment", "Test"),
    ("instrument", "Instrument"),
    ("laboratory", "Place"),
    ("location", "Place"),
    ("notes", "Comment"),
    ("operator", "Operator"),
    ("place", "Place"),
    ("project", "Project"),
    ("remark", "Comment"),
    ("remarks", "Comment"),
    ("rig", "Specimen"),
    ("sensor", "Sensors"),
    ("sensors", "Sensors"),
    ("serial number", "Serial number"),
    ("specimen", "Specimen"),
    ("test", "Test"),
    ("test object", "Specimen"),
    ("tester", "Operator"),
    ("title", "Title"),
    ("transducers", "Sensors"),
];

/// Returns names and values of the details in the head of a record, each name once: lines such as
/// `# Operator: …` above the table of a text, the header of a LabVIEW measurement file (`.lvm`),
/// descriptions of universal files (datasets 58 and 151), and keys of a Parquet file. Empty for
/// other formats, for files in gzip, and for files that cannot be read.
pub fn record_details(path: impl AsRef<Path>) -> Vec<(String, String)> {
    let path = path.as_ref();
    let mut head = Vec::new();
    let is_read =
        File::open(path).and_then(|file| file.take(DETAILS_BYTES).read_to_end(&mut head)).is_ok();
    if !is_read {
        return Vec::new();
    }
    #[cfg(feature = "parquet")]
    if head.starts_with(b"PAR1") {
        let keys = crate::parquet::read_parquet_metadata(path).unwrap_or_default();
        return first_of_each_name(keys.iter().filter_map(|(name, value)| known(name, value)));
    }
    if head.contains(&0) {
        return Vec::new();
    }
    parse_details(&String::from_utf8_lossy(&head))
}

/// Returns the details in the head of a text.
fn parse_details(head: &str) -> Vec<(String, String)> {
    let lines: Vec<&str> = head.lines().collect();
    if lines.first().is_some_and(|line| line.trim() == "-1") {
        return first_of_each_name(universal_details(&lines));
    }
    // In a LabVIEW header, name and value are separate fields; in other files, a line of separate
    // fields is a row of column names.
    let is_labview = lines.first().is_some_and(|line| line.starts_with("LabVIEW Measurement"));
    let signs: &[char] = if is_labview { &['\t', ',', ';'] } else { &[':', '='] };
    let above_table = lines.iter().take_while(|line| !begins_table(line));
    first_of_each_name(above_table.filter_map(|line| {
        let line = line.trim().trim_start_matches(['#', '%', '!', ';', '*', '"']).trim_start();
        let (name, value) = line.split_once(signs)?;
        known(name, value)
    }))
}

/// Returns whether a line is a row of numbers.
fn begins_table(line: &str) -> bool {
    let mut fields = line.split([',', ';', '\t', ' ']).map(str::trim).filter(|f| !f.is_empty());
    let is_number = |field: &str| field.trim_matches('"').parse::<f64>().is_ok();
    fields.next().is_some_and(is_number) && fields.all(is_number)
}

/// Returns the details that the datasets 58 and 151 of a universal file state, in the order of the
/// file.
fn universal_details<'a>(lines: &'a [&str]) -> impl Iterator<Item = (String, String)> + 'a {
    let sets = lines.windows(2).enumerate().filter(|(_, pair)| pair[0].trim() == "-1");
    sets.flat_map(|(at, pair)| {
        let names: &[&str] = match pair[1].trim() {
            "58" | "58b" => &["Description", "", "Date"],
            "151" => &["Specimen", "Description", "", "Date"],
            _ => &[],
        };
        names.iter().zip(&lines[(at + 2).min(lines.len())..])
    })
    .filter_map(|(name, line)| {
        let value = line.trim();
        let is_stated = !value.is_empty() && !value.eq_ignore_ascii_case("none");
        (is_stated && !name.is_empty()).then(|| ((*name).to_owned(), value.to_owned()))
    })
}

/// Returns a detail if its name is known and it has a value.
fn known(name: &str, value: &str) -> Option<(String, String)> {
    let name = name.trim().trim_matches('"').to_lowercase();
    let value = value.trim().trim_matches(['"', ';', ',', '\t']).trim();
    let (_, shown) = NAMES.iter().find(|(spelled, _)| *spelled == name)?;
    (!value.is_empty()).then(|| ((*shown).to_owned(), value.to_owned()))
}

/// Keeps the first detail of each name.
fn first_of_each_name(details: impl Iterator<Item = (String, String)>) -> Vec<(String, String)> {
    let mut first: Vec<(String, String)> = Vec::new();
    for (name, value) in details {
        if first.iter().all(|(other, _)| *other != name) {
            first.push((name, value));
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pairs(details: &[(String, String)]) -> Vec<(&str, &str)> {
        details.iter().map(|(name, value)| (name.as_str(), value.as_str())).collect()
    }

    #[test]
    fn comments_above_a_table_are_details() {
        let text = "# Operator: A. Nowak\n# rate: 512 Hz\n% Sensors = 2 × 352C33\ntime,F,x\n0,1,2\n# Date: never\n";
        let expected = [("Operator", "A. Nowak"), ("Sensors", "2 × 352C33")];
        assert_eq!(pairs(&parse_details(text)), expected);
        assert!(parse_details("date,F,x\n0,1,2\n").is_empty());
    }

    /// The header is the example that National Instruments gives in its specification; operator and
    /// date are read from it.
    #[test]
    fn the_header_of_a_labview_file_has_operator_and_date() {
        let text = "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t1\nSeparator\tTab\n\
                    Operator\tJohn Doe\nDate\t2005/03/17\nTime\t10:33:02.1\nDescription\t\n\
                    ***End_of_Header***\t\n";
        let expected = [("Operator", "John Doe"), ("Date", "2005/03/17")];
        assert_eq!(pairs(&parse_details(text)), expected);
    }

    #[test]
    fn a_universal_file_describes_its_functions_and_its_model() {
        let text = "    -1\n   151\nwing\nground test\nNONE\n12-Mar-24 10:00:00\n    -1\n    -1\n    58\nimpact at 3\nNONE\n13-Mar-24\nNONE\nNONE\n";
        let expected =
            [("Specimen", "wing"), ("Description", "ground test"), ("Date", "12-Mar-24 10:00:00")];
        assert_eq!(pairs(&parse_details(text)), expected);
    }

    #[test]
    fn no_file_and_no_text_have_no_details() {
        assert!(record_details("no such file").is_empty());
        assert!(parse_details("").is_empty());
        assert!(parse_details("-1").is_empty());
    }
}
