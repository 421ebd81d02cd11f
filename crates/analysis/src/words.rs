//! Words of settings: `serde` saves the variants of an enum by the same names that the options of
//! the program and the keywords of Python use.

use serde::de::value::Error;
use serde::de::{DeserializeOwned, Deserializer, Error as _, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;

/// Returns the words of an enum without fields, in the order of its variants; empty for other
/// types.
///
/// ```
/// use mechid_analysis::{frf::Estimator, words};
///
/// assert_eq!(words::all::<Estimator>(), ["h1", "h2", "hv"]);
/// ```
pub fn all<T: DeserializeOwned>() -> &'static [&'static str] {
    let mut words: &'static [&'static str] = &[];
    // The deserializer records the words, and always fails because it has no value.
    let _ = T::deserialize(Variants(&mut words));
    words
}

/// Reads the word of a variant.
///
/// # Errors
/// A sentence with all valid words, if `word` is not one of them.
pub fn read<T: DeserializeOwned>(word: &str) -> Result<T, String> {
    let deserializer: serde::de::value::StrDeserializer<'_, Error> = word.into_deserializer();
    T::deserialize(deserializer)
        .map_err(|_| format!("\"{word}\" is not one of {}", all::<T>().join(", ")))
}

/// Deserializer that stores the names of the variants of the requested enum.
struct Variants<'a>(&'a mut &'static [&'static str]);

impl<'de> Deserializer<'de> for Variants<'_> {
    type Error = Error;

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        _: V,
    ) -> Result<V::Value, Error> {
        *self.0 = variants;
        Err(Error::custom("only the words were asked for"))
    }

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        Err(Error::custom("no enum"))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf option unit
        unit_struct newtype_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// Readers of settings as saved or as written by a user: a text such as `1024:50:hann`, a number,
/// or true for the defaults.
pub(crate) mod written {
    use std::fmt::Display;
    use std::str::FromStr;

    use serde::de::{DeserializeOwned, Error};
    use serde::{Deserialize, Deserializer};
    use serde_json::Value;

    fn read<T, E>(value: Value) -> Result<T, E>
    where
        T: DeserializeOwned + FromStr<Err: Display>,
        E: Error,
    {
        let parsed = |text: &str| text.parse().map_err(E::custom);
        match &value {
            Value::String(text) => parsed(text),
            Value::Number(number) => parsed(&number.to_string()),
            Value::Bool(true) => parsed(""),
            _ => serde_json::from_value(value).map_err(E::custom),
        }
    }

    pub(crate) fn one<'de, D: Deserializer<'de>, T>(deserializer: D) -> Result<T, D::Error>
    where
        T: DeserializeOwned + FromStr<Err: Display>,
    {
        read(Value::deserialize(deserializer)?)
    }

    pub(crate) fn optional<'de, D: Deserializer<'de>, T>(
        deserializer: D,
    ) -> Result<Option<T>, D::Error>
    where
        T: DeserializeOwned + FromStr<Err: Display>,
    {
        match Value::deserialize(deserializer)? {
            Value::Null | Value::Bool(false) => Ok(None),
            value => read(value).map(Some),
        }
    }

    /// Reads a setting that is given as a text such as `2:50`, or as a pair of numbers such as `[2,
    /// 50]`.
    pub(crate) fn pair<'de, D: Deserializer<'de>, T>(deserializer: D) -> Result<Option<T>, D::Error>
    where
        T: DeserializeOwned + FromStr<Err: Display>,
    {
        match Value::deserialize(deserializer)? {
            Value::Null => Ok(None),
            Value::Array(ends) => {
                let ends: Vec<String> = ends.iter().map(ToString::to_string).collect();
                ends.join(":").parse().map(Some).map_err(D::Error::custom)
            }
            value => read(value).map(Some),
        }
    }

    pub(crate) fn list<'de, D: Deserializer<'de>, T>(deserializer: D) -> Result<Vec<T>, D::Error>
    where
        T: DeserializeOwned + FromStr<Err: Display>,
    {
        Vec::<Value>::deserialize(deserializer)?.into_iter().map(read).collect()
    }
}

#[cfg(test)]
mod tests {
    use mechid_signal::Extent;

    use super::*;
    use crate::identify::Method;

    #[test]
    fn words_are_those_that_serde_saves() {
        assert_eq!(read("period"), Ok(Extent::WholePeriod));
        assert_eq!(all::<Method>(), ["least-squares", "instrumental", "maximum-likelihood"]);
        let wrong = read::<Method>("ml").unwrap_err();
        assert_eq!(wrong, "\"ml\" is not one of least-squares, instrumental, maximum-likelihood");
        assert!(all::<f64>().is_empty());
    }
}
