//! Sizes that the pages of a column state, looked at before anything is allocated for them.
//!
//! # Source
//! Apache Parquet format, `PageHeader`; Apache Thrift, compact protocol.

use std::ops::Range;

use ::parquet::file::metadata::ColumnChunkMetaData;

/// Depth of structs in structs beyond which a header is refused; those of pages have three levels.
const DEPTH: usize = 8;

/// Encodings by the indices of a dictionary: `PLAIN_DICTIONARY` and `RLE_DICTIONARY`.
const OF_DICTIONARY: [i64; 2] = [2, 8];

/// Returns the bytes of a column in a row group; `None` if they are not in a file of `len` bytes.
pub fn bytes_of(column: &ColumnChunkMetaData, len: usize) -> Option<Range<usize>> {
    let start = column.dictionary_page_offset().unwrap_or(column.data_page_offset());
    let start = usize::try_from(start).ok()?;
    let end = start.checked_add(usize::try_from(column.compressed_size()).ok()?)?;
    (end <= len).then_some(start..end)
}

/// Returns the size of the largest page of a column once it is unpacked, in bytes; `None` if the headers of
/// the pages are damaged, a dictionary has more values than bytes, or one is used before it stands.
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
    /// Size once it is unpacked, in bytes.
    unpacked: Option<i64>,
    /// Size as it stands, in bytes.
    packed: Option<i64>,
    /// Number of values, of a dictionary.
    dictionary_values: Option<i64>,
    /// Encoding of the values, of a page of data.
    encoding: Option<i64>,
}

/// Bytes not read yet.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn take(&mut self, count: usize) -> Option<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        Some(self.take(1)?[0])
    }

    /// Reads an unsigned number of 7 bits a byte, the lowest first.
    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte & 0x80 == 0 {
                return Some(value);
            }
        }
        None
    }

    /// Reads a signed number, of which the lowest bit is the sign.
    fn signed(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    /// Reads the header of a page.
    fn page_header(&mut self) -> Option<PageHeader> {
        let mut header = PageHeader::default();
        self.fields(|bytes, field, kind| match (field, kind) {
            (2, 5) => bytes.signed().map(|size| header.unpacked = Some(size)),
            (3, 5) => bytes.signed().map(|size| header.packed = Some(size)),
            // Headers of a page of data, of a dictionary, and of a page of data of version 2.
            (5, 12) => bytes.number_of(2).map(|encoding| header.encoding = encoding),
            (7, 12) => bytes.number_of(1).map(|count| header.dictionary_values = count),
            (8, 12) => bytes.number_of(4).map(|encoding| header.encoding = encoding),
            _ => bytes.skip(kind, 0),
        })?;
        Some(header)
    }

    /// Reads a struct for the number in one of its fields, if it has that field.
    fn number_of(&mut self, wanted: i64) -> Option<Option<i64>> {
        let mut number = None;
        self.fields(|bytes, field, kind| match kind {
            5 if field == wanted => bytes.signed().map(|value| number = Some(value)),
            _ => bytes.skip(kind, 1),
        })?;
        Some(number)
    }

    /// Reads a struct, its fields by their numbers and kinds.
    fn fields(&mut self, mut read: impl FnMut(&mut Self, i64, u8) -> Option<()>) -> Option<()> {
        let mut field = 0;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(());
            }
            field = self.field(head, field)?;
            read(self, field, head & 0x0f)?;
        }
    }

    /// Returns the number of a field, which follows the one before or stands by itself.
    fn field(&mut self, head: u8, before: i64) -> Option<i64> {
        match head >> 4 {
            0 => self.signed(),
            step => Some(before.checked_add(i64::from(step))?),
        }
    }

    /// Passes over a value of some kind.
    fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            // True and false are the kind itself.
            1 | 2 => {}
            3 => drop(self.byte()?),
            4..=6 => drop(self.varint()?),
            7 => drop(self.take(8)?),
            8 => {
                let len = usize::try_from(self.varint()?).ok()?;
                self.take(len)?;
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = match head >> 4 {
                    15 => self.varint()?,
                    count => u64::from(count),
                };
                self.skip_all(&[head & 0x0f], count, depth)?;
            }
            11 => {
                let count = self.varint()?;
                if count > 0 {
                    let kinds = self.byte()?;
                    self.skip_all(&[kinds >> 4, kinds & 0x0f], count, depth)?;
                }
            }
            12 if depth < DEPTH => {
                self.fields(|bytes, _, kind| bytes.skip(kind, depth + 1))?;
            }
            _ => return None,
        }
        Some(())
    }

    /// Passes over so many elements of a list or map; each takes a byte at least.
    fn skip_all(&mut self, kinds: &[u8], count: u64, depth: usize) -> Option<()> {
        if count > self.0.len() as u64 || depth >= DEPTH {
            return None;
        }
        for _ in 0..count {
            for kind in kinds {
                match kind {
                    1 | 2 => drop(self.byte()?),
                    kind => self.skip(*kind, depth + 1)?,
                }
            }
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read_past_whatever_else_they_hold() {
        // Type 0, 600 bytes unpacked, 3 as they stand, a struct of a list of two numbers and a truth.
        let header = [
            0x15, 0x00, 0x15, 0xb0, 0x09, 0x15, 0x06, 0x2c, 0x19, 0x25, 0x02, 0x04, 0x11, 0x00,
            0x00,
        ];
        let page = [&header[..], b"abc"].concat();
        assert_eq!(largest_page(&page), Some(600));
        let two = [&page[..], &[0x15, 0x00, 0x15, 0x04, 0x15, 0x00, 0x00]].concat();
        assert_eq!(largest_page(&two), Some(600));
        // Cut off anywhere, with a negative size, or with a list longer than the file.
        for len in 1..page.len() {
            assert_eq!(largest_page(&page[..len]), None, "{len}");
        }
        assert_eq!(largest_page(&[0x15, 0x00, 0x15, 0x01, 0x15, 0x00, 0x00]), None);
        assert_eq!(largest_page(&[0x19, 0xf5, 0xff, 0xff, 0x03, 0x00]), None);
        // A dictionary of 6 bytes with 4 values, and with 400.
        let dictionary = |count: [u8; 2]| {
            let head = [0x15, 0x04, 0x15, 0x0c, 0x15, 0x00, 0x4c, 0x15, count[0], count[1]];
            [&head[..], &[0x15, 0x00, 0x00, 0x00]].concat()
        };
        assert_eq!(largest_page(&dictionary([0x88, 0x00])), Some(6));
        assert_eq!(largest_page(&dictionary([0xa0, 0x06])), None);
        // Data by the indices of a dictionary, behind it and without it.
        let head = [0x15, 0x00, 0x15, 0x04, 0x15, 0x00, 0x2c, 0x15, 0x02, 0x15, 0x10, 0x00, 0x00];
        let behind = [&dictionary([0x88, 0x00])[..], &head].concat();
        assert_eq!(largest_page(&behind), Some(6));
        assert_eq!(largest_page(&head), None);
    }
}
