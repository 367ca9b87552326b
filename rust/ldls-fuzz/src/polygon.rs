//! Polygons: the drawing of outlines against one of the same rule that looks at every pixel.

use crate::rle::check_pixels;
use crate::{Bytes, Outcome};
use ldls_core::Rle;

/// Fine steps a pixel, of the COCO tools' rule.
const FINE: f64 = 5.0;
/// Farthest corner, in pixels.
const FARTHEST: f64 = 1e5;

/// The mask of one polygon or several.
///
/// # Panics
/// If fast and slow differ.
pub fn polygon(data: &[u8]) -> Outcome {
    let mut bytes = Bytes::new(data);
    let [height, width] = std::array::from_fn(|_| 1 + bytes.below(30));
    let mut polygons: Vec<Vec<f64>> = Vec::new();
    for _ in 0..=bytes.below(3) {
        let corners = [3, 3, 4, 4, 5, 9, 1, 2][bytes.below(8)];
        let odd = usize::from(bytes.below(40) == 0);
        polygons.push(
            (0..2 * corners + odd)
                .map(|_| coordinate(&mut bytes))
                .collect(),
        );
    }
    let fits = |polygon: &Vec<f64>| {
        polygon.len() >= 6
            && polygon.len().is_multiple_of(2)
            && polygon.iter().all(|x| x.is_finite() && x.abs() <= FARTHEST)
    };
    let found = Rle::from_polygons(height, width, &polygons);
    assert_eq!(
        found.is_ok(),
        polygons.iter().all(fits),
        "{polygons:?}: {found:?}"
    );
    let Ok(found) = found else {
        return Outcome::Refused;
    };
    let mut pixels = vec![false; height * width];
    for polygon in &polygons {
        let inside = fill(polygon, height, width);
        pixels
            .iter_mut()
            .zip(inside)
            .for_each(|(pixel, inside)| *pixel |= inside);
    }
    check_pixels(&found, &pixels);
    Outcome::Accepted
}

fn coordinate(bytes: &mut Bytes<'_>) -> f64 {
    match bytes.below(48) {
        0 => f64::from_bits(bytes.number()),
        1 => bytes.between(-2e3, 2e3),
        2..=9 => bytes.below(31) as f64 - 0.5,
        10..=29 => bytes.below(31) as f64,
        _ => bytes.between(-3.0, 33.0),
    }
}

/// The pixels of a polygon, column by column: as often as its outline lies before a pixel in its column.
fn fill(polygon: &[f64], height: usize, width: usize) -> Vec<bool> {
    let fine = |x: f64| (FINE * x + 0.5).trunc();
    let corners: Vec<(f64, f64)> = polygon
        .chunks(2)
        .map(|xy| (fine(xy[0]), fine(xy[1])))
        .collect();
    let mut outline = Vec::new();
    for (i, &from) in corners.iter().enumerate() {
        draw(from, corners[(i + 1) % corners.len()], &mut outline);
    }
    let mut switched = vec![false; height * width + 1];
    for pair in outline.windows(2) {
        let (left, top) = (pair[0].0.min(pair[1].0), pair[0].1.min(pair[1].1));
        // the centres of pixels lie in the middle of five steps
        let column = (left - 2.0) / FINE;
        if pair[0].0 == pair[1].0 || column.fract() != 0.0 || column < 0.0 || column >= width as f64
        {
            continue;
        }
        let row = ((top + 0.5) / FINE - 0.5)
            .max(0.0)
            .min(height as f64)
            .ceil();
        let at = column as usize * height + row as usize;
        switched[at] = !switched[at];
    }
    let mut inside = false;
    switched[..height * width]
        .iter()
        .map(|&here| {
            inside ^= here;
            inside
        })
        .collect()
}

/// The fine points of an edge in its direction, its ends included.
fn draw(from: (f64, f64), to: (f64, f64), outline: &mut Vec<(f64, f64)>) {
    let (wide, high) = ((to.0 - from.0).abs(), (to.1 - from.1).abs());
    let flat = wide >= high;
    let length = wide.max(high) as u64;
    let backwards = if flat { from.0 > to.0 } else { from.1 > to.1 };
    let (start, end) = if backwards { (to, from) } else { (from, to) };
    let slope = match (length, flat) {
        (0, _) => 0.0,
        (_, true) => (end.1 - start.1) / wide,
        (_, false) => (end.0 - start.0) / high,
    };
    for step in 0..=length {
        let step = if backwards { length - step } else { step } as f64;
        outline.push(if flat {
            (start.0 + step, (start.1 + slope * step + 0.5).trunc())
        } else {
            ((start.0 + slope * step + 0.5).trunc(), start.1 + step)
        });
    }
}
