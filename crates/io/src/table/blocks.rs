//! Division of a text into blocks of whole rows.

use std::io::{BufRead, Read};

use mechid_signal::message;
use memchr::{memchr, memchr_iter};

use super::dialect::is_sample;
use super::fields::{Layout, RowIter};
use super::lvm::{self, LvmHeader};
use super::source::{BYTE_ORDER_MARK, Source, failed};
use crate::IoError;
use crate::contents::Place;
use crate::limits::{Limit, ReadOptions};

/// Number of bytes read at a time.
const BLOCK_BYTES: usize = 1 << 16;

/// Maximum number of bytes, with lines of any length, that are read to detect the delimiter.
const SAMPLE_BYTES: usize = 1 << 24;

/// Block of whole rows of a text.
#[derive(Debug, Default)]
pub(super) struct Block {
    pub text: Vec<u8>,
    /// Number of the first line in the file, counted from 1.
    pub line: u64,
}

/// Condition of the end of a text: whether the last line is complete, and how many zero bytes
/// follow it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct TextEnd {
    /// Last line, if no line break ends it.
    pub open_line: Option<u64>,
    /// Number of zero bytes after the last line, as in a preallocated file.
    pub padding: u64,
}

impl TextEnd {
    /// Returns the remark on the end of the text.
    pub fn remark(self) -> Option<String> {
        let bytes =
            message::count(usize::try_from(self.padding).ok().filter(|n| *n > 0)?, "zero byte");
        Some(format!("left out: {bytes} after the last line (was a preallocated file not filled?)"))
    }
}

/// Reader of the blocks of a text.
pub(super) struct Blocks<'a> {
    file: String,
    gzip: bool,
    reader: Box<dyn BufRead + Send + 'a>,
    terminator: u8,
    /// Number of the line at which `rest` begins.
    line: u64,
    row_bytes: usize,
    /// Bytes after the last block that are read already.
    rest: Vec<u8>,
    end: Option<TextEnd>,
    /// Header of a LabVIEW measurement file, which is removed from the text.
    lvm: Option<LvmHeader>,
}

impl<'a> Blocks<'a> {
    /// Skips the lines above the table and reads enough to detect the dialect of the text.
    pub fn open(source: Source<'a>, options: &ReadOptions) -> Result<Self, IoError> {
        let terminator = source.terminator();
        let Source { file, gzip, mut reader, .. } = source.bounded(&options.limits);
        for _ in 0..options.skip_lines {
            match reader.skip_until(terminator) {
                Ok(0) => {
                    let finding = "all lines of the file are skipped";
                    return Err(IoError::Empty { file, found: finding });
                }
                Ok(_) => {}
                Err(source) => return Err(failed(&file, gzip, source)),
            }
        }
        let mut blocks = Self {
            file,
            gzip,
            reader,
            terminator,
            line: options.skip_lines + 1,
            row_bytes: options.limits.row_bytes,
            rest: Vec::new(),
            end: None,
            lvm: None,
        };
        while blocks.end.is_none() && !is_sample(&blocks.rest, terminator) {
            blocks.fill(blocks.rest.len().max(BLOCK_BYTES))?;
            if blocks.rest.len() >= SAMPLE_BYTES {
                break;
            }
        }
        if blocks.rest.starts_with(BYTE_ORDER_MARK) {
            blocks.rest.drain(..BYTE_ORDER_MARK.len());
        }
        if options.skip_lines == 0 && lvm::is_lvm(&blocks.rest) {
            blocks.leave_out_header()?;
        }
        Ok(blocks)
    }

    /// Removes the header of a LabVIEW measurement file.
    fn leave_out_header(&mut self) -> Result<(), IoError> {
        while self.end.is_none()
            && !lvm::is_complete(&self.rest)
            && self.rest.len() < lvm::MAX_BYTES
        {
            self.fill(BLOCK_BYTES)?;
        }
        self.lvm = LvmHeader::parse(&self.rest, self.terminator);
        if let Some(header) = &self.lvm {
            self.line += header.lines;
            self.rest.drain(..header.bytes);
        }
        // The dialect is detected from the rows of the table, so some of them are read.
        while self.end.is_none() && !is_sample(&self.rest, self.terminator) {
            self.fill(self.rest.len().max(BLOCK_BYTES))?;
            if self.rest.len() >= SAMPLE_BYTES {
                break;
            }
        }
        Ok(())
    }

