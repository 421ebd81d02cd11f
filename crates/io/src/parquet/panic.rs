//! Panics of the decoder on damaged files, converted to errors.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    /// Number of calls of [`caught`] that are running on this thread.
    static GUARDS: Cell<usize> = const { Cell::new(0) };
}

/// Returns the result of `work`; `None` if it panics. The message of the panic is not printed: it
/// contains paths of the computer that compiled the decoder, and the caller reports what is wrong
/// with the file.
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

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;

    #[test]
    fn a_panic_that_is_caught_says_nothing_and_another_one_does() {
        static TOLD: AtomicUsize = AtomicUsize::new(0);
        let before = panic::take_hook();
        panic::set_hook(Box::new(|_| {
            TOLD.fetch_add(1, Ordering::Relaxed);
        }));
        assert_eq!(caught(|| caught(|| panic!("inside"))), Some(None));
        assert_eq!((caught(|| 1), TOLD.load(Ordering::Relaxed)), (Some(1), 0));
        assert!(catch_unwind(|| panic!("outside")).is_err());
        assert_eq!(TOLD.load(Ordering::Relaxed), 1);
        panic::set_hook(before);
    }
}
