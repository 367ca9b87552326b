//! How far pixels lie from the edge of a mask, inside and outside.

use crate::memory::{collect, zeros};
use crate::{Cancel, Result, Rle};
use std::ops::Range;

/// Most pixels by which a mask may be off, and pixels inside it on which all count alike.
const REACH: usize = 10;
/// Steps that stand for all beyond.
const FARTHER: u8 = REACH as u8 + 1;
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
    pub(super) fn of(mask: &Rle, margin: f64, cancel: &Cancel) -> Result<Option<Self>> {
        let Some([columns, rows]) = extent(mask) else {
            return Ok(None);
        };
        let shorter = columns.len().min(rows.len());
        let margin = ((margin * shorter as f64) as usize).clamp(LEAST_MARGIN, REACH);
        let around = |side: Range<usize>, end: usize| {
            side.start.saturating_sub(margin)..(side.end + margin).min(end)
        };
        let (columns, rows) = (around(columns, mask.width()), around(rows, mask.height()));
        let mut inside = zeros(columns.len() * rows.len(), cancel)?;
        for (column, span) in mask.column_spans() {
            let start = (column - columns.start) * rows.len();
            inside[start + span.start - rows.start..start + span.end - rows.start].fill(true);
        }
        let to_outside = steps_to(&inside, false, rows.len(), cancel)?;
        let to_inside = steps_to(&inside, true, rows.len(), cancel)?;
        let signed = |(&out, &back): (&u8, &u8)| match (out, back) {
            (0, back) if usize::from(back) <= margin => -(back as i8),
            (out, _) => out.min(REACH as u8) as i8,
        };
        let steps = collect(to_outside.iter().zip(&to_inside).map(signed), cancel)?;
        Ok(Some(Self {
            columns,
            rows,
            steps,
        }))
    }

    /// Steps from the pixel `[column, row]` to the edge: positive inside the mask, negative beside it within the margin,
    /// 0 elsewhere.
    pub(super) fn steps_at(&self, [column, row]: [usize; 2]) -> i8 {
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

/// Steps from each pixel to the nearest one of `wanted`, at most one more than [`REACH`], in columns of `height` pixels.
fn steps_to(pixels: &[bool], wanted: bool, height: usize, cancel: &Cancel) -> Result<Vec<u8>> {
    let start = |&pixel: &bool| if pixel == wanted { 0 } else { FARTHER };
    let mut steps = collect(pixels.iter().map(start), cancel)?;
    // two passes: what comes from the columns before and the pixels above, and then the other way around
    for _ in 0..2 {
        let mut before = vec![FARTHER; height];
        for column in steps.chunks_exact_mut(height) {
            let mut above = FARTHER;
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
    Ok(steps)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ROWS: usize = 34;
    const PIXELS: usize = ROWS * 40;

    proptest! {
        #[test]
        fn steps_equal_a_search_of_every_pixel(
            [left, top] in proptest::array::uniform2(0_usize..30), [width, height] in proptest::array::uniform2(1_usize..28),
            others in proptest::collection::vec(0..PIXELS, 0..4), share in 0.0..1.0_f64,
        ) {
            // column-major, a rectangle and some pixels more
            let within = |at: usize| (left..left + width).contains(&(at / ROWS)) && (top..top + height).contains(&(at % ROWS));
            let pixels: Vec<bool> = (0..PIXELS).map(|at| within(at) || others.contains(&at)).collect();
            let row_major: Vec<bool> = (0..PIXELS).map(|at| pixels[at % 40 * ROWS + at / 40]).collect();
            let mask = Rle::from_pixels(ROWS, 40, &row_major).unwrap();
            let Some(edges) = Edges::of(&mask, share, Cancel::never()).unwrap() else {
                prop_assert!(!pixels.contains(&true));
                return Ok(());
            };
            let [columns, rows] = extent(&mask).unwrap();
            let shorter = columns.len().min(rows.len()) as f64;
            let margin = ((share * shorter) as usize).clamp(LEAST_MARGIN, REACH);
            for at in 0..PIXELS {
                let steps = |other: usize| {
                    (at / ROWS).abs_diff(other / ROWS).max((at % ROWS).abs_diff(other % ROWS))
                };
                let others = (0..PIXELS).filter(|&other| pixels[other] != pixels[at]);
                let nearest = others.map(steps).min().unwrap_or(PIXELS);
                let expected = match (pixels[at], nearest <= margin) {
                    (true, _) => nearest.min(REACH) as i8,
                    (false, true) => -(nearest as i8),
                    (false, false) => 0,
                };
                prop_assert_eq!(edges.steps_at([at / ROWS, at % ROWS]), expected);
            }
        }
    }
}
