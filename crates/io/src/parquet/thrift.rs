//! Reader of the compact protocol of Thrift. It is used to check a footer before the memory that
//! the footer states is allocated.
//!
//! # Source
//! Apache Thrift, compact protocol.

/// Maximum depth of nested structs; a Parquet footer has nine levels.
const DEPTH: usize = 16;

/// Bytes that are not read yet.
pub(super) struct Bytes<'a>(pub &'a [u8]);

impl Bytes<'_> {
    /// Takes the next bytes.
    pub fn take(&mut self, count: usize) -> Option<&[u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        Some(self.take(1)?[0])
    }

    /// Reads an unsigned number, stored with 7 bits in each byte, the lowest bits first.
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

    /// Reads a signed number, whose lowest bit is the sign.
    pub fn signed(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    /// Reads a struct and returns the number in one of its fields, if it has that field.
    pub fn number_of(&mut self, wanted: i64) -> Option<Option<i64>> {
        let mut number = None;
        self.fields(|bytes, field, kind| match kind {
            5 if field == wanted => bytes.signed().map(|value| number = Some(value)),
            _ => bytes.skip(kind, 1),
        })?;
        Some(number)
    }

    /// Reads a struct and passes each field, with its number and kind, to `read`.
    pub fn fields(&mut self, mut read: impl FnMut(&mut Self, i64, u8) -> Option<()>) -> Option<()> {
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

    /// Returns the number of a field, which is stored relative to the previous one or in full.
    fn field(&mut self, head: u8, before: i64) -> Option<i64> {
        match head >> 4 {
            0 => self.signed(),
            step => Some(before.checked_add(i64::from(step))?),
        }
    }

    /// Reads the head of a list: the kind and the number of its elements.
    pub fn list(&mut self) -> Option<(u8, u64)> {
        let head = self.byte()?;
        let count = match head >> 4 {
            15 => self.varint()?,
            count => u64::from(count),
        };
        Some((head & 0x0f, count))
    }

    /// Skips a value of this kind.
    pub fn skip(&mut self, kind: u8, depth: usize) -> Option<()> {
        match kind {
            // Booleans are stored in the kind itself.
            1 | 2 => {}
            3 => drop(self.byte()?),
            4..=6 => drop(self.varint()?),
            7 => drop(self.take(8)?),
            8 => {
                let len = usize::try_from(self.varint()?).ok()?;
                self.take(len)?;
            }
            9 | 10 => {
                let (kind, count) = self.list()?;
                self.skip_all(&[kind], count, depth)?;
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

    /// Skips elements of a list or map; each needs at least one byte.
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
