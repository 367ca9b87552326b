//! The memory that one frame leaves for the next.

use ldls_core::Memory;
use libmimalloc_sys::{mi_option_set, mi_option_t};
use pyo3::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Without it, what a frame gives back would go to the system, and the next would fetch it page by page, each of them
/// cleared by the kernel: a third of the time of a large cloud.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// `mi_option_purge_delay`: milliseconds for which the allocator keeps free memory.
const PURGE_DELAY: mi_option_t = 15;
/// Longer than a frame of ten million points takes.
const A_WHILE: i64 = 10_000;

/// To be called once, when the module is loaded: lets the allocator keep free memory for a while.
#[expect(unsafe_code, reason = "the allocator is a C library")]
pub fn keep_for_a_while() {
    // SAFETY: sets a number that the allocator reads when it frees memory; any thread may at any time
    unsafe { mi_option_set(PURGE_DELAY, A_WHILE as _) };
}

/// The memory of a stream: one set of vectors for each frame that runs at a time.
#[pyclass(frozen, module = "ldls._ldls")]
#[derive(Default)]
pub struct StreamMemory(Mutex<Vec<Memory>>);

#[pymethods]
impl StreamMemory {
    #[new]
    fn new() -> Self {
        Self::default()
    }
}

impl StreamMemory {
    /// Calls `work` with memory that no other frame has meanwhile. What a frame that panics had is lost to the next.
    pub fn lend<T>(&self, work: impl FnOnce(&mut Memory) -> T) -> T {
        let spare = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut memory = spare().pop().unwrap_or_else(Memory::of_stream);
        let outcome = work(&mut memory);
        spare().push(memory);
        outcome
    }
}
