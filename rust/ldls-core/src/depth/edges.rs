//! How far pixels lie from the edge of a mask, inside and outside.

use crate::memory::filled;
use crate::{Cancel, Result, Rle};
use std::ops::Range;

/// Most pixels by which a mask may be off, and pixels inside it on which all count alike.
const REACH: i8 = 10;
/// Steps that stand for all beyond.
const FARTHER: i8 = REACH + 1;
/// Fewest pixels by which a mask may be off.
const LEAST_MARGIN: usize = 3;

/// Distances to the edge of a mask, counted in steps to one of the eight pixels around, in a window around the mask.
pub(super) struct Edges {
    columns: Range<usize>,
    rows: Range<usize>,
    /// Pixels by which the mask may be off.
    margin: i8,
    /// Column by column: steps to the nearest pixel outside the mask, or minus those to the nearest one inside, [`FARTHER`] at most.
    steps: Vec<i8>,
}

impl Edges {
    /// The edges of a mask that may be off by the share `margin` of its shorter side; none of an empty mask.
    pub(super) fn of(mask: &Rle, margin: f64, cancel: &Cancel) -> Result<Option<Self>> {
        let Some([columns, rows]) = extent(mask) else {
            return Ok(None);
        };
        let shorter = columns.len().min(rows.len());
        let margin = ((margin * shorter as f64) as usize).clamp(LEAST_MARGIN, REACH as usize);
        let around = |side: Range<usize>, end: usize| {
            side.start.saturating_sub(margin)..(side.end + margin).min(end)
        };
        let (columns, rows) = (around(columns, mask.width()), around(rows, mask.height()));
        let mut steps = filled(-FARTHER, columns.len() * rows.len(), cancel)?;
        let mut spans = mask.column_spans().peekable();
        for (column, steps) in columns.clone().zip(steps.chunks_mut(rows.len())) {
            let mut outside = 0;
            while let Some((_, span)) = spans.next_if(|(of, _)| *of == column) {
                let [start, end] = [span.start, span.end].map(|row| row - rows.start);
                count_along(steps, outside..start, -1);
                count_along(steps, start..end, 1);
                outside = end;
            }
            if outside > 0 {
                count_along(steps, outside..rows.len(), -1);
            }
        }
        cancel.check()?;
        spread(&mut steps, rows.len());
        Ok(Some(Self {
            columns,
            rows,
            margin: margin as i8,
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
        let steps =
            self.steps[(column - self.columns.start) * self.rows.len() + row - self.rows.start];
        if steps < -self.margin {
            0
        } else {
            steps.min(REACH)
        }
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

/// Steps along a column from the pixels of a `run`, all inside the mask or all outside, to those before and after it, with the
/// sign of where it lies.
fn count_along(column: &mut [i8], run: Range<usize>, sign: i8) {
    let (first, last) = (run.start == 0, run.end == column.len());
    let run = &mut column[run];
    run.fill(sign * FARTHER);
    let nearer = |(steps, pixel): (i8, &mut i8)| *pixel = sign * steps.min(pixel.abs());
    if !first {
        (1..FARTHER).zip(run.iter_mut()).for_each(nearer);
    }
    if !last {
        (1..FARTHER).zip(run.iter_mut().rev()).for_each(nearer);
    }
}

/// Turns steps along each column, of `height` pixels, into those by any of the eight neighbours: over columns first, from
/// one side and then from the other.
fn spread(steps: &mut [i8], height: usize) {
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
fn step_over(from: &[i8], to: &mut [i8]) {
    let last = from.len() - 1;
    for row in [0, last] {
        let beside = &from[row.saturating_sub(1)..(row + 2).min(from.len())];
        for &steps in beside {
            to[row] = nearer(to[row], [steps; 3]);
        }
    }
    for (to, beside) in to[1..last.max(1)].iter_mut().zip(from.windows(3)) {
        *to = nearer(*to, [beside[0], beside[1], beside[2]]);
    }
}

/// The steps of a pixel, or one more than the fewest `beside` it, where those on the other side of the edge are none.
#[inline(always)]
fn nearer(steps: i8, beside: [i8; 3]) -> i8 {
    // all bits are set if it lies outside: steps on its side count positive with that
    let outside = steps >> 7;
    let on_its_side = |steps: i8| (steps ^ outside) - outside;
    let [above, level, below] = beside.map(on_its_side);
    let nearest = above.min(level).min(below).max(0) + 1;
    on_its_side(nearest.min(on_its_side(steps)))
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
            let margin = ((share * shorter) as usize).clamp(LEAST_MARGIN, REACH as usize);
            for at in 0..PIXELS {
                let steps = |other: usize| {
                    (at / ROWS).abs_diff(other / ROWS).max((at % ROWS).abs_diff(other % ROWS))
                };
                let others = (0..PIXELS).filter(|&other| pixels[other] != pixels[at]);
                let nearest = others.map(steps).min().unwrap_or(PIXELS);
                let expected = match (pixels[at], nearest <= margin) {
                    (true, _) => nearest.min(REACH as usize) as i8,
                    (false, true) => -(nearest as i8),
                    (false, false) => 0,
                };
                prop_assert_eq!(edges.steps_at([at / ROWS, at % ROWS]), expected);
            }
        }
    }
}
