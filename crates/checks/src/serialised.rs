//! Forms of numbers in serialised findings.

/// Serialises an index counted from 0 as a number counted from 1.
#[cfg(feature = "serde")]
pub(crate) fn from_one<S: serde::Serializer>(
    index: &usize,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.serialize_u64(*index as u64 + 1)
}

/// Serialises a value as the text that it prints.
#[cfg(feature = "serde")]
pub(crate) fn as_text<T: std::fmt::Display, S: serde::Serializer>(
    value: &T,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}
