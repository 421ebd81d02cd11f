//! A sign of life while a subcommand computes.

use std::io::{IsTerminal as _, stderr};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Work that is done sooner needs none.
const PATIENCE: Duration = Duration::from_secs(1);

/// Shows that something moves, how long it has taken, and how it is ended; on a terminal only.
fn spinner(message: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{spinner} {msg}, {elapsed} (Ctrl-C ends it)");
    let spinner = ProgressBar::new_spinner()
        .with_style(style.expect("the template is written correctly"))
        .with_message(message);
    spinner.enable_steady_tick(Duration::from_millis(100));
    spinner
}

/// Does some work; if it takes long and somebody watches at a terminal, something moves meanwhile.
pub fn watched<T>(message: &'static str, work: impl FnOnce() -> T) -> T {
    if !stderr().is_terminal() {
        return work();
    }
    thread::scope(|scope| {
        let (done, end) = channel::<()>();
        scope.spawn(move || {
            if end.recv_timeout(PATIENCE) != Err(RecvTimeoutError::Timeout) {
                return;
            }
            let spinner = spinner(message);
            // Until the other end is dropped.
            let _ = end.recv();
            spinner.finish_and_clear();
        });
        let result = work();
        drop(done);
        result
    })
}
