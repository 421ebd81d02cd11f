//! Time limits of iterative searches.
//!
//! [`within`] runs some work with a limit. Every search of this workspace that may take long calls
//! [`is_over`] before each step; after the end of the limit it stops at its best point so far.
//! [`ended`] returns whether a search has stopped for this reason: the result is then usable, but
//! it may not be a minimum.
//!
//! A limit applies to the thread that calls [`within`], so that two analyses in one process do not
//! affect each other. The searches of this workspace take their steps on the calling thread; the
//! sums within a step use other threads, and [`join`] runs parts without a limit at the same time.
//!
//! ```
//! use mechid_numerics::time_limit::{self, TimeLimit};
//!
//! let steps = || (0..100).take_while(|_| !time_limit::is_over()).count();
//! let limit = TimeLimit::from_polls(7);
//! let (taken, ended) = time_limit::within(Some(limit), || (steps(), time_limit::ended()));
//! assert_eq!((taken, ended), (7, Some(0.0)));
//! assert_eq!(steps(), 100);
//! ```

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Limit of the time of some work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeLimit {
    seconds: f64,
    polls: Option<u64>,
}

impl TimeLimit {
    /// Creates a limit of this number of seconds, counted from the call of [`within`]; `None` if
    /// the number is negative or not finite. With 0 s, every search ends before its first step.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        (seconds >= 0.0 && seconds.is_finite()).then_some(Self { seconds, polls: None })
    }

    /// Creates a limit that ends after a number of calls of [`is_over`], without a clock: the same
    /// work then always ends at the same step. For such a limit, [`ended`] returns 0 s.
    pub fn from_polls(polls: u64) -> Self {
        Self { seconds: 0.0, polls: Some(polls) }
    }
}

/// Limit of the work that is running.
#[derive(Debug)]
struct Active {
    seconds: f64,
    /// End of the limit; `None` if it is beyond the range of the clock, or if the limit is a number
    /// of calls of [`is_over`].
    deadline: Option<Instant>,
    /// Number of further calls of [`is_over`] before the limit ends; `None` for a limit in seconds.
    polls: Option<Cell<u64>>,
    has_ended: Cell<bool>,
}

impl Active {
    fn new(TimeLimit { seconds, polls }: TimeLimit) -> Self {
        let time = Duration::try_from_secs_f64(seconds).ok().filter(|_| polls.is_none());
        let deadline = time.and_then(|time| Instant::now().checked_add(time));
        Self { seconds, deadline, polls: polls.map(Cell::new), has_ended: Cell::new(false) }
    }

    fn is_over(&self) -> bool {
        let is_over = match &self.polls {
            Some(polls) => {
                let further = polls.get();
                polls.set(further.saturating_sub(1));
                further == 0
            }
            None => self.deadline.is_some_and(|deadline| Instant::now() >= deadline),
        };
        if is_over {
            self.has_ended.set(true);
        }
        is_over
    }
}

thread_local! {
    /// Limit of the work on this thread.
    static ACTIVE: RefCell<Option<Rc<Active>>> = const { RefCell::new(None) };
}

/// Restores the earlier limit when the work under a later limit ends, also if the work panics.
struct Restored(Option<Rc<Active>>);

impl Drop for Restored {
    fn drop(&mut self) {
        ACTIVE.set(self.0.take());
    }
}

/// Runs some work on this thread with a limit, which replaces any other limit of this thread until
/// the work ends.
///
/// `None` means no limit, also if the calling code has a limit: a thread that waits for a part of
/// its work may run other work meanwhile, and the limit does not apply to this other work.
pub fn within<T>(limit: Option<TimeLimit>, work: impl FnOnce() -> T) -> T {
    let active = limit.map(|limit| Rc::new(Active::new(limit)));
    let _restored = Restored(ACTIVE.replace(active));
    work()
}

/// Runs two parts of some work: at the same time if there is no limit, otherwise one after the
/// other, because a limit applies to one thread.
pub fn join<A: Send, B: Send>(
    one: impl FnOnce() -> A + Send,
    other: impl FnOnce() -> B + Send,
) -> (A, B) {
    if ACTIVE.with_borrow(Option::is_some) {
        (one(), other())
    } else {
        rayon::join(|| within(None, one), || within(None, other))
    }
}

/// Returns whether the limit of the work on this thread is over; `false` without a limit. A search
/// must stop if the answer is `true`, because [`ended`] reports after this answer that a search was
/// ended early.
pub fn is_over() -> bool {
    ACTIVE.with_borrow(|active| active.as_ref().is_some_and(|active| active.is_over()))
}

/// Returns the limit, in s, if it has ended a search of the work on this thread early; `None` if
/// all searches so far have run to their ends.
pub fn ended() -> Option<f64> {
    ACTIVE.with_borrow(|active| {
        active.as_ref().filter(|active| active.has_ended.get()).map(|active| active.seconds)
    })
}

#[cfg(test)]
mod tests {
    use std::panic::catch_unwind;

    use super::*;

    #[test]
    fn a_limit_ends_with_its_work() {
        assert!(!is_over());
        let limit = TimeLimit::from_seconds(0.0);
        within(limit, || {
            assert_eq!(ended(), None);
            // Work inside `within(None, …)` has no limit, and does not change the state of the
            // outer limit.
            within(None, || assert!(!is_over() && ended().is_none()));
            assert_eq!(ended(), None);
            assert!(is_over());
            assert_eq!(ended(), Some(0.0));
        });
        assert!(!is_over() && ended().is_none());
        assert!(catch_unwind(|| within(limit, || assert!(!is_over()))).is_err());
        assert!(!is_over(), "a panic has ended the work");
    }

    #[test]
    fn limits_are_finite_and_not_negative() {
        for seconds in [-1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(TimeLimit::from_seconds(seconds), None);
        }
        // A limit beyond the range of the clock never ends.
        within(TimeLimit::from_seconds(f64::MAX), || assert!(!is_over()));
    }

    #[test]
    fn a_limit_applies_to_both_parts_of_the_work() {
        let both = || join(|| (0..9).take_while(|_| !is_over()).count(), is_over);
        assert_eq!(within(Some(TimeLimit::from_polls(4)), both), (4, true));
        assert_eq!(both(), (9, false));
    }

    #[test]
    fn other_threads_have_no_limit() {
        within(Some(TimeLimit::from_polls(0)), || {
            assert!(is_over());
            assert!(!std::thread::spawn(is_over).join().unwrap());
        });
    }
}
