//! The part of a cloud that images see, and how many of the other points are left out for which reason.

use super::block::Block;
use super::camera::{Camera, Sights};
use super::cloud::Cloud;
use super::lanes::{LANES, Lanes};
use crate::bits::ones;
use crate::memory::{collect, with_room};
use crate::{Cancel, Error, Result};
use multiversion::multiversion;
use rayon::prelude::*;
use std::ops::Range;

/// Largest magnitude of a coordinate, in metres: beyond it squared distances lose their meaning.
const COORDINATE_LIMIT_M: f64 = 1e7;
/// Points handled by one task of the thread pool.
const POINTS_A_TASK: usize = 8192;

/// The points that at least one image sees, in the order of the cloud.
#[derive(Debug, Clone, PartialEq)]
pub struct InView {
    /// Rows of the cloud, ascending.
    pub indices: Vec<u32>,
    /// Coordinates in the lidar frame, in metres.
    pub points: Vec<[f64; 3]>,
    /// The points that each image sees.
    pub sightings: Vec<Sighting>,
    /// Numbers of the other points.
    pub counts: Counts,
}

/// The points that one image sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sighting {
    /// Positions in the list of the points in view, ascending.
    pub seen: Vec<u32>,
    /// Pixels: u (right), v (down).
    pub uv: Vec<[f64; 2]>,
}

impl Sighting {
    /// The part of the points at some positions in the list of those in view.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(crate) fn within(&self, positions: Range<usize>, cancel: &Cancel) -> Result<Self> {
        let place = |position: usize| self.seen.partition_point(|&at| (at as usize) < position);
        let kept = place(positions.start)..place(positions.end);
        Ok(Self {
            seen: collect(self.seen[kept.clone()].iter().copied(), cancel)?,
            uv: collect(self.uv[kept].iter().copied(), cancel)?,
        })
    }
}

/// Numbers of points that are not in view, by reason, and the extent of the usable ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Counts {
    /// Points with a coordinate that is not finite.
    pub nonfinite: usize,
    /// Points at exactly (0, 0, 0), which sensors write where there was no return.
    pub origin: usize,
    /// Points at or behind the smallest depth of every camera.
    pub behind: usize,
    /// Points in front of a camera, beside every image.
    pub outside: usize,
    /// Smallest finite x, y, z, in metres; infinite where there is none.
    pub min: [f64; 3],
    /// Largest finite x, y, z, in metres; minus infinite where there is none.
    pub max: [f64; 3],
}

/// The points of `cloud` whose nearest pixel lies in at least one image, of cameras with height and width of their
/// images in pixels.
///
/// A point at exactly (0, 0, 0) counts as no return unless `keep_origin` is set.
///
/// # Errors
/// [`Error::CoordinateOutOfRange`], [`Error::TooManyPoints`], [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn project(
    cloud: Cloud,
    images: &[(&Camera, [usize; 2])],
    keep_origin: bool,
    cancel: &Cancel,
) -> Result<InView> {
    let n = cloud.len();
    check_points(n)?;
    let starts: Vec<usize> = (0..n).step_by(POINTS_A_TASK).collect();
    let parts: Vec<Result<InView>> = starts
        .into_par_iter()
        .map(|start| {
            cancel.check()?;
            project_rows(
                cloud,
                start..n.min(start + POINTS_A_TASK),
                images,
                keep_origin,
            )
        })
        .collect();
    // taken in order, so that the first bad row is the one reported
    let parts = parts.into_iter().collect::<Result<Vec<InView>>>()?;
    InView::concatenate(&parts, images.len(), cancel)
}

/// Refuses clouds with more points than labels have rows for.
fn check_points(points: usize) -> Result<()> {
    if i32::try_from(points).is_ok() {
        return Ok(());
    }
    Err(Error::TooManyPoints {
        points,
        neighbors: 0,
        limit: i32::MAX as u64,
        of: "points",
    })
}

