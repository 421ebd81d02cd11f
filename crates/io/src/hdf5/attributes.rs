//! Attributes that state units, rates and names.

use hdf5_pure::{AttrValue, Dataset, Group};

use crate::labels::states_unit;

/// Names, in lower case, of the attribute whose value multiplies the stored numbers: the first name
/// in netCDF, the second in NeXus.
const FACTORS: [&str; 2] = ["scale_factor", "scaling_factor"];

/// Name, in lower case, of the attribute whose value is added to the stored numbers after they are
/// multiplied by the factor.
///
/// # Source
/// *NetCDF Climate and Forecast (CF) Metadata Conventions*, version 1.11, section 8.1.
const OFFSET: &str = "add_offset";

/// Names, in lower case, of an offset that some programs add before the multiplication by the
/// factor, and other programs after it.
const UNCLEAR_OFFSETS: [&str; 2] = ["offset", "scaling_offset"];

/// Names, in lower case, of an attribute that describes a channel.
const ABOUT: [&str; 6] = ["long_name", "name", "label", "description", "channel_name", "title"];

/// Names, in lower case, of an attribute with the first instant, in s.
const START: [&str; 4] = ["t0", "x0", "start_time", "wf_start_offset"];

/// Maximum number of attributes of an object that are read.
const MAX_ATTRIBUTES: usize = 1024;

/// Maximum length of a text attribute, in bytes.
const MAX_BYTES: usize = 256;

/// Attributes of an object, in the order of their names.
#[derive(Debug, Default)]
pub(super) struct Attributes(Vec<(String, Value)>);

#[derive(Debug)]
enum Value {
    Number(f64),
    Texts(Vec<String>),
    /// Any other value.
    Other,
}

impl Attributes {
    /// Reads the attributes of a group; none if they are damaged.
    pub fn from_group(group: &Group) -> Self {
        group.attrs().map(Self::new).unwrap_or_default()
    }

    /// Reads the attributes of a data set; none if they are damaged.
    pub fn from_dataset(dataset: &Dataset) -> Self {
        dataset.attrs().map(Self::new).unwrap_or_default()
    }

    fn new(all: std::collections::HashMap<String, AttrValue>) -> Self {
        let values =
            all.into_iter().map(|(name, value)| (name, read(value).unwrap_or(Value::Other)));
        let mut values: Vec<(String, Value)> = values.take(MAX_ATTRIBUTES).collect();
        values.sort_by(|a, b| a.0.cmp(&b.0));
        Self(values)
    }

    /// Returns the attributes that are numbers, with their names, without the attributes that
    /// MATLAB writes for its own use.
    pub fn numbers(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().filter_map(|(name, value)| match value {
            Value::Number(number) if !name.starts_with("MATLAB") => Some((name.as_str(), *number)),
            _ => None,
        })
    }

    /// Returns whether there is an attribute of this name.
    pub fn has(&self, wanted: &str) -> bool {
        self.0.iter().any(|(name, _)| name == wanted)
    }

    /// Returns the first text of an attribute, by its name.
    pub fn text(&self, wanted: &str) -> Option<&str> {
        let named = self.0.iter().find(|(name, _)| name.eq_ignore_ascii_case(wanted))?;
        match &named.1 {
            Value::Texts(texts) => texts.first().map(String::as_str),
            _ => None,
        }
    }

    /// Returns the factor that multiplies the stored numbers, and the offset that is then added;
    /// `None` if they do not change the numbers. The error is the reason why the attributes are not
    /// clear.
    pub fn scaling(&self) -> Result<Option<(f64, f64)>, String> {
        let named = |names: &[&str]| {
            self.0.iter().find(|(name, _)| names.contains(&name.to_lowercase().as_str()))
        };
        let number = |names: &[&str], default: f64| match named(names) {
            None => Ok(default),
            Some((_, Value::Number(number))) if *number != 0.0 || default == 0.0 => Ok(*number),
            Some((name, _)) => Err(format!(
                "numbers whose attribute {name} cannot be used (it must be a single number, and a factor must not be 0)"
            )),
        };
        let (factor, offset) = (number(&FACTORS, 1.0)?, number(&[OFFSET], 0.0)?);
        match named(&UNCLEAR_OFFSETS).filter(|_| named(&FACTORS).is_some()) {
            Some((name, _)) => Err(format!(
                "numbers with a factor and the offset {name}; it is not clear whether this offset is added before or \
                 after the multiplication: store it as {OFFSET}, which is added after the multiplication"
            )),
            None => Ok(Some((factor, offset)).filter(|scaling| *scaling != (1.0, 0.0))),
        }
    }

    /// Returns the unit of a channel, counted from 0.
    pub fn unit(&self, channel: usize) -> Option<String> {
        let texts = self.0.iter().find_map(|(name, value)| match value {
            Value::Texts(texts) if states_unit(name) => Some(texts),
            _ => None,
        })?;
        texts.get(channel).or(texts.first().filter(|_| texts.len() == 1)).cloned()
    }

    /// Returns the description of a channel; empty if there is none.
    pub fn about(&self) -> String {
        ABOUT.iter().find_map(|name| self.text(name)).unwrap_or_default().to_owned()
    }

    /// Returns the first instant, in s.
    pub fn start(&self) -> f64 {
        let start = |name: &str| START.contains(&name.to_lowercase().as_str());
        self.numbers().find(|(name, _)| start(name)).map_or(0.0, |(_, value)| value)
    }
}

fn read(value: AttrValue) -> Option<Value> {
    let one = |numbers: Vec<f64>| match numbers[..] {
        [number] if number.is_finite() => Some(Value::Number(number)),
        _ => None,
    };
    let text = |text: String| {
        let text = text.trim_matches(['\0', ' ']).to_owned();
        (text.len() <= MAX_BYTES).then(|| Value::Texts(vec![text]))
    };
    match value {
        AttrValue::F32(number) => one(vec![number.into()]),
        AttrValue::F64(number) => one(vec![number]),
        AttrValue::I8(number) => one(vec![number.into()]),
        AttrValue::I16(number) => one(vec![number.into()]),
        AttrValue::I32(number) => one(vec![number.into()]),
        AttrValue::I64(number) => one(vec![number as f64]),
        AttrValue::U8(number) => one(vec![number.into()]),
        AttrValue::U16(number) => one(vec![number.into()]),
        AttrValue::U32(number) => one(vec![number.into()]),
        AttrValue::U64(number) => one(vec![number as f64]),
        AttrValue::F64Array(numbers) => one(numbers),
        AttrValue::F32Array(numbers) => one(numbers.into_iter().map(f64::from).collect()),
        AttrValue::I64Array(numbers) => one(numbers.into_iter().map(|n| n as f64).collect()),
        AttrValue::I32Array(numbers) => one(numbers.into_iter().map(f64::from).collect()),
        AttrValue::String(value)
        | AttrValue::AsciiString(value)
        | AttrValue::VarLenString(value)
        | AttrValue::VarLenAsciiString(value)
        | AttrValue::StringSized { value, .. }
        | AttrValue::AsciiStringSized { value, .. } => text(value),
        AttrValue::StringArray(values)
        | AttrValue::VarLenStringArray(values)
        | AttrValue::VarLenAsciiStringArray(values)
        | AttrValue::AsciiStringArray(values)
        | AttrValue::StringArraySized { values, .. } => {
            Some(Value::Texts(values.into_iter().filter(|text| text.len() <= MAX_BYTES).collect()))
        }
        _ => None,
    }
}
