//! Words in the names of columns: quantities, places and directions.

use std::ops::Range;

use super::{Quantity, Unit};

/// Words that mean a force.
const FORCE: &[&str] = &[
    "force",
    "forces",
    "load",
    "loadcell",
    "thrust",
    "hammer",
    "impact",
    "shaker",
    "excitation",
    "tension",
    "kraft",
    "fx",
    "fy",
    "fz",
    "effort",
    "fuerza",
    "carga",
    "força",
    "forza",
    "carico",
    "kracht",
    "standardkraft",
    "prüfkraft",
    "zugkraft",
    "loads",
];

/// Words that mean a displacement.
const DISPLACEMENT: &[&str] = &[
    "disp",
    "displ",
    "displacement",
    "deflection",
    "position",
    "pos",
    "lvdt",
    "laser",
    "prox",
    "proximity",
    "gap",
    "stroke",
    "travel",
    "weg",
    "auslenkung",
    "verschiebung",
    "standardweg",
    "hub",
    "abstand",
    "traverse",
    "crosshead",
    "extension",
    "déplacement",
    "deplacement",
    "course",
    "desplazamiento",
    "deslocamento",
    "spostamento",
    "verplaatsing",
];

/// Words that mean a velocity.
const VELOCITY: &[&str] = &[
    "vel",
    "velo",
    "velocity",
    "speed",
    "vibration",
    "vib",
    "geschwindigkeit",
    "schwinggeschwindigkeit",
    "schnelle",
    "vitesse",
    "velocidad",
    "velocidade",
    "velocità",
    "velocita",
    "veff",
    "vrms",
];

/// Words that mean an acceleration.
const ACCELERATION: &[&str] = &[
    "acc",
    "accel",
    "accels",
    "acceleration",
    "accelerations",
    "accelerometer",
    "accelerance",
    "beschleunigung",
    "ax",
    "ay",
    "az",
    "beschl",
    "accélération",
    "aceleración",
    "aceleracion",
    "aceleração",
    "aceleracao",
    "accelerazione",
    "versnelling",
];

/// Words that mean a time.
const TIME: &[&str] =
    &["time", "t", "zeit", "timestamp", "elapsed", "temps", "tiempo", "tempo", "messzeit"];

/// Words that mean a frequency.
const FREQUENCY: &[&str] = &[
    "frequency",
    "freq",
    "omega",
    "w",
    "f",
    "frequenz",
    "speed",
    "fréquence",
    "frequence",
    "frecuencia",
    "frequenza",
    "freqüência",
];

/// Units that are also English words, symbols of other quantities or ends of names: they count as
/// units only after the name of their quantity.
const AMBIGUOUS: &[&str] =
    &["g", "gs", "in", "ins", "m", "n", "s", "h", "d", "c", "v", "foot", "feet", "min"];

/// Words that multiply the unit after them.
const PREFIXES: [&str; 7] = ["nano", "micro", "milli", "centi", "deci", "kilo", "mega"];

/// Words in brackets that name a place, a direction, a channel or a treatment of the signal rather
/// than a unit.
const LABELS: &[&str] = &[
    "x",
    "y",
    "z",
    "rx",
    "ry",
    "rz",
    "axis",
    "direction",
    "dir",
    "left",
    "right",
    "top",
    "bottom",
    "front",
    "back",
    "rear",
    "upper",
    "lower",
    "inner",
    "outer",
    "middle",
    "center",
    "centre",
    "drive",
    "driven",
    "end",
    "free",
    "fixed",
    "de",
    "nde",
    "inboard",
    "outboard",
    "vertical",
    "horizontal",
    "vert",
    "horiz",
    "hor",
    "axial",
    "radial",
    "tangential",
    "lateral",
    "longitudinal",
    "transverse",
    "north",
    "south",
    "east",
    "west",
    "up",
    "down",
    "side",
    "base",
    "tip",
    "root",
    "filtered",
    "filt",
    "corrected",
    "measured",
    "calculated",
    "estimated",
    "smoothed",
    "mean",
    "average",
    "ch",
    "chan",
    "channel",
    "ai",
    "ain",
    "input",
    "output",
    "node",
    "point",
    "pt",
    "dof",
    "sensor",
    "shaker",
    "hammer",
    "exciter",
    "motor",
    "pump",
    "bearing",
    "shaft",
    "rotor",
    "beam",
    "plate",
    "mass",
    "floor",
    "table",
    "ref",
    "reference",
    "driving",
    "response",
    "force",
    "acceleration",
    "velocity",
    "displacement",
    "signal",
    "test",
    "run",
    "no",
    "nr",
    "position",
    "pos",
    "dev",
    "mod",
    "unit",
    "of",
    "the",
    "at",
    "on",
];

/// Returns the quantity that a word of three letters or more means.
pub(super) fn quantity_word(word: &str) -> Option<Quantity> {
    let quantities = [
        Quantity::Force,
        Quantity::DISPLACEMENT,
        Quantity::VELOCITY,
        Quantity::ACCELERATION,
        Quantity::Time,
    ];
    quantities.into_iter().find(|quantity| word.len() > 2 && is_quantity_word(word, *quantity))
}

