//! The instance masks of an image, and the weights b that their pixels give to points (method, steps 2 and 4).

use crate::camera::nearest_pixel;
use crate::rle::check_size;
use crate::{Error, Memory, Real, Result, Rle};
use rayon::prelude::*;
use std::collections::HashMap;

/// Most instances: SemanticKITTI's labels and the panoptic formats hold 16 bits.
const MAX_INSTANCES: usize = 65_535;
/// Points handled by one task of the thread pool.
const BLOCK: usize = 2048;

/// Instance masks of one image. Instance m = 1, 2, ... is the mask at position m - 1; 0 is the background.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InstanceMasks {
    height: usize,
    width: usize,
    masks: Vec<Rle>,
}

/// The pixel edges of every point, added up by label: row i holds the labels found in the window of point i and the
/// sum of the weights of the edges that end in each. A pixel under several masks counts for each of them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PixelLabels<T = f32> {
    /// Row i lies at `offsets[i]..offsets[i + 1]`.
    pub offsets: Vec<usize>,
    /// Labels, ascending within a row.
    pub labels: Vec<u32>,
    /// Weight of each of them.
    pub weights: Vec<T>,
    /// Sum of the weights of all pixel edges of a point, each pixel once.
    pub mass: Vec<T>,
}

impl InstanceMasks {
    /// Masks of an image of `height` x `width` pixels.
    ///
    /// # Errors
    /// [`Error::MaskSize`] for a mask of another size, [`Error::TooManyInstances`], [`Error::ImageSize`].
    pub fn new(height: usize, width: usize, masks: Vec<Rle>) -> Result<Self> {
        check_size(height, width)?;
        if masks.len() > MAX_INSTANCES {
            return Err(Error::TooManyInstances {
                found: masks.len(),
                limit: MAX_INSTANCES,
            });
        }
        for (index, mask) in masks.iter().enumerate() {
            let found = (mask.height(), mask.width());
            if found != (height, width) {
                let hint = if found == (width, height) {
                    "; swapped?"
                } else {
                    ""
                };
                let (found_height, found_width) = found;
                return Err(Error::MaskSize {
                    index,
                    found_height,
                    found_width,
                    height,
                    width,
                    hint,
                });
            }
        }
        Ok(Self {
            height,
            width,
            masks,
        })
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of instances, the background not counted.
    pub fn len(&self) -> usize {
        self.masks.len()
    }

    /// Whether there is no instance.
    pub fn is_empty(&self) -> bool {
        self.masks.is_empty()
    }

    /// The masks in their order.
    pub fn masks(&self) -> &[Rle] {
        &self.masks
    }

    /// Sets the pixels of mask m in image m of `pixels`, row by row, all `false` before.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where `pixels` does not hold one image a mask.
    pub fn paint(&self, pixels: &mut [bool]) -> Result<()> {
        let image = self.height * self.width;
        if self.masks.len().checked_mul(image) != Some(pixels.len()) {
            let problem = format!("{} values for {} masks", pixels.len(), self.masks.len());
            return Err(Error::Mismatch {
                name: "pixels",
                problem,
            });
        }
        let images = pixels.par_chunks_mut(image);
        images
            .zip(&self.masks)
            .for_each(|(pixels, mask)| mask.paint(pixels));
        Ok(())
    }

    /// The pixel edges of points that fall on the pixels `uv`: each point is joined to the pixels of the `window` x
    /// `window` square centred on its nearest pixel that lie in the image, each with weight `pixel_weight`.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the nearest pixel of a point lies outside the image.
    pub fn pixel_labels<T: Real>(
        &self,
        uv: &[[f64; 2]],
        window: usize,
        pixel_weight: f64,
        memory: &mut Memory,
    ) -> Result<PixelLabels<T>> {
        let image = LabelImage::paint(self, memory);
        let count = uv.len().div_ceil(BLOCK);
        let mut blocks: Vec<PixelLabels<T>> = memory.as_left(count);
        let outcomes: Vec<Result<()>> = blocks
            .par_iter_mut()
            .zip(uv.par_chunks(BLOCK))
            .enumerate()
            .map(|(block, (labels, uv))| {
                labels.clear();
                let mut counts = WindowCounts::default();
                for (i, &uv) in (block * BLOCK..).zip(uv) {
                    image.count(self.nearest_pixel(i, uv)?, window / 2, &mut counts);
                    labels.push(&counts, pixel_weight);
                }
                Ok(())
            })
            .collect();
        memory.keep(image.pixels);
        outcomes.into_iter().collect::<Result<()>>()?;
        let labels = PixelLabels::concatenate(&blocks[..count], memory);
        memory.keep_as_is(blocks);
        Ok(labels)
    }

    /// Direct projection: the label of the pixel nearest to each of `uv`; of several masks, the first.
    ///
    /// # Errors
    /// As [`InstanceMasks::pixel_labels`].
    pub fn direct_labels(&self, uv: &[[f64; 2]]) -> Result<Vec<u32>> {
        let image = LabelImage::paint(self, &mut Memory::of_one_frame());
        let label = |(i, &uv): (usize, &[f64; 2])| {
            let set = image.set_at(self.nearest_pixel(i, uv)?);
            Ok(image.labels_of(set).last().unwrap_or(0))
        };
        uv.iter().enumerate().map(label).collect()
    }

    /// The pixel nearest to `uv`, that of point `i`.
    fn nearest_pixel(&self, i: usize, uv: [f64; 2]) -> Result<[usize; 2]> {
        nearest_pixel(uv, self.height, self.width).ok_or_else(|| {
            let problem = format!(
                "row {i} is at ({}, {}), outside the image of {} x {}",
                uv[0], uv[1], self.height, self.width
            );
            Error::Mismatch {
                name: "pixels",
                problem,
            }
        })
    }
}

impl<T: Real> PixelLabels<T> {
    /// Labels from the three arrays of a sparse matrix, and the weight of all pixel edges of each point.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the arrays do not fit one another.
    pub fn from_csr(
        offsets: Vec<usize>,
        labels: Vec<u32>,
        weights: Vec<T>,
        mass: Vec<T>,
    ) -> Result<Self> {
        let ascending = offsets.first() == Some(&0)
            && offsets.is_sorted()
            && offsets.last() == Some(&labels.len());
        if !ascending || labels.len() != weights.len() || offsets.len() != mass.len() + 1 {
            let problem = format!(
                "indptr of {}, indices of {}, values of {} and mass of {} do not make one sparse matrix",
                offsets.len(),
                labels.len(),
                weights.len(),
                mass.len()
            );
            return Err(Error::Mismatch {
                name: "pixel_labels",
                problem,
            });
        }
        Ok(Self {
            offsets,
            labels,
            weights,
            mass,
        })
    }

