//! The weights b that the pixels around points give them (method, steps 2 and 4).

use super::label_image::{LabelImage, WindowCounts};
use crate::memory::with_room;
use crate::projection::nearest_pixel;
use crate::{Cancel, Error, Real, Result};
use rayon::prelude::*;

/// Points handled by one task of the thread pool.
const POINTS_A_TASK: usize = 512;

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

/// What labels may come to at any point.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Most {
    /// All labels together: 1 where masks do not overlap.
    pub(crate) all: f64,
    /// A single one.
    pub(crate) one: f64,
}

impl LabelImage {
    /// The pixel edges of points that fall on the pixels `uv`: each point is joined to the pixels of the `window` x
    /// `window` square centred on its nearest pixel that lie in the image, each with weight `pixel_weight`. Only the labels
    /// that are `admitted` for a point, given by its row, come in; the weight of the others counts in the mass alone.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the nearest pixel of a point lies outside the image, [`Error::OutOfMemory`] and
    /// [`Error::Cancelled`].
    pub fn pixel_labels<T: Real>(
        &self,
        uv: &[[f64; 2]],
        window: usize,
        pixel_weight: f64,
        admitted: impl Fn(usize, u32) -> bool + Sync,
        cancel: &Cancel,
    ) -> Result<PixelLabels<T>> {
        let parts: Vec<Result<PixelLabels<T>>> = uv
            .par_chunks(POINTS_A_TASK)
            .enumerate()
            .map(|(task, uv)| {
                cancel.check()?;
                let mut labels = PixelLabels::default();
                let mut counts = WindowCounts::default();
                for (i, &uv) in (task * POINTS_A_TASK..).zip(uv) {
                    self.count(self.nearest_pixel(i, uv)?, window / 2, &mut counts);
                    counts.labels.retain(|&(label, _)| admitted(i, label));
                    labels.push(&counts, pixel_weight);
                }
                Ok(labels)
            })
            .collect();
        let parts = parts.into_iter().collect::<Result<Vec<_>>>()?;
        PixelLabels::concatenate(&parts, cancel)
    }

