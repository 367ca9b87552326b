//! Which points of a cloud the cameras of a ring see, and where they fall on each image.

use super::RingView;
use crate::Result;
use crate::projection::{Cloud, Sight, View, ViewCounts};
use rayon::prelude::*;
use std::ops::Range;

/// Points handled by one task of the thread pool.
const BLOCK: usize = 4096;
/// Entry for points that a camera does not see.
pub(crate) const UNSEEN: u32 = u32::MAX;

/// Points that one camera sees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sighting {
    /// Positions in the list of points that any camera sees, ascending.
    pub seen: Vec<u32>,
    /// Where they fall: u (right), v (down), in pixels.
    pub uv: Vec<[f64; 2]>,
}

impl Sighting {
    /// Where each of `n` points stands in this sighting.
    pub(crate) fn slots(&self, n: usize) -> Vec<u32> {
        let mut slots = vec![UNSEEN; n];
        for (slot, &point) in self.seen.iter().enumerate() {
            slots[point as usize] = slot as u32;
        }
        slots
    }
}

/// The points that any camera sees, and which cameras see them.
pub(crate) fn sight_all(
    cloud: Cloud,
    views: &[RingView],
    keep_origin: bool,
) -> Result<(View, Vec<Sighting>)> {
    let n = cloud.len();
    let starts: Vec<usize> = (0..n).step_by(BLOCK).collect();
    let blocks: Vec<Result<(View, Vec<Sighting>)>> = starts
        .into_par_iter()
        .map(|start| sight_rows(cloud, start..n.min(start + BLOCK), views, keep_origin))
        .collect();
    let mut all = View::default();
    let mut sightings = vec![Sighting::default(); views.len()];
    // taken in order, so that the first bad row is the one reported
    for block in blocks {
        let (view, seen_by) = block?;
        let before = all.indices.len() as u32;
        for (sighting, part) in sightings.iter_mut().zip(seen_by) {
            sighting.seen.extend(part.seen.iter().map(|at| before + at));
            sighting.uv.extend(part.uv);
        }
        all.indices.extend(view.indices);
        all.points.extend(view.points);
        all.counts.merge(&view.counts);
    }
    Ok((all, sightings))
}

fn sight_rows(
    cloud: Cloud,
    rows: Range<usize>,
    views: &[RingView],
    keep_origin: bool,
) -> Result<(View, Vec<Sighting>)> {
    let mut view = View::default();
    let mut sightings = vec![Sighting::default(); views.len()];
    for row in rows {
        let Some(xyz) = view.counts.usable(cloud, row, keep_origin)? else {
            continue;
        };
        let mut seen = false;
        let mut in_front = false;
        for (sighting, one) in sightings.iter_mut().zip(views) {
            let (height, width) = (one.masks.height(), one.masks.width());
            match one.camera.sight(&xyz, height, width) {
                Sight::Behind => {}
                Sight::Outside => in_front = true,
                Sight::Seen(uv) => {
                    seen = true;
                    sighting.seen.push(view.indices.len() as u32);
                    sighting.uv.push(uv);
                }
            }
        }
        if seen {
            view.indices.push(row as u32);
            view.points.push(xyz);
        } else {
            count_unseen(&mut view.counts, in_front);
        }
    }
    Ok((view, sightings))
}

fn count_unseen(counts: &mut ViewCounts, in_front: bool) {
    if in_front {
        counts.outside += 1;
    } else {
        counts.behind += 1;
    }
}
