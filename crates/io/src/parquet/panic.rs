//! Panics of the decoder, which damaged files can cause, as errors and without their text.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    /// Number of guards on this thread.
    static GUARDS: Cell<usize> = const { Cell::new(0) };
}

/// Calls `work`; `None` if it panics. Nothing is printed of a panic in it: its text holds paths of the
/// machine that compiled the decoder, and the caller tells what is wrong with the file.
pub fn caught<T>(work: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            if GUARDS.get() == 0 {
                before(panic);
            }
        }));
    });
    GUARDS.set(GUARDS.get() + 1);
    let result = catch_unwind(AssertUnwindSafe(work));
    GUARDS.set(GUARDS.get() - 1);
    result.ok()
}
