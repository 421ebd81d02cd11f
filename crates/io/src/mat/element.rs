//! The elements of a MATLAB file: each has a type, a number of bytes, and the bytes.

use crate::contents::Fault;

/// A variable.
pub(crate) const MATRIX: u32 = 14;

/// A compressed variable.
pub(crate) const COMPRESSED: u32 = 15;

/// Byte order of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Endian {
    Little,
    Big,
}

impl Endian {
    pub fn u16(self, bytes: [u8; 2]) -> u16 {
        match self {
            Endian::Little => u16::from_le_bytes(bytes),
            Endian::Big => u16::from_be_bytes(bytes),
        }
    }

    pub fn u32(self, bytes: [u8; 4]) -> u32 {
        match self {
            Endian::Little => u32::from_le_bytes(bytes),
            Endian::Big => u32::from_be_bytes(bytes),
        }
    }

    pub fn u64(self, bytes: [u8; 8]) -> u64 {
        match self {
            Endian::Little => u64::from_le_bytes(bytes),
            Endian::Big => u64::from_be_bytes(bytes),
        }
    }
}

/// One element of the file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Element<'a> {
    pub kind: u32,
    pub data: &'a [u8],
    /// Offset of the data of the element in the file.
    pub at: usize,
}

/// Iterator over consecutive elements.
#[derive(Debug)]
pub(crate) struct Elements<'a> {
    bytes: &'a [u8],
    /// Number of bytes read.
    next: usize,
    /// Offset of `bytes` in the file.
    base: usize,
    endian: Endian,
}

impl<'a> Elements<'a> {
    pub fn new(bytes: &'a [u8], base: usize, endian: Endian) -> Self {
        Self { bytes, next: 0, base, endian }
    }

    /// Reads the next element inside a variable, `None` at the end; each is padded to 8 bytes.
    pub fn next(&mut self) -> Result<Option<Element<'a>>, Fault> {
        self.padded(|_| true)
    }

    /// Returns whether no element follows.
    pub fn is_at_end(&self) -> bool {
        self.next >= self.bytes.len()
    }

    /// Reads the next element at the top level of the file, where compressed elements are not
    /// padded.
    pub fn next_at_top(&mut self) -> Result<Option<Element<'a>>, Fault> {
        self.padded(|kind| kind != COMPRESSED)
    }

    /// Reads the next element; returns an error if there is none.
    pub fn required(&mut self, what: &str) -> Result<Element<'a>, Fault> {
        let at = self.base + self.next;
        self.next()?.ok_or_else(|| Fault::new(at, format!("a variable ends before its {what}")))
    }

    fn padded(&mut self, is_padded: impl Fn(u32) -> bool) -> Result<Option<Element<'a>>, Fault> {
        let remaining = self.bytes.get(self.next..).unwrap_or_default();
        if remaining.is_empty() {
            return Ok(None);
        }
        let at = self.base + self.next;
        let short = || Fault::new(at, "the file is cut short");
        let (tag, remaining) = remaining.split_first_chunk::<4>().ok_or_else(short)?;
        let (kind, small) = split(self.endian.u32(*tag));
        if let Some(len) = small {
            // Up to four bytes of data are stored in the tag itself.
            let data = remaining.get(..4).ok_or_else(short)?.get(..len);
            let data = data.ok_or_else(|| Fault::new(at, "an element has an impossible length"))?;
            self.next += 8;
            return Ok(Some(Element { kind, data, at: at + 4 }));
        }
        let (tag, remaining) = remaining.split_first_chunk::<4>().ok_or_else(short)?;
        let len = self.endian.u32(*tag) as usize;
        let data = remaining.get(..len).ok_or_else(|| {
            Fault::new(
                at,
                format!(
                    "an element of {len} bytes has only {}: the file is cut short",
                    remaining.len()
                ),
            )
        })?;
        self.next += 8 + if is_padded(kind) { len.next_multiple_of(8) } else { len };
        Ok(Some(Element { kind, data, at: at + 8 }))
    }
}

/// Splits a tag into the type of its element and, if the data are in the tag, their length.
fn split(tag: u32) -> (u32, Option<usize>) {
    match tag >> 16 {
        0 => (tag, None),
        len => (tag & 0xffff, Some(len as usize)),
    }
}

impl Element<'_> {
    /// Returns how many numbers the element has; `None` if its type is not numeric.
    pub fn count(&self) -> Option<usize> {
        let bytes = match self.kind {
            1 | 2 => 1,
            3 | 4 => 2,
            5..=7 => 4,
            9 | 12 | 13 => 8,
            _ => return None,
        };
        self.data.len().is_multiple_of(bytes).then_some(self.data.len() / bytes)
    }

    /// Returns the numbers of an element of any numeric type; `None` for other types.
    pub fn numbers(&self, endian: Endian) -> Option<Vec<f64>> {
        fn all<const N: usize>(data: &[u8], number: impl Fn([u8; N]) -> f64) -> Vec<f64> {
            data.as_chunks::<N>().0.iter().map(|chunk| number(*chunk)).collect()
        }
        self.count()?;
        let data = self.data;
        Some(match self.kind {
            1 => all(data, |b| f64::from(i8::from_le_bytes(b))),
            2 => all(data, |b| f64::from(u8::from_le_bytes(b))),
            3 => all(data, |b| f64::from(endian.u16(b).cast_signed())),
            4 => all(data, |b| f64::from(endian.u16(b))),
            5 => all(data, |b| f64::from(endian.u32(b).cast_signed())),
            6 => all(data, |b| f64::from(endian.u32(b))),
            7 => all(data, |b| f64::from(f32::from_bits(endian.u32(b)))),
            9 => all(data, |b| f64::from_bits(endian.u64(b))),
            12 => all(data, |b| endian.u64(b).cast_signed() as f64),
            _ => all(data, |b| endian.u64(b) as f64),
        })
    }
}
