//! Which label each lane of each pass over the graph stands for, and where.
//!
//! A label comes one edge farther with every step. In a large cloud most stay far from most others, and those that never come to
//! the same block share a lane: a pass holds more of them, and fewer groups of lanes are in use at any place.

use super::lane_order::{extents, in_order};
use super::schedule::{BLOCK, Schedule};
use super::spread::{Blocks, spread};
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::filled;
use crate::{Cancel, Real, Result};
use std::cmp::Reverse;
use std::ops::Range;

/// Most groups of a pass: one bit each says which of them are in use, and one of 64 bits which of their lanes have a seed.
pub(super) const MOST_GROUPS: usize = 8;
/// Points from which on a pass has a single group: each takes 64 bytes a point.
const MANY_POINTS: usize = 1 << 20;
/// Blocks from which on lanes are shared: in a frame of one camera most labels come to most of it.
const SHARED_FROM: usize = (1 << 15) / BLOCK;
/// Share of the blocks, for each group that there would be, in which labels that are to share lanes may go on: to follow them
/// through a block takes as long as two groups take for a step there, and not all groups are spared.
const AWAKE_A_GROUP: f64 = 1.0 / 16.0;
/// Lane of the background in the pass that has it.
pub(super) const BACKGROUND_LANE: usize = 0;
/// Lanes of the probe.
pub(super) const PROBE_LANES: usize = 2;
/// The group of lanes that they are in.
pub(super) const PROBE_GROUP: usize = 0;
/// Label of a lane where it has none.
const NONE: u32 = u32::MAX;

/// The lanes of one pass.
#[derive(Debug)]
pub(super) struct Plan {
    /// Each label, and the lane that it has wherever it comes.
    pub(super) lanes: Vec<(u32, usize)>,
    /// First lane of the probe, where the pass has it.
    pub(super) probe: Option<usize>,
    /// Lane of the sum of all labels of the pass, where it has it: there the values differ from the sum of theirs by rounding alone.
    pub(super) sum: Option<usize>,
    /// Number of groups of lanes.
    pub(super) groups: usize,
    /// Lanes of a group.
    pub(super) width: usize,
    /// Label of each lane: block after block, or once for all of them where none is shared.
    labels: Vec<u32>,
    /// Distance of the labels of a block from those of the next.
    stride: usize,
}

/// What makes the plans of passes, from labels and their seeds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planner<'a> {
    pub(super) schedule: &'a Schedule,
    /// Lanes of a group.
    pub(super) width: usize,
    /// Whether the first has the probe: all labels times factors, of which only the mean of the last two terms of the series is
    /// summed. It shows how large the terms left out may be.
    pub(super) probe: bool,
    /// Whether it has a lane of the sum of its labels, too.
    pub(super) sum: bool,
    /// Most steps of each.
    pub(super) steps: usize,
}

impl Planner<'_> {
    /// The passes that `labels` take over the graph `a` from their seeds in `b`. Labels without a seed need no lane.
    ///
    /// The first group, which the background keeps busy everywhere, takes the labels with the most seeds, or where lanes are
    /// shared those that come farthest.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn plan<T: Real>(
        &self,
        (a, b): (&PointGraph<T>, &PixelLabels<T>),
        labels: &[u32],
        cancel: &Cancel,
    ) -> Result<Vec<Plan>> {
        let background = labels.contains(&0);
        let mut own = usize::from(background);
        let probe = self.probe.then_some(own);
        own += probe.map_or(0, |_| PROBE_LANES);
        let sum = self.sum.then_some(own);
        own += usize::from(self.sum);
        let extents = extents(b, labels);
        let is_seeded = |label: &u32| *label > 0 && extents[*label as usize].seeds > 0;
        let seeded: Vec<u32> = labels.iter().copied().filter(is_seeded).collect();
        let blocks = self.schedule.blocks();
        let groups = (own + seeded.len()).div_ceil(self.width);
        let come = if blocks >= SHARED_FROM && groups > 1 {
            let followed = (self.steps, AWAKE_A_GROUP * groups as f64);
            spread((a, b), self.schedule, &seeded, followed, cancel)?
        } else {
            None
        };
        let are_shared = come.is_some();
        let mut lanes = vec![Shared::default(); own];
        if background {
            lanes[BACKGROUND_LANE].labels.push((0, None));
        }
        if let Some(come) = come {
            lanes.extend(share(&seeded, come));
        } else {
            let seeded = in_order(seeded, &extents, own, self.width).into_iter();
            lanes.extend(seeded.map(|label| Shared {
                labels: vec![(label, None)],
                ..Shared::default()
            }));
        }
        let most_groups = if b.rows() < MANY_POINTS {
            MOST_GROUPS
        } else {
            1
        };
        let passes = lanes.chunks(most_groups * self.width).enumerate();
        let of_pass = |(at, lanes): (usize, &[Shared])| {
            let [probe, sum] = [probe, sum].map(|lane| lane.filter(|_| at == 0));
            let blocks = if are_shared { blocks } else { 1 };
            let plan = Plan::of_lanes(lanes, self.width, blocks, cancel)?;
            Ok(Plan { probe, sum, ..plan })
        };
        passes.map(of_pass).collect()
    }
}