    /// Direct projection: the label of the pixel nearest to each of `uv`; of several masks, the first.
    ///
    /// # Errors
    /// As [`LabelImage::pixel_labels`].
    pub fn direct_labels(&self, uv: &[[f64; 2]], cancel: &Cancel) -> Result<Vec<u32>> {
        let label = |(i, &uv): (usize, &[f64; 2])| {
            let set = self.set_at(self.nearest_pixel(i, uv)?);
            Ok(self.labels_of(set).last().unwrap_or(0))
        };
        let mut labels = with_room(uv.len())?;
        for (task, uv) in uv.chunks(POINTS_A_TASK).enumerate() {
            cancel.check()?;
            for at in (task * POINTS_A_TASK..).zip(uv) {
                labels.push(label(at)?);
            }
        }
        Ok(labels)
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

impl PixelLabels {
    /// The rows of `points`, or all, in double precision as they were before each was multiplied by its `scale`: single
    /// precision still tells how many pixels of `pixel_weight` each had.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`] and [`Error::Cancelled`].
    pub(crate) fn counted(
        &self,
        points: Option<&[u32]>,
        scale: impl Fn(usize) -> f32 + Sync,
        pixel_weight: f64,
        cancel: &Cancel,
    ) -> Result<PixelLabels<f64>> {
        let count = points.map_or(self.rows(), <[_]>::len);
        let row_at = |at: usize| {
            let point = points.map_or(at, |points| points[at] as usize);
            (point, self.offsets[point]..self.offsets[point + 1])
        };
        let of_task = |task: usize| {
            cancel.check()?;
            let places = task * POINTS_A_TASK..count.min((task + 1) * POINTS_A_TASK);
            let entries = places.clone().map(|at| row_at(at).1.len()).sum();
            let mut some = PixelLabels {
                offsets: with_room(places.len())?,
                labels: with_room(entries)?,
                weights: with_room(entries)?,
                mass: with_room(places.len())?,
            };
            for (point, row) in places.map(row_at) {
                let pixel = f64::from(scale(point)) * pixel_weight;
                // to the nearest number of pixels
                let counted = |weight: &f32| {
                    pixel_weight * f64::from((f64::from(*weight) / pixel + 0.5) as u32)
                };
                some.labels.extend_from_slice(&self.labels[row.clone()]);
                some.weights.extend(self.weights[row].iter().map(counted));
                some.mass.push(counted(&self.mass[point]));
                some.offsets.push(some.labels.len());
            }
            Ok(some)
        };
        let tasks = (0..count.div_ceil(POINTS_A_TASK)).into_par_iter();
        let parts = tasks.map(of_task).collect::<Result<Vec<_>>>()?;
        PixelLabels::concatenate(&parts, cancel)
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

    /// The rows of `points`, in their order.
    #[must_use]
    pub fn among(&self, points: &[u32]) -> Self {
        let mut some = Self {
            offsets: vec![0],
            ..Self::default()
        };
        for &point in points {
            let row = self.offsets[point as usize]..self.offsets[point as usize + 1];
            some.labels.extend_from_slice(&self.labels[row.clone()]);
            some.weights.extend_from_slice(&self.weights[row]);
            some.mass.push(self.mass[point as usize]);
            some.offsets.push(some.labels.len());
        }
        some
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

    /// Labels of no point yet, with room for those of `points`.
    pub(crate) fn with_room(points: usize) -> Result<Self> {
        let mut offsets = with_room(points + 1)?;
        offsets.push(0);
        Ok(Self {
            offsets,
            labels: Vec::new(),
            weights: Vec::new(),
            mass: with_room(points)?,
        })
    }

    fn concatenate(parts: &[Self], cancel: &Cancel) -> Result<Self> {
        let mut all = Self::with_room(parts.iter().map(Self::rows).sum())?;
        let entries = parts.iter().map(|part| part.labels.len()).sum();
        all.labels = with_room(entries)?;
        all.weights = with_room(entries)?;
        for part in parts {
            cancel.check()?;
            let start = all.labels.len();
            all.offsets
                .extend(part.offsets.iter().map(|offset| start + offset));
            all.labels.extend_from_slice(&part.labels);
            all.weights.extend_from_slice(&part.weights);
            all.mass.extend_from_slice(&part.mass);
        }
        Ok(all)
    }

    /// Refuses labels of another number of points, and labels from `n_labels` on.
    pub(crate) fn check(&self, points: usize, n_labels: usize) -> Result<()> {
        let mismatch = |problem: String| {
            Err(Error::Mismatch {
                name: "pixel_labels",
                problem,
            })
        };
        if self.rows() != points {
            return mismatch(format!("{} rows, the graph has {points}", self.rows()));
        }
        let highest = self
            .labels
            .iter()
            .find(|&&label| label as usize >= n_labels);
        highest.map_or(Ok(()), |label| {
            mismatch(format!("label {label}, expected labels below {n_labels}"))
        })
    }

    /// The most that these seeds may come to in so many `products`: as many times the largest seed, and no more than the largest
    /// share of the weight of the pixel edges that any point has, or 1.
    pub(crate) fn most(&self, products: Option<usize>) -> Most {
        let of_point = |i: usize| {
            let mass = self.mass[i].to_f64();
            let weights = self.row(i).map(|(_, weight)| weight.to_f64());
            let [all, one] = weights.fold([0.0_f64; 2], |[all, one], weight| {
                [all + weight, one.max(weight)]
            });
            // a point without pixel edges counts for none
            let share = |weight: f64| if all > 0.0 { weight / mass } else { 0.0 };
            [all, one, share(all), share(one)]
        };
        let larger = |a: [f64; 4], b: [f64; 4]| std::array::from_fn(|at| a[at].max(b[at]));
        let points = (0..self.rows()).into_par_iter().with_min_len(POINTS_A_TASK);
        let [all, one, of_all, of_one] = points.map(of_point).reduce(|| [0.0; 4], larger);
        let products = products.map_or(f64::INFINITY, |products| products as f64);
        let most = |seed: f64, share: f64| (products * seed).min(share.max(1.0));
        Most {
            all: most(all, of_all),
            one: most(one, of_one),
        }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::masks::{InstanceMasks, Rle};
    use proptest::prelude::*;

    fn painted(height: usize, width: usize, pixels: &[Vec<bool>]) -> LabelImage {
        let rles = pixels
            .iter()
            .map(|p| Rle::from_pixels(height, width, p).unwrap())
            .collect();
        let masks = InstanceMasks::new(height, width, rles).unwrap();
        LabelImage::paint(&masks, Cancel::never()).unwrap()
    }

    #[test]
    fn a_window_at_the_corner_has_fewer_pixels() {
        let labels = painted(6, 6, &[vec![true; 36]])
            .pixel_labels::<f32>(&[[0.0, 0.0]], 5, 1.0, |_, _| true, Cancel::never())
            .unwrap();
        assert_eq!(
            (labels.mass[0], labels.row(0).collect::<Vec<_>>()),
            (9.0, vec![(1, 9.0)])
        );
    }

    #[test]
    fn rows_in_double_precision_are_those_of_the_pixels() {
        let stripes = (0..63).map(|at| at % 9 < 4).collect();
        let image = painted(7, 9, &[stripes, vec![true; 63]]);
        let uv: Vec<[f64; 2]> = (0..63)
            .map(|at| [f64::from(at % 9), f64::from(at / 9)])
            .collect();
        for weight in [0.001, 0.7, 1e6] {
            let mut labels = image
                .pixel_labels::<f32>(&uv, 5, weight, |_, _| true, Cancel::never())
                .unwrap();
            let expected: PixelLabels<f64> = image
                .pixel_labels(&uv, 5, weight, |_, _| true, Cancel::never())
                .unwrap();
            // as rows are normalised
            let scales: Vec<f32> = (1..=63).map(|i| 1.0 / (1.7 * i as f32)).collect();
            for (i, scale) in scales.iter().enumerate() {
                let row = labels.offsets[i]..labels.offsets[i + 1];
                labels.weights[row]
                    .iter_mut()
                    .for_each(|weight| *weight *= scale);
                labels.mass[i] *= scale;
            }
            let counted = |points: Option<&[u32]>| {
                let all = labels.counted(points, |i| scales[i], weight, Cancel::never());
                all.unwrap()
            };
            assert_eq!(counted(None), expected);
            assert_eq!(counted(Some(&[40, 3])), expected.among(&[40, 3]));
        }
    }

    proptest! {
        #[test]
        fn weights_equal_a_count_of_every_pixel(
            pixels in proptest::collection::vec(proptest::collection::vec(any::<bool>(), 63), 0..4),
            u in -0.5..8.49_f64, v in -0.5..6.49_f64, reach in 0_usize..4,
        ) {
            let found = painted(7, 9, &pixels).pixel_labels::<f32>(&[[u, v]], 2 * reach + 1, 1.0, |_, _| true, Cancel::never()).unwrap();
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
