//! Depth groups: of the points that a mask shows, those that are its object, by their distance to the camera.
//!
//! A mask also shows what stands before its object, and at its edge and through its windows what lies behind. Points
//! that stand on the ground are put into groups by distance; the group with the most weight is the object.

mod edges;
mod groups;

use crate::masks::InstanceMasks;
use crate::projection::nearest_pixel;
use crate::{Params, Rle};
use edges::Edges;
use groups::{Member, object_of};
use rayon::prelude::*;

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
}

impl InstanceMasks {
    /// The depth groups of points at the pixels `uv` and at `distances` (metres) from the camera; `standing` are those
    /// off the ground. Of `params`, `depth_gap`, `bridged_gap` and `edge_margin` count.
    pub fn depth_groups(
        &self,
        uv: &[[f64; 2]],
        distances: Vec<f64>,
        standing: &[bool],
        params: &Params,
    ) -> DepthGroups {
        let pixel = |(point, &uv): (usize, &[f64; 2])| {
            let pixel = nearest_pixel(uv, self.height(), self.width())?;
            standing[point].then_some((point, pixel))
        };
        let standing: Vec<(usize, [usize; 2])> = uv.iter().enumerate().filter_map(pixel).collect();
        let of_mask = |mask: &Rle| {
            let edges = Edges::of(mask, params.edge_margin)?;
            let (mut members, mut beside) = (Vec::new(), Vec::new());
            for &(point, pixel) in &standing {
                let distance = distances[point];
                match edges.steps_at(pixel) {
                    0 => {}
                    steps @ 1.. => members.push(Member {
                        distance,
                        weight: u64::from(steps.unsigned_abs()),
                    }),
                    _ => beside.push((distance, point)),
                }
            }
            beside.sort_unstable_by(|one, other| one.0.total_cmp(&other.0));
            let distances: Vec<f64> = beside.iter().map(|&(distance, _)| distance).collect();
            let [near, far] = object_of(members, &distances, params)?;
            let shared = beside
                .iter()
                .filter(|(distance, _)| (near..=far).contains(distance));
            let points: Vec<usize> = shared.map(|&(_, point)| point).collect();
            Some(([near, far], points))
        };
        let found: Vec<_> = self.masks().par_iter().map(of_mask).collect();
        let mut unsure = vec![false; uv.len()];
        if params.edge_margin > 0.0 {
            let points = found.iter().flatten().flat_map(|(_, points)| points);
            points.for_each(|&point| unsure[point] = true);
        }
        let intervals = found
            .into_iter()
            .map(|found| found.map(|(interval, _)| interval))
            .collect();
        DepthGroups {
            intervals,
            distances,
            unsure,
        }
    }
}
