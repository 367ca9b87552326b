//! What belongs together because one leads to the other.

use crate::memory::collect;
use crate::{Cancel, Result};

/// Union-find in which the root of a set is its lowest element.
#[derive(Debug)]
pub(super) struct DisjointSets {
    parents: Vec<u32>,
}

impl DisjointSets {
    /// `n` sets of one element each.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(n: usize, cancel: &Cancel) -> Result<Self> {
        Ok(Self {
            parents: collect(0..n as u32, cancel)?,
        })
    }

    pub(super) fn root(&mut self, mut element: u32) -> u32 {
        while self.parents[element as usize] != element {
            let grandparent = self.parents[self.parents[element as usize] as usize];
            self.parents[element as usize] = grandparent;
            element = grandparent;
        }
        element
    }

    pub(super) fn join(&mut self, a: u32, b: u32) {
        if self.parents[a as usize] == self.parents[b as usize] {
            return;
        }
        let (a, b) = (self.root(a), self.root(b));
        self.parents[a.max(b) as usize] = a.min(b);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_are_joined_by_their_roots_whichever_elements_are_named() {
        // 3 is no root: joined itself, it would leave 2 behind
        for last in [[0, 3], [3, 0]] {
            let mut sets = DisjointSets::new(5, Cancel::never()).unwrap();
            for [a, b] in [[2, 3], [3, 4], last] {
                sets.join(a, b);
            }
            let roots: Vec<u32> = (0..5).map(|i| sets.root(i)).collect();
            assert_eq!(roots, [0, 1, 0, 0, 0]);
        }
    }
}
