//! One mask as run lengths: column by column, runs of zeros and ones in turn, zeros first, as COCO has it.

use crate::memory::collect;
use crate::{Cancel, Error, Result};
use std::iter::repeat_n;
use std::ops::Range;

/// Most pixels of an image: what Pillow takes for a decompression bomb.
pub(crate) const MAX_PIXELS: usize = 178_956_970;

/// A binary mask of `height` x `width` pixels as column-major run lengths.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Rle {
    height: usize,
    width: usize,
    runs: Vec<u32>,
}

impl Rle {
    /// A mask from its run lengths, which must cover the image exactly. Those beside an empty one are one run.
    ///
    /// # Errors
    /// [`Error::ImageSize`] and [`Error::RunSum`].
    pub fn from_runs(height: usize, width: usize, runs: Vec<u32>) -> Result<Self> {
        let pixels = check_size(height, width)?;
        let found: u64 = runs.iter().map(|&run| u64::from(run)).sum();
        if found != pixels as u64 {
            return Err(Error::RunSum {
                found,
                expected: pixels as u64,
                height,
                width,
            });
        }
        let ends = runs.into_iter().scan(0, |end, run| {
            *end += run;
            Some(*end)
        });
        Ok(Self::from_switches(height, width, ends.collect()))
    }

    /// A mask from its pixels, row by row: `true` where the object is.
    ///
    /// # Errors
    /// [`Error::ImageSize`], and [`Error::Mismatch`] where `pixels` is not `height * width` long.
    pub fn from_pixels(height: usize, width: usize, pixels: &[bool]) -> Result<Self> {
        if check_size(height, width)? != pixels.len() {
            let problem = format!("{} values, expected {height} x {width}", pixels.len());
            return Err(Error::Mismatch {
                name: "mask",
                problem,
            });
        }
        Ok(Self::from_switches(
            height,
            width,
            switches(height, width, pixels),
        ))
    }

    /// A mask from the positions, in column-major order, at which it switches between zeros and ones. Two switches at
    /// one place undo each other.
    pub(crate) fn from_switches(height: usize, width: usize, mut switches: Vec<u32>) -> Self {
        switches.sort_unstable();
        let end = (height * width) as u32;
        let mut runs = Vec::new();
        let mut start = 0;
        let mut at = 0;
        while at < switches.len() && switches[at] < end {
            if switches.get(at + 1) == Some(&switches[at]) {
                at += 2;
                continue;
            }
            runs.push(switches[at] - start);
            start = switches[at];
            at += 1;
        }
        runs.push(end - start);
        Self {
            height,
            width,
            runs,
        }
    }

