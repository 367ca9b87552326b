//! The allocator, which keeps the memory of one frame for the next, and some for when there is no more.

#[cfg(not(all(windows, target_env = "gnu")))]
use mimalloc::MiMalloc as Store;
#[cfg(all(windows, target_env = "gnu"))]
use std::alloc::System as Store;
use std::alloc::{GlobalAlloc, Layout};
use std::ptr::null_mut;
use std::sync::atomic::{AtomicPtr, Ordering::SeqCst};

/// Without it, what a frame gives back would go to the system, and the next would fetch it page by page, each of them
/// cleared by the kernel: a third of the time of a large cloud.
#[global_allocator]
static ALLOCATOR: Allocator = Allocator;

/// Memory that nobody touches, given up when a small allocation fails: where Rust would end the process, work comes to
/// its next look at the flag. Arrays as long as a cloud do not need it, for a lack of memory is an error to them.
static BALLAST: AtomicPtr<u8> = AtomicPtr::new(null_mut());
const BALLAST_BYTES: Layout = Layout::new::<[u8; 64 << 20]>();
/// Largest allocation that the ballast is given up for.
const SMALL: usize = 4 << 20;

struct Allocator;

/// To be called once, when the module is loaded: lets the allocator keep free memory for a while.
#[cfg(not(all(windows, target_env = "gnu")))]
#[expect(unsafe_code, reason = "the allocator is a C library")]
pub fn keep_for_a_while() {
    /// `mi_option_purge_delay`: milliseconds for which the allocator keeps free memory.
    const PURGE_DELAY: libmimalloc_sys::mi_option_t = 15;
    /// Longer than a frame of ten million points takes.
    const A_WHILE: i64 = 10_000;
    // SAFETY: sets a number that the allocator reads when it frees memory; any thread may at any time
    unsafe { libmimalloc_sys::mi_option_set(PURGE_DELAY, A_WHILE as _) };
}

/// The system's keeps what it likes.
#[cfg(all(windows, target_env = "gnu"))]
pub fn keep_for_a_while() {}

/// Takes the ballast aboard, unless it is there; false if there is no memory for it.
#[expect(unsafe_code, reason = "allocates without a type")]
pub fn take_ballast() -> bool {
    if has_ballast() {
        return true;
    }
    // SAFETY: the layout has a size
    let ballast = unsafe { Store.alloc(BALLAST_BYTES) };
    let taken = BALLAST.compare_exchange(null_mut(), ballast, SeqCst, SeqCst);
    if taken.is_err() && !ballast.is_null() {
        // SAFETY: another thread was faster; this one is of that allocator and layout, and nobody else has it
        unsafe { Store.dealloc(ballast, BALLAST_BYTES) };
    }
    has_ballast()
}

/// False once the ballast had to be given up.
pub fn has_ballast() -> bool {
    !BALLAST.load(SeqCst).is_null()
}

/// What `allocate` yields; if nothing, and it is for a few bytes, once more without the ballast.
#[inline]
#[expect(unsafe_code, reason = "frees without a type")]
fn or_from_ballast(bytes: usize, allocate: impl Fn() -> *mut u8) -> *mut u8 {
    let allocated = allocate();
    if !allocated.is_null() || bytes > SMALL {
        return allocated;
    }
    let ballast = BALLAST.swap(null_mut(), SeqCst);
    if !ballast.is_null() {
        // SAFETY: of that allocator and layout, and nobody else has it after the swap
        unsafe { Store.dealloc(ballast, BALLAST_BYTES) };
    }
    allocate()
}

// SAFETY: hands everything on to an allocator; a second try takes the place of a first one that yielded nothing
#[expect(unsafe_code, reason = "the trait is unsafe")]
unsafe impl GlobalAlloc for Allocator {
    #[inline]
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises
        or_from_ballast(layout.size(), || unsafe { Store.alloc(layout) })
    }

    #[inline]
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as the caller promises
        or_from_ballast(layout.size(), || unsafe { Store.alloc_zeroed(layout) })
    }

    #[inline]
    unsafe fn realloc(&self, at: *mut u8, layout: Layout, bytes: usize) -> *mut u8 {
        // SAFETY: as the caller promises; a try that yields nothing leaves the old allocation as it was
        or_from_ballast(bytes, || unsafe { Store.realloc(at, layout, bytes) })
    }

    #[inline]
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: as the caller promises
        unsafe { Store.dealloc(at, layout) };
    }
}
