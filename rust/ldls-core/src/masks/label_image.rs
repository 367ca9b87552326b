//! All masks of an image painted into one, and the labels found in windows of it. [`super::pixel_labels`]
//! weighs them.

use super::instance_masks::InstanceMasks;
use super::rle::Rle;
use crate::memory::zeros;
use crate::{Cancel, Result};
use std::collections::HashMap;

/// The labels of every pixel, column by column. Pixels hold the number of a set of labels: a set for each combination
/// of masks that occurs, so that one image is enough whatever overlaps.
#[derive(Debug)]
pub struct LabelImage {
    pub(crate) height: usize,
    pub(crate) width: usize,
    pixels: Vec<u32>,
    /// Set 0 is empty: the background.
    sets: Vec<LabelSet>,
}

/// A set of labels: its largest one, and the number of the set of the others.
#[derive(Debug, Clone, Copy)]
struct LabelSet {
    label: u32,
    rest: u32,
}

/// Number of occurrences of each label in one window.
#[derive(Debug, Default)]
pub(crate) struct WindowCounts {
    /// Pixels of the window that lie in the image.
    pub(crate) pixels: u32,
    /// Label and count, labels ascending.
    pub(crate) labels: Vec<(u32, u32)>,
    /// Set of labels and count, as met.
    sets: Vec<(u32, u32)>,
}

impl LabelImage {
    /// Paints all masks; where several lie, the pixel has the labels of all of them.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub fn paint(masks: &InstanceMasks, cancel: &Cancel) -> Result<Self> {
        let mut image = Self {
            height: masks.height(),
            width: masks.width(),
            pixels: zeros(masks.height() * masks.width(), cancel)?,
            sets: vec![LabelSet { label: 0, rest: 0 }],
        };
        for (m, mask) in masks.masks().iter().enumerate() {
            cancel.check()?;
            image.add(mask, m as u32 + 1);
        }
        Ok(image)
    }

    fn add(&mut self, mask: &Rle, label: u32) {
        let mut extended: HashMap<u32, u32> = HashMap::new();
        let mut last = None;
        for (start, end) in mask.spans() {
            for pixel in &mut self.pixels[start as usize..end as usize] {
                let set = match last {
                    Some((from, to)) if from == *pixel => to,
                    _ => *extended.entry(*pixel).or_insert_with(|| {
                        self.sets.push(LabelSet {
                            label,
                            rest: *pixel,
                        });
                        self.sets.len() as u32 - 1
                    }),
                };
                last = Some((*pixel, set));
                *pixel = set;
            }
        }
    }

    /// Number of the set of labels of a pixel of the image.
    pub(crate) fn set_at(&self, [column, row]: [usize; 2]) -> u32 {
        self.pixels[column * self.height + row]
    }

    /// Labels of a set, descending; none for the background.
    pub(crate) fn labels_of(&self, set: u32) -> impl Iterator<Item = u32> {
        let get = |number: u32| (number > 0).then(|| self.sets[number as usize]);
        std::iter::successors(get(set), move |found| get(found.rest)).map(|found| found.label)
    }

    /// Counts the labels of the window of `reach` pixels around `[column, row]`.
    pub(crate) fn count(&self, [column, row]: [usize; 2], reach: usize, counts: &mut WindowCounts) {
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(self.width);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.height);
        counts.pixels = (columns.len() * rows.len()) as u32;
        counts.sets.clear();
        // pixels of one set come in runs
        let (mut last, mut run) = (0, 0);
        for column in columns {
            let start = column * self.height;
            for &set in &self.pixels[start + rows.start..start + rows.end] {
                if set != last && run > 0 {
                    add_count(&mut counts.sets, last, run);
                    run = 0;
                }
                last = set;
                run += 1;
            }
        }
        if run > 0 {
            add_count(&mut counts.sets, last, run);
        }
        counts.labels.clear();
        for &(set, count) in &counts.sets {
            if set == 0 {
                add_count(&mut counts.labels, 0, count);
            }
            for label in self.labels_of(set) {
                add_count(&mut counts.labels, label, count);
            }
        }
        counts.labels.sort_unstable();
    }
}

/// Adds to the count of `key` in a list so short that a search beats a map.
#[inline]
fn add_count(counts: &mut Vec<(u32, u32)>, key: u32, count: u32) {
    match counts.iter_mut().find(|(known, _)| *known == key) {
        Some((_, total)) => *total += count,
        None => counts.push((key, count)),
    }
}
