//! Page sizes that a column states, which are checked before memory is allocated for them.
//!
//! # Source
//! Apache Parquet format, `PageHeader`.

use std::ops::Range;

use ::parquet::file::metadata::ColumnChunkMetaData;

use super::thrift::Bytes;

/// Encodings that use the indices of a dictionary: `PLAIN_DICTIONARY` and `RLE_DICTIONARY`.
const OF_DICTIONARY: [i64; 2] = [2, 8];

/// Returns the byte range of a column in a row group; `None` if it is not inside a file of `len`
/// bytes.
pub fn bytes_of(column: &ColumnChunkMetaData, len: usize) -> Option<Range<usize>> {
    let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
    let start = usize::try_from(start).ok()?;
    let end = start.checked_add(usize::try_from(column.compressed_size()).ok()?)?;
    (end <= len).then_some(start..end)
}

/// Returns the unpacked size of the largest page of a column, in bytes; `None` if the headers of
/// the pages are damaged, if a dictionary has more values than bytes, or if a dictionary is used
/// before it is defined.
pub fn largest_page(column: &[u8]) -> Option<usize> {
    let (mut rest, mut largest, mut dictionary) = (Bytes(column), 0, false);
    while !rest.0.is_empty() {
        let PageHeader { unpacked, packed, dictionary_values, encoding } = rest.page_header()?;
        let unpacked = usize::try_from(unpacked?).ok()?;
        if let Some(values) = dictionary_values {
            if usize::try_from(values).ok()? > unpacked {
                return None;
            }
            dictionary = true;
        }
        if encoding.is_some_and(|encoding| OF_DICTIONARY.contains(&encoding)) && !dictionary {
            return None;
        }
        largest = largest.max(unpacked);
        rest.take(usize::try_from(packed?).ok()?)?;
    }
    Some(largest)
}

/// Numbers in the header of a page.
#[derive(Debug, Default)]
struct PageHeader {
    /// Unpacked size, in bytes.
    unpacked: Option<i64>,
    /// Stored size, in bytes.
    packed: Option<i64>,
    /// Number of values, for a dictionary.
    dictionary_values: Option<i64>,
    /// Encoding of the values, for a page of data.
    encoding: Option<i64>,
}

impl Bytes<'_> {
    /// Reads the header of a page.
    fn page_header(&mut self) -> Option<PageHeader> {
        let mut header = PageHeader::default();
        self.fields(|bytes, field, kind| match (field, kind) {
            (2, 5) => bytes.signed().map(|size| header.unpacked = Some(size)),
            (3, 5) => bytes.signed().map(|size| header.packed = Some(size)),
            // The structs 5, 7 and 8 are the headers of a page of data, of a dictionary, and of a
            // page of data of version 2.
            (5, 12) => bytes.number_of(2).map(|encoding| header.encoding = encoding),
            (7, 12) => bytes.number_of(1).map(|count| header.dictionary_values = count),
            (8, 12) => bytes.number_of(4).map(|encoding| header.encoding = encoding),
            _ => bytes.skip(kind, 0),
        })?;
        Some(header)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_past_whatever_else_they_hold() {
        // The header states type 0, 600 unpacked bytes, 3 stored bytes, and a struct with a list of
        // two numbers and a Boolean.
        let header = [
            0x15, 0x00, 0x15, 0xb0, 0x09, 0x15, 0x06, 0x2c, 0x19, 0x25, 0x02, 0x04, 0x11, 0x00,
            0x00,
        ];
        let page = [&header[..], b"abc"].concat();
        assert_eq!(largest_page(&page), Some(600));
        let two = [&page[..], &[0x15, 0x00, 0x15, 0x04, 0x15, 0x00, 0x00]].concat();
        assert_eq!(largest_page(&two), Some(600));
        // A page that is cut off, has a negative size or has a list longer than the file is
        // refused.
        for len in 1..page.len() {
            assert_eq!(largest_page(&page[..len]), None, "{len}");
        }
        assert_eq!(largest_page(&[0x15, 0x00, 0x15, 0x01, 0x15, 0x00, 0x00]), None);
        assert_eq!(largest_page(&[0x19, 0xf5, 0xff, 0xff, 0x03, 0x00]), None);
        // A dictionary of 6 bytes can have 4 values, but not 400.
        let dictionary = |count: [u8; 2]| {
            let head = [0x15, 0x04, 0x15, 0x0c, 0x15, 0x00, 0x4c, 0x15, count[0], count[1]];
            [&head[..], &[0x15, 0x00, 0x00, 0x00]].concat()
        };
        assert_eq!(largest_page(&dictionary([0x88, 0x00])), Some(6));
        assert_eq!(largest_page(&dictionary([0xa0, 0x06])), None);
        // A page of data with dictionary indices is accepted after the dictionary, and refused
        // without it.
        let head = [0x15, 0x00, 0x15, 0x04, 0x15, 0x00, 0x2c, 0x15, 0x02, 0x15, 0x10, 0x00, 0x00];
        let behind = [&dictionary([0x88, 0x00])[..], &head].concat();
        assert_eq!(largest_page(&behind), Some(6));
        assert_eq!(largest_page(&head), None);
    }
}