    fn clear(&mut self) {
        self.offsets.clear();
        self.labels.clear();
        self.weights.clear();
        self.mass.clear();
    }

    fn push(&mut self, counts: &WindowCounts, pixel_weight: f64) {
        for &(label, count) in &counts.labels {
            self.labels.push(label);
            self.weights
                .push(T::from_f64(pixel_weight * f64::from(count)));
        }
        self.mass
            .push(T::from_f64(pixel_weight * f64::from(counts.pixels)));
        self.offsets.push(self.labels.len());
    }

    fn concatenate(blocks: &[Self], memory: &mut Memory) -> Self {
        let points: usize = blocks.iter().map(Self::rows).sum();
        let entries = blocks.iter().map(|block| block.labels.len()).sum();
        let mut all = Self {
            offsets: memory.empty(points + 1),
            labels: memory.empty(entries),
            weights: memory.empty(entries),
            mass: memory.empty(points),
        };
        all.offsets.push(0);
        for block in blocks {
            let start = all.labels.len();
            all.offsets
                .extend(block.offsets.iter().map(|offset| start + offset));
            all.labels.extend_from_slice(&block.labels);
            all.weights.extend_from_slice(&block.weights);
            all.mass.extend_from_slice(&block.mass);
        }
        all
    }

    /// Keeps the vectors, which are no longer needed.
    pub(crate) fn keep_in(self, memory: &mut Memory) {
        memory.keep(self.offsets);
        memory.keep(self.labels);
        memory.keep(self.weights);
        memory.keep(self.mass);
    }

    /// Number of points.
    pub fn rows(&self) -> usize {
        self.mass.len()
    }

