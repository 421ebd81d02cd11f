//! Words of settings as values of options.

use clap::builder::{PossibleValuesParser, TypedValueParser};
use mechid::analysis::words;
use serde::de::DeserializeOwned;

/// Returns a parser of the words of an enum, which are the names that `serde` gives its variants.
pub fn word<T>() -> impl TypedValueParser<Value = T>
where
    T: DeserializeOwned + Clone + Send + Sync + 'static,
{
    one_of(words::all::<T>())
}

/// Returns a parser of some words of an enum.
pub fn one_of<T>(words: &'static [&'static str]) -> impl TypedValueParser<Value = T>
where
    T: DeserializeOwned + Clone + Send + Sync + 'static,
{
    PossibleValuesParser::new(words).try_map(|text| words::read(&text))
}
