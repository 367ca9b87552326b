//! The memory that one frame leaves for the next.
//!
//! A frame takes some hundred bytes a point and gives them back at its end. If they went back to the system, the next
//! frame would fetch them page by page, and the kernel would clear each: a third of the time of a large cloud. So the
//! allocator keeps them for a while, and for as long as a stream of frames lives.

use libmimalloc_sys::{mi_collect, mi_option_set, mi_option_t};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Keeps what a frame leaves.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// `mi_option_purge_delay`: milliseconds for which free memory is kept, -1 for ever.
const PURGE_DELAY: mi_option_t = 15;
/// The frames of a sensor come more often.
const A_WHILE: i64 = 10_000;
const FOR_EVER: i64 = -1;

/// Streams that live.
static STREAMS: AtomicUsize = AtomicUsize::new(0);

/// While one of these lives, memory that a frame leaves is kept.
#[pyclass(frozen, module = "ldls._ldls")]
pub struct KeepMemory(());

#[pymethods]
impl KeepMemory {
    #[new]
    fn new() -> Self {
        STREAMS.fetch_add(1, Relaxed);
        set_purge_delay(FOR_EVER);
        Self(())
    }
}

impl Drop for KeepMemory {
    fn drop(&mut self) {
        if STREAMS.fetch_sub(1, Relaxed) == 1 {
            set_purge_delay(A_WHILE);
            give_back();
        }
    }
}

/// To be called once, when the module is loaded.
pub fn keep_for_a_while() {
    set_purge_delay(A_WHILE);
}

#[expect(unsafe_code, reason = "the allocator is a C library")]
fn set_purge_delay(milliseconds: i64) {
    // SAFETY: sets a number that the allocator reads when it frees memory; any thread may at any time
    unsafe { mi_option_set(PURGE_DELAY, milliseconds as _) };
}

#[expect(unsafe_code, reason = "the allocator is a C library")]
fn give_back() {
    // SAFETY: returns memory that nobody uses; any thread may at any time
    unsafe { mi_collect(true) };
}