/// What images see of some rows, sixteen at a time: as many as look alike in every step.
#[multiversion(targets("x86_64+avx2+popcnt"))]
fn project_rows(
    cloud: Cloud<'_>,
    rows: Range<usize>,
    images: &[(&Camera, [usize; 2])],
    keep_origin: bool,
) -> Result<InView> {
    let mut part = InView::empty(images.len(), 0)?;
    let mut extent =
        [Lanes::all(f64::INFINITY), Lanes::all(f64::NEG_INFINITY)].map(|none| [none; 3]);
    let mut sights = with_room(images.len())?;
    for first in rows.clone().step_by(LANES) {
        let block = Block::new(cloud, first..rows.end.min(first + LANES));
        let usable = part.counts.usable(&block, &mut extent, keep_origin)?;
        let of_image = |&(camera, size): &(&Camera, _)| camera.sights(&block.xyz, size);
        sights.clear();
        sights.extend(images.iter().map(of_image));
        let any =
            |bits: fn(&Sights) -> u32| usable & sights.iter().fold(0, |all, of| all | bits(of));
        let (in_front, seen) = (any(|of| of.in_front), any(|of| of.seen));
        part.counts.behind += (usable & !in_front).count_ones() as usize;
        part.counts.outside += (in_front & !seen).count_ones() as usize;
        for lane in ones(seen) {
            for (sighting, of) in part.sightings.iter_mut().zip(&sights) {
                if of.seen >> lane & 1 == 1 {
                    sighting.seen.push(part.indices.len() as u32);
                    sighting.uv.push([of.uv[0][lane], of.uv[1][lane]]);
                }
            }
            part.indices.push((first + lane) as u32);
            part.points.push(block.point(lane));
        }
    }
    for axis in 0..3 {
        let [low, high] = extent.map(|of_axes| of_axes[axis].to_array().into_iter());
        part.counts.min[axis] = low.fold(part.counts.min[axis], f64::min);
        part.counts.max[axis] = high.fold(part.counts.max[axis], f64::max);
    }
    Ok(part)
}

impl InView {
    /// Position that a row of the cloud has, or would have, in the list of the points in view.
    pub(crate) fn place(&self, row: usize) -> usize {
        self.indices
            .partition_point(|&index| (index as usize) < row)
    }

    /// No point of `images` images, with room for `points`.
    fn empty(images: usize, points: usize) -> Result<Self> {
        Ok(Self {
            indices: with_room(points)?,
            points: with_room(points)?,
            sightings: vec![Sighting::default(); images],
            counts: Counts::default(),
        })
    }

    fn concatenate(parts: &[Self], images: usize, cancel: &Cancel) -> Result<Self> {
        let mut all = Self::empty(images, parts.iter().map(|part| part.indices.len()).sum())?;
        for (image, sighting) in all.sightings.iter_mut().enumerate() {
            let seen = parts
                .iter()
                .map(|part| part.sightings[image].seen.len())
                .sum();
            sighting.seen = with_room(seen)?;
            sighting.uv = with_room(seen)?;
        }
        for part in parts {
            cancel.check()?;
            let before = all.indices.len() as u32;
            for (sighting, own) in all.sightings.iter_mut().zip(&part.sightings) {
                sighting.seen.extend(own.seen.iter().map(|at| before + at));
                sighting.uv.extend_from_slice(&own.uv);
            }
            all.indices.extend_from_slice(&part.indices);
            all.points.extend_from_slice(&part.points);
            all.counts.merge(&part.counts);
        }
        Ok(all)
    }
}

impl Default for Counts {
    fn default() -> Self {
        Self {
            nonfinite: 0,
            origin: 0,
            behind: 0,
            outside: 0,
            min: [f64::INFINITY; 3],
            max: [f64::NEG_INFINITY; 3],
        }
    }
}