    /// The pixels of `self` and of `other`, which is of the same size.
    ///
    /// # Panics
    /// If the sizes differ.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        self.assert_same_size(other);
        let mut spans: Vec<(u32, u32)> = self.spans().chain(other.spans()).collect();
        spans.sort_unstable();
        Self::from_spans(self.height, self.width, spans)
    }

    /// The pixels of `self` that `other`, of the same size, has not.
    ///
    /// # Panics
    /// If the sizes differ.
    #[must_use]
    pub fn difference(&self, other: &Self) -> Self {
        self.assert_same_size(other);
        self.complement().union(other).complement()
    }

    /// The pixels that `self` has not.
    #[must_use]
    pub fn complement(&self) -> Self {
        let runs = match self.runs.split_first() {
            Some((0, rest)) if !rest.is_empty() => rest.to_vec(),
            _ => std::iter::once(0)
                .chain(self.runs.iter().copied())
                .collect(),
        };
        Self { runs, ..*self }
    }

    fn assert_same_size(&self, other: &Self) {
        assert_eq!(
            (self.height, self.width),
            (other.height, other.width),
            "masks of one image"
        );
    }

    /// A mask from half-open spans in ascending order of their starts; they may overlap.
    pub(crate) fn from_spans(
        height: usize,
        width: usize,
        spans: impl IntoIterator<Item = (u32, u32)>,
    ) -> Self {
        let mut switches = Vec::new();
        let mut open: Option<(u32, u32)> = None;
        for (start, end) in spans {
            open = match open {
                Some((first, last)) if start <= last => Some((first, last.max(end))),
                done => {
                    switches.extend(done.into_iter().flat_map(|(first, last)| [first, last]));
                    Some((start, end))
                }
            };
        }
        switches.extend(open.into_iter().flat_map(|(first, last)| [first, last]));
        Self::from_switches(height, width, switches)
    }

    /// Rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Run lengths, zeros first.
    pub fn runs(&self) -> &[u32] {
        &self.runs
    }

    /// Number of pixels of the object.
    pub fn area(&self) -> usize {
        self.spans()
            .map(|(start, end)| (end - start) as usize)
            .sum()
    }

    /// Half-open spans of the object's pixels, positions counted column by column.
    pub fn spans(&self) -> impl Iterator<Item = (u32, u32)> {
        let mut at = 0;
        self.runs
            .chunks(2)
            .map(move |pair| {
                let start = at + pair[0];
                at = start + pair.get(1).copied().unwrap_or(0);
                (start, at)
            })
            .filter(|(start, end)| start < end)
    }

    /// The smallest box that holds the object: top, left, height, width; all 0 where it is empty.
    pub fn bounding_box(&self) -> [usize; 4] {
        let mut rows = (usize::MAX, 0);
        let mut columns = (usize::MAX, 0);
        for (start, end) in self.spans() {
            let [first, last] =
                [start as usize, end as usize - 1].map(|at| (at / self.height, at % self.height));
            columns = (columns.0.min(first.0), columns.1.max(last.0));
            let spans_columns = first.0 != last.0;
            let (top, bottom) = if spans_columns {
                (0, self.height - 1)
            } else {
                (first.1, last.1)
            };
            rows = (rows.0.min(top), rows.1.max(bottom));
        }
        if rows.0 == usize::MAX {
            return [0; 4];
        }
        [
            rows.0,
            columns.0,
            rows.1 + 1 - rows.0,
            columns.1 + 1 - columns.0,
        ]
    }

    /// The pixels of the box top, left, height, width, row by row.
    ///
    /// # Errors
    /// [`Error::Mismatch`] where the box leaves the image.
    pub fn crop(&self, [top, left, height, width]: [usize; 4]) -> Result<Vec<bool>> {
        if top.saturating_add(height) > self.height || left.saturating_add(width) > self.width {
            let problem = format!(
                "box {height} x {width} at ({top}, {left}) leaves {} x {}",
                self.height, self.width
            );
            return Err(Error::Mismatch {
                name: "crop",
                problem,
            });
        }
        let mut pixels = collect(repeat_n(false, height * width), Cancel::never())?;
        for (column, rows) in self.column_spans() {
            if (left..left + width).contains(&column) {
                let rows = rows.start.max(top)..rows.end.min(top + height);
                for row in rows {
                    pixels[(row - top) * width + column - left] = true;
                }
            }
        }
        Ok(pixels)
    }

    /// Sets the object's pixels in an image of this mask's size, row by row, that is all `false`.
    ///
    /// # Panics
    /// If `pixels` has another length.
    pub fn paint(&self, pixels: &mut [bool]) {
        assert_eq!(pixels.len(), self.height * self.width, "one value a pixel");
        for (column, rows) in self.column_spans() {
            let end = rows.end * self.width;
            for at in (rows.start * self.width + column..end).step_by(self.width) {
                pixels[at] = true;
            }
        }
    }

    /// The object's pixels as a column and a range of rows each.
    pub(crate) fn column_spans(&self) -> impl Iterator<Item = (usize, Range<usize>)> {
        self.spans().flat_map(move |(start, end)| {
            let (start, end) = (start as usize, end as usize);
            let columns = start / self.height..end.div_ceil(self.height);
            columns.map(move |column| {
                let first = column * self.height;
                let rows = start.max(first) - first..end.min(first + self.height) - first;
                (column, rows)
            })
        })
    }
}

/// Number of pixels, if an image may have so many.
pub(crate) fn check_size(height: usize, width: usize) -> Result<usize> {
    match height.checked_mul(width) {
        Some(pixels) if (1..=MAX_PIXELS).contains(&pixels) => Ok(pixels),
        _ => Err(Error::ImageSize {
            height,
            width,
            limit: MAX_PIXELS,
        }),
    }
}

