//! The label that wins at a point because its seeds do: at the point, and wherever anything flows to it from, none of another is
//! larger. So it is where several masks show all that is near, and near the edge of one.

use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{collect, filled, push, with_room};
use crate::{Cancel, Result};

/// Points that may be met for each that is asked about. Where there are more, there is no end to them as a rule.
const MET_A_POINT: usize = 8;
/// As many more, so that it may be far from a few points to the seeds that flow to them.
const MET_ANYWAY: usize = 4096;
/// Points met after which it is first looked whether a search is in vain.
const FIRST_LOOK: usize = 64;
/// Place of a point that has not been met.
const NOWHERE: u32 = u32::MAX;
/// By what share of its value a label has to be ahead of another, so that no rounding makes them equal.
const AHEAD: f32 = 1e-12;

/// The search for the seeds that flow to points in `a`.
#[derive(Debug)]
pub(super) struct SeedSearch<'a> {
    a: &'a PointGraph,
    b: &'a PixelLabels,
    /// Edges that a seed goes along at most.
    steps: usize,
    /// Place of each point among those met.
    places: Vec<u32>,
}

/// What a search has met.
#[derive(Debug, Default)]
struct Region {
    /// The points asked about, then what flows to them, points of the fewest edges first.
    met: Vec<u32>,
    /// The first of them, so many, have been followed: all that flows to them is met.
    followed: usize,
    /// To how many of those followed each point flows.
    flows: Vec<u32>,
}

/// A place that is flowed to, and the weight of the edge.
type Flow = (u32, f32);

/// Which labels are behind others, by some of their seeds.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Behind {
    /// A bit for each label.
    labels: u64,
    /// What each of them lacks at least.
    by: f32,
}

impl<'a> SeedSearch<'a> {
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(
        (a, b): (&'a PointGraph, &'a PixelLabels),
        steps: usize,
        cancel: &Cancel,
    ) -> Result<Self> {
        let places = filled(NOWHERE, a.len(), cancel)?;
        Ok(Self {
            a,
            b,
            steps,
            places,
        })
    }

    /// Of `labels`, ascending, the one that wins at each of `points`, of equal ones the lowest: where seeds that come along edges
    /// of more than the `least` weight tell, and neither too many points have to be looked at nor more than 64 labels. Winners have
    /// about these `values`.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn winners(
        &mut self,
        labels: &[u32],
        (points, values): (&[u32], &[f32]),
        least: f32,
        cancel: &Cancel,
    ) -> Result<Vec<Option<u32>>> {
        let mut winners = filled(None, points.len(), cancel)?;
        if labels.len() > u64::BITS as usize {
            return Ok(winners);
        }
        let mut region = Region::default();
        let found = self.search(labels, points, least, &mut region, cancel);
        for point in region.met {
            self.places[point as usize] = NOWHERE;
        }
        for ((winner, behind), value) in winners.iter_mut().zip(found?).zip(values) {
            // those below the lowest that is not behind are, and may not be equal to it
            let at = behind.labels.trailing_ones() as usize;
            if at == 0 || behind.by >= AHEAD * value {
                *winner = labels.get(at).copied();
            }
        }
        Ok(winners)
    }

    /// Which of `labels` are behind others at `points`, the first that the `region` meets; nothing where the search is in vain.
    fn search(
        &mut self,
        labels: &[u32],
        points: &[u32],
        least: f32,
        region: &mut Region,
        cancel: &Cancel,
    ) -> Result<Vec<Behind>> {
        for &point in points {
            self.meet(region, point)?;
        }
        let most = MET_ANYWAY + MET_A_POINT * points.len();
        let (mut edges, mut last) = (0, points.len());
        let mut look = FIRST_LOOK.max(2 * points.len());
        while region.followed < region.met.len() && edges < self.steps {
            self.follow(region, least)?;
            if region.met.len() > most {
                return Ok(Vec::new());
            }
            if region.followed == last {
                cancel.check()?;
                (edges, last) = (edges + 1, region.met.len());
            }
            if region.followed == look && look < MET_ANYWAY {
                let behind = self.spread(labels, region, least, cancel)?;
                let is_open = |behind: &Behind| behind.labels.trailing_ones() < labels.len() as u32;
                if !behind[..points.len()].iter().any(is_open) {
                    return Ok(Vec::new());
                }
                look *= 2;
            }
        }
        self.spread(labels, region, least, cancel)
    }

    /// Meets what flows to the next point of the `region`.
    fn follow(&mut self, region: &mut Region, least: f32) -> Result<()> {
        for (column, _) in heavier(self.a, region.met[region.followed], least) {
            if self.places[column] == NOWHERE {
                self.meet(region, column as u32)?;
            }
            region.flows[self.places[column] as usize] += 1;
        }
        region.followed += 1;
        Ok(())
    }

    fn meet(&mut self, region: &mut Region, point: u32) -> Result<()> {
        self.places[point as usize] = region.met.len() as u32;
        push(&mut region.met, point)?;
        push(&mut region.flows, 0)
    }

    /// Which of `labels` are behind others at each point of the `region`, by seeds that come to it from there.
    fn spread(
        &self,
        labels: &[u32],
        region: &Region,
        least: f32,
        cancel: &Cancel,
    ) -> Result<Vec<Behind>> {
        let (flows, starts) = self.flows(region, least, cancel)?;
        let highest = labels.last().map_or(0, |&label| label as usize);
        let mut bits = filled(0, highest + 1, cancel)?;
        for (at, &label) in labels.iter().enumerate() {
            bits[label as usize] = 1 << at;
        }
        let own = |&point: &u32| Behind::of_seeds(self.b.row(point as usize), &bits);
        let mut all = collect(region.met.iter().map(own), cancel)?;
        let mut new = filled(Behind::none(), all.len(), cancel)?;
        let labels = all.iter().map(|behind| behind.labels);
        let mut front: Vec<(u32, u64)> = (0..)
            .zip(labels)
            .filter(|(_, labels)| *labels != 0)
            .collect();
        for _ in 0..self.steps {
            cancel.check()?;
            let mut reached = Vec::new();
            for (from, labels) in front {
                let (from, by) = (from as usize, all[from as usize].by);
                for &(to, weight) in &flows[starts[from]..starts[from + 1]] {
                    let (known, new) = (all[to as usize].labels, &mut new[to as usize]);
                    if labels & !(known | new.labels) != 0 {
                        if *new == Behind::none() {
                            push(&mut reached, to)?;
                        }
                        new.add(labels & !known, weight * by);
                    }
                }
            }
            if reached.is_empty() {
                break;
            }
            let settle = |at: u32| {
                let new = std::mem::replace(&mut new[at as usize], Behind::none());
                all[at as usize].add(new.labels, new.by);
                (at, new.labels)
            };
            front = reached.into_iter().map(settle).collect();
        }
        Ok(all)
    }

    /// The place of each point of the `region` that another flows to, with the weight of the edge, and where those of each place
    /// begin.
    fn flows(
        &self,
        region: &Region,
        least: f32,
        cancel: &Cancel,
    ) -> Result<(Vec<Flow>, Vec<usize>)> {
        let mut starts = with_room(region.met.len() + 1)?;
        let mut sum = 0;
        for flows in &region.flows {
            sum += *flows as usize;
            starts.push(sum);
        }
        starts.push(sum);
        let mut flows = filled((0, 0.0), sum, cancel)?;
        for (to, &point) in (0..).zip(&region.met[..region.followed]) {
            for (column, weight) in heavier(self.a, point, least) {
                let start = &mut starts[self.places[column] as usize];
                *start -= 1;
                flows[*start] = (to, weight);
            }
        }
        Ok((flows, starts))
    }
}

