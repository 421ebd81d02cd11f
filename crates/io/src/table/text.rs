//! Delimited text converted to columns of numbers, on all cores and in the order of the file.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;

use super::batch::{Batch, Plan};
use super::blocks::{Block, Blocks, TextEnd};
use super::dialect;
use super::fields::Layout;
use super::preamble::{self, Beginning};
use super::rows::Rows;
use super::source::Source;
use crate::IoError;
use crate::contents::{Contents, DecimalSign};
use crate::limits::ReadOptions;

/// Maximum number of threads that read rows; more would wait for memory.
const MOST_THREADS: usize = 8;

/// Reader of a text into columns.
#[derive(Debug)]
pub(super) struct TextReader<'a> {
    layout: Layout,
    /// Line at which the table seems to begin, counted in the file.
    table: Option<Beginning>,
    blocks: Blocks<'a>,
    rows: Rows,
}

/// Columns of a text to read, and properties of the text.
#[derive(Debug, Clone, Default)]
pub(super) struct Wanted {
    /// Indices of the columns, in rising order; all if `None`.
    pub columns: Option<Vec<usize>>,
    /// Decimal sign, if an earlier pass over the text has determined it.
    pub decimal: Option<DecimalSign>,
}

/// Callback that receives the rows read so far, after each block; it returns whether to continue.
pub(super) type TakeRows<'a, E> = dyn FnMut(&mut Rows) -> Result<ControlFlow<()>, E> + 'a;

impl<'a> TextReader<'a> {
    /// Opens a text and detects its dialect.
    pub fn open(
        source: Source<'a>,
        options: &ReadOptions,
        wanted: Wanted,
    ) -> Result<Self, IoError> {
        let stored = source.stored.clone();
        let mut blocks = Blocks::open(source, options)?;
        let lvm = blocks.take_lvm();
        let (start, terminator) = (blocks.start(), blocks.terminator());
        let delimiter = dialect::detect(start, terminator);
        let layout = Layout { delimiter, terminator };
        let decimal =
            wanted.decimal.or_else(|| dialect::decimal_sign(start, terminator, delimiter));
        let table = preamble::table(start, terminator)
            .map(|t| Beginning { line: blocks.first_line() - 1 + t.line, ..t });
        let file = blocks.file().to_owned();
        let rows = Rows::new(file, layout, (options.limits, stored), decimal, wanted.columns)
            .with_lvm(lvm);
        Ok(Self { layout, table, blocks, rows })
    }

    /// Returns the rows read so far.
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Returns the condition of the end of the text; `None` if the end was not reached.
    pub fn end(&self) -> Option<TextEnd> {
        self.blocks.end()
    }

    /// Reads rows until the text ends, or until `take`, which receives them block by block, breaks;
    /// returns whether the text has ended.
    pub fn read<E: From<IoError>>(&mut self, take: &mut TakeRows<'_, E>) -> Result<bool, E> {
        let (mut block, mut batch) = (Block::default(), Batch::default());
        // The first two blocks are read without threads: the names come first, and a short text is
        // read faster in this way.
        for _ in 0..2 {
            loop {
                if !self.blocks.next(self.layout, &mut block)? {
                    return Ok(true);
                }
                let begin = self.rows.begin(&block).map_err(|e| self.above_or(e))?;
                if begin < block.text.len() {
                    batch.read(&self.rows.plan(), &block, begin);
                    break;
                }
            }
            self.rows.append(&mut batch).map_err(|e| self.above_or(e))?;
            if take(&mut self.rows)?.is_break() {
                return Ok(false);
            }
        }
        self.read_in_parallel(take)
    }