    /// Returns the header of a LabVIEW measurement file and removes it from `self`.
    pub fn take_lvm(&mut self) -> Option<LvmHeader> {
        self.lvm.take()
    }

    /// Returns the line number at which the text begins.
    pub fn first_line(&self) -> u64 {
        self.line
    }

    /// Returns the name of the file in messages.
    pub fn file(&self) -> &str {
        &self.file
    }

    pub fn terminator(&self) -> u8 {
        self.terminator
    }

    /// Returns the bytes that were read before the first block.
    pub fn start(&self) -> &[u8] {
        &self.rest
    }

    /// Returns the condition of the end of the text; `None` until all of the text has been read.
    pub fn end(&self) -> Option<TextEnd> {
        self.end.filter(|_| self.rest.is_empty())
    }

    /// Reads the next block into `block`; `false` at the end.
    ///
    /// # Errors
    /// [`IoError::TooLarge`] for a row longer than the limit, [`IoError::Malformed`] for zero bytes
    /// within the text, and errors of reading.
    pub fn next(&mut self, layout: Layout, block: &mut Block) -> Result<bool, IoError> {
        let complete = loop {
            if self.rest.len() < BLOCK_BYTES && self.end.is_none() {
                self.fill(BLOCK_BYTES - self.rest.len())?;
            }
            if self.end.is_some() {
                break self.rest.len();
            }
            match RowIter::complete(&self.rest, layout) {
                0 if self.rest.len() > self.row_bytes => return Err(self.too_long(self.line)),
                0 => self.fill(self.rest.len())?,
                complete => break complete,
            }
        };
        block.line = self.line;
        block.text.clear();
        std::mem::swap(&mut block.text, &mut self.rest);
        self.rest.extend_from_slice(&block.text[complete..]);
        block.text.truncate(complete);
        self.line += memchr_iter(self.terminator, &block.text).count() as u64;
        Ok(complete > 0)
    }

    /// Returns the error for a row that is too long.
    pub fn too_long(&self, line: u64) -> IoError {
        let limit = Limit::RowBytes(self.row_bytes);
        IoError::TooLarge { file: self.file.clone(), at: Place::Line(line), limit }
    }

    /// Reads about `count` further bytes.
    fn fill(&mut self, count: usize) -> Result<(), IoError> {
        let before = self.rest.len();
        let read = self.reader.by_ref().take(count as u64).read_to_end(&mut self.rest);
        let read = read.map_err(|source| failed(&self.file, self.gzip, source))?;
        if let Some(zero) = memchr(0, &self.rest[before..]) {
            self.end_at_zero(before + zero)?;
        } else if read < count {
            self.end = Some(TextEnd { open_line: self.open_line(), padding: 0 });
        }
        Ok(())
    }

    /// Ends the text at a zero byte; only zero bytes may follow it.
    fn end_at_zero(&mut self, zero: usize) -> Result<(), IoError> {
        let mut is_zero = self.rest[zero..].iter().all(|b| *b == 0);
        let mut padding = (self.rest.len() - zero) as u64;
        self.rest.truncate(zero);
        while is_zero {
            let more = self.reader.fill_buf();
            let more = more.map_err(|source| failed(&self.file, self.gzip, source))?;
            if more.is_empty() {
                self.end = Some(TextEnd { open_line: self.open_line(), padding });
                return Ok(());
            }
            is_zero = more.iter().all(|b| *b == 0);
            let len = more.len();
            padding += len as u64;
            self.reader.consume(len);
        }
        let line = self.line + memchr_iter(self.terminator, &self.rest).count() as u64;
        Err(IoError::Malformed {
            file: self.file.clone(),
            at: Place::Line(line),
            what: "the text contains bytes with the value 0: the file is damaged, or it is not a text file"
                .into(),
        })
    }

    /// Returns the number of the last line read, if no line break ends it.
    fn open_line(&self) -> Option<u64> {
        let ended = self.rest.last().is_none_or(|last| *last == self.terminator);
        let lines = memchr_iter(self.terminator, &self.rest).count() as u64;
        (!ended).then_some(self.line + lines)
    }
}

impl std::fmt::Debug for Blocks<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Blocks").field("file", &self.file).field("line", &self.line).finish()
    }
}
