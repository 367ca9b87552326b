//! Memory that one frame leaves for the next: the vectors with an entry for each point.

use rayon::prelude::*;
use std::any::{Any, TypeId};
use std::collections::HashMap;

/// Vectors that wait to be used again.
///
/// A stream of frames that hands the same one to [`crate::segment()`] allocates, after its first frame of a size, what
/// it returns and some tens of kilobytes.
#[derive(Debug)]
pub struct Memory {
    keeps: bool,
    /// For each type T, a `Vec<Vec<T>>`.
    spare: HashMap<TypeId, Box<dyn Any + Send>>,
}

impl Memory {
    /// Keeps all for the next frame.
    pub fn of_stream() -> Self {
        Self {
            keeps: true,
            spare: HashMap::new(),
        }
    }

    /// Keeps nothing: a single frame takes less at its peak if it gives back early what it no longer needs.
    pub fn of_one_frame() -> Self {
        Self {
            keeps: false,
            ..Self::of_stream()
        }
    }

    /// An empty vector with room for `len` values.
    pub(crate) fn empty<T: Send + 'static>(&mut self, len: usize) -> Vec<T> {
        let mut vector = self.take(len).unwrap_or_default();
        vector.reserve_exact(roomy(len));
        vector
    }

    /// `len` times `value`.
    pub(crate) fn filled<T: Clone + Send + 'static>(&mut self, len: usize, value: T) -> Vec<T> {
        fill(self.take(len), len, value)
    }

    /// `count` vectors of `len` times `value`, which threads fill beside one another.
    pub(crate) fn filled_together<T: Clone + Send + Sync + 'static>(
        &mut self,
        count: usize,
        len: usize,
        value: &T,
    ) -> Vec<Vec<T>> {
        let spare: Vec<_> = (0..count).map(|_| self.take(len)).collect();
        spare
            .into_par_iter()
            .map(|vector| fill(vector, len, value.clone()))
            .collect()
    }

    /// What `values` yields, in its order.
    pub(crate) fn collect<T: Send + 'static>(
        &mut self,
        values: impl IndexedParallelIterator<Item = T>,
    ) -> Vec<T> {
        let mut vector = self.empty(values.len());
        values.collect_into_vec(&mut vector);
        vector
    }

    /// At least `len` values as [`Memory::keep_as_is`] got them, the vectors in them included, or new ones.
    pub(crate) fn as_left<T: Default + Send + 'static>(&mut self, len: usize) -> Vec<T> {
        let mut vector = self.take(len).unwrap_or_default();
        vector.resize_with(len.max(vector.len()), T::default);
        vector
    }

    /// Keeps a vector that is no longer needed, or gives it back.
    pub(crate) fn keep<T: Send + 'static>(&mut self, mut vector: Vec<T>) {
        vector.clear();
        self.keep_as_is(vector);
    }

    /// Keeps values that are no longer needed but have vectors in them that are.
    pub(crate) fn keep_as_is<T: Send + 'static>(&mut self, vector: Vec<T>) {
        if !self.keeps {
            return;
        }
        let spare = self
            .spare
            .entry(TypeId::of::<T>())
            .or_insert_with(|| Box::new(Vec::<Vec<T>>::new()));
        if let Some(spare) = spare.downcast_mut::<Vec<Vec<T>>>() {
            spare.push(vector);
        }
    }

    /// Of the vectors with room for `len` values the smallest, or else the largest one.
    fn take<T: Send + 'static>(&mut self, len: usize) -> Option<Vec<T>> {
        let spare = self
            .spare
            .get_mut(&TypeId::of::<T>())?
            .downcast_mut::<Vec<Vec<T>>>()?;
        let fitting = (0..spare.len()).filter(|&at| spare[at].capacity() >= len);
        let smallest = fitting.min_by_key(|&at| spare[at].capacity());
        let largest = || (0..spare.len()).max_by_key(|&at| spare[at].capacity());
        smallest.or_else(largest).map(|at| spare.swap_remove(at))
    }
}

fn fill<T: Clone>(spare: Option<Vec<T>>, len: usize, value: T) -> Vec<T> {
    let Some(mut vector) = spare else {
        // zeros then come from the system as they are, page by page when used
        let mut vector = vec![value; roomy(len)];
        vector.truncate(len);
        return vector;
    };
    vector.resize(len, value);
    vector
}

/// Room for `len` values and for a few more: frames of one sensor differ a little.
fn roomy(len: usize) -> usize {
    len.next_multiple_of(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_smallest_vector_with_room_is_used_again() {
        let mut memory = Memory::of_stream();
        let (small, large) = (vec![1_u8; 10], vec![2_u8; 4096]);
        let places = [small.as_ptr(), large.as_ptr()];
        memory.keep(small);
        memory.keep(large);
        let again = [memory.filled(9, 0_u8), memory.empty(11)];
        assert_eq!(again.each_ref().map(Vec::as_ptr), places);
        assert_eq!(again, [vec![0; 9], vec![]]);
        assert_eq!(memory.empty::<u16>(5).capacity(), 1024);
    }

    #[test]
    fn a_vector_too_small_grows_and_is_not_kept_beside_a_larger_one() {
        let mut memory = Memory::of_stream();
        memory.keep(vec![1_u8; 10]);
        let grown = memory.collect((0..100_u8).into_par_iter());
        assert_eq!(grown.len(), 100);
        assert!(memory.take::<u8>(0).is_none());
    }
}
