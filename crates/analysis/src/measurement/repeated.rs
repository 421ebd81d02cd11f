//! Records that are given twice.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::{CHUNK_SAMPLES, Measurement};
use crate::AnalysisError;

/// Refuses two records that are equal in every sample: noise makes two tests differ. A record that
/// is used twice would wrongly halve the variances of all results.
///
/// # Errors
/// [`AnalysisError::RepeatedRecord`], and if a file cannot be read.
pub(crate) fn check_distinct(measurements: &[Measurement]) -> Result<(), AnalysisError> {
    for (at, second) in measurements.iter().enumerate() {
        for first in &measurements[..at] {
            if may_repeat(first, second)? && digest(first)? == digest(second)? {
                let (first, second) = (first.name().to_owned(), second.name().to_owned());
                return Err(AnalysisError::RepeatedRecord { first, second });
            }
        }
    }
    Ok(())
}

/// Returns whether the largest values, the channels and the windows of two records are equal,
/// without reading their samples again. Records that are zero throughout do not count, because
/// other errors report them.
fn may_repeat(a: &Measurement, b: &Measurement) -> Result<bool, AnalysisError> {
    let moves = a.source.peaks.iter().any(|peak| *peak > 0.0);
    let is_alike = a.source.peaks == b.source.peaks && a.channels() == b.channels();
    Ok(moves && is_alike && a.span()? == b.span()?)
}

/// Returns a hash of all samples of the window.
fn digest(record: &Measurement) -> Result<u64, AnalysisError> {
    let (start, len) = record.span()?;
    let mut hasher = DefaultHasher::new();
    record.source.blocks(start..start + len, CHUNK_SAMPLES, CHUNK_SAMPLES, &mut |block| {
        block.iter().for_each(|value| value.to_bits().hash(&mut hasher));
        Ok(())
    })?;
    Ok(hasher.finish())
}
