//! The nearest pixels of points, column by column, so that a mask need not look at all of them.

use crate::memory::{filled, with_room, zeros};
use crate::projection::nearest_pixel;
use crate::{Cancel, Result};

/// Some points by the column of their nearest pixel.
pub(super) struct Pixels {
    /// Those of column c lie at `offsets[c]..offsets[c + 1]`.
    offsets: Vec<usize>,
    points: Vec<Point>,
}

/// A point, with all that masks ask of it in one place.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Point {
    /// Distance to the camera, in metres.
    pub(super) distance: f64,
    /// Row of its nearest pixel.
    pub(super) row: u32,
    /// Its number among all that the image sees.
    pub(super) number: u32,
}

impl Pixels {
    /// The pixels nearest to `uv` of the points that are `wanted`, at these `distances` from the camera in metres, in an
    /// image of `height` x `width` pixels.
    pub(super) fn of(
        (uv, distances): (&[[f64; 2]], &[f64]),
        wanted: &[bool],
        [height, width]: [usize; 2],
        cancel: &Cancel,
    ) -> Result<Self> {
        let mut seen = with_room(wanted.iter().filter(|&&wanted| wanted).count())?;
        let mut offsets = zeros(width + 1, cancel)?;
        for (block, uv) in uv.chunks(Cancel::ITEMS_A_LOOK).enumerate() {
            cancel.check()?;
            let wanted = (block * Cancel::ITEMS_A_LOOK..)
                .zip(uv)
                .filter(|(point, _)| wanted[*point]);
            for (number, &uv) in wanted {
                if let Some([column, row]) = nearest_pixel(uv, height, width) {
                    offsets[column + 1] += 1;
                    let point = Point {
                        distance: distances[number],
                        row: row as u32,
                        number: number as u32,
                    };
                    seen.push((column, point));
                }
            }
        }
        for column in 0..width {
            offsets[column + 1] += offsets[column];
        }
        let mut points = filled(Point::default(), seen.len(), cancel)?;
        for block in seen.chunks(Cancel::ITEMS_A_LOOK) {
            cancel.check()?;
            for &(column, point) in block {
                points[offsets[column]] = point;
                offsets[column] += 1;
            }
        }
        // each column now begins where it ended
        offsets.rotate_right(1);
        offsets[0] = 0;
        Ok(Self { offsets, points })
    }

    /// The points of a column.
    pub(super) fn of_column(&self, column: usize) -> &[Point] {
        &self.points[self.offsets[column]..self.offsets[column + 1]]
    }
}
