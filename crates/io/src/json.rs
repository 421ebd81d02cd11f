//! Descriptions and reports in JSON.

use std::fmt;
use std::io;
use std::path::Path;

use serde::Deserialize;
use serde::de::value::StrDeserializer;
use serde::de::{DeserializeOwned, Deserializer, Error, Visitor};

use crate::{IoError, standard};

/// Reads a value from a JSON file, or from standard input as `-`: the saved settings of an
/// analysis.
///
/// # Errors
/// [`IoError::Read`], [`IoError::NotJson`], and [`IoError::Json`] with the field that is wrong.
pub fn read_json<T: DeserializeOwned>(path: impl AsRef<Path>) -> Result<T, IoError> {
    Ok(read(path.as_ref())?.1)
}

/// Reads a value from a JSON file, or from standard input as `-`; also returns the name of the file
/// for messages.
pub(crate) fn read<T: DeserializeOwned>(path: &Path) -> Result<(String, T), IoError> {
    let file = standard::input_name(path);
    match standard::read_text(path) {
        Ok(text) => parse(&file, &text).map(|value| (file, value)),
        // A file that is not UTF-8 is a binary file.
        Err(e) if e.kind() == io::ErrorKind::InvalidData => Err(IoError::NotJson { file }),
        Err(source) => Err(IoError::Read { file, source }),
    }
}

/// Returns the folder to which the paths in a JSON file are relative; the current folder for
/// standard input.
pub(crate) fn folder(path: &Path) -> &Path {
    if standard::is_input(path) { Path::new("") } else { path.parent().unwrap_or(Path::new("")) }
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

/// Converts a text or parsed JSON to a value; `file` is its name in messages.
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

/// Largest length of an error message of the parser, in bytes; longer ones, which repeat the value
/// in the file, are shortened.
const MAX_MESSAGE: usize = 1000;

/// Removes the middle of a long message.
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

/// Reads a word: one of the variants of an enum. For a value that is not a text, the derived reader
/// would report terms of the serialisation library, such as "expected unit".
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
