//! Computation without the interpreter's lock, in threads of this process, which Ctrl-C can
//! interrupt.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process;
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use mechid::numerics::time_limit;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::failure::{self, Failure};

/// Time between two checks for signals of the operating system, such as the signal of Ctrl-C.
const POLL: Duration = Duration::from_millis(50);

/// Thread pool, with the identifier of the process that created it. A forked child process inherits
/// this value but not the threads, and therefore creates another pool.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Runs a short computation on the calling thread, without the interpreter's lock.
///
/// # Errors
/// `MechidError` for a failure or a panic of `work`.
pub fn brief<T: Send, E: Failure + Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, E> + Send,
) -> PyResult<T> {
    outcome(py, py.detach(|| catch_unwind(AssertUnwindSafe(work))))
}

/// Runs a computation in the pool of this process, or in a separate pool of `threads` threads, and
/// regularly calls `poll` with the lock of the Python interpreter.
///
/// If `poll` fails or Ctrl-C is pressed, the call returns at once; the computation continues to its
/// end in the background, and its result is dropped.
///
/// # Errors
/// `MechidError` for a failure or a panic of `work`, `KeyboardInterrupt`, and errors of `poll`.
pub fn watched<T: Send + 'static, E: Failure + Send + 'static>(
    py: Python<'_>,
    threads: Option<usize>,
    mut poll: impl FnMut() -> PyResult<()>,
    work: impl FnOnce() -> Result<T, E> + Send + 'static,
) -> PyResult<T> {
    let pool = match threads {
        Some(threads) => made(py, threads)?,
        None => shared(py)?,
    };
    let (done, mut end) = sync_channel(1);
    // A thread that waits for a part of another computation may run this computation; the time
    // limit of the other computation does not apply here.
    let work = move || time_limit::within(None, work);
    pool.spawn(move || {
        // After Ctrl-C there is no receiver any more, so a failed send is ignored.
        let _ = done.send(catch_unwind(AssertUnwindSafe(work)));
    });
    loop {
        let (received, back) = py.detach(move || (end.recv_timeout(POLL), end));
        end = back;
        match received {
            Ok(result) => {
                poll()?;
                return outcome(py, result);
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(failure::panicked(py, "a thread has ended without a result"));
            }
            Err(RecvTimeoutError::Timeout) => {
                if let Err(interrupt) = py.check_signals().and_then(|()| poll()) {
                    abandon(&pool);
                    return Err(interrupt);
                }
            }
        }
    }
}

fn outcome<T, E: Failure>(
    py: Python<'_>,
    result: Result<Result<T, E>, Box<dyn Any + Send>>,
) -> PyResult<T> {
    match result {
        Ok(result) => result.map_err(|error| failure::exception(py, &error)),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let text = text.or(panic.downcast_ref::<&str>().copied());
            Err(failure::panicked(py, text.unwrap_or("no reason is known")))
        }
    }
}

fn made(py: Python<'_>, threads: usize) -> PyResult<Arc<ThreadPool>> {
    let pool = ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map(Arc::new).map_err(|error| failure::no_threads(py, &error))
}

fn shared(py: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    // The mutex is held only while a pool is created, and Python is not called meanwhile.
    let mut known = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = process::id();
    match known.take() {
        Some((owner, pool)) if owner == process => {
            *known = Some((process, Arc::clone(&pool)));
            Ok(pool)
        }
        stale => {
            // The threads of the inherited pool are not in this process, so the pool must not be
            // dropped.
            std::mem::forget(stale);
            let pool = made(py, 0)?;
            *known = Some((process, Arc::clone(&pool)));
            Ok(pool)
        }
    }
}

/// Releases a thread pool whose threads are busy, so that the next call creates another pool.
fn abandon(pool: &Arc<ThreadPool>) {
    let mut known = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    if known.as_ref().is_some_and(|(_, shared)| Arc::ptr_eq(shared, pool)) {
        *known = None;
    }
}
