//! A point cloud as it lies in memory: rows of three or more columns, x y z first, single or double precision.

use crate::memory::tabulate;
use crate::{Cancel, Result};
use std::array::from_fn;
use std::ops::Range;

/// Borrowed rows of x y z and perhaps more columns, in metres. Coordinates are read as `f64`, so that large map
/// coordinates keep their precision until differences are taken.
#[derive(Debug, Clone, Copy)]
pub enum Cloud<'a> {
    /// Single precision, `columns` values a row.
    F32 {
        /// All rows, one after the other.
        values: &'a [f32],
        /// Values a row, at least 3.
        columns: usize,
    },
    /// Double precision, `columns` values a row.
    F64 {
        /// All rows, one after the other.
        values: &'a [f64],
        /// Values a row, at least 3.
        columns: usize,
    },
}

impl Cloud<'_> {
    /// Number of points.
    pub fn len(&self) -> usize {
        match self {
            Self::F32 { values, columns } => values.len() / columns,
            Self::F64 { values, columns } => values.len() / columns,
        }
    }

    /// True if there is no point.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// x, y and z of `LEN` points each, in metres: those of some rows, as many at most, and of the last of them again.
    #[inline(always)]
    pub(super) fn axes<const LEN: usize>(&self, rows: Range<usize>) -> [[f64; LEN]; 3] {
        match *self {
            Self::F32 { values, columns } => {
                axes_of(&values[rows.start * columns..rows.end * columns], columns)
            }
            Self::F64 { values, columns } => {
                axes_of(&values[rows.start * columns..rows.end * columns], columns)
            }
        }
    }

    /// x, y, z of point `row`, in metres.
    #[inline]
    pub fn xyz(&self, row: usize) -> [f64; 3] {
        match *self {
            Self::F32 { values, columns } => {
                let row = &values[row * columns..row * columns + 3];
                [f64::from(row[0]), f64::from(row[1]), f64::from(row[2])]
            }
            Self::F64 { values, columns } => {
                let row = &values[row * columns..row * columns + 3];
                [row[0], row[1], row[2]]
            }
        }
    }
}

/// x, y and z, in metres, of the points of `clouds`, one cloud after the other, each after its transform: the first three rows of its
/// matrix, for column vectors. Points at exactly (0, 0, 0) are missing returns and stay there, unless `keep_origin` is set.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub fn brought_together(
    clouds: &[(Cloud, [[f64; 4]; 3])],
    keep_origin: bool,
    cancel: &Cancel,
) -> Result<Vec<[f64; 3]>> {
    let ends = clouds.iter().scan(0, |end, (cloud, _)| {
        *end += cloud.len();
        Some(*end)
    });
    let ends: Vec<usize> = ends.collect();
    let place = |row: usize| {
        let at = ends.partition_point(|&end| end <= row);
        let (cloud, matrix) = &clouds[at];
        let xyz = cloud.xyz(row + cloud.len() - ends[at]);
        if xyz == [0.0; 3] && !keep_origin {
            return xyz;
        }
        matrix.map(|[x, y, z, shift]| x * xyz[0] + y * xyz[1] + z * xyz[2] + shift)
    };
    tabulate(ends.last().copied().unwrap_or(0), place, cancel)
}

#[inline(always)]
fn axes_of<T: Copy + Into<f64>, const LEN: usize>(values: &[T], columns: usize) -> [[f64; LEN]; 3] {
    // most clouds have intensities too; of rows of a known length the instructions are known
    if let Ok(rows) = <&[[T; 4]; LEN]>::try_from(values.as_chunks().0)
        && columns == 4
    {
        return [0, 1, 2].map(|axis| from_fn(|lane| rows[lane][axis].into()));
    }
    let last = values.len() / columns - 1;
    let row = |lane: usize| lane.min(last) * columns;
    [0, 1, 2].map(|axis| from_fn(|lane| values[row(lane) + axis].into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clouds_come_one_after_the_other_each_after_its_transform() {
        let single = Cloud::F32 {
            values: &[1.0, 2.0, 3.0, 9.0, 0.0, 0.0, 0.0, 9.0],
            columns: 4,
        };
        let double = Cloud::F64 {
            values: &[1.0, 2.0, 3.0],
            columns: 3,
        };
        let quarter_turn = [[0., -1., 0., 10.], [1., 0., 0., 20.], [0., 0., 1., 30.]];
        let still = [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.]];
        let clouds = [(single, quarter_turn), (double, still)];
        let placed = |keep_origin| brought_together(&clouds, keep_origin, Cancel::never()).unwrap();
        let (moved, there) = ([8., 21., 33.], [1., 2., 3.]);
        assert_eq!(placed(false), [moved, [0.; 3], there]);
        assert_eq!(placed(true), [moved, [10., 20., 30.], there]);
    }
}
