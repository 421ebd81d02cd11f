//! The bytes of a file, unpacked from gzip and with text as UTF-8, and their format.

use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use encoding_rs_io::DecodeReaderBytesBuilder;
use flate2::bufread::MultiGzDecoder;

use crate::contents::Place;
use crate::limits::{Budget, Limit, Limits};
use crate::{IoError, escaped, standard};

/// Number of bytes read at a time.
const CHUNK: usize = 1 << 16;

/// Number of bytes unpacked between two checks of the limits.
const AT_ONCE: u64 = 1 << 20;

/// Byte order mark of UTF-8.
pub(crate) const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// Number of bytes at the beginning of a file that are used to detect its format.
const HEAD: u64 = 512;

/// Position of the version in a MATLAB 7.3 file; such files are always little-endian.
const VERSION: std::ops::Range<usize> = 124..128;
const VERSION_73: [u8; 4] = *b"\x00\x02IM";

/// Counter of the bytes read from a file; for gzip, the packed bytes are counted.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stored(Arc<AtomicUsize>);

impl Stored {
    pub fn bytes(&self) -> usize {
        self.0.load(Ordering::Relaxed)
    }
}

/// Stream whose bytes are counted.
struct Counted<R> {
    stream: R,
    stored: Stored,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.stream.read(buffer)?;
        self.stored.0.fetch_add(count, Ordering::Relaxed);
        Ok(count)
    }
}

/// Text unpacked from gzip. Its length is limited; the limit depends on the number of bytes read
/// from the packed file.
struct Bounded<'a> {
    text: Box<dyn BufRead + Send + 'a>,
    /// Number of unpacked bytes read so far.
    bytes: usize,
    stored: Stored,
    limits: Limits,
}

impl BufRead for Bounded<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let most = self.limits.text_bytes(self.stored.bytes());
        if self.bytes > most {
            return Err(io::Error::other(TooLong(most)));
        }
        self.text.fill_buf()
    }

    fn consume(&mut self, count: usize) {
        self.bytes += count;
        self.text.consume(count);
    }
}

impl Read for Bounded<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let available = self.fill_buf()?;
        let count = available.len().min(buffer.len());
        buffer[..count].copy_from_slice(&available[..count]);
        self.consume(count);
        Ok(count)
    }
}

/// Error for an unpacked text with more bytes than the limit.
#[derive(Debug, thiserror::Error)]
#[error("the unpacked text is longer than {0} bytes")]
struct TooLong(usize);

/// File that is being read.
pub(crate) struct Source<'a> {
    pub file: String,
    /// `true` if the file is read through gzip.
    pub gzip: bool,
    /// `true` for UTF-16, which is converted to UTF-8.
    pub utf16: bool,
    /// Counter of the bytes read from the file; for gzip, the packed bytes are counted.
    pub stored: Stored,
    /// First bytes, which `reader` also returns.
    head: Vec<u8>,
    pub reader: Box<dyn BufRead + Send + 'a>,
}

