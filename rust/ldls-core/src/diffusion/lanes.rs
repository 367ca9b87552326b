//! Which labels share a sweep over the graph, and where in a row of values each of them lies.

use crate::Real;
use crate::masks::PixelLabels;
use rayon::prelude::*;
use std::ops::Range;

/// Most groups of a pass: one bit each says which of them are in use.
pub(crate) const MOST_GROUPS: usize = 8;
/// The same for clouds so large that every group counts: it takes 64 bytes a point.
const MOST_GROUPS_OF_MANY: usize = 3;
const MANY_POINTS: usize = 1 << 20;
/// Rows that one task of the thread pool seeds.
const ROWS_A_TASK: usize = 4096;

/// Groups of lanes that a pass over `points` points may have.
pub(crate) fn most_groups(points: usize) -> usize {
    if points < MANY_POINTS {
        MOST_GROUPS
    } else {
        MOST_GROUPS_OF_MANY
    }
}

/// What one lane carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Lane {
    /// The likelihoods of a label.
    Label(u32),
    /// All labels with random signs, of which only the last term of the series is summed: to see what
    /// the terms left out may amount to.
    Probe,
}

/// The lanes of each pass over the graph.
///
/// Labels without a seed need no lane. The first group, which the background keeps busy everywhere, takes the labels
/// with the most seeds; the others follow in the order of where they lie, so that the labels of a group are neighbours
/// and the group is zero over most of the cloud.
pub(crate) fn plan<T: Real>(
    b: &PixelLabels<T>,
    labels: &[u32],
    width: usize,
    probe: bool,
) -> Vec<Vec<Lane>> {
    let seeds = seeds_of(b, labels);
    let mut rest: Vec<&Seeds> = seeds
        .iter()
        .filter(|seeds| seeds.label > 0 && seeds.count > 0)
        .collect();
    rest.sort_by_key(|seeds| std::cmp::Reverse(seeds.count));
    let background = seeds
        .iter()
        .filter(|seeds| seeds.label == 0)
        .map(|_| Lane::Label(0));
    let mut order: Vec<Lane> = background.chain(probe.then_some(Lane::Probe)).collect();
    if !order.is_empty() {
        let first = (width - order.len()).min(rest.len());
        order.extend(rest.drain(..first).map(|seeds| Lane::Label(seeds.label)));
    }
    rest.sort_by_key(|seeds| (seeds.row_sum / seeds.count, seeds.label));
    order.extend(rest.iter().map(|seeds| Lane::Label(seeds.label)));
    order
        .chunks(width * most_groups(b.rows()))
        .map(<[Lane]>::to_vec)
        .collect()
}

/// Seeds of one label.
#[derive(Debug, Clone, Copy, Default)]
struct Seeds {
    label: u32,
    count: u64,
    /// Sum of the row numbers, which say where the label lies: near rows are near points.
    row_sum: u64,
}

fn seeds_of<T: Real>(b: &PixelLabels<T>, labels: &[u32]) -> Vec<Seeds> {
    let n_labels = labels.iter().max().map_or(0, |&label| label as usize + 1);
    let mut all: Vec<Seeds> = (0..n_labels as u32)
        .map(|label| Seeds {
            label,
            ..Seeds::default()
        })
        .collect();
    for i in 0..b.rows() {
        for (label, _) in b.row(i).filter(|&(label, _)| label < n_labels) {
            all[label].count += 1;
            all[label].row_sum += i as u64;
        }
    }
    labels.iter().map(|&label| all[label as usize]).collect()
}

/// Where the background lies in the pass that has it.
pub(crate) const BACKGROUND_LANE: usize = 0;

/// The seeds of the labels of one pass by lane, row after row.
#[derive(Debug)]
pub(crate) struct LaneSeeds<T> {
    /// Seeds of the background, which nearly every row has; zeros where it is in another pass.
    pub(crate) background: Vec<T>,
    offsets: Vec<u32>,
    /// Number of lanes.
    pub(crate) lanes: usize,
    /// Row, lane and weight of each seed.
    entries: Vec<(u32, u32, T)>,
    /// Values up to this magnitude are too small to matter.
    pub(crate) least: T,
    /// Lane of the probe, and its seeds.
    pub(crate) probe: Option<(usize, Vec<T>)>,
}