/// Columns and weights of the edges of a point that weigh more than the `least`.
fn heavier(a: &PointGraph, point: u32, least: f32) -> impl Iterator<Item = (usize, f32)> {
    let edges = a.row(point as usize);
    edges.filter(move |(_, weight)| *weight > least)
}

impl Behind {
    fn none() -> Self {
        Self {
            labels: 0,
            by: f32::INFINITY,
        }
    }

    /// Those that are behind at a point with these `seeds`, of labels that have `bits`.
    fn of_seeds(seeds: impl Iterator<Item = (usize, f32)>, bits: &[u64]) -> Self {
        let (mut first, mut largest, mut next) = (0, 0.0, 0.0);
        for (label, seed) in seeds {
            let Some(&bit) = bits.get(label).filter(|bit| **bit != 0) else {
                continue;
            };
            if seed > largest {
                (first, largest, next) = (bit, seed, largest);
            } else if seed == largest {
                first |= bit;
            } else if seed > next {
                next = seed;
            }
        }
        let last = bits.last().copied().unwrap_or(0);
        let labels = last | last.wrapping_sub(1);
        if first == 0 || first == labels {
            return Self::none();
        }
        Self {
            labels: labels & !first,
            by: largest - next,
        }
    }

    fn add(&mut self, labels: u64, by: f32) {
        self.labels |= labels;
        self.by = self.by.min(by);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::seeds_by_point;
    use proptest::prelude::*;

    /// The winner of labels 1 and 2, whose value is 1, at each of `points` of a graph that `edges` describe: of each point the
    /// points that flow to it, with a weight of 0.25. Each of a point's `seeds` is 0.5.
    fn winners(
        edges: &[&[u32]],
        seeds: &[&[u32]],
        steps: usize,
        points: &[u32],
    ) -> Vec<Option<u32>> {
        let offsets = (0..=edges.len()).map(|i| edges[..i].iter().map(|from| from.len()).sum());
        let columns = edges.concat();
        let weights = vec![0.25; columns.len()];
        let a = PointGraph::from_csr(offsets.collect(), columns, weights).unwrap();
        let seeds = seeds
            .iter()
            .map(|of_row| of_row.iter().map(|&label| (label, 0.5)));
        let seeds: Vec<Vec<(u32, f64)>> = seeds.map(Iterator::collect).collect();
        let seeds: Vec<&[(u32, f64)]> = seeds.iter().map(Vec::as_slice).collect();
        let b = seeds_by_point(edges.len(), &seeds);
        let mut search = SeedSearch::new((&a, &b), steps, Cancel::never()).unwrap();
        let values = vec![1.0; points.len()];
        let mut find = || search.winners(&[1, 2], (points, &values), 0.0, Cancel::never());
        let (first, second) = (find().unwrap(), find().unwrap());
        assert_eq!(first, second, "nothing is left of the first time");
        first
    }

    const BOTH: &[u32] = &[1, 2];

    #[test]
    fn labels_are_equal_where_no_seed_that_differs_flows_to_and_the_lowest_wins() {
        // 0 <- 1 <- 2 <-> 3, and 4 with a seed of one label flows to 0 alone
        let edges: [&[u32]; 5] = [&[1, 4], &[2], &[3], &[2], &[]];
        let seeds = [BOTH, &[], BOTH, &[], &[2]];
        let found = winners(&edges, &seeds, 9, &[3, 0, 1, 2, 4]);
        assert_eq!(found, [1, 2, 1, 1, 2].map(Some));
    }

    #[test]
    fn seeds_farther_away_than_they_go_tell_nothing() {
        // 0 <- 1 <- 2 <- 3
        let edges: [&[u32]; 4] = [&[1], &[2], &[3], &[]];
        let seeds = [BOTH, BOTH, BOTH, &[2]];
        let found = |steps| winners(&edges, &seeds, steps, &[0, 1, 2, 3]);
        assert_eq!(found(0), [1, 1, 1, 2].map(Some));
        assert_eq!(found(1), [1, 1, 2, 2].map(Some));
        assert_eq!(found(3), [2, 2, 2, 2].map(Some));
    }

    #[test]
    fn nothing_is_told_where_each_label_is_behind_somewhere() {
        // 0 <- 1, 0 <- 2 and 1 <- 3
        let edges: [&[u32]; 4] = [&[1, 2], &[3], &[], &[]];
        let seeds: [&[u32]; 4] = [BOTH, &[1], &[2], &[]];
        let found = winners(&edges, &seeds, 9, &[0, 1, 2]);
        assert_eq!(found, [None, Some(1), Some(2)]);
    }

    #[test]
    fn a_label_is_the_winner_over_a_lower_one_only_where_rounding_does_not_make_them_equal() {
        // each flows to the one before it, and 0.25^20 is 1e-12
        let edges: Vec<Vec<u32>> = (1..40).map(|from| vec![from]).chain([vec![]]).collect();
        let edges: Vec<&[u32]> = edges.iter().map(Vec::as_slice).collect();
        let last = |labels: &'static [u32]| [vec![BOTH; 39], vec![labels]].concat();
        let found = |labels| winners(&edges, &last(labels), 99, &[30, 10]);
        assert_eq!(found(&[2]), [Some(2), None]);
        assert_eq!(found(&[1]), [Some(1), Some(1)], "or equal, and the lowest");
    }

    #[test]
    fn the_more_points_are_asked_about_the_farther_it_may_be_to_seeds() {
        let n = 2 * MET_ANYWAY as u32;
        let edges: Vec<Vec<u32>> = (0..n).map(|i| vec![(i + 1) % n]).collect();
        let edges: Vec<&[u32]> = edges.iter().map(Vec::as_slice).collect();
        let seeds = vec![BOTH; n as usize];
        let all: Vec<u32> = (0..n).collect();
        let found = |points| winners(&edges, &seeds, usize::MAX, points);
        assert!(found(&all).iter().all(|winner| *winner == Some(1)));
        assert_eq!(found(&[0]), [None]);
    }

    proptest! {
        #[test]
        fn the_winner_is_the_lowest_label_that_is_behind_at_no_point_within_so_many_edges(
            rows in proptest::collection::vec((proptest::collection::vec(0..60_u32, 0..3), 0..12_usize), 60),
            steps in 0..8_usize,
            asked in proptest::sample::subsequence((0..60).collect::<Vec<u32>>(), 1..30),
        ) {
            let edges: Vec<&[u32]> = rows.iter().map(|(from, _)| from.as_slice()).collect();
            let kinds: [&[u32]; 4] = [&[1], &[2], &[], BOTH];
            let seeds = rows.iter().map(|(_, kind)| kinds[(*kind).min(3)]);
            let seeds: Vec<&[u32]> = seeds.collect();
            let own = rows.iter().map(|(_, kind)| [*kind == 1, *kind == 0]);
            let mut behind: Vec<[bool; 2]> = own.collect();
            for _ in 0..steps {
                let before = behind.clone();
                for (behind, from) in behind.iter_mut().zip(&edges) {
                    for from in from.iter().map(|from| before[*from as usize]) {
                        *behind = [behind[0] || from[0], behind[1] || from[1]];
                    }
                }
            }
            let winner = |point: &u32| match behind[*point as usize] {
                [false, _] => Some(1),
                [true, false] => Some(2),
                [true, true] => None,
            };
            let expected: Vec<Option<u32>> = asked.iter().map(winner).collect();
            prop_assert_eq!(winners(&edges, &seeds, steps, &asked), expected);
        }
    }
}
