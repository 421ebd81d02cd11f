//! Descriptions and reports in JSON.

use std::fmt;
use std::io;
use std::path::Path;

use serde::Deserialize;
use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, Deserializer, Error, Visitor};

use crate::{IoError, standard};

/// Reads a value from a JSON file, or from standard input as `-`: the saved settings of an analysis.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], and [`IoError::Json`] with the field that is wrong.
pub fn read_json<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, IoError> {
    Ok(read(path.as_ref())?.1)
}

/// Reads a value from a JSON file, or from standard input as `-`; returns its name in messages, too.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> Result<(String, T), IoError> {
    let file = standard::input_name(path);
    match standard::read_text(path) {
        Ok(text) => parse(&file, &text).map(|value| (file, value)),
        // No UTF-8: a binary file.
        Err(e) if e.kind() == io::ErrorKind::InvalidData => Err(IoError::NotJson { file }),
        Err(source) => Err(IoError::Read { file, source }),
    }
}

/// Returns the folder that the paths in a JSON file begin at; of standard input, the current one.
pub(crate) fn folder(path: &Path) -> &Path {
    match standard::is_input(path) {
        true => Path::new(""),
        false => path.parent().unwrap_or(Path::new("")),
    }
}

/// Reads a value from a JSON text; `file` is its name in messages.
pub(crate) fn parse<T: DeserializeOwned>(file: &str, text: &str) -> Result<T, IoError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if !text.trim_start().starts_with('{') {
        return Err(IoError::NotJson { file: file.into() });
    }
    let wrong = |source| IoError::Json { file: file.into(), field: String::new(), source };
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let value = deserialized(file, &mut deserializer)?;
    deserializer.end().map_err(wrong)?;
    Ok(value)
}

/// Reads a value from a text or from JSON that was parsed before; `file` is its name in messages.
pub(crate) fn deserialized<'de, T: Deserialize<'de>>(
    file: &str,
    from: impl Deserializer<'de, Error = serde_json::Error>,
) -> Result<T, IoError> {
    serde_path_to_error::deserialize(from).map_err(|error| {
        let field = match error.path().to_string() {
            root if root == "." => String::new(),
            field => format!("{field}: "),
        };
        IoError::Json { file: file.into(), field, source: shortened(error.into_inner()) }
    })
}

/// Largest number of bytes of a message of the parser, which repeats the value that it found.
const MAX_MESSAGE: usize = 1000;

/// Leaves the middle of a long message out.
fn shortened(error: serde_json::Error) -> serde_json::Error {
    let text = error.to_string();
    if text.len() <= MAX_MESSAGE {
        return error;
    }
    let beginning: String = text.chars().take(MAX_MESSAGE / 2).collect();
    let end = text.chars().count().saturating_sub(MAX_MESSAGE / 4);
    let end: String = text.chars().skip(end).collect();
    serde_json::Error::custom(format!("{beginning} … {end}"))
}

/// Reads a word, one of the variants of an enum. Without this a value of another shape is refused
/// with the words of the serialisation library, such as "expected unit".
pub(crate) fn word<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
) -> Result<T, D::Error> {
    struct Word;

    impl Visitor<'_> for Word {
        type Value = String;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a word in quotes")
        }

        fn visit_str<E: Error>(self, word: &str) -> Result<String, E> {
            Ok(word.into())
        }
    }
    let word = deserializer.deserialize_any(Word)?;
    T::deserialize(StrDeserializer::new(&word))
}
