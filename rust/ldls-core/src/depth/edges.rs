//! How far pixels lie from the edge of a mask, inside and outside.

use crate::memory::{collect, filled};
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
        let window = [columns.clone(), rows.clone()];
        let to_outside = steps_to(&mask.complement(), &window, cancel)?;
        let to_inside = steps_to(mask, &window, cancel)?;
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

    /// Columns of the window.
    pub(super) fn columns(&self) -> Range<usize> {
        self.columns.clone()
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

/// Steps from each pixel of a window, columns and rows, to the nearest one of `mask` in it, at most [`FARTHER`].
fn steps_to(mask: &Rle, [columns, rows]: &[Range<usize>; 2], cancel: &Cancel) -> Result<Vec<u8>> {
    let mut steps = filled(FARTHER, columns.len() * rows.len(), cancel)?;
    for (column, span) in mask.column_spans() {
        let span = span.start.max(rows.start)..span.end.min(rows.end);
        if columns.contains(&column) && !span.is_empty() {
            let start = (column - columns.start) * rows.len();
            let span = span.start - rows.start..span.end - rows.start;
            surround(&mut steps[start..start + rows.len()], span);
        }
    }
    spread(&mut steps, rows.len());
    Ok(steps)
}

/// Steps along a column to the pixels of a span, where none is nearer.
fn surround(column: &mut [u8], span: Range<usize>) {
    let (above, others) = column.split_at_mut(span.start);
    let (own, below) = others.split_at_mut(span.len());
    own.fill(0);
    let nearer = |(step, pixel): (u8, &mut u8)| *pixel = step.min(*pixel);
    (1..FARTHER).zip(above.iter_mut().rev()).for_each(nearer);
    (1..FARTHER).zip(below).for_each(nearer);
}

/// Turns steps along each column, of `height` pixels, into those by any of the eight neighbours: over columns first, from
/// one side and then from the other.
fn spread(steps: &mut [u8], height: usize) {
    for column in 1..steps.len() / height {
        let (before, after) = steps.split_at_mut(column * height);
        step_over(&before[(column - 1) * height..], &mut after[..height]);
    }
    for column in (1..steps.len() / height).rev() {
        let (before, after) = steps.split_at_mut(column * height);
        step_over(&after[..height], &mut before[(column - 1) * height..]);
    }
}

/// Takes one step from a column `from` to the one beside it, straight or to a side.
fn step_over(from: &[u8], to: &mut [u8]) {
    let last = from.len() - 1;
    for row in [0, last] {
        let beside = &from[row.saturating_sub(1)..(row + 2).min(from.len())];
        let nearest = beside
            .iter()
            .fold(FARTHER, |nearest, &steps| nearest.min(steps));
        to[row] = to[row].min(nearest + 1);
    }
    for (to, beside) in to[1..last.max(1)].iter_mut().zip(from.windows(3)) {
        let nearest = beside[0].min(beside[1]).min(beside[2]);
        *to = (*to).min(nearest + 1);
    }
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