/// Format of a file, by its first bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Text,
    Json,
    /// MATLAB level 5, which MATLAB versions 5 to 7.2 write.
    Mat5,
    /// HDF5, which MATLAB can write since version 7.3.
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
            Ok(stream) => Source::new(file, stream),
            Err(source) => Err(IoError::Read { file, source }),
        }
    }

    /// Reads the first bytes of a stream; `file` is its name in messages.
    pub fn new(file: String, raw: impl Read + Send + 'a) -> Result<Self, IoError> {
        let file = escaped(&file).into_owned();
        let stored = Stored::default();
        let raw = Counted { stream: raw, stored: stored.clone() };
        let mut raw = BufReader::with_capacity(CHUNK, raw);
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
            Ok((head, reader)) => Ok(Self { file, gzip, utf16, stored, head, reader }),
            Err(source) => Err(failed(&file, gzip, source)),
        }
    }

    /// Returns the format of the file.
    pub fn kind(&self) -> Kind {
        let head = &self.head;
        // Programs other than MATLAB begin a file of version 7.3 with the words of level 5: only
        // the version number differs.
        let is_version_73 = head.get(VERSION) == Some(&VERSION_73);
        if head.starts_with(b"MATLAB 5.0 MAT-file") && !is_version_73 {
            Kind::Mat5
        } else if head.starts_with(b"MATLAB 5.0 MAT-file")
            || head.starts_with(b"MATLAB 7.3 MAT-file")
            || head.starts_with(b"\x89HDF\r\n")
        {
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

    /// Returns the last byte of a line: a line feed, or a carriage return in a text without line
    /// feeds.
    pub fn terminator(&self) -> u8 {
        let is_old = self.head.contains(&b'\r') && !self.head.contains(&b'\n');
        if is_old { b'\r' } else { b'\n' }
    }

    /// Reads the rest of the file; the limits apply to the unpacked bytes.
    pub fn bytes(&mut self, limits: &Limits) -> Result<Vec<u8>, IoError> {
        let mut bytes = Vec::new();
        loop {
            match self.reader.by_ref().take(AT_ONCE).read_to_end(&mut bytes) {
                Ok(0) => return Ok(bytes),
                Ok(_) => self.check_unpacked(bytes.len(), limits)?,
                Err(source) => return Err(failed(&self.file, self.gzip, source)),
            }
        }
    }

    /// Returns an error if `len` unpacked bytes are more than the limits allow for the number of
    /// stored bytes that were read.
    fn check_unpacked(&self, len: usize, limits: &Limits) -> Result<(), IoError> {
        let (most, limit) = self.budget(limits).unpacked_bytes();
        if self.gzip && len > most {
            let at = Place::Byte(most);
            return Err(IoError::TooLarge { file: self.file.clone(), at, limit });
        }
        Ok(())
    }

    /// Applies the limits to a text while it is unpacked.
    #[must_use]
    pub fn bounded(self, limits: &Limits) -> Self {
        if !self.gzip {
            return self;
        }
        let (stored, limits) = (self.stored.clone(), *limits);
        let reader = Box::new(Bounded { text: self.reader, bytes: 0, stored, limits });
        Self { reader, ..self }
    }

    /// Returns the memory budget for the bytes read.
    pub fn budget(&self, limits: &Limits) -> Budget {
        Budget::new(limits, self.stored.bytes())
    }
}

/// Returns the first bytes of a stream, and a stream that still begins with them.
fn peek<'a>(
    mut stream: Box<dyn BufRead + Send + 'a>,
) -> io::Result<(Vec<u8>, Box<dyn BufRead + Send + 'a>)> {
    let mut head = Vec::new();
    stream.by_ref().take(HEAD).read_to_end(&mut head)?;
    Ok((head.clone(), Box::new(Cursor::new(head).chain(stream))))
}

/// Returns whether the first bytes are the byte order mark of UTF-16, and not of UTF-32.
fn is_utf16(head: &[u8]) -> bool {
    let little = head.starts_with(&[0xff, 0xfe]) && !head.starts_with(&[0xff, 0xfe, 0, 0]);
    little || head.starts_with(&[0xfe, 0xff])
}

/// Returns whether the first bytes are not text: zero bytes are allowed only at the end, as in a
/// preallocated file.
fn is_binary(head: &[u8]) -> bool {
    let text = head.len() - head.iter().rev().take_while(|b| **b == 0).count();
    let is_control = |b: &u8| *b < b' ' && !b.is_ascii_whitespace();
    text < head.len() && (text == 0 || head[..text].iter().any(is_control))
        || head[..text].contains(&0)
}

/// Returns whether the first bytes identify Parquet, and are not the name of a column in a text.
fn is_parquet(head: &[u8]) -> bool {
    let after_magic = head.strip_prefix(b"PAR1").and_then(<[u8]>::first);
    after_magic.is_some_and(|b| b.is_ascii_control() && !b.is_ascii_whitespace())
}

/// Returns whether a text begins like a JSON object or a list of objects.
fn is_json(head: &[u8]) -> bool {
    let text = head.strip_prefix(BYTE_ORDER_MARK).unwrap_or(head);
    let mut marks = text.iter().filter(|b| !b.is_ascii_whitespace());
    matches!(
        (marks.next(), marks.next()),
        (Some(b'{'), Some(b'"' | b'}') | None) | (Some(b'['), Some(b'{'))
    )
}

/// Returns the error for a failed read: of the file, or of the gzip around it.
pub(crate) fn failed(file: &str, gzip: bool, source: io::Error) -> IoError {
    let file = file.to_owned();
    if let Some(TooLong(most)) = source.get_ref().and_then(|cause| cause.downcast_ref()) {
        return IoError::TooLarge {
            file,
            at: Place::Byte(*most),
            limit: Limit::UnpackedBytes(*most),
        };
    }
    if gzip { IoError::Gzip { file, source } } else { IoError::Read { file, source } }
}

/// Returns whether the first line that is not empty has -1 in its columns 5 and 6, and whether the
/// next line has the number of a dataset in its first six columns, or a misplaced 58b.
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