    /// Labels and weights of point `i`.
    #[inline]
    pub fn row(&self, i: usize) -> impl Iterator<Item = (usize, T)> {
        let range = self.offsets[i]..self.offsets[i + 1];
        self.labels[range.clone()]
            .iter()
            .map(|&label| label as usize)
            .zip(self.weights[range].iter().copied())
    }
}

/// How often each label occurs in one window.
#[derive(Debug, Default)]
struct WindowCounts {
    /// Pixels of the window that lie in the image.
    pixels: u32,
    /// Label and count, labels ascending.
    labels: Vec<(u32, u32)>,
    /// Set of labels and count, as met.
    sets: Vec<(u32, u32)>,
}

/// The labels of every pixel, column by column. Pixels hold the number of a set of labels: a set for each combination
/// of masks that occurs, so that one image is enough whatever overlaps.
struct LabelImage {
    height: usize,
    width: usize,
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

impl LabelImage {
    fn paint(masks: &InstanceMasks, memory: &mut Memory) -> Self {
        let mut image = Self {
            height: masks.height,
            width: masks.width,
            pixels: memory.filled(masks.height * masks.width, 0),
            sets: vec![LabelSet { label: 0, rest: 0 }],
        };
        for (m, mask) in masks.masks.iter().enumerate() {
            image.add(mask, m as u32 + 1);
        }
        image
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

    fn set_at(&self, [column, row]: [usize; 2]) -> u32 {
        self.pixels[column * self.height + row]
    }

    /// Labels of a set, descending; none for the background.
    fn labels_of(&self, set: u32) -> impl Iterator<Item = u32> {
        let get = |number: u32| (number > 0).then(|| self.sets[number as usize]);
        std::iter::successors(get(set), move |found| get(found.rest)).map(|found| found.label)
    }

    /// Counts the labels of the window of `reach` pixels around `[column, row]`.
    fn count(&self, [column, row]: [usize; 2], reach: usize, counts: &mut WindowCounts) {
        let columns = column.saturating_sub(reach)..(column + reach + 1).min(self.width);
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(self.height);
        counts.pixels = (columns.len() * rows.len()) as u32;
        counts.sets.clear();
        for column in columns {
            let start = column * self.height;
            for &set in &self.pixels[start + rows.start..start + rows.end] {
                add_count(&mut counts.sets, set, 1);
            }
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn masks(height: usize, width: usize, pixels: &[Vec<bool>]) -> InstanceMasks {
        let rles = pixels
            .iter()
            .map(|p| Rle::from_pixels(height, width, p).unwrap())
            .collect();
        InstanceMasks::new(height, width, rles).unwrap()
    }

    #[test]
    fn a_mask_of_another_size_is_named() {
        let rle = Rle::from_pixels(4, 3, &[false; 12]).unwrap();
        let error = InstanceMasks::new(3, 4, vec![rle]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "mask 0: 4 x 3 pixels, the image is 3 x 4; swapped?"
        );
    }

    #[test]
    fn a_window_at_the_corner_has_fewer_pixels() {
        let labels = masks(6, 6, &[vec![true; 36]])
            .pixel_labels::<f32>(&[[0.0, 0.0]], 5, 1.0, &mut Memory::of_one_frame())
            .unwrap();
        assert_eq!(
            (labels.mass[0], labels.row(0).collect::<Vec<_>>()),
            (9.0, vec![(1, 9.0)])
        );
    }

    proptest! {
        #[test]
        fn weights_equal_a_count_of_every_pixel(
            pixels in proptest::collection::vec(proptest::collection::vec(any::<bool>(), 63), 0..4),
            u in -0.5..8.49_f64, v in -0.5..6.49_f64, reach in 0_usize..4,
        ) {
            let found = masks(7, 9, &pixels).pixel_labels::<f32>(&[[u, v]], 2 * reach + 1, 1.0, &mut Memory::of_one_frame()).unwrap();
            let mut expected = vec![0.0_f32; pixels.len() + 1];
            let mut mass = 0.0;
            for row in 0..7_usize {
                for column in 0..9_usize {
                    let near = |c: f64, p: usize| (c + 0.5).floor() as i64 - p as i64;
                    if near(u, column).abs() > reach as i64 || near(v, row).abs() > reach as i64 {
                        continue;
                    }
                    mass += 1.0;
                    let inside: Vec<_> = (0..pixels.len()).filter(|&m| pixels[m][row * 9 + column]).collect();
                    if inside.is_empty() { expected[0] += 1.0; }
                    for m in inside { expected[m + 1] += 1.0 }
                }
            }
            let mut dense = vec![0.0; expected.len()];
            found.row(0).for_each(|(label, weight)| dense[label] = weight);
            prop_assert_eq!(dense, expected);
            prop_assert_eq!(found.mass[0], mass);
        }
    }
}
