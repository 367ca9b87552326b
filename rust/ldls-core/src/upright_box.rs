//! The upright box that fits points of which a lidar sees one side or two.

use multiversion::multiversion;
use std::cmp::Ordering;
use std::f64::consts::FRAC_PI_2;

/// Headings that are tried, equally far apart: a rectangle comes round to itself after a quarter turn.
const HEADINGS: usize = 90;
/// Distance from a side, in metres, up to which points count the same: sides bulge, and ranges are noisy.
const NEAR_M: f64 = 0.1;
/// Share of the best closeness from which on area decides.
const AS_GOOD: f64 = 0.998;
/// Share of the points at either end that do not decide where a side is.
const STRAY: f64 = 0.04;
/// Points, evenly chosen in the order of their heights, that decide on the heading, and how many of them at most are stray at one
/// end.
const MOST_LOOKED_AT: usize = 150;
const MOST_STRAY: usize = (STRAY * MOST_LOOKED_AT as f64) as usize;

/// A box with level top and bottom.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UprightBox {
    /// x, y and z of its middle, in metres.
    pub center: [f64; 3],
    /// Length, width and height in metres; the length is the longer side on the ground.
    pub size: [f64; 3],
    /// Angle in radians from the x axis to the length, anticlockwise, above -pi/2 and up to pi/2.
    pub yaw: f64,
}

impl UprightBox {
    /// The box around `points` (x, y and z in metres) whose sides run along the sides that the lidar saw; none around none.
    ///
    /// Of 90 headings it has the one at which points lie nearest to two sides that meet (closeness, of Zhang et al.,
    /// Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017), and of those as good as that, the
    /// one of least area. Stray points do not decide where sides are, and of more than 150 points some decide; the box holds all.
    /// The order of the points does not matter.
    pub fn around(points: &[[f64; 3]]) -> Option<Self> {
        let first = points.first()?;
        // which are the same whatever way the axes on the ground point
        let mut sorted: Vec<[f64; 3]> = points.iter().map(|&[x, y, z]| [z, x, y]).collect();
        sorted.sort_unstable_by(|one, other| {
            let axes = one
                .iter()
                .zip(other)
                .map(|(one, other)| one.total_cmp(other));
            axes.fold(Ordering::Equal, Ordering::then)
        });
        let step = sorted.len().div_ceil(MOST_LOOKED_AT);
        let some = sorted.iter().step_by(step).map(|&[_, x, y]| [x, y]);
        let heading = best_heading(&some.collect::<Vec<_>>());
        let (sin, cos) = heading.sin_cos();
        let turned = |[x, y, z]: &[f64; 3]| [cos * x + sin * y, cos * y - sin * x, *z];
        let [mut low, mut high] = [turned(first); 2];
        for place in points.iter().map(turned) {
            for axis in 0..3 {
                low[axis] = low[axis].min(place[axis]);
                high[axis] = high[axis].max(place[axis]);
            }
        }
        let [along, across, up] = [0, 1, 2].map(|axis| f64::midpoint(low[axis], high[axis]));
        let [length, width, height] = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let (size, yaw) = if width > length {
            // a heading of 0 would turn to -pi/2, which is pi/2
            let turned = if heading > 0.0 {
                heading - FRAC_PI_2
            } else {
                FRAC_PI_2
            };
            ([width, length, height], turned)
        } else {
            ([length, width, height], heading)
        };
        Some(Self {
            center: [cos * along - sin * across, sin * along + cos * across, up],
            size,
            yaw,
        })
    }
}

/// The heading that fits `places` (x and y, of no more than [`MOST_LOOKED_AT`] points) best, in radians from 0 to pi/2.
#[multiversion(targets("x86_64+avx2"))]
fn best_heading(places: &[[f64; 2]]) -> f64 {
    let mut fits = [(0.0, 0.0); HEADINGS];
    let (mut along, mut across) = ([0.0; MOST_LOOKED_AT], [0.0; MOST_LOOKED_AT]);
    let (along, across) = (&mut along[..places.len()], &mut across[..places.len()]);
    for (number, fit) in fits.iter_mut().enumerate() {
        let (sin, cos) = heading_of(number).sin_cos();
        for (([x, y], along), across) in places.iter().zip(&mut *along).zip(&mut *across) {
            *along = cos * x + sin * y;
            *across = cos * y - sin * x;
        }
        let [length, width] = [Side::of(along), Side::of(across)];
        let to_sides = along.iter().zip(&*across);
        let to_sides = to_sides.map(|(a, b)| (a - length.near).abs().min((b - width.near).abs()));
        let closeness: f64 = to_sides.map(|to_side| 1.0 / to_side.max(NEAR_M)).sum();
        *fit = (closeness, length.extent * width.extent);
    }
    let closest = fits.iter().fold(0.0, |most: f64, fit| most.max(fit.0));
    let as_good = fits
        .iter()
        .enumerate()
        .filter(|(_, fit)| fit.0 >= AS_GOOD * closest);
    let best = as_good.min_by(|(_, one), (_, other)| one.1.total_cmp(&other.1));
    heading_of(best.map_or(0, |(number, _)| number))
}

