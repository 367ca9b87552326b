//! Polygons to masks, by the rule of the COCO tools, so that the same annotation has the same pixels here as there.
//!
//! The outline is drawn on a grid five times as fine. Where it passes from one fine column to the next in the middle
//! of an image column, it crosses that column's line of pixel centres: there the column switches between outside and
//! inside, from the first pixel at or below the crossing.

use super::rle::{Rle, check_size};
use crate::{Error, Result};

/// Fine grid steps a pixel.
const FINE: i64 = 5;
/// Farthest corner from the origin, in pixels: drawing takes time and memory in proportion.
const FARTHEST: f64 = 1e5;

impl Rle {
    /// The pixels inside any of `polygons`, each a flat list x1, y1, x2, y2, ... of its corners in pixels.
    ///
    /// # Errors
    /// [`Error::Polygon`] and [`Error::ImageSize`].
    pub fn from_polygons(height: usize, width: usize, polygons: &[Vec<f64>]) -> Result<Self> {
        check_size(height, width)?;
        let empty = Self::from_switches(height, width, Vec::new());
        polygons.iter().try_fold(empty, |mask, polygon| {
            check(polygon)?;
            Ok(mask.union(&Self::from_switches(
                height,
                width,
                column_switches(polygon, height, width),
            )))
        })
    }
}

fn check(polygon: &[f64]) -> Result<()> {
    let problem = if polygon.len() % 2 == 1 || polygon.len() < 6 {
        format!("{} numbers", polygon.len())
    } else if let Some(at) = polygon.iter().position(|c| !(c.abs() <= FARTHEST)) {
        format!("number {at} is {:?}", polygon[at])
    } else {
        return Ok(());
    };
    Err(Error::Polygon { problem })
}

/// Column-major positions at which the closed outline switches a column between outside and inside.
fn column_switches(polygon: &[f64], height: usize, width: usize) -> Vec<u32> {
    let corners: Vec<[i64; 2]> = polygon
        .chunks_exact(2)
        .map(|xy| [xy[0], xy[1]].map(|c| (FINE as f64 * c + 0.5) as i64))
        .collect();
    let outline: Vec<[i64; 2]> = (0..corners.len())
        .flat_map(|i| line(corners[i], corners[(i + 1) % corners.len()]))
        .collect();
    outline
        .windows(2)
        .filter(|step| step[0][0] != step[1][0])
        .filter_map(|step| switch(step[0], step[1], height, width))
        .collect()
}

/// The position at which the step from `a` to `b`, one fine column apart, switches an image column, if it crosses one's centre line.
fn switch(a: [i64; 2], b: [i64; 2], height: usize, width: usize) -> Option<u32> {
    let left = a[0].min(b[0]);
    let crosses_centres = left.rem_euclid(FINE) == FINE / 2;
    let column = left.div_euclid(FINE);
    if !crosses_centres || column < 0 || column >= width as i64 {
        return None;
    }
    let upper = a[1].min(b[1]);
    let row = ((upper as f64 + 0.5) / FINE as f64 - 0.5)
        .clamp(0.0, height as f64)
        .ceil() as i64;
    Some((column * height as i64 + row) as u32)
}

/// Fine grid points from `a` to `b`, both included, one a step along the longer axis.
fn line(a: [i64; 2], b: [i64; 2]) -> Vec<[i64; 2]> {
    let along = usize::from((b[0] - a[0]).abs() < (b[1] - a[1]).abs());
    let across = 1 - along;
    // drawn from the smaller end, so that an edge has the same points in both directions
    let reversed = a[along] > b[along];
    let (from, to) = if reversed { (b, a) } else { (a, b) };
    let length = to[along] - from[along];
    let slope = if length == 0 {
        0.0
    } else {
        (to[across] - from[across]) as f64 / length as f64
    };
    let at = |step: i64| {
        let mut point = [0; 2];
        point[along] = from[along] + step;
        point[across] = (from[across] as f64 + slope * step as f64 + 0.5) as i64;
        point
    };
    if reversed {
        (0..=length).rev().map(at).collect()
    } else {
        (0..=length).map(at).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_covers_the_pixels_between_its_edges() {
        let rle = Rle::from_polygons(5, 6, &[vec![1., 1., 4., 1., 4., 3., 1., 3.]]).unwrap();
        assert_eq!(rle.bounding_box(), [1, 1, 2, 3]);
        assert_eq!(rle.area(), 6);
    }

    #[test]
    fn two_polygons_make_one_mask_of_both() {
        let square = |x: f64| vec![x, 0., x + 2., 0., x + 2., 2., x, 2.];
        let rle = Rle::from_polygons(4, 9, &[square(0.), square(5.), square(1.)]).unwrap();
        assert_eq!(rle.area(), 3 * 2 + 4);
    }

    #[test]
    fn a_polygon_beyond_the_image_is_cut_off() {
        let rle =
            Rle::from_polygons(4, 4, &[vec![-9., -9., 20., -9., 20., 20., -9., 20.]]).unwrap();
        assert_eq!(rle.area(), 16);
    }

    #[test]
    fn polygons_without_meaning_are_refused() {
        for polygon in [
            vec![1., 2., 3.],
            vec![0.; 4],
            vec![f64::NAN; 6],
            vec![1e9; 6],
        ] {
            assert!(matches!(
                Rle::from_polygons(4, 4, &[polygon]),
                Err(Error::Polygon { .. })
            ));
        }
    }
}