impl Counts {
    /// Bits of the usable points; counts the others, and takes all that are finite into the extent, least and largest.
    #[inline(always)]
    fn usable(
        &mut self,
        block: &Block,
        [min, max]: &mut [[Lanes; 3]; 2],
        keep_origin: bool,
    ) -> Result<u32> {
        let near = block.bits(|axis| axis.abs().up_to(COORDINATE_LIMIT_M));
        let usable = if near.count_ones() as usize == block.rows.len() {
            for axis in 0..3 {
                min[axis] = min[axis].min(block.xyz[axis]);
                max[axis] = max[axis].max(block.xyz[axis]);
            }
            near
        } else {
            self.usable_of_some(block, near)?
        };
        if keep_origin {
            return Ok(usable);
        }
        let origin = usable & block.bits(|axis| axis.is(0.0));
        self.origin += origin.count_ones() as usize;
        Ok(usable & !origin)
    }

    /// The same where only those of the bits `near` are within the limits.
    #[cold]
    fn usable_of_some(&mut self, block: &Block, near: u32) -> Result<u32> {
        for lane in 0..block.rows.len() {
            let xyz = block.point(lane);
            if near >> lane & 1 == 1 {
                for axis in 0..3 {
                    self.min[axis] = self.min[axis].min(xyz[axis]);
                    self.max[axis] = self.max[axis].max(xyz[axis]);
                }
            } else if !xyz.iter().all(|c| c.is_finite()) {
                self.nonfinite += 1;
            } else if let Some(&value) = xyz.iter().find(|c| c.abs() > COORDINATE_LIMIT_M) {
                return Err(Error::CoordinateOutOfRange {
                    row: block.rows.start + lane,
                    value,
                    limit: COORDINATE_LIMIT_M,
                });
            }
        }
        Ok(near)
    }

