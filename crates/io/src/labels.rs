//! Text fields of a struct that state the unit and the channel of its numeric fields.

use std::collections::HashMap;

use crate::contents::{Column, Contents};
use crate::table::is_time;

/// Names of fields and attributes that state a unit but do not contain the word `unit`; in lower
/// case, letters only.
const UNITS: [&str; 2] = ["eu", "uom"];

/// Sequences of letters in names whose `unit` is not the unit of the values, but the unit of an
/// axis (`xunit`) or a device (`serial`).
const OTHER_UNITS: [&str; 10] =
    ["xunit", "unitx", "xaxis", "time", "number", "serial", "name", "count", "test", "under"];

/// Names, in lower case, of a field that states the name of a channel.
const NAMES: [&str; 5] = ["name", "label", "channel", "channelname", "description"];

/// Returns whether a field or an attribute of this name states the unit of values: `units`,
/// `y_unit_label`, `NI_UnitDescription`, `uom`.
pub(crate) fn states_unit(name: &str) -> bool {
    let letters: String = name.chars().filter(|c| c.is_alphabetic()).collect();
    let letters = letters.to_lowercase();
    let is_device = letters.starts_with("id") || letters.ends_with("id");
    // In `community`, `unity` is a part of a word, whereas `unit_y` and `unitY` state a unit.
    let mut words = name.split(|c: char| !c.is_alphabetic());
    let is_word = words.any(|word| word.contains("unity") || word.contains("UNITY"));
    UNITS.contains(&letters.as_str())
        || (letters.contains("unit")
            && !is_device
            && !is_word
            && !OTHER_UNITS.iter().any(|other| letters.contains(other)))
}

/// Assigns the units of a list to the channels of a neighbouring array, if the array has as many
/// channels as the list has units. A list without such an array is reported in a remark.
fn with_listed_units(mut contents: Contents) -> Contents {
    let mut lists: Vec<(String, Vec<String>)> = Vec::new();
    for (path, text) in &contents.texts {
        let Some((list, number)) = path.split_once('{') else { continue };
        let leaf = list.rsplit_once('.').map_or(list, |(_, leaf)| leaf);
        if !states_unit(leaf) || number.strip_suffix('}').is_none_or(|n| n.parse::<u32>().is_err())
        {
            continue;
        }
        match lists.last_mut().filter(|(last, _)| last == list) {
            Some((_, units)) => units.push(text.clone()),
            None => lists.push((list.to_owned(), vec![text.clone()])),
        }
    }
    for (list, units) in lists {
        let group = list.rsplit_once('.').map(|(group, _)| group);
        let array_of = |column: &Column| {
            let (array, number) = column.name.strip_suffix(']')?.split_once('[')?;
            let is_beside = array.rsplit_once('.').map(|(group, _)| group) == group;
            let channel = number.parse::<usize>().ok()?.checked_sub(1)?;
            is_beside.then(|| (array.to_owned(), channel))
        };
        let channels: Vec<Option<(String, usize)>> =
            contents.columns.iter().map(array_of).collect();
        let mut counts: HashMap<&str, usize> = HashMap::new();
        for (array, _) in channels.iter().flatten() {
            *counts.entry(array).or_default() += 1;
        }
        let mut is_used = false;
        for (column, channel) in contents.columns.iter_mut().zip(&channels) {
            let Some((array, channel)) = channel else { continue };
            let is_whole = counts.get(array.as_str()) == Some(&units.len());
            // The channel number in the name of a column may be larger than the number of units.
            let unit = units.get(*channel).filter(|_| is_whole && column.unit.is_empty());
            if let Some(unit) = unit {
                (column.unit, is_used) = (unit.clone(), true);
            }
        }
        if !is_used {
            contents.remarks.push(format!(
                "{list} lists {} units ({}), but no array of the same struct has this number of channels: the \
                 units were not used (state them with `unit`)",
                units.len(),
                units.join(", ")
            ));
        }
    }
    contents
}

/// Assigns to the columns of a struct the unit and the name that its text fields state.
pub(crate) fn with_labels(contents: Contents) -> Contents {
    let mut contents = with_listed_units(contents);
    let mut labels: HashMap<&str, [&str; 2]> = HashMap::new();
    for (path, text) in &contents.texts {
        // A text in a list, such as `units{1}`, belongs to one channel, not to the whole struct.
        let Some((place, leaf)) = path.rsplit_once('.').filter(|_| !path.ends_with('}')) else {
            continue;
        };
        let [unit, name] = labels.entry(place).or_default();
        if states_unit(leaf) {
            *unit = text;
        } else if NAMES.contains(&leaf.to_lowercase().as_str()) {
            *name = text;
        }
    }
    for column in &mut contents.columns {
        let Some((place, leaf)) = column.name.rsplit_once('.') else { continue };
        let Some([unit, about]) = labels.get(place).filter(|_| !is_time(leaf)) else { continue };
        if column.unit.is_empty() && column.about.is_empty() {
            (column.unit, column.about) = (unit.to_string(), about.to_string());
        }
    }
    for array in &mut contents.complex {
        let group = array.name.rsplit_once('.').map(|(group, _)| group);
        if let Some([unit, _]) = group.and_then(|group| labels.get(group))
            && array.unit.is_empty()
        {
            array.unit = unit.to_string();
        }
    }
    contents
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_units_are_known() {
        for name in [
            "units",
            "Unit",
            "y_unit_label",
            "unit_y",
            "unitY",
            "NI_UnitDescription",
            "uom",
            "EngineeringUnits",
        ] {
            assert!(states_unit(name), "{name}");
        }
        for name in [
            "x_units",
            "time_unit",
            "unit_id",
            "UnitUnderTest",
            "unit_number",
            "acc",
            "community",
            "UNITY",
        ] {
            assert!(!states_unit(name), "{name}");
        }
    }

    /// Units in a cell array are assigned to the columns of the matrix in the same struct; a cell
    /// array that fits no matrix is reported in a remark.
    #[test]
    fn a_list_of_units_belongs_to_the_matrix_beside_it() {
        let column = |name: &str| Column::from_numbers(name.into(), vec![1.0, 2.0]);
        let text = |name: &str, text: &str| (name.to_owned(), text.to_owned());
        let contents = || Contents {
            columns: ["rec.data[1]", "rec.data[2]", "rec.other[1]"].map(column).into(),
            texts: vec![text("rec.units{1}", "kN"), text("rec.units{2}", "g")],
            ..Contents::default()
        };
        let read = with_labels(contents());
        let units: Vec<&str> = read.columns.iter().map(|column| column.unit.as_str()).collect();
        assert_eq!(units, ["kN", "g", ""]);
        assert!(read.remarks.is_empty());
        // A column whose number is larger than the number of units has no unit.
        let mut gaps = contents();
        gaps.columns[1].name = "rec.data[9]".into();
        let units: Vec<String> = with_labels(gaps).columns.into_iter().map(|c| c.unit).collect();
        assert_eq!(units, ["kN", "", ""]);
        let mut elsewhere = contents();
        elsewhere.columns.truncate(1);
        let read = with_labels(elsewhere);
        assert!(read.columns[0].unit.is_empty());
        assert!(read.remarks[0].contains("rec.units lists 2 units (kN, g)"), "{:?}", read.remarks);
    }
}
