//! Which labels each lane of each pass over the graph stands for, and where.
//!
//! A label spreads by one edge a step, so most stay near their seeds: labels that never come to the same block share a lane.
//! Of twenty objects one group of lanes holds all but those of the densest places.

use super::schedule::BLOCK;
use super::spread::{Blocks, spread};
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{filled, push};
use crate::{Cancel, Real, Result};
use std::cmp::Reverse;

/// Most groups of a pass: one bit each says which of them are in use.
pub(super) const MOST_GROUPS: usize = 8;
/// Points from which on a pass has a single group: each takes 64 bytes a point.
const MANY_POINTS: usize = 1 << 20;
/// Lane of the background in the pass that has it.
pub(super) const BACKGROUND_LANE: usize = 0;
/// Label of a lane where it has none.
const NONE: u32 = u32::MAX;

/// The lanes of one pass.
#[derive(Debug)]
pub(super) struct Plan {
    /// Each label and its lane.
    pub(super) lanes: Vec<(u32, usize)>,
    /// Lane of the probe, where the pass has it.
    pub(super) probe: Option<usize>,
    /// Number of groups.
    pub(super) groups: usize,
    /// Lanes of a group.
    width: usize,
    /// Block after block, the label there of each lane of all groups.
    labels: Vec<u32>,
}

impl Plan {
    /// The passes that `labels` take in groups of `width` lanes, where each takes so many `steps`.
    ///
    /// The `probe` goes with the first. It is all labels with random signs, of which only the last term of the series is summed:
    /// it shows how large the terms left out may be. Labels without a seed need no lane.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn passes<T: Real>(
        (a, b): (&PointGraph<T>, &PixelLabels<T>),
        labels: &[u32],
        (width, probe, steps): (usize, bool, usize),
        cancel: &Cancel,
    ) -> Result<Vec<Self>> {
        let count = a.len().div_ceil(BLOCK);
        let (seeded, seeds) = seeded(b, labels)?;
        let mut packing = Packing::new(width);
        if labels.contains(&0) {
            packing.put(BACKGROUND_LANE, Some(0), Blocks::all(count));
        }
        let probe = probe.then_some(packing.lanes.len());
        if let Some(lane) = probe {
            packing.put(lane, None, Blocks::all(count));
        }
        let t0 = std::time::Instant::now();
        let reached = if packing.lanes.len() + seeded.len() <= width {
            // a lane for each
            vec![Blocks::all(count); seeded.len()]
        } else {
            spread(a, &seeds, steps, cancel)?
        };
        if std::env::var_os("SHOW").is_some() { if let Some(d) = std::env::var_os("DUMP") { use std::io::Write; let mut f = std::fs::File::create(d).unwrap(); for (l, r) in seeded.iter().zip(&reached) { writeln!(f, "{l} {count} {}", r.iter().map(|b| b.to_string()).collect::<Vec<_>>().join(",")).unwrap(); } } eprintln!("labels a block {}", reached.iter().map(|r| r.len()).sum::<usize>() as f64 / count as f64); eprintln!("spread {:?}", t0.elapsed()); }
        let mut labels: Vec<_> = seeded.into_iter().zip(reached).collect();
        labels.sort_by_key(|(label, blocks)| (Reverse(blocks.len()), *label));
        for (label, blocks) in labels {
            packing.put(packing.best_lane(&blocks), Some(label), blocks);
        }
        let most_groups = if a.len() < MANY_POINTS {
            MOST_GROUPS
        } else {
            1
        };
        let passes = packing.lanes.chunks(most_groups * width).enumerate();
        let passes = passes.map(|(at, lanes)| {
            Self::of_lanes(lanes, width, probe.filter(|_| at == 0), count, cancel)
        });
        passes.collect()
    }

    fn of_lanes(
        shared: &[Shared],
        width: usize,
        probe: Option<usize>,
        blocks: usize,
        cancel: &Cancel,
    ) -> Result<Self> {
        let groups = shared.len().div_ceil(width);
        let mut labels = filled(NONE, blocks * groups * width, cancel)?;
        let mut lanes = Vec::new();
        for (lane, shared) in shared.iter().enumerate() {
            for (label, reached) in &shared.labels {
                lanes.push((*label, lane));
                for block in reached.iter() {
                    labels[block * groups * width + lane] = *label;
                }
            }
        }
        Ok(Self {
            lanes,
            probe,
            groups,
            width,
            labels,
        })
    }

    /// True if `label` has a lane.
    pub(super) fn holds(&self, label: u32) -> bool {
        self.lanes.iter().any(|&(other, _)| other == label)
    }

    /// Label of each lane of `group` at a row, if it has one there.
    #[inline]
    pub(super) fn labels_at(&self, row: usize, group: usize) -> impl Iterator<Item = Option<u32>> {
        let first = (row / BLOCK * self.groups + group) * self.width;
        let labels = self.labels[first..first + self.width].iter();
        labels.map(|&label| (label != NONE).then_some(label))
    }
}