/// Returns whether a word, with or without a number after it, means a quantity.
pub(super) fn is_quantity_word(word: &str, quantity: Quantity) -> bool {
    let lower = word.to_lowercase();
    let word = lower.trim_end_matches(|c: char| c.is_ascii_digit());
    let words = match quantity {
        Quantity::Force => FORCE,
        Quantity::DISPLACEMENT => DISPLACEMENT,
        Quantity::VELOCITY => VELOCITY,
        Quantity::ACCELERATION => ACCELERATION,
        Quantity::Time => TIME,
        Quantity::Frequency => FREQUENCY,
    };
    words.contains(&word)
}

/// Returns whether a unit is also a word or a symbol of something else.
pub(super) fn is_ambiguous(unit: &str) -> bool {
    AMBIGUOUS.contains(&unit.to_lowercase().as_str())
}

/// Words for units with several sizes or no size: tons of three kinds, decibels, percent.
const UNCLEAR: &[&str] =
    &["ton", "tons", "tn", "db", "dba", "dbv", "dbu", "dbm", "dbfs", "percent", "%", "%fs", "‰"];

/// Returns whether a word is a unit with several sizes, such as `ton`, or with no size, such as
/// `percent`.
pub(super) fn is_unclear(word: &str) -> bool {
    UNCLEAR.contains(&word.to_lowercase().as_str())
}

/// Returns whether a word multiplies the unit after it, as `milli` does in `milli-g`.
pub(super) fn is_prefix(word: &str) -> bool {
    PREFIXES.contains(&word.to_lowercase().as_str())
}

/// Returns whether a text names places, directions or channels: `left`, `+Z`, `AI0`, `shaker 1`,
/// `Dev1/ai0`.
pub(super) fn is_label(text: &str) -> bool {
    let mut words = text.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.all(|word| {
        let lower = word.to_lowercase();
        let stem = lower.trim_end_matches(|c: char| c.is_ascii_digit());
        let is_identifier = stem.len() < lower.len() && stem.chars().all(char::is_alphabetic);
        is_identifier || LABELS.contains(&stem) || quantity_word(word).is_some()
    })
}

/// Splits a name into words, at blanks and punctuation.
pub(super) fn split_words(name: &str) -> Vec<Range<usize>> {
    let (mut words, mut start): (Vec<Range<usize>>, _) = (Vec::new(), None);
    let mut chars = name.char_indices().peekable();
    while let Some((at, c)) = chars.next() {
        let next = chars.peek().map(|(_, c)| *c);
        let is_minus = c == '-' && next.is_some_and(|c| c.is_ascii_digit());
        // The point of `in./s` belongs to the unit.
        let is_abbreviation = c == '.' && next == Some('/');
        let separates = c.is_whitespace()
            || "_,;:=.|#\\@~→&![]<>".contains(c) && !is_abbreviation
            || c == '-' && !is_minus;
        if separates {
            words.extend(start.take().map(|start| start..at));
        } else if start.is_none() {
            start = Some(at);
        }
    }
    words.extend(start.map(|start| start..name.len()));
    words.into_iter().map(|word| without_quotes(name, word)).collect()
}

/// Returns a word without the quotation marks, asterisks and closing brackets around it.
fn without_quotes(name: &str, word: Range<usize>) -> Range<usize> {
    const AROUND: [char; 4] = ['*', '\'', '"', '`'];
    let text = &name[word.clone()];
    let inner = text.trim_matches(AROUND);
    let inner = if inner.contains(['(', '{']) { inner } else { inner.trim_end_matches([')', '}']) };
    if inner.is_empty() {
        return word;
    }
    let start = word.start + text.len() - text.trim_start_matches(AROUND).len();
    start..start + inner.len()
}

/// Reads words as a unit: `mm`, `m_s2`, `mm_per_s`.
pub(super) fn joined_unit(words: &[&str]) -> Option<Unit> {
    if let [prefix, unit] = words
        && is_prefix(prefix)
    {
        return Unit::parse(&format!("{prefix}{unit}"));
    }
    match words {
        [one] => Unit::parse(one),
        ["lb" | "lbs" | "Lb", "f" | "force"] => Unit::parse("lbf"),
        ["kg", "f" | "force"] => Unit::parse("kgf"),
        ["g", "force"] | ["G", "Force" | "force"] => Unit::parse("gforce"),
        [length, per, time] if per.eq_ignore_ascii_case("per") => {
            Unit::parse(&format!("{length}/{time}"))
        }
        [length, per, time, "2" | "squared"] if per.eq_ignore_ascii_case("per") => {
            Unit::parse(&format!("{length}/{time}^2"))
        }
        ["rad" | "radians", "s" | "sec"] => Unit::parse("rad/s"),
        [length, time @ ("s" | "sec" | "s2" | "sec2" | "s^2" | "s²")] => {
            Unit::parse(&format!("{length}/{time}"))
        }
        [length, time @ ("s-1" | "s^-1" | "s⁻¹" | "s-2" | "s^-2" | "s⁻²")] => {
            Unit::parse(&format!("{length} {time}"))
        }
        [length, time @ ("s" | "sec"), "2"] => Unit::parse(&format!("{length}/{time}^2")),
        _ => None,
    }
    .filter(|unit| {
        let is_compound = matches!(unit.quantity, Quantity::Response(_) | Quantity::Frequency);
        words.len() == 1 || is_compound || words[words.len() - 1].starts_with(['f', 'F'])
    })
}
