//! The allocator, which keeps the memory of one frame for the next.

use libmimalloc_sys::{mi_option_set, mi_option_t};

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
