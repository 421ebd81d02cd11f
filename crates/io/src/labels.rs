//! Text fields of a struct that state the unit and the channel of its numeric fields.

use std::collections::HashMap;

use crate::contents::Contents;
use crate::table::is_time;

/// Names, in lower case, of a field that states a unit.
const UNITS: [&str; 5] = ["unit", "units", "yunit", "y_unit", "eu"];

/// Names, in lower case, of a field that states the name of a channel.
const NAMES: [&str; 5] = ["name", "label", "channel", "channelname", "description"];

/// Assigns to the columns of a struct the unit and the name that its text fields state.
pub(crate) fn with_labels(mut contents: Contents) -> Contents {
    let mut labels: HashMap<&str, [&str; 2]> = HashMap::new();
    for (path, text) in &contents.texts {
        let Some((place, leaf)) = path.rsplit_once('.') else { continue };
        let leaf = leaf.to_lowercase();
        for (label, words) in labels.entry(place).or_default().iter_mut().zip([UNITS, NAMES]) {
            if words.contains(&leaf.as_str()) {
                *label = text;
            }
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
        let place = array.name.rsplit_once('.').map(|(place, _)| place);
        if let Some([unit, _]) = place.and_then(|place| labels.get(place))
            && array.unit.is_empty()
        {
            array.unit = unit.to_string();
        }
    }
    contents
}