/// Those of `labels` other than the background that have seeds, and their rows.
fn seeded<T: Real>(b: &PixelLabels<T>, labels: &[u32]) -> Result<(Vec<u32>, Vec<Vec<u32>>)> {
    let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
    let mut rows = vec![Vec::new(); n_labels];
    for i in 0..b.rows() {
        for (label, _) in b.row(i).filter(|(label, _)| (1..n_labels).contains(label)) {
            push(&mut rows[label], i as u32)?;
        }
    }
    let rows_of = |&label: &u32| (label, std::mem::take(&mut rows[label as usize]));
    let seeded = labels.iter().map(rows_of).filter(|(_, rows)| !rows.is_empty());
    Ok(seeded.unzip())
}

/// What shares a lane.
#[derive(Debug)]
struct Shared {
    /// Labels and where they come to; none for the probe.
    labels: Vec<(u32, Blocks)>,
    /// Where the lane is taken.
    blocks: Blocks,
}

/// Labels put into lanes one after the other.
#[derive(Debug)]
struct Packing {
    width: usize,
    lanes: Vec<Shared>,
    /// Where each group is in use.
    groups: Vec<Blocks>,
}

impl Packing {
    fn new(width: usize) -> Self {
        Self {
            width,
            lanes: Vec::new(),
            groups: Vec::new(),
        }
    }

    /// The lane, free in all of `blocks`, whose group gets the fewest blocks more to compute; of equal ones the first.
    fn best_lane(&self, blocks: &Blocks) -> usize {
        let more = |group: usize| {
            let of_group = self.groups.get(group);
            of_group.map_or_else(|| blocks.len(), |used| used.lacks(blocks))
        };
        let more: Vec<usize> = (0..=self.groups.len()).map(more).collect();
        let is_free = |lane: &usize| {
            let shared = self.lanes.get(*lane);
            shared.is_none_or(|shared| shared.blocks.is_disjoint(blocks))
        };
        let free = (0..=self.lanes.len()).filter(is_free);
        free.min_by_key(|lane| more[lane / self.width])
            .unwrap_or(self.lanes.len())
    }

    /// Puts what comes to `blocks` into `lane`: a label, or else the probe.
    fn put(&mut self, lane: usize, label: Option<u32>, blocks: Blocks) {
        let group = lane / self.width;
        match self.groups.get_mut(group) {
            Some(used) => used.add(&blocks),
            None => self.groups.push(blocks.clone()),
        }
        match self.lanes.get_mut(lane) {
            Some(shared) => shared.blocks.add(&blocks),
            None => self.lanes.push(Shared {
                labels: Vec::new(),
                blocks: blocks.clone(),
            }),
        }
        self.lanes[lane].labels.extend(label.map(|label| (label, blocks)));
    }
}
