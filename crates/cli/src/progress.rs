//! Progress display while a subcommand computes.

use std::io::{IsTerminal as _, Write, stderr};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use log::{Level, LevelFilter, Log, Metadata, Record};

/// Time before progress is displayed; shorter work shows no progress.
const PATIENCE: Duration = Duration::from_secs(1);

/// Time between two lines of progress if standard error is no terminal, such as the log of a batch
/// job: often enough to show that the work goes on, seldom enough not to fill the log.
const LINE: Duration = Duration::from_secs(30);

/// Time between two updates of the display.
const TICK: Duration = Duration::from_millis(100);

static PROGRESS: Progress = Progress { parts: Mutex::new([String::new(), String::new()]) };

/// Current part of the work and its progress, from the log messages of the crates of this
/// workspace: [`Level::Debug`] names the part, [`Level::Trace`] reports its progress.
struct Progress {
    parts: Mutex<[String; 2]>,
}

impl Log for Progress {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("mechid") && metadata.level() >= Level::Debug
    }

    fn log(&self, record: &Record<'_>) {
        if !self.enabled(record.metadata()) {
            return;
        }
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        match record.level() {
            Level::Trace => parts[1] = record.args().to_string(),
            _ => *parts = [record.args().to_string(), String::new()],
        }
    }

    fn flush(&self) {}
}

impl Progress {
    /// Returns a message followed by the progress.
    fn after(&self, message: &str) -> String {
        let parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let stated = parts.iter().map(String::as_str).filter(|part| !part.is_empty());
        [message].into_iter().chain(stated).collect::<Vec<_>>().join(", ")
    }
}

/// Creates a display of the current work, its progress, the elapsed time, and how to end it.
fn spinner() -> ProgressBar {
    let style =
        ProgressStyle::with_template("{spinner} {msg}, {elapsed} (Ctrl-C ends the program)");
    ProgressBar::new_spinner().with_style(style.expect("the template is written correctly"))
}

/// Does some work and shows its progress if it takes long. At a terminal, the progress is one line
/// that changes; otherwise a new line is written every [`LINE`].
pub fn watched<T>(message: &'static str, work: impl FnOnce() -> T) -> T {
    // An existing logger is kept: a caller of the library may have set one.
    if log::set_logger(&PROGRESS).is_ok() {
        log::set_max_level(LevelFilter::Trace);
    }
    thread::scope(|scope| {
        let (done, end) = channel::<()>();
        scope.spawn(move || {
            if stderr().is_terminal() {
                spin(message, &end);
            } else {
                write_lines(message, LINE, &end, &mut stderr());
            }
        });
        let result = work();
        drop(done);
        result
    })
}

/// Shows the progress at a terminal until the other end of the channel is dropped.
fn spin(message: &str, end: &Receiver<()>) {
    let mut spinner = None;
    let mut wait = PATIENCE;
    while end.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
        let spinner = spinner.get_or_insert_with(self::spinner);
        spinner.set_message(PROGRESS.after(message));
        spinner.tick();
        wait = TICK;
    }
    if let Some(spinner) = spinner {
        spinner.finish_and_clear();
    }
}

/// Writes a line of progress at equal times until the other end of the channel is dropped.
fn write_lines(message: &str, every: Duration, end: &Receiver<()>, to: &mut impl Write) {
    let begin = Instant::now();
    while end.recv_timeout(every) == Err(RecvTimeoutError::Timeout) {
        let seconds = begin.elapsed().as_secs();
        // The work goes on if the line cannot be written.
        let _ = writeln!(to, "{}, {seconds} s so far", PROGRESS.after(message));
    }
}

#[cfg(test)]
mod tests {
    use mechid::signal::{CrestSearch, Multisine, Phases, lines};

    use super::*;

    #[test]
    fn lines_are_written_until_the_work_ends() {
        let (done, end) = channel::<()>();
        let writer = thread::spawn(move || {
            let mut text = Vec::new();
            write_lines("identifying", Duration::from_millis(20), &end, &mut text);
            String::from_utf8(text).unwrap()
        });
        thread::sleep(Duration::from_millis(150));
        drop(done);
        let text = writer.join().unwrap();
        assert!(text.lines().count() >= 1, "{text}");
        let is_line = |line: &str| line.starts_with("identifying") && line.ends_with(" s so far");
        assert!(text.lines().all(is_line), "{text}");
    }

    #[test]
    fn the_progress_of_a_search_follows_the_message() {
        log::set_logger(&PROGRESS).expect("no other test of the program sets one");
        log::set_max_level(LevelFilter::Trace);
        assert_eq!(PROGRESS.after("working"), "working");
        let schroeder = Multisine::flat(lines::odd(11), 1.0, Phases::Schroeder).unwrap();
        CrestSearch { starts: 3, seed: 1 }.minimise(&schroeder).unwrap();
        assert_eq!(PROGRESS.after("designing"), "designing, start 3 of 3");
        log::trace!(target: "mechid_estimate", "step 7");
        assert_eq!(PROGRESS.after("designing"), "designing, start 3 of 3, step 7");
        log::debug!(target: "mechid_estimate", "search 2");
        log::info!(target: "another", "nothing of ours");
        assert_eq!(PROGRESS.after("identifying"), "identifying, search 2");
    }
}
