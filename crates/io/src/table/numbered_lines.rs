//! The lines of a text and their numbers in the file.

use std::collections::VecDeque;
use std::io::{self, BufRead, Read};

use super::dialect::COMMENT;

/// A text whose lines are counted; all of them end with a line feed alone.
pub(super) struct NumberedLines<R> {
    text: R,
    line: Vec<u8>,
    /// Bytes of `line` that were handed out.
    given: usize,
    /// Number of the line before the first.
    first: u64,
    /// Number of the line read last.
    count: u64,
    /// Whether it had no line feed.
    open: bool,
    /// First and last of each run of lines handed out that hold no row: empty ones and comments;
    /// those that rows were read beyond are forgotten.
    idle: VecDeque<(u64, u64)>,
}

impl<R: BufRead> NumberedLines<R> {
    /// A text that follows so many lines.
    pub fn new(text: R, first: u64) -> Self {
        Self {
            text,
            line: Vec::new(),
            given: 0,
            first,
            count: first,
            open: false,
            idle: VecDeque::new(),
        }
    }

    /// The next line and its number.
    pub fn next_line(&mut self) -> io::Result<Option<(u64, &[u8])>> {
        self.line.clear();
        self.given = 0;
        if self.text.read_until(b'\n', &mut self.line)? == 0 {
            return Ok(None);
        }
        self.count += 1;
        self.open = !self.line.ends_with(b"\n");
        if self.line.ends_with(b"\r\n") {
            self.line.pop();
            self.line.pop();
            self.line.push(b'\n');
        }
        Ok(Some((self.count, &self.line)))
    }

    /// Number of the line read last, if nothing ends it.
    pub fn open_line(&self) -> Option<u64> {
        self.open.then_some(self.count)
    }

    /// The first line from `line` on, of those handed out, that holds a row; no earlier one is asked
    /// for again.
    pub fn row_from(&mut self, line: u64) -> u64 {
        let line = self.first + line;
        while self.idle.front().is_some_and(|(_, last)| *last < line) {
            self.idle.pop_front();
        }
        match self.idle.front() {
            Some((first, last)) if *first <= line => last + 1,
            _ => line,
        }
    }

    fn note_idle(&mut self) {
        if matches!(self.line[0], COMMENT | b'\n') {
            match self.idle.back_mut() {
                Some((_, last)) if *last + 1 == self.count => *last = self.count,
                _ => self.idle.push_back((self.count, self.count)),
            }
        }
    }
}

impl<R: BufRead> Read for NumberedLines<R> {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        let mut filled = 0;
        while filled < into.len() {
            if self.given == self.line.len() {
                if self.next_line()?.is_none() {
                    break;
                }
                self.note_idle();
            }
            let some = (self.line.len() - self.given).min(into.len() - filled);
            into[filled..filled + some].copy_from_slice(&self.line[self.given..self.given + some]);
            self.given += some;
            filled += some;
        }
        Ok(filled)
    }
}