    fn read_in_parallel<E: From<IoError>>(
        &mut self,
        take: &mut TakeRows<'_, E>,
    ) -> Result<bool, E> {
        let threads = thread::available_parallelism().map_or(1, usize::from).min(MOST_THREADS);
        let Self { layout, table, blocks, rows } = self;
        let (layout, plan) = (*layout, rows.plan());
        let shared = Mutex::new(Shared { blocks, next: 0 });
        // Two blocks per thread exist at a time: one is being read, and one waits to be appended.
        let (free, freed) = channel();
        let freed = Mutex::new(freed);
        let under_way = 2 * threads;
        (0..under_way).for_each(|_| drop(free.send(Work::default())));
        let (done, finished) = sync_channel(under_way);
        thread::scope(|scope| {
            for _ in 0..threads {
                let (shared, freed, done, plan) = (&shared, &freed, done.clone(), &plan);
                scope.spawn(move || worker(layout, plan, shared, freed, &done));
            }
            drop(done);
            let above_or = |e: IoError, rows: &Rows| above_or(*table, rows, e);
            let mut early = BTreeMap::new();
            for next in 0.. {
                let work = loop {
                    if let Some(work) = early.remove(&next) {
                        break work;
                    }
                    match finished.recv() {
                        Ok((number, work)) => drop(early.insert(number, work)),
                        Err(_) => return Ok(true),
                    }
                };
                let mut work: Work = work?;
                if rows.contradicts(&work.batch) {
                    work.batch.read(&rows.plan(), &work.block, 0);
                }
                rows.append(&mut work.batch).map_err(|e| above_or(e, rows))?;
                if take(rows)?.is_break() {
                    break;
                }
                drop(free.send(work));
            }
            // Dropping the channels ends the threads.
            drop((finished, free));
            Ok(false)
        })
    }

    /// Returns the contents of the file, which ends with `end`.
    ///
    /// # Errors
    /// [`IoError::Empty`] without samples, [`IoError::AboveTable`] if the table seems to begin
    /// further down.
    pub fn finish(self, end: TextEnd) -> Result<Contents, IoError> {
        match above(self.table, &self.rows, self.blocks.file()) {
            Some(above) if self.table.is_some_and(|t| self.rows.width() < t.fields) => Err(above),
            _ => {
                let mut contents = self.rows.finish()?;
                contents.open_line = end.open_line;
                contents.remarks.extend(end.remark());
                Ok(contents)
            }
        }
    }

    fn above_or(&self, error: IoError) -> IoError {
        above_or(self.table, &self.rows, error)
    }
}

/// Source of blocks that the threads share.
struct Shared<'a, 'b> {
    blocks: &'a mut Blocks<'b>,
    /// Number of the next block.
    next: usize,
}

/// Block and its rows.
#[derive(Debug, Default)]
struct Work {
    block: Block,
    batch: Batch,
}

/// Reads the rows of one block after the other until the text ends or the receiver is closed.
fn worker(
    layout: Layout,
    plan: &Plan,
    shared: &Mutex<Shared<'_, '_>>,
    freed: &Mutex<Receiver<Work>>,
    done: &SyncSender<(usize, Result<Work, IoError>)>,
) {
    loop {
        let Ok(mut work) = lock(freed).recv() else { return };
        let (number, read) = {
            let mut shared = lock(shared);
            let read = shared.blocks.next(layout, &mut work.block);
            shared.next += 1;
            (shared.next - 1, read)
        };
        let (work, is_last) = match read {
            Ok(false) => return,
            Ok(true) => {
                work.batch.read(plan, &work.block, 0);
                (Ok(work), false)
            }
            Err(error) => (Err(error), true),
        };
        if done.send((number, work)).is_err() || is_last {
            return;
        }
    }
}

/// Locks a mutex. Only a panic in another thread can have poisoned it, and that panic is passed on.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Returns the error for text above the table if there is such text and `error` is about rows of
/// different lengths; otherwise returns `error`.
fn above_or(table: Option<Beginning>, rows: &Rows, error: IoError) -> IoError {
    match &error {
        IoError::Ragged { file, .. } => above(table, rows, file).unwrap_or(error),
        _ => error,
    }
}

/// Returns the error for text above the table, if there is any.
fn above(table: Option<Beginning>, rows: &Rows, file: &str) -> Option<IoError> {
    let Beginning { line, fields } = table?;
    let above = rows.first_line()? < line;
    above.then(|| IoError::AboveTable { file: file.into(), line, fields })
}
