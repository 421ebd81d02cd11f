//! Parsers of options whose values are the variants of an enum, by name.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use mechid::analysis::words;
use serde::de::DeserializeOwned;

/// Returns a parser of the variants of an enum, by the names that `serde` gives them.
pub fn word<T>() -> impl TypedValueParser<Value = T>
where
    T: DeserializeOwned + Clone + Send + Sync + 'static,
{
    one_of(words::all::<T>())
}

/// Returns a parser of the variants of an enum whose names are in `words`.
pub fn one_of<T>(words: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: DeserializeOwned + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|text| words::read(&text))
}