/// Column-major positions at which `pixels`, row by row, switch between zeros and ones. Rows are compared with the rows
/// above them, so that memory is read in its order; most are equal, and of the others most is passed over 32 pixels at a time.
fn switches(height: usize, width: usize, pixels: &[bool]) -> Vec<u32> {
    const CHUNK: usize = 32;
    let position = |row: usize, column: usize| (column * height + row) as u32;
    let mut found = Vec::new();
    // above the top of a column is the bottom of the one before it
    let bottom = &pixels[(height - 1) * width..];
    let before = std::iter::once(&false).chain(bottom);
    for (column, (pixel, above)) in pixels[..width].iter().zip(before).enumerate() {
        if pixel != above {
            found.push(position(0, column));
        }
    }
    for row in 1..height {
        let [above, pixels] = [row - 1, row].map(|r| &pixels[r * width..(r + 1) * width]);
        if above == pixels {
            continue;
        }
        for (chunk, (a, b)) in above.chunks(CHUNK).zip(pixels.chunks(CHUNK)).enumerate() {
            if a != b {
                let switched = (0..a.len()).filter(|&i| a[i] != b[i]);
                found.extend(switched.map(|i| position(row, chunk * CHUNK + i)));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn pixels_of(rle: &Rle) -> Vec<bool> {
        rle.crop([0, 0, rle.height(), rle.width()]).unwrap()
    }

    #[test]
    fn runs_go_down_the_columns() {
        let rle = Rle::from_runs(2, 3, vec![1, 2, 3]).unwrap();
        assert_eq!(pixels_of(&rle), [false, true, false, true, false, false]);
        assert_eq!(rle.bounding_box(), [0, 0, 2, 2]);
        assert_eq!(rle.area(), 2);
    }

    #[test]
    fn runs_beside_an_empty_one_are_one() {
        let runs_of = |runs: &[u32]| Rle::from_runs(4, 3, runs.to_vec()).unwrap();
        let plain = runs_of(&[0, 3, 4, 5]);
        assert_eq!(plain.runs(), [0, 3, 4, 5]);
        assert_eq!(runs_of(&[0, 1, 0, 2, 1, 0, 3, 5, 0]), plain);
        assert_eq!(runs_of(&[0, 0, 12]).runs(), [12]);
    }

    #[test]
    fn runs_must_cover_the_image() {
        let error = Rle::from_runs(10, 10, vec![3, 5]).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("runs sum to 8, size 10 x 10 needs 100"),
            "{error}"
        );
        assert!(Rle::from_runs(10, 10, vec![]).is_err());
        assert!(Rle::from_runs(1 << 31, 1 << 31, vec![1]).is_err());
    }

    #[test]
    fn an_empty_mask_has_an_empty_box() {
        let rle = Rle::from_pixels(3, 4, &[false; 12]).unwrap();
        assert_eq!(
            (rle.runs(), rle.area(), rle.bounding_box()),
            (&[12][..], 0, [0; 4])
        );
    }

    proptest! {
        #[test]
        fn pixels_survive_the_round_trip((height, width, pixels) in (1_usize..9, 1_usize..9).prop_flat_map(
            |(h, w)| (Just(h), Just(w), proptest::collection::vec(any::<bool>(), h * w))
        )) {
            let rle = Rle::from_pixels(height, width, &pixels).unwrap();
            prop_assert_eq!(&pixels_of(&rle), &pixels);
            let mut painted = vec![false; height * width];
            rle.paint(&mut painted);
            prop_assert_eq!(&painted, &pixels);
            prop_assert_eq!(rle.area(), pixels.iter().filter(|&&p| p).count());
            prop_assert_eq!(&rle, &Rle::from_runs(height, width, rle.runs().to_vec()).unwrap());
        }

        #[test]
        fn a_union_has_the_pixels_of_both(a in proptest::collection::vec(any::<bool>(), 35),
                                          b in proptest::collection::vec(any::<bool>(), 35)) {
            let both = Rle::from_pixels(5, 7, &a).unwrap().union(&Rle::from_pixels(5, 7, &b).unwrap());
            let expected: Vec<bool> = a.iter().zip(&b).map(|(&p, &q)| p || q).collect();
            prop_assert_eq!(pixels_of(&both), expected);
        }

        #[test]
        fn a_difference_has_the_pixels_of_one_alone(a in proptest::collection::vec(any::<bool>(), 35),
                                                    b in proptest::collection::vec(any::<bool>(), 35)) {
            let one = Rle::from_pixels(5, 7, &a).unwrap().difference(&Rle::from_pixels(5, 7, &b).unwrap());
            let expected: Vec<bool> = a.iter().zip(&b).map(|(&p, &q)| p && !q).collect();
            prop_assert_eq!(pixels_of(&one), expected.clone());
            prop_assert_eq!(one, Rle::from_pixels(5, 7, &expected).unwrap());
        }
    }
}