    fn merge(&mut self, other: &Self) {
        self.nonfinite += other.nonfinite;
        self.origin += other.origin;
        self.behind += other.behind;
        self.outside += other.outside;
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Distortion;
    use crate::projection::nearest_pixel;
    use crate::test_support::IDENTITY;
    use proptest::prelude::*;

    const PROJECTION: [f64; 12] = [100., 0., 50., 0., 0., 100., 40., 0., 0., 0., 1., 0.];

    /// The points in view of an image of 80 x 100 pixels, of those given in single precision.
    fn in_view(points: &[f32]) -> Result<InView> {
        let camera = Camera::new(&PROJECTION, &IDENTITY, 0.125).unwrap();
        let cloud = Cloud::F32 {
            values: points,
            columns: 3,
        };
        project(cloud, &[(&camera, [80, 100])], false, Cancel::never())
    }

    /// A coordinate of all kinds: near the camera and its edges, far, none.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![
            8 => -3.0..3.0_f64,
            2 => Just(0.0),
            1 => -1e7..1e7_f64,
            1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY)],
        ]
    }

    proptest! {
        #[test]
        fn points_are_seen_as_one_by_one(
            rows in proptest::collection::vec(proptest::array::uniform3(coordinate()), 0..70),
            single in any::<bool>(), columns in 3_usize..6, keep_origin in any::<bool>(), bent in any::<bool>(),
        ) {
            let forward = if bent {
                let lens = Distortion::Equidistant { k: [0.1, -0.02, 0.001, 0.0] };
                let k = [100., 0., 50., 0., 100., 40., 0., 0., 1.];
                Camera::with_distortion(&k, lens, &IDENTITY, 0.125).unwrap()
            } else {
                Camera::new(&PROJECTION, &IDENTITY, 0.125).unwrap()
            };
            let mut turned = IDENTITY;
            (turned[0], turned[10]) = (-1.0, -1.0);
            let backward = Camera::new(&PROJECTION, &turned, 0.125).unwrap();
            let images = [(&forward, [80, 100]), (&backward, [60, 90])];
            let doubles: Vec<f64> = rows.iter().flat_map(|xyz| (0..columns).map(|c| if c < 3 { xyz[c] } else { f64::NAN })).collect();
            let floats: Vec<f32> = doubles.iter().map(|&value| value as f32).collect();
            let cloud = if single {
                Cloud::F32 { values: &floats, columns }
            } else {
                Cloud::F64 { values: &doubles, columns }
            };
            let found = project(cloud, &images, keep_origin, Cancel::never()).unwrap();
            let mut expected = InView::empty(2, 0).unwrap();
            let counts = &mut expected.counts;
            for row in 0..rows.len() {
                let xyz = cloud.xyz(row);
                if !xyz.iter().all(|c| c.is_finite()) {
                    counts.nonfinite += 1;
                    continue;
                }
                for axis in 0..3 {
                    counts.min[axis] = counts.min[axis].min(xyz[axis]);
                    counts.max[axis] = counts.max[axis].max(xyz[axis]);
                }
                if xyz == [0.0; 3] && !keep_origin {
                    counts.origin += 1;
                    continue;
                }
                let (mut in_front, mut seen) = (false, false);
                for (sighting, (camera, [height, width])) in expected.sightings.iter_mut().zip(images) {
                    let [u, v, depth] = camera.project(&xyz);
                    in_front |= depth > 0.125;
                    if depth > 0.125 && nearest_pixel([u, v], height, width).is_some() {
                        seen = true;
                        sighting.seen.push(expected.indices.len() as u32);
                        sighting.uv.push([u, v]);
                    }
                }
                if seen {
                    expected.indices.push(row as u32);
                    expected.points.push(xyz);
                }
                counts.outside += usize::from(in_front && !seen);
                counts.behind += usize::from(!in_front);
            }
            prop_assert_eq!(found, expected);
        }
    }

    #[test]
    fn a_point_on_the_axis_falls_on_the_principal_point() {
        let in_view = in_view(&[0., 0., 10.]).unwrap();
        assert_eq!(in_view.sightings[0].uv, [[50., 40.]]);
    }

    #[test]
    fn points_behind_beside_and_missing_are_counted_and_left_out() {
        let nan = f32::NAN;
        let in_view = in_view(&[
            0., 0., -10., 0., 0., 1e-30, 100., 0., 1., nan, 0., 1., 0., 0., 0., 0., 0., 2.,
        ])
        .unwrap();
        assert_eq!(in_view.indices, [5]);
        let Counts {
            behind,
            outside,
            nonfinite,
            origin,
            ..
        } = in_view.counts;
        assert_eq!([behind, outside, nonfinite, origin], [2, 1, 1, 1]);
    }

    #[test]
    fn a_point_at_the_smallest_depth_is_not_in_view() {
        let in_view = in_view(&[0., 0., 0.125, 0., 0., 0.125_f32.next_up()]).unwrap();
        assert_eq!((in_view.indices, in_view.counts.behind), (vec![1], 1));
    }

    #[test]
    fn a_coordinate_beyond_the_limit_names_its_row() {
        let limit = COORDINATE_LIMIT_M as f32;
        assert_eq!(in_view(&[limit, -limit, 1.]).unwrap().counts.outside, 1);
        let error = in_view(&[0., 0., 1., 0., limit.next_up(), 1.]).unwrap_err();
        assert!(
            matches!(error, Error::CoordinateOutOfRange { row: 1, .. }),
            "{error}"
        );
    }

    #[test]
    fn there_are_at_most_as_many_points_as_labels_have_rows_for() {
        let most = i32::MAX as usize;
        assert!(check_points(most).is_ok() && check_points(most + 1).is_err());
    }

    #[test]
    fn an_image_sees_points_by_their_positions_among_those_in_view() {
        let forward = Camera::new(&PROJECTION, &IDENTITY, 0.125).unwrap();
        let mut turned = IDENTITY;
        (turned[0], turned[10]) = (-1.0, -1.0);
        let backward = Camera::new(&PROJECTION, &turned, 0.125).unwrap();
        let cloud = Cloud::F64 {
            values: &[0., 0., 2., 0., 0., 0.1, 0., 0., -2.],
            columns: 3,
        };
        let images = [(&forward, [80, 100]), (&backward, [80, 100])];
        let in_view = project(cloud, &images, false, Cancel::never()).unwrap();
        assert_eq!((in_view.indices, in_view.counts.behind), (vec![0, 2], 1));
        assert_eq!(in_view.sightings[0].seen, [0]);
        assert_eq!(in_view.sightings[1].seen, [1]);
    }
}
