//! Masks grown and shrunk by a disk.

use super::rle::Rle;
use std::ops::Range;

impl Rle {
    /// The pixels at most `radius` from a pixel of the object, centre to centre.
    #[must_use]
    pub fn grow(&self, radius: usize) -> Self {
        let (height, width) = (self.height(), self.width());
        let mut columns: Vec<Vec<Range<usize>>> = vec![Vec::new(); width];
        for (column, rows) in self.column_spans() {
            columns[column].push(rows);
        }
        let mut spans = Vec::new();
        let mut grown: Vec<Range<usize>> = Vec::new();
        for column in 0..width {
            grown.clear();
            let first = column.saturating_sub(radius);
            let last = (column.saturating_add(radius)).min(width - 1);
            for (near, rows) in columns.iter().enumerate().take(last + 1).skip(first) {
                let up = half_chord(radius, near.abs_diff(column));
                grown.extend(rows.iter().map(|rows| {
                    rows.start.saturating_sub(up)..rows.end.saturating_add(up).min(height)
                }));
            }
            grown.sort_unstable_by_key(|rows| rows.start);
            let start = column * height;
            spans.extend(
                grown
                    .iter()
                    .map(|rows| ((start + rows.start) as u32, (start + rows.end) as u32)),
            );
        }
        Self::from_spans(height, width, spans)
    }

    /// The pixels of the object farther than `radius` from every pixel beside it. Nothing is taken away at the edge of
    /// the image, where the object may go on.
    #[must_use]
    pub fn shrink(&self, radius: usize) -> Self {
        self.complement().grow(radius).complement()
    }
}

/// The distance that a disk of `radius` around 0 reaches up at `across` from its middle.
fn half_chord(radius: usize, across: usize) -> usize {
    let (radius, across) = (radius as u128, across as u128);
    (radius * radius - across * across).isqrt() as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn disks_equal_a_search_of_every_pixel(
            pixels in proptest::collection::vec(proptest::bool::weighted(0.2), 63), radius in 0_usize..12,
        ) {
            let mask = Rle::from_pixels(7, 9, &pixels).unwrap();
            let near = |at: usize, wanted: bool| (0..63).any(|other| {
                let [rows, columns] = [(at / 9).abs_diff(other / 9), (at % 9).abs_diff(other % 9)];
                pixels[other] == wanted && rows * rows + columns * columns <= radius * radius
            });
            let grown: Vec<bool> = (0..63).map(|at| near(at, true)).collect();
            let shrunk: Vec<bool> = (0..63).map(|at| !near(at, false)).collect();
            prop_assert_eq!(mask.grow(radius), Rle::from_pixels(7, 9, &grown).unwrap());
            prop_assert_eq!(mask.shrink(radius), Rle::from_pixels(7, 9, &shrunk).unwrap());
        }
    }
}
