//! Limits of the time or the work of iterative searches.
//!
//! [`within`] runs some work with a limit, in seconds or in operations. Seconds end a search at a
//! different step on every computer, operations always at the same step: the sums over lines and
//! samples count them with [`spend`].
//!
//! Every search of this workspace that may take long calls [`is_over`] before each step; after the
//! end of the limit it stops at its best point so far. [`ended`] returns whether a search has
//! stopped for this reason: the result is then usable, but it may not be a minimum.
//!
//! A limit applies to the thread that calls [`within`], so that two analyses in one process do not
//! affect each other. The searches of this workspace take their steps on the calling thread; the
//! sums within a step use other threads, and [`join`] runs two parts of the work at the same time.
//!
//! ```
//! use mechid_numerics::time_limit::{self, Ended, TimeLimit};
//!
//! let steps = || (0..100).take_while(|_| !time_limit::is_over()).count();
//! let limit = TimeLimit::from_polls(7);
//! let (taken, ended) = time_limit::within(Some(limit), || (steps(), time_limit::ended()));
//! assert_eq!((taken, ended), (7, Some(Ended::AfterSeconds(0.0))));
//! assert_eq!(steps(), 100);
//! ```

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::time::{Duration, Instant};

/// Limit of some work.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeLimit(Limit);

#[derive(Debug, Clone, Copy, PartialEq)]
enum Limit {
    Seconds(f64),
    Operations(f64),
    Polls(u64),
}

/// Limit that has ended a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Ended {
    /// A time, in s.
    AfterSeconds(f64),
    /// A number of operations (pure number).
    AfterOperations(f64),
}

impl TimeLimit {
    /// Creates a limit of this number of seconds, counted from the call of [`within`]; `None` if
    /// the number is negative or not finite. With 0 s, every search ends before its first step.
    pub fn from_seconds(seconds: f64) -> Option<Self> {
        (seconds >= 0.0 && seconds.is_finite()).then_some(Self(Limit::Seconds(seconds)))
    }

    /// Creates a limit of this number of operations, a pure number, as [`spend`] counts them.
    pub fn from_operations(operations: f64) -> Self {
        Self(Limit::Operations(operations))
    }

    /// Creates a limit that ends after a number of calls of [`is_over`], without a clock: the same
    /// work then always ends at the same step. For such a limit, [`ended`] returns 0 s.
    pub fn from_polls(polls: u64) -> Self {
        Self(Limit::Polls(polls))
    }
}

/// Limit of the work that is running.
#[derive(Debug)]
struct Active {
    limit: Limit,
    /// End of a limit in seconds; `None` if it is beyond the range of the clock.
    deadline: Option<Instant>,
    /// Number of calls of [`is_over`] so far.
    polls: Cell<u64>,
    /// Number of operations so far.
    operations: Cell<f64>,
    has_ended: Cell<bool>,
    /// `true` for a limit of [`within_default`].
    is_default: bool,
}

impl Active {
    fn new(TimeLimit(limit): TimeLimit, is_default: bool) -> Self {
        let deadline = match limit {
            Limit::Seconds(seconds) => Duration::try_from_secs_f64(seconds)
                .ok()
                .and_then(|time| Instant::now().checked_add(time)),
            Limit::Operations(_) | Limit::Polls(_) => None,
        };
        let (polls, operations, has_ended) = (Cell::new(0), Cell::new(0.0), Cell::new(false));
        Self { limit, deadline, polls, operations, has_ended, is_default }
    }

    fn is_over(&self) -> bool {
        let is_over = match self.limit {
            Limit::Seconds(_) => self.deadline.is_some_and(|deadline| Instant::now() >= deadline),
            Limit::Operations(most) => self.operations.get() >= most,
            Limit::Polls(most) => self.polls.replace(self.polls.get().saturating_add(1)) >= most,
        };
        if is_over {
            self.has_ended.set(true);
        }
        is_over
    }

    fn spend(&self, operations: f64) {
        self.operations.set(self.operations.get() + operations);
    }

