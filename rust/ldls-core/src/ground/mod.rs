//! The ground below a cloud: how high each point lies above it.
//!
//! A surface of degree 5 through the lowest points follows slopes and bends where lines are sparse and where objects hide the
//! ground; a local offset follows kerbs and lawns where enough of the ground is seen.

mod local;
mod surface;

use crate::memory::{filled, tabulate};
use crate::{Camera, Cancel, Result};
use local::Cells;
use surface::Surface;

/// Heights between which points belong to the ground, in metres: lower ones lie in a pit or under a surface that is not
/// the ground, and up to the upper one there are the noise of a lidar and tufts of grass.
pub const GROUND_M: [f64; 2] = [-0.3, 0.15];

/// Height of each of `points` (metres) above the ground that `camera` stands on, NaN where none is found.
///
/// Up is z of the lidar frame, or -y where the camera looks along its z. `local` asks for the local offset.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub fn ground_heights(
    points: &[[f64; 3]],
    camera: &Camera,
    local: bool,
    cancel: &Cancel,
) -> Result<Vec<f64>> {
    let places = tabulate(points.len(), |i| camera.upright(&points[i]), cancel)?;
    // each is work for one thread alone
    let (surface, cells) = rayon::join(
        || Surface::fit(&places, cancel),
        || local.then(|| Cells::of(&places, cancel)).transpose(),
    );
    let (Some(surface), cells) = (surface?, cells?) else {
        return filled(f64::NAN, points.len(), cancel);
    };
    let mut heights = tabulate(places.len(), |i| surface.height(&places[i]), cancel)?;
    if let Some(cells) = cells {
        cells.level(&mut heights, cancel)?;
    }
    Ok(heights)
}

/// True for a point of the ground, by its height above it in metres.
pub fn is_ground(height: f64) -> bool {
    GROUND_M[0] < height && height < GROUND_M[1]
}

/// True for a point of the ground that lies lower above it than `clearance`, both in metres; at 0 for none.
pub fn is_cleared(height: f64, clearance: f64) -> bool {
    clearance > 0.0 && GROUND_M[0] < height && height < clearance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support;

    fn heights_of(points: &[[f64; 3]], camera: &Camera) -> Vec<f64> {
        ground_heights(points, camera, true, Cancel::never()).unwrap()
    }

    /// A camera at the origin of a lidar frame with z upwards that looks along x.
    fn camera_ahead() -> Camera {
        let t = [
            0., -1., 0., 0., 0., 0., -1., 0., 1., 0., 0., 0., 0., 0., 0., 1.,
        ];
        Camera::new(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0.], &t, 0.1).unwrap()
    }

    /// A plain that rises by 5 %, with a pavement 0.12 m higher beside it and a wall.
    fn street() -> Vec<([f64; 3], f64)> {
        let mut points = Vec::new();
        for i in 0..200 {
            for j in 0..40 {
                let (x, y) = (4.0 + 0.2 * f64::from(i), -4.0 + 0.2 * f64::from(j));
                let up = if y > 2.0 { 0.12 } else { 0.0 };
                points.push(([x, y, 0.05 * x + up - 1.7], 0.0));
            }
            let x = 4.0 + 0.2 * f64::from(i);
            points.extend((0..10).map(|k| {
                let up = 0.3 + 0.2 * f64::from(k);
                ([x, 4.5, 0.05 * x + 0.12 + up - 1.7], up)
            }));
        }
        points
    }

    #[test]
    fn heights_are_those_above_road_and_pavement() {
        let (points, truth): (Vec<_>, Vec<_>) = street().into_iter().unzip();
        let heights = heights_of(&points, &camera_ahead());
        let off = |tolerance: f64| {
            let pairs = heights.iter().zip(&truth);
            pairs
                .filter(|(found, up)| (*found - *up).abs() > tolerance)
                .count()
        };
        assert!(off(0.05) < points.len() / 20, "{} are off", off(0.05));
        assert_eq!(off(0.25), 0);
    }

    #[test]
    fn a_cloud_without_ground_has_no_heights() {
        let wall: Vec<[f64; 3]> = (0..900)
            .map(|i| [9.0, f64::from(i % 30), f64::from(i / 30)])
            .collect();
        for points in [&wall[..2], &[]] {
            assert!(
                heights_of(points, &camera_ahead())
                    .iter()
                    .all(|height| height.is_nan())
            );
        }
    }

    #[test]
    fn a_cloud_in_the_frame_of_the_camera_is_upright_too() {
        let (points, _): (Vec<_>, Vec<_>) = street().into_iter().unzip();
        let turned: Vec<[f64; 3]> = points.iter().map(|&[x, y, z]| [-y, -z, x]).collect();
        let own = test_support::camera(20.0);
        assert_eq!(
            heights_of(&turned, &own),
            heights_of(&points, &camera_ahead())
        );
    }

    #[test]
    fn a_ground_above_the_camera_is_none() {
        let (points, _): (Vec<_>, Vec<_>) = street().into_iter().unzip();
        let above: Vec<[f64; 3]> = points.iter().map(|&[x, y, z]| [x, y, z + 3.0]).collect();
        let heights = heights_of(&above, &camera_ahead());
        assert!(heights.iter().all(|height| height.is_nan()));
    }

    #[test]
    fn pits_are_not_ground() {
        assert!(is_ground(0.1) && is_ground(-0.2));
        assert!(!is_ground(0.2) && !is_ground(-0.4) && !is_ground(f64::NAN));
        let cleared = |clearance| {
            [0.01, 0.05, -1.0, -0.1, f64::NAN].map(|height| is_cleared(height, clearance))
        };
        assert_eq!(cleared(0.04), [true, false, false, true, false]);
        assert_eq!(cleared(0.0), [false; 5]);
    }
}
