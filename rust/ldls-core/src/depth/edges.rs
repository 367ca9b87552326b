//! How far pixels lie from the edge of a mask, inside and outside.

use crate::Rle;
use std::ops::Range;

/// Pixels from the edge on which all count alike.
const REACH: usize = 10;
/// Fewest pixels by which a mask may be off.
const LEAST_MARGIN: usize = 3;

/// Distances to the edge of a mask, counted in steps to one of the eight pixels around, in a window around the mask.
pub(super) struct Edges {
    columns: Range<usize>,
    rows: Range<usize>,
    /// Column by column: steps to the nearest pixel outside the mask, or minus those to the nearest one inside.
    steps: Vec<i8>,
}

impl Edges {
    /// The edges of a mask that may be off by the share `margin` of its shorter side; none of an empty mask.
    pub(super) fn of(mask: &Rle, margin: f64) -> Option<Self> {
        let [columns, rows] = extent(mask)?;
        let shorter = columns.len().min(rows.len());
        let margin = ((margin * shorter as f64) as usize).clamp(LEAST_MARGIN, REACH);
        let around = |side: Range<usize>, end: usize| {
            side.start.saturating_sub(margin)..(side.end + margin).min(end)
        };
        let (columns, rows) = (around(columns, mask.width()), around(rows, mask.height()));
        let mut inside = vec![false; columns.len() * rows.len()];
        for (column, span) in mask.column_spans() {
            let start = (column - columns.start) * rows.len();
            inside[start + span.start - rows.start..start + span.end - rows.start].fill(true);
        }
        let to_outside = steps_to(&inside, false, rows.len());
        let to_inside = steps_to(&inside, true, rows.len());
        let signed = |(&out, &back): (&u8, &u8)| match (out, back) {
            (0, back) if usize::from(back) <= margin => -(back as i8),
            (out, _) => out as i8,
        };
        let steps = to_outside.iter().zip(&to_inside).map(signed).collect();
        Some(Self {
            columns,
            rows,
            steps,
        })
    }

    /// Steps from the pixel `[column, row]` to the edge: positive inside the mask, negative beside it within the margin,
    /// 0 elsewhere.
    pub(super) fn depth_at(&self, [column, row]: [usize; 2]) -> i8 {
        if !self.columns.contains(&column) || !self.rows.contains(&row) {
            return 0;
        }
        self.steps[(column - self.columns.start) * self.rows.len() + row - self.rows.start]
    }
}

/// Columns and rows that a mask spans.
fn extent(mask: &Rle) -> Option<[Range<usize>; 2]> {
    let mut all: Option<[Range<usize>; 2]> = None;
    for (column, span) in mask.column_spans() {
        let [columns, rows] = all.get_or_insert([column..column, span.clone()]);
        columns.end = column + 1;
        *rows = rows.start.min(span.start)..rows.end.max(span.end);
    }
    all
}

/// Steps from each pixel to the nearest one of `wanted`, at most [`REACH`], in columns of `height` pixels.
fn steps_to(pixels: &[bool], wanted: bool, height: usize) -> Vec<u8> {
    let start = |&pixel: &bool| if pixel == wanted { 0 } else { REACH as u8 };
    let mut steps: Vec<u8> = pixels.iter().map(start).collect();
    // two passes: what comes from the columns before and the pixels above, and then the other way around
    for _ in 0..2 {
        let mut before = vec![REACH as u8; height];
        for column in steps.chunks_exact_mut(height) {
            let mut above = REACH as u8;
            for row in 0..height {
                let beside = &before[row.saturating_sub(1)..(row + 2).min(height)];
                let nearest = beside
                    .iter()
                    .fold(above, |nearest, &other| nearest.min(other));
                above = column[row].min(nearest + 1);
                column[row] = above;
            }
            before.copy_from_slice(column);
        }
        steps.reverse();
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn steps_equal_a_search_of_every_pixel(
            pixels in proptest::collection::vec(proptest::bool::weighted(0.4), 9 * 14),
        ) {
            // column-major, 9 rows
            let row_major: Vec<bool> = (0..9 * 14).map(|at| pixels[at % 14 * 9 + at / 14]).collect();
            let mask = Rle::from_pixels(9, 14, &row_major).unwrap();
            let Some(edges) = Edges::of(&mask, 1.0) else {
                prop_assert!(!pixels.contains(&true));
                return Ok(());
            };
            let [columns, rows] = extent(&mask).unwrap();
            let margin = columns.len().min(rows.len()).clamp(LEAST_MARGIN, REACH);
            for at in 0_usize..9 * 14 {
                let steps = |other: usize| (at / 9).abs_diff(other / 9).max((at % 9).abs_diff(other % 9));
                let others = (0..9 * 14).filter(|&other| pixels[other] != pixels[at]);
                let nearest = others.map(steps).min().unwrap_or(REACH).min(REACH);
                let expected = match (pixels[at], nearest <= margin) {
                    (true, _) => nearest as i8,
                    (false, true) => -(nearest as i8),
                    (false, false) => 0,
                };
                prop_assert_eq!(edges.depth_at([at / 9, at % 9]), expected);
            }
        }
    }
}