    fn ended(&self) -> Option<Ended> {
        let ended = match self.limit {
            Limit::Seconds(seconds) => Ended::AfterSeconds(seconds),
            Limit::Operations(operations) => Ended::AfterOperations(operations),
            Limit::Polls(_) => Ended::AfterSeconds(0.0),
        };
        self.has_ended.get().then_some(ended)
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
    run(limit.map(|limit| Active::new(limit, false)), work)
}

/// Runs some work on this thread with a limit of its own, unless the caller has set a limit by
/// [`within`], which then remains.
///
/// The limit of another call of this function has no effect on the work: a thread that waits for a
/// part of its work may run other work meanwhile.
pub fn within_default<T>(limit: TimeLimit, work: impl FnOnce() -> T) -> T {
    let is_set = |active: &Option<Rc<Active>>| active.as_ref().is_some_and(|a| !a.is_default);
    if ACTIVE.with_borrow(is_set) { work() } else { run(Some(Active::new(limit, true)), work) }
}

fn run<T>(active: Option<Active>, work: impl FnOnce() -> T) -> T {
    let _restored = Restored(ACTIVE.replace(active.map(Rc::new)));
    work()
}

/// Runs two parts of some work. They run at the same time without a limit, and with a limit of
/// operations; each part may then use half of the remaining operations. With another limit they run
/// one after the other, because a limit applies to one thread.
pub fn join<A: Send, B: Send>(
    one: impl FnOnce() -> A + Send,
    other: impl FnOnce() -> B + Send,
) -> (A, B) {
    let Some(active) = ACTIVE.with_borrow(Option::clone) else {
        return rayon::join(|| within(None, one), || within(None, other));
    };
    let Limit::Operations(most) = active.limit else { return (one(), other()) };
    let half = TimeLimit::from_operations(0.5 * (most - active.operations.get()).max(0.0));
    let is_default = active.is_default;
    let ((one, first), (other, second)) = rayon::join(
        || counted(Active::new(half, is_default), one),
        || counted(Active::new(half, is_default), other),
    );
    for (operations, has_ended) in [first, second] {
        active.spend(operations);
        active.has_ended.set(active.has_ended.get() || has_ended);
    }
    (one, other)
}

/// Runs a part of some work, such as the search for the cause of a bad fit, with a limit of its
/// own: this `share` (pure number) of the operations of the whole work, in addition to its limit.
/// [`ended`] does not report the end of this limit, because it does not affect the rest of the
/// work. Without a limit of operations, the part runs like the rest of the work.
pub fn apart<T>(share: f64, work: impl FnOnce() -> T) -> T {
    let active = ACTIVE.with_borrow(Option::clone);
    let limit = active.and_then(|active| match active.limit {
        Limit::Operations(most) => {
            Some(Active::new(TimeLimit::from_operations(share * most), active.is_default))
        }
        Limit::Seconds(_) | Limit::Polls(_) => None,
    });
    match limit {
        Some(limit) => run(Some(limit), work),
        None => work(),
    }
}

/// Runs some work with a limit. Also returns the number of its operations, and whether the limit
/// has ended a search.
fn counted<T>(limit: Active, work: impl FnOnce() -> T) -> (T, (f64, bool)) {
    run(Some(limit), || {
        let result = work();
        let used = ACTIVE.with_borrow(|active| {
            active.as_ref().map(|active| (active.operations.get(), active.has_ended.get()))
        });
        (result, used.unwrap_or_default())
    })
}

/// Counts operations of the work on this thread, a pure number: about one for each multiplication
/// of the sums over all lines or samples.
pub fn spend(operations: f64) {
    ACTIVE.with_borrow(|active| active.iter().for_each(|active| active.spend(operations)));
}

/// Returns whether the limit of the work on this thread is over; `false` without a limit. A search
/// must stop if the answer is `true`, because [`ended`] reports after this answer that a search was
/// ended early.
pub fn is_over() -> bool {
    ACTIVE.with_borrow(|active| active.as_ref().is_some_and(|active| active.is_over()))
}

/// Returns the limit if it has ended a search of the work on this thread early; `None` if all
/// searches so far have run to their ends.
pub fn ended() -> Option<Ended> {
    ACTIVE.with_borrow(|active| active.as_ref().and_then(|active| active.ended()))
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
            assert_eq!(ended(), Some(Ended::AfterSeconds(0.0)));
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
    fn operations_end_at_the_same_step_on_any_computer() {
        let steps = || {
            let steps = (0..100).take_while(|_| !is_over()).inspect(|_| spend(3.0));
            steps.count()
        };
        let limit = Some(TimeLimit::from_operations(10.0));
        let ended = || (steps(), ended());
        assert_eq!(within(limit, ended), (4, Some(Ended::AfterOperations(10.0))));
        // Each part has half of the 10 operations, and together they use 12.
        let parts = || (join(steps, steps), is_over());
        assert_eq!(within(limit, parts), ((2, 2), true));
        let with_more = || (steps(), apart(0.5, steps), steps(), is_over());
        assert_eq!(within(limit, with_more), (4, 2, 0, true));
        assert_eq!(apart(0.5, steps), 100);
        assert_eq!(steps(), 100);
    }

    #[test]
    fn a_default_limit_gives_way_to_that_of_the_caller_alone() {
        let [few, many] = [2, 5].map(TimeLimit::from_polls);
        let steps = || (0..100).take_while(|_| !is_over()).count();
        assert_eq!(within_default(few, steps), 2);
        assert_eq!(within(Some(many), || within_default(few, steps)), 5);
        assert_eq!(within_default(few, || (within_default(many, steps), steps())), (5, 2));
    }

    #[test]
    fn other_threads_have_no_limit() {
        within(Some(TimeLimit::from_polls(0)), || {
            assert!(is_over());
            assert!(!std::thread::spawn(is_over).join().unwrap());
        });
    }
}
