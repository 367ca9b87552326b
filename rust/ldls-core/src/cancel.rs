//! A way to ask long work to stop.

use crate::{Error, Result};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// A flag that long work looks at between blocks of a few milliseconds; once it is set, the work returns
/// [`Error::Cancelled`].
#[derive(Debug, Default)]
pub struct Cancel(AtomicBool);

impl Cancel {
    /// Points or rows that one thread works on between two looks at the flag.
    pub const ITEMS_A_LOOK: usize = 1 << 16;

    /// The flag of work that nobody stops.
    pub fn never() -> &'static Self {
        static NEVER: Cancel = Cancel(AtomicBool::new(false));
        &NEVER
    }

    /// Asks the work to stop. Any thread may at any time.
    pub fn cancel(&self) {
        self.0.store(true, Relaxed);
    }

    /// Called by the work between two blocks.
    ///
    /// # Errors
    /// [`Error::Cancelled`] if it was asked to stop.
    #[inline]
    pub fn check(&self) -> Result<()> {
        if self.0.load(Relaxed) {
            return Err(Error::Cancelled);
        }
        Ok(())
    }
}