impl<T: Real> LaneSeeds<T> {
    pub(crate) fn new(b: &PixelLabels<T>, pass: &[Lane]) -> Self {
        let lane_of = |label: usize| {
            pass.iter()
                .position(|lane| *lane == Lane::Label(label as u32))
                .map(|lane| lane as u32)
        };
        let n_labels = b.labels.iter().max().map_or(0, |&label| label as usize + 1);
        let lanes: Vec<Option<u32>> = (0..n_labels).map(lane_of).collect();
        let probe = pass.iter().position(|lane| *lane == Lane::Probe);
        let has_background = pass.get(BACKGROUND_LANE) == Some(&Lane::Label(0));
        let background = |i: usize| {
            if has_background {
                background_of(b, i)
            } else {
                T::default()
            }
        };
        let points = || (0..b.rows()).into_par_iter().with_min_len(ROWS_A_TASK);
        let mut seeds = Self {
            background: points().map(background).collect(),
            lanes: pass.len(),
            least: T::from_f64(T::NEGLIGIBLE * largest_weight(b)),
            offsets: Vec::with_capacity(b.rows() + 1),
            entries: Vec::with_capacity(0),
            probe: probe.map(|lane| (lane, points().map(|i| probe_seed(b, i)).collect())),
        };
        seeds.offsets.push(0);
        for i in 0..b.rows() {
            let others = b.row(i).filter(|&(label, _)| label > 0);
            let in_pass =
                others.filter_map(|(label, weight)| Some((i as u32, lanes[label]?, weight)));
            seeds.entries.extend(in_pass);
            seeds.offsets.push(seeds.entries.len() as u32);
        }
        seeds
    }

    /// For each block of `block` rows, bit g where lanes of group g have seeds.
    pub(crate) fn groups(&self, block: usize, width: usize) -> Vec<u8> {
        let rows = self.offsets.len() - 1;
        let probed = self.probe.as_ref();
        let probed = probed.map_or(0, |(lane, _)| 1 << (lane / width));
        let full = self.background.iter().any(|&weight| weight > T::default());
        let everywhere = probed | u8::from(full) << (BACKGROUND_LANE / width);
        let of_block = |first: usize| {
            let entries =
                self.offsets[first] as usize..self.offsets[rows.min(first + block)] as usize;
            self.entries[entries]
                .iter()
                .fold(everywhere, |bits, (_, lane, _)| {
                    bits | 1 << (*lane as usize / width)
                })
        };
        (0..rows).step_by(block).map(of_block).collect()
    }

    /// Row, lane and weight of each seed of `rows`, but for the background's.
    #[inline(always)]
    pub(crate) fn of_rows(&self, rows: Range<usize>) -> &[(u32, u32, T)] {
        &self.entries[self.offsets[rows.start] as usize..self.offsets[rows.end] as usize]
    }
}

fn largest_weight<T: Real>(b: &PixelLabels<T>) -> f64 {
    b.weights
        .iter()
        .map(|weight| weight.to_f64())
        .fold(0.0, f64::max)
}

fn background_of<T: Real>(b: &PixelLabels<T>, i: usize) -> T {
    b.row(i)
        .find(|&(label, _)| label == 0)
        .map_or(T::default(), |(_, weight)| weight)
}

fn probe_seed<T: Real>(b: &PixelLabels<T>, i: usize) -> T {
    let signed = |(label, weight): (usize, T)| T::from_f64(random_sign(label)) * weight;
    b.row(i).map(signed).sum()
}

/// Plus or minus one, without a pattern.
fn random_sign(label: usize) -> f64 {
    // the multiplier of Knuth's multiplicative hash
    let hash = (label as u32).wrapping_add(1).wrapping_mul(2_654_435_769);
    if hash & 0x8000 == 0 { 1.0 } else { -1.0 }
}
