//! Depth groups: of the points that a mask shows, those that are its object, by their distance to the camera.
//!
//! A mask also shows what stands before its object, and at its edge and through its windows what lies behind. Points
//! that stand on the ground are put into groups by distance; the group with the most weight is the object.

mod edges;
mod groups;
mod pixels;

use crate::masks::InstanceMasks;
use crate::memory::{collect, push, zeros};
use crate::neighbors::arrange;
use crate::{Cancel, Params, Result, Rle};
use edges::Edges;
use groups::{Cells, object_of};
use pixels::Pixels;
use rayon::prelude::*;

/// Distance, in metres, by which an object may be nearer or farther at another moment: it may move, and poses are off.
const MOVED_M: f64 = 1.0;
/// Values above which the two halves are sorted by two threads.
const PARALLEL: usize = 1 << 16;

/// What depth says of the points that one image sees and of its masks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct DepthGroups {
    /// Nearest and farthest distance of the object of each mask to the camera, in metres; none where no point that
    /// stands on the ground falls on the mask, so that there is no object.
    pub intervals: Vec<Option<[f64; 2]>>,
    /// Distance of each point to the camera, in metres.
    pub distances: Vec<f64>,
    /// For each point, true if it stands beside the edge of a mask, as far away as its object: the mask may have missed
    /// it, so that background pixels say nothing.
    pub unsure: Vec<bool>,
}

impl DepthGroups {
    /// True if a point takes `label` from pixels: the background where the masks are sure of it, an instance at the
    /// distance of its object.
    pub fn admits(&self, point: usize, label: u32) -> bool {
        let distance = self.distances[point];
        match label.checked_sub(1) {
            None => !self.unsure[point],
            Some(m) => self.intervals[m as usize]
                .is_some_and(|[near, far]| near <= distance && distance <= far),
        }
    }

    /// The same objects, and some of the points, in the order of `points`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(crate) fn of_points(&self, points: &[u32], cancel: &Cancel) -> Result<Self> {
        Ok(Self {
            intervals: self.intervals.clone(),
            distances: arrange(points, &self.distances, cancel)?,
            unsure: arrange(points, &self.unsure, cancel)?,
        })
    }

    /// The same objects, and points of other moments at `distances` from the camera in metres. An object that no point of
    /// its own moment falls on is at any distance.
    pub(crate) fn at_other_moments(&self, distances: Vec<f64>) -> Self {
        let moved = |interval: &Option<[f64; 2]>| {
            let [near, far] = interval.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            Some([near - MOVED_M, far + MOVED_M])
        };
        Self {
            intervals: self.intervals.iter().map(moved).collect(),
            distances,
            unsure: Vec::new(),
        }
    }
}

impl InstanceMasks {
    /// The depth groups of points at the pixels `uv` and at `distances` (metres) from the camera; `standing` are those
    /// off the ground. Of `params`, `depth_gap`, `bridged_gap` and `edge_margin` count.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub fn depth_groups(
        &self,
        uv: &[[f64; 2]],
        distances: Vec<f64>,
        standing: &[bool],
        params: &Params,
        cancel: &Cancel,
    ) -> Result<DepthGroups> {
        let pixels = Pixels::of(
            (uv, &distances),
            standing,
            [self.height(), self.width()],
            cancel,
        )?;
        let of_mask = |mask: &Rle| {
            cancel.check()?;
            let Some(edges) = Edges::of(mask, params.edge_margin, cancel)? else {
                return Ok(None);
            };
            let (mut cells, mut beside) = (Cells::new(params), Vec::new());
            for column in edges.columns() {
                cancel.check()?;
                for point in pixels.of_column(column) {
                    match edges.steps_at([column, point.row as usize]) {
                        0 => {}
                        steps @ 1.. => cells.add(point.distance, steps.unsigned_abs().into())?,
                        _ => push(&mut beside, (point.distance, point.number))?,
                    }
                }
            }
            sort(&mut beside, cancel)?;
            let distances = collect(beside.iter().map(|&(distance, _)| distance), cancel)?;
            let Some([near, far]) = object_of(&cells, &distances, params) else {
                return Ok(None);
            };
            beside.retain(|(distance, _)| (near..=far).contains(distance));
            Ok(Some(([near, far], beside)))
        };
        let found = self.masks().par_iter().map(of_mask);
        let found = found.collect::<Result<Vec<_>>>()?;
        let mut unsure = zeros(uv.len(), cancel)?;
        if params.edge_margin > 0.0 {
            let points = found.iter().flatten().flat_map(|(_, beside)| beside);
            points.for_each(|&(_, point)| unsure[point as usize] = true);
        }
        let intervals = found
            .into_iter()
            .map(|found| found.map(|(interval, _)| interval))
            .collect();
        Ok(DepthGroups {
            intervals,
            distances,
            unsure,
        })
    }
}

/// Sorts points by their distance, ascending.
fn sort(points: &mut [(f64, u32)], cancel: &Cancel) -> Result<()> {
    let compare = |one: &(f64, u32), other: &(f64, u32)| one.0.total_cmp(&other.0);
    if points.len() <= PARALLEL {
        points.sort_unstable_by(compare);
        return Ok(());
    }
    cancel.check()?;
    let middle = points.len() / 2;
    points.select_nth_unstable_by(middle, compare);
    let (near, far) = points.split_at_mut(middle);
    let (near, far) = rayon::join(|| sort(near, cancel), || sort(far, cancel));
    near.and(far)
}