impl Plan {
    fn of_lanes(lanes: &[Shared], width: usize, blocks: usize, cancel: &Cancel) -> Result<Self> {
        let groups = lanes.len().div_ceil(width);
        let stride = groups * width;
        let mut labels = filled(NONE, blocks * stride, cancel)?;
        let mut lane_of = Vec::new();
        for (lane, shared) in lanes.iter().enumerate() {
            for (label, come) in &shared.labels {
                lane_of.push((*label, lane));
                let mut put = |block: usize| labels[block * stride + lane] = *label;
                match come {
                    Some(come) => come.iter().for_each(put),
                    None => (0..blocks).for_each(&mut put),
                }
            }
        }
        Ok(Self {
            lanes: lane_of,
            probe: None,
            sum: None,
            groups,
            width,
            labels,
            stride: if blocks > 1 { stride } else { 0 },
        })
    }

    /// The lanes of the probe.
    pub(super) fn probe_lanes(&self) -> Range<usize> {
        self.probe.map_or(0..0, |first| first..first + PROBE_LANES)
    }

    /// The lanes that stand for no label: those of the probe, and that of the sum.
    pub(super) fn beside_labels(&self) -> impl Iterator<Item = usize> {
        self.probe_lanes().chain(self.sum)
    }

    /// Label of each lane of `group` at a row, if it has one there.
    #[inline]
    pub(super) fn labels_at(&self, row: usize, group: usize) -> impl Iterator<Item = Option<u32>> {
        let first = row / BLOCK * self.stride + group * self.width;
        let labels = self.labels[first..first + self.width].iter();
        labels.map(|&label| (label != NONE).then_some(label))
    }
}

/// Lanes for `labels`, each in the first that is free in all blocks to which it may `come`.
fn share(labels: &[u32], come: Vec<Blocks>) -> Vec<Shared> {
    let mut lanes: Vec<Shared> = Vec::new();
    // those that come far first, which leaves groups of lanes that are in use in few blocks
    let mut labels: Vec<_> = labels.iter().zip(come).collect();
    labels.sort_by_key(|(_, come)| Reverse(come.len()));
    for (&label, come) in labels {
        let free = lanes.iter().position(|lane| !lane.blocks.meet(&come));
        let lane = free.unwrap_or(lanes.len());
        if lane == lanes.len() {
            lanes.push(Shared::default());
        }
        lanes[lane].blocks.add(&come);
        lanes[lane].labels.push((label, Some(come)));
    }
    lanes
}

/// What shares a lane.
#[derive(Debug, Clone, Default)]
struct Shared {
    /// Labels, and the blocks that each may come to; none named where it is alone.
    labels: Vec<(u32, Option<Blocks>)>,
    /// All of these blocks.
    blocks: Blocks,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::one_seed_each;

    /// The lanes of `labels` of points in a row, each with edges to those beside it; label l has one seed, at `seeds[l]`.
    fn planned(points: usize, seeds: &[usize], probe: bool, steps: usize) -> Vec<Plan> {
        let rows = (0..points).map(|i| i.saturating_sub(1)..points.min(i + 2));
        let columns: Vec<u32> = rows.clone().flatten().map(|j| j as u32).collect();
        let offsets = rows.scan(0, |end, row| {
            *end += row.len();
            Some(*end)
        });
        let offsets = [0].into_iter().chain(offsets).collect();
        let weights = vec![0.25; columns.len()];
        let a = PointGraph::<f32>::from_csr(offsets, columns, weights).unwrap();
        let b = one_seed_each(points, seeds);
        let planner = Planner {
            schedule: &Schedule::new(&a, Cancel::never()).unwrap(),
            width: 4,
            probe,
            sum: false,
            steps,
        };
        let labels: Vec<u32> = (0..seeds.len() as u32).collect();
        planner.plan((&a, &b), &labels, Cancel::never()).unwrap()
    }

    /// Labels of group 0 at a row.
    fn at(plan: &Plan, row: usize) -> Vec<Option<u32>> {
        plan.labels_at(row, 0).collect()
    }

    #[test]
    fn in_a_small_cloud_each_label_has_a_lane_everywhere() {
        let plans = planned(100, &[0, 50, 99, 20, 70], true, 3);
        let [plan] = &plans[..] else {
            panic!("one pass")
        };
        assert_eq!((plan.groups, plan.probe), (2, Some(1)));
        // of labels with as many seeds the lowest first, and then by place
        assert_eq!(at(plan, 0), [Some(0), None, None, Some(1)]);
        assert_eq!(at(plan, 99), at(plan, 0));
        let second: Vec<_> = plan.labels_at(0, 1).collect();
        assert_eq!(second, [Some(3), Some(4), Some(2), None]);
    }

    #[test]
    fn labels_that_do_not_meet_share_a_lane() {
        let far = SHARED_FROM * BLOCK;
        let seeds = [0, 100, 5000, 110, 9000, 13000];
        let plans = planned(far, &seeds, false, 30);
        let [plan] = &plans[..] else {
            panic!("one pass")
        };
        assert_eq!(plan.groups, 1);
        assert_eq!(plan.lanes, [(0, 0), (1, 1), (2, 1), (4, 1), (5, 1), (3, 2)]);
        assert_eq!(at(plan, 100), [Some(0), Some(1), Some(3), None]);
        assert_eq!(at(plan, 5000), [Some(0), Some(2), None, None]);
        assert_eq!(at(plan, 7000), [Some(0), None, None, None]);
    }

    #[test]
    fn labels_that_come_far_enough_to_meet_do_not() {
        let far = SHARED_FROM * BLOCK;
        let lanes = |steps| planned(far, &[0, 100, 300, 500, 700], false, steps)[0].groups;
        assert_eq!((lanes(50), lanes(120)), (1, 1));
        assert_eq!(lanes(usize::MAX), 2);
    }
}
