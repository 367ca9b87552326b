//! Phases of work that threads go through together, each begun when the one before it is done.
//!
//! A sweep over a frame takes a tenth of a millisecond, and to hand it to a sleeping thread half as much. So threads come
//! once and stay until the last phase. In each they take items of their own share first, which are in their cache, then
//! what is left of others'. Nobody waits for a thread that has not come: whoever is there does all of the work.

use crate::{Cancel, Error, Result};
use std::hint::spin_loop;
use std::ops::Range;
use std::sync::atomic::Ordering::{AcqRel, Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize};

/// Items that a thread takes at a time.
const ITEMS_A_TURN: usize = 4;
/// Looks at the others' progress before a waiting thread offers its core to whoever else has work.
const LOOKS_A_SPIN: usize = 1 << 10;

/// Calls `work` with each of `phases` and with turns of its items, so many as `items` says, on all threads of the pool that
/// come. Whatever was written in a phase is visible in those after it.
///
/// # Errors
/// [`Error::Cancelled`]: some items have not been worked on then.
pub(super) fn run<P>(
    phases: &(impl Iterator<Item = P> + Clone + Sync),
    items: impl Fn(&P) -> usize + Sync,
    cancel: &Cancel,
    work: impl Fn(&P, Range<usize>) + Sync,
) -> Result<()> {
    let crew = Crew {
        shares: (0..rayon::current_num_threads())
            .map(|_| Share::default())
            .collect(),
        here: AtomicUsize::new(0),
        done: AtomicUsize::new(0),
        left: AtomicBool::new(false),
    };
    let member = || crew.go_through(phases.clone(), &items, cancel, &work);
    rayon::scope(|scope| {
        for _ in 1..crew.shares.len() {
            scope.spawn(|_| member());
        }
        member();
    });
    if crew.left.into_inner() {
        return Err(Error::Cancelled);
    }
    Ok(())
}

/// The threads that go through the phases.
struct Crew {
    shares: Vec<Share>,
    /// Threads that have come.
    here: AtomicUsize,
    /// Items done, of all phases.
    done: AtomicUsize,
    /// Whether a thread left before the end: the others must not wait for it.
    left: AtomicBool,
}

impl Crew {
    fn go_through<P>(
        &self,
        phases: impl Iterator<Item = P>,
        items: &impl Fn(&P) -> usize,
        cancel: &Cancel,
        work: &impl Fn(&P, Range<usize>),
    ) {
        let leaving = Leaving(self);
        let (me, count) = (self.here.fetch_add(1, Relaxed), self.shares.len());
        let mut before = 0;
        for (number, phase) in phases.enumerate() {
            let items = items(&phase);
            if !self.wait_for(before) {
                return;
            }
            let mut taken = 0;
            for share in (me..me + count).map(|share| share % count) {
                let [start, end] = [share, share + 1].map(|share| items * share / count);
                while let Some(turn) = self.shares[share].take(number, start..end) {
                    if cancel.check().is_err() {
                        return;
                    }
                    taken += turn.len();
                    work(&phase, turn);
                }
            }
            self.done.fetch_add(taken, AcqRel);
            before += items;
        }
        std::mem::forget(leaving);
    }

    /// Waits until `items` are done; false if they never will be.
    fn wait_for(&self, items: usize) -> bool {
        let mut looks = 0;
        while self.done.load(Acquire) < items {
            if self.left.load(Relaxed) {
                return false;
            }
            looks += 1;
            if looks % LOOKS_A_SPIN == 0 {
                std::thread::yield_now();
            } else {
                spin_loop();
            }
        }
        true
    }
}

/// Tells the others, when dropped, that this thread has left before the end, be it by a panic.
struct Leaving<'a>(&'a Crew);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        self.0.left.store(true, Release);
    }
}

/// How far one share of the items has been handed out: the phase in the upper half, its items in the lower one. It has a
/// line of the cache for itself.
#[derive(Default)]
#[repr(align(128))]
struct Share(AtomicU64);

impl Share {
    /// The next turn of `items` in `phase`, if any are left.
    fn take(&self, phase: usize, items: Range<usize>) -> Option<Range<usize>> {
        let handed_out = |state: u64| {
            let (at, count) = (state >> 32, state as u32 as usize);
            match at.cmp(&(phase as u64)) {
                std::cmp::Ordering::Less => 0,
                std::cmp::Ordering::Equal => count,
                std::cmp::Ordering::Greater => items.len(),
            }
        };
        let next = |state| {
            let count = handed_out(state);
            let after = (count + ITEMS_A_TURN).min(items.len());
            (count < items.len()).then_some((phase as u64) << 32 | after as u64)
        };
        let state = self.0.fetch_update(Relaxed, Relaxed, next).ok()?;
        let start = items.start + handed_out(state);
        Some(start..items.end.min(start + ITEMS_A_TURN))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::Ordering::SeqCst;

    fn on_threads<R: Send>(count: usize, call: impl FnOnce() -> R + Send) -> R {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count);
        pool.build().unwrap().install(call)
    }

    #[test]
    fn every_item_of_every_phase_is_worked_on_once_and_after_all_of_the_phase_before() {
        let sizes = [5, 0, 1, 700, 3, 64, 0, 9];
        for threads in [1, 2, 3, 8] {
            let worked: Vec<Vec<AtomicUsize>> = sizes
                .iter()
                .map(|&size| (0..size).map(|_| AtomicUsize::new(0)).collect())
                .collect();
            let early = AtomicUsize::new(0);
            let work = |&phase: &usize, items: Range<usize>| {
                let all =
                    |phase: &Vec<AtomicUsize>| phase.iter().all(|item| item.load(SeqCst) == 1);
                early.fetch_add(usize::from(!worked[..phase].iter().all(all)), SeqCst);
                for item in items {
                    worked[phase][item].fetch_add(1, SeqCst);
                }
            };
            let ran = on_threads(threads, || {
                run(
                    &(0..sizes.len()),
                    |&phase| sizes[phase],
                    Cancel::never(),
                    work,
                )
            });
            ran.unwrap();
            assert_eq!(early.into_inner(), 0);
            assert!(worked.iter().flatten().all(|item| item.load(SeqCst) == 1));
        }
    }

    #[test]
    fn a_thread_that_is_busy_elsewhere_is_not_waited_for() {
        let finished = AtomicBool::new(false);
        on_threads(2, || {
            rayon::join(
                || {
                    run(&(0..50), |_| 20, Cancel::never(), |_, _| ()).unwrap();
                    finished.store(true, SeqCst);
                },
                || {
                    while !finished.load(SeqCst) {
                        std::thread::yield_now();
                    }
                },
            )
        });
    }

    #[test]
    fn a_cancelled_phase_lets_all_threads_go() {
        for threads in [1, 4] {
            let cancel = Cancel::default();
            let ran = on_threads(threads, || {
                run(
                    &(0..1000),
                    |_| 100,
                    &cancel,
                    |&phase, _| {
                        if phase == 500 {
                            cancel.cancel();
                        }
                    },
                )
            });
            assert!(matches!(ran, Err(Error::Cancelled)));
        }
    }

    #[test]
    fn a_panic_in_a_phase_lets_all_threads_go() {
        let panicked = std::panic::catch_unwind(|| {
            on_threads(4, || {
                run(
                    &(0..1000),
                    |_| 100,
                    Cancel::never(),
                    |&phase, items| {
                        assert!(phase < 500 || !items.contains(&50), "item 50");
                    },
                )
            })
        });
        assert!(panicked.is_err());
    }
}
