//! The part of a cloud that images see, and how many of the other points are left out for which reason.

use super::camera::{Camera, Sight};
use super::cloud::Cloud;
use crate::memory::with_room;
use crate::{Cancel, Error, Result};
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
    pub(crate) fn within(mut self, positions: Range<usize>) -> Self {
        let place = |position: usize| self.seen.partition_point(|&at| (at as usize) < position);
        let kept = place(positions.start)..place(positions.end);
        self.uv.truncate(kept.end);
        self.uv.drain(..kept.start);
        self.seen.truncate(kept.end);
        self.seen.drain(..kept.start);
        self
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

fn project_rows(
    cloud: Cloud,
    rows: Range<usize>,
    images: &[(&Camera, [usize; 2])],
    keep_origin: bool,
) -> Result<InView> {
    let mut part = InView::empty(images.len(), 0)?;
    for row in rows {
        let Some(xyz) = part.counts.usable(cloud, row, keep_origin)? else {
            continue;
        };
        let (mut seen, mut in_front) = (false, false);
        for (sighting, (camera, [height, width])) in part.sightings.iter_mut().zip(images) {
            match camera.sight(&xyz, *height, *width) {
                Sight::Behind => {}
                Sight::Outside => in_front = true,
                Sight::Seen(uv) => {
                    seen = true;
                    sighting.seen.push(part.indices.len() as u32);
                    sighting.uv.push(uv);
                }
            }
        }
        if seen {
            part.indices.push(row as u32);
            part.points.push(xyz);
        } else {
            part.counts.outside += usize::from(in_front);
            part.counts.behind += usize::from(!in_front);
        }
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
    /// The point of a row, if it is usable; counts it otherwise.
    fn usable(&mut self, cloud: Cloud, row: usize, keep_origin: bool) -> Result<Option<[f64; 3]>> {
        let xyz = cloud.xyz(row);
        // written so that NaN fails
        if let Some(&value) = xyz.iter().find(|c| !(c.abs() <= COORDINATE_LIMIT_M)) {
            if !xyz.iter().all(|c| c.is_finite()) {
                self.nonfinite += 1;
                return Ok(None);
            }
            return Err(Error::CoordinateOutOfRange {
                row,
                value,
                limit: COORDINATE_LIMIT_M,
            });
        }
        for (axis, &c) in xyz.iter().enumerate() {
            self.min[axis] = self.min[axis].min(c);
            self.max[axis] = self.max[axis].max(c);
        }
        if xyz == [0.0; 3] && !keep_origin {
            self.origin += 1;
            return Ok(None);
        }
        Ok(Some(xyz))
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

    const IDENTITY: [f64; 16] = [
        1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
    ];
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