/// The heading of a number, in radians.
fn heading_of(number: usize) -> f64 {
    number as f64 * FRAC_PI_2 / HEADINGS as f64
}

/// Places along an axis.
struct Side {
    /// The end of them to which they are nearer as a whole, stray ones left out.
    near: f64,
    /// From the first to the last.
    extent: f64,
}

impl Side {
    fn of(places: &[f64]) -> Self {
        let stray = (STRAY * places.len().saturating_sub(1) as f64) as usize;
        // the lowest and the highest, so many as may be stray and one more, from the end inwards
        let [mut low, mut high] = [[f64::INFINITY; MOST_STRAY + 1]; 2];
        let mut sum = 0.0;
        for &place in places {
            sum += place;
            keep_lowest(&mut low[..=stray], place);
            keep_lowest(&mut high[..=stray], -place);
        }
        let [first, last] = [low[stray], -high[stray]];
        // the sum of the squared distances is less to that end on whose side of the middle the mean is
        let is_low = sum / (places.len() as f64) < f64::midpoint(first, last);
        Self {
            near: if is_low { first } else { last },
            extent: -high[0] - low[0],
        }
    }
}

/// Puts `value` among the `lowest`, which ascend, if it is one of them.
#[inline(always)]
fn keep_lowest(lowest: &mut [f64], value: f64) {
    let mut at = lowest.len() - 1;
    if lowest[at] > value {
        while at > 0 && lowest[at - 1] > value {
            lowest[at] = lowest[at - 1];
            at -= 1;
        }
        lowest[at] = value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_length_runs_along_the_longer_of_two_sides_that_meet() {
        for yaw_degrees in [-60_i32, 0, 25, 90] {
            let yaw = f64::from(yaw_degrees).to_radians();
            let turned = |x: f64, y: f64, z: f64| {
                let (sin, cos) = yaw.sin_cos();
                [cos * x - sin * y + 10.0, sin * x + cos * y - 3.0, z]
            };
            let side = (0..=40).map(|i| turned(-2.0 + 0.1 * f64::from(i), 1.0, -1.0));
            let rear = (0..=20).map(|i| turned(2.0, -1.0 + 0.1 * f64::from(i), 0.5));
            let found = UprightBox::around(&side.chain(rear).collect::<Vec<_>>()).unwrap();
            let expected = [[10.0, -3.0, -0.25], [4.0, 2.0, 1.5]];
            for (found, expected) in [found.center, found.size]
                .iter()
                .flatten()
                .zip(expected.as_flattened())
            {
                assert!((found - expected).abs() < 1e-9, "{found} for {expected}");
            }
            assert!((found.yaw - yaw).abs() < 1e-9);
        }
    }

    #[test]
    fn the_order_of_the_points_does_not_matter() {
        // an oval, which fits many headings nearly as well, in golden steps around it
        let mut points: Vec<[f64; 3]> = (0..1000)
            .map(|i| (f64::from(i) * 2.4).sin_cos())
            .map(|(sin, cos)| [1.3 * cos, sin, 0.0])
            .collect();
        let found = UprightBox::around(&points);
        points.reverse();
        assert_eq!(UprightBox::around(&points), found);
        points.rotate_left(1);
        assert_eq!(UprightBox::around(&points), found);
    }

    #[test]
    fn the_lowest_values_ascend() {
        let mut lowest = [f64::INFINITY; 3];
        for value in [5.0, 2.0, 9.0, 2.0, 7.0, 1.0] {
            keep_lowest(&mut lowest, value);
        }
        assert_eq!(lowest, [1.0, 2.0, 2.0]);
    }

    #[test]
    fn there_is_no_box_around_no_points() {
        assert_eq!(UprightBox::around(&[]), None);
        let one = UprightBox::around(&[[3.0, 4.0, 5.0]]).unwrap();
        assert_eq!((one.center, one.size), ([3.0, 4.0, 5.0], [0.0; 3]));
    }
}
