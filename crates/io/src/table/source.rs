//! The bytes of a file, without gzip, text as UTF-8, and their format.

use std::io::{self, BufRead, BufReader, Cursor, Read as _};
use std::path::Path;

use encoding_rs_io::DecodeReaderBytesBuilder;
use flate2::bufread::MultiGzDecoder;

use crate::contents::Place;
use crate::limits::{Limit, Limits};
use crate::{IoError, escaped, standard};

/// Number of bytes read at a time.
const CHUNK: usize = 1 << 16;

/// Byte order mark of UTF-8.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Number of bytes from which the format is detected.
const HEAD: u64 = 512;

/// A file being read.
pub(crate) struct Source<'a> {
    pub file: String,
    /// Whether it is read through gzip.
    pub gzip: bool,
    /// Whether it is UTF-16, read as UTF-8.
    pub utf16: bool,
    /// Its first bytes, which stand in `reader` too.
    head: Vec<u8>,
    pub reader: Box<dyn BufRead + Send + 'a>,
}

/// Format of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Text,
    Json,
    /// MATLAB level 5, which its versions 5 to 7.2 write.
    Mat5,
    /// HDF5, which MATLAB writes since version 7.3 on request.
    Hdf5,
    Uff,
    Parquet,
    Unknown,
}

impl<'a> Source<'a> {
    /// Opens a file, or standard input as `-`.
    pub fn open(path: &Path) -> Result<Source<'static>, IoError> {
        let file = standard::input_name(path);
        match standard::open(path) {
            Ok(stream) => Source::new(file, BufReader::with_capacity(CHUNK, stream)),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// Looks at the first bytes of a stream; `file` is its name in messages.
    pub fn new(file: String, mut raw: impl BufRead + Send + 'a) -> Result<Self, IoError> {
        let file = escaped(&file).into_owned();
        let (mut magic, mut gzip, mut utf16) = (Vec::new(), false, false);
        let looked = raw.by_ref().take(2).read_to_end(&mut magic).and_then(|_| {
            gzip = magic == [0x1f, 0x8b];
            let whole = Cursor::new(magic).chain(raw);
            let stream: Box<dyn BufRead + Send + 'a> = if gzip {
                Box::new(BufReader::with_capacity(CHUNK, MultiGzDecoder::new(whole)))
            } else {
                Box::new(whole)
            };
            let (mut head, mut stream) = peek(stream)?;
            utf16 = is_utf16(&head);
            if utf16 {
                let text = DecodeReaderBytesBuilder::new().strip_bom(true).build(stream);
                (head, stream) = peek(Box::new(BufReader::with_capacity(CHUNK, text)))?;
            }
            Ok((head, stream))
        });
        match looked {
            Ok((head, reader)) => Ok(Self { file, gzip, utf16, head, reader }),
            Err(source) => Err(failed(&file, gzip, source)),
        }
    }

    /// Format of the file.
    pub fn kind(&self) -> Kind {
        let head = &self.head;
        if head.starts_with(b"MATLAB 5.0 MAT-file") {
            Kind::Mat5
        } else if head.starts_with(b"MATLAB 7.3 MAT-file") || head.starts_with(b"\x89HDF\r\n") {
            Kind::Hdf5
        } else if is_parquet(head) {
            Kind::Parquet
        } else if is_uff(head) {
            Kind::Uff
        } else if is_binary(head) {
            Kind::Unknown
        } else if is_json(head) {
            Kind::Json
        } else {
            Kind::Text
        }
    }

    /// Last byte of a line: a line feed, or a carriage return in a text without any.
    pub fn terminator(&self) -> u8 {
        let is_old = self.head.contains(&b'\r') && !self.head.contains(&b'\n');
        if is_old { b'\r' } else { b'\n' }
    }

    /// Reads the rest of the file; what gzip unpacks is held to the limit.
    pub fn bytes(&mut self, limits: &Limits) -> Result<Vec<u8>, IoError> {
        let limit = if self.gzip { limits.unpacked_bytes } else { usize::MAX };
        let mut bytes = Vec::new();
        let most = (limit as u64).saturating_add(1);
        match self.reader.by_ref().take(most).read_to_end(&mut bytes) {
            Ok(_) if bytes.len() > limit => {
                let (at, limit) = (Place::Byte(limit), Limit::UnpackedBytes(limit));
                Err(IoError::TooLarge { file: self.file.clone(), at, limit })
            }
            Ok(_) => Ok(bytes),
            Err(source) => Err(failed(&self.file, self.gzip, source)),
        }
    }
}

/// The first bytes of a stream, and the stream with them still in it.
fn peek<'a>(
    mut stream: Box<dyn BufRead + Send + 'a>,
) -> io::Result<(Vec<u8>, Box<dyn BufRead + Send + 'a>)> {
    let mut head = Vec::new();
    stream.by_ref().take(HEAD).read_to_end(&mut head)?;
    Ok((head.clone(), Box::new(Cursor::new(head).chain(stream))))
}

/// Returns whether the first bytes are the byte order mark of UTF-16, and not that of UTF-32.
fn is_utf16(head: &[u8]) -> bool {
    let little = head.starts_with(&[0xff, 0xfe]) && !head.starts_with(&[0xff, 0xfe, 0, 0]);
    little || head.starts_with(&[0xfe, 0xff])
}

/// Returns whether the first bytes are no text: zeros may stand only at its end, where a preallocated file has
/// them.
fn is_binary(head: &[u8]) -> bool {
    let text = head.len() - head.iter().rev().take_while(|b| **b == 0).count();
    let is_control = |b: &u8| *b < b' ' && !b.is_ascii_whitespace();
    text < head.len() && (text == 0 || head[..text].iter().any(is_control))
        || head[..text].contains(&0)
}

/// Returns whether the first bytes are those of Parquet, and not the name of a column in a text.
fn is_parquet(head: &[u8]) -> bool {
    let rest = head.strip_prefix(b"PAR1").and_then(<[u8]>::first);
    rest.is_some_and(|b| b.is_ascii_control() && !b.is_ascii_whitespace())
}

/// Returns whether a text begins as an object of JSON does, or a list of objects.
fn is_json(head: &[u8]) -> bool {
    let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
    let mut marks = text.iter().filter(|b| !b.is_ascii_whitespace());
    matches!(
        (marks.next(), marks.next()),
        (Some(b'{'), Some(b'"' | b'}') | None) | (Some(b'['), Some(b'{'))
    )
}

/// The error for a failed read: of the file, or of the gzip around it.
pub(crate) fn failed(file: &str, gzip: bool, source: io::Error) -> IoError {
    let file = file.to_owned();
    if gzip { IoError::Gzip { file, source } } else { IoError::Read { file, source } }
}

/// Returns whether the first line that is not empty holds -1 in its columns 5 and 6, and the next one the
/// number of a dataset in its first six, or a misplaced 58b.
fn is_uff(head: &[u8]) -> bool {
    let mut lines =
        head.split(|b| *b == b'\n').map(<[u8]>::trim_ascii_end).skip_while(|line| line.is_empty());
    let number = |line: &[u8]| {
        let field = line.get(..6).unwrap_or(line).trim_ascii();
        !field.is_empty() && field.iter().all(u8::is_ascii_digit)
    };
    let binary = |line: &[u8]| {
        let word = line.trim_ascii_start().get(..3).unwrap_or_default();
        word.eq_ignore_ascii_case(b"58b")
    };
    lines.next() == Some(b"    -1")
        && lines.next().is_some_and(|line| line.starts_with(b"  ") && number(line) || binary(line))
}
