//! A point cloud as it lies in memory: rows of three or more columns, x y z first, single or double precision.

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
