//! Labels that are equal at a point because their seeds are, at the point and wherever anything flows to it from.

use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{filled, push};
use crate::{Cancel, Result};

/// Points that may be followed for each that is asked about: less work than to diffuse labels there.
const FOLLOWED_A_POINT: usize = 16;
/// As many more, so that a few points may be followed far.
const FOLLOWED_ANYWAY: usize = 4096;

/// What is known of some labels at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Known {
    Nothing,
    /// What flows to it is being looked at.
    Met,
    Equal,
    /// Seeds differ at a point that flows to it, or too many points do.
    Unequal,
}

/// The search for what flows to points of `a`, by edges of more than the weight asked for.
#[derive(Debug)]
pub(super) struct Followed<'a> {
    a: &'a PointGraph,
    b: &'a PixelLabels,
    known: Vec<Known>,
    /// The points of which something is known.
    seen: Vec<u32>,
    /// Those of the present walk, and where in it the point is that each flows to.
    walk: Vec<(u32, usize)>,
}

impl<'a> Followed<'a> {
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn new(a: &'a PointGraph, b: &'a PixelLabels, cancel: &Cancel) -> Result<Self> {
        Ok(Self {
            a,
            b,
            known: filled(Known::Nothing, a.len(), cancel)?,
            seen: Vec::new(),
            walk: Vec::new(),
        })
    }

    /// Those of `points`, in their order, at which `labels` are equal, as far as edges of more than the `least` weight show it
    /// without being followed far.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
    pub(super) fn equal_at(
        &mut self,
        points: &[u32],
        labels: &[u32],
        least: f32,
        cancel: &Cancel,
    ) -> Result<Vec<u32>> {
        let most = FOLLOWED_ANYWAY + FOLLOWED_A_POINT * points.len();
        let (mut equal, mut followed) = (Vec::new(), 0);
        for &point in points {
            if self.known[point as usize] == Known::Nothing && followed < most {
                cancel.check()?;
                followed += self.follow(point, labels, least, most - followed)?;
            }
            if self.known[point as usize] == Known::Equal {
                push(&mut equal, point)?;
            }
        }
        for point in self.seen.drain(..) {
            self.known[point as usize] = Known::Nothing;
        }
        Ok(equal)
    }

    /// Finds out about a point, where no more than `most` flow to it; how many were followed.
    fn follow(&mut self, from: u32, labels: &[u32], least: f32, most: usize) -> Result<usize> {
        self.meet(from, 0)?;
        let mut at = 0;
        let unequal = loop {
            let Some(&(point, _)) = self.walk.get(at) else {
                break None;
            };
            if self.differ_at(point as usize, labels) || self.walk.len() > most {
                break Some(at);
            }
            let mut is_unequal = false;
            for (column, weight) in self.a.row(point as usize) {
                if weight > least {
                    match self.known[column] {
                        Known::Nothing => self.meet(column as u32, at)?,
                        Known::Unequal => is_unequal = true,
                        Known::Met | Known::Equal => {}
                    }
                }
            }
            if is_unequal {
                break Some(at);
            }
            at += 1;
        };
        let result = if unequal.is_some() {
            Known::Nothing
        } else {
            Known::Equal
        };
        for &(point, _) in &self.walk {
            self.known[point as usize] = result;
        }
        // of those met in vain, all that it flows to on its way
        let mut next = unequal;
        while let Some(at) = next {
            let (point, to) = self.walk[at];
            self.known[point as usize] = Known::Unequal;
            next = (at > 0).then_some(to);
        }
        let followed = self.walk.len();
        self.walk.clear();
        Ok(followed)
    }

    fn meet(&mut self, point: u32, flows_to: usize) -> Result<()> {
        self.known[point as usize] = Known::Met;
        push(&mut self.seen, point)?;
        push(&mut self.walk, (point, flows_to))
    }

    fn differ_at(&self, point: usize, labels: &[u32]) -> bool {
        let seed = |label: u32| {
            let mut row = self.b.row(point);
            row.find_map(|(at, weight)| (at == label as usize).then_some(weight))
        };
        let first = seed(labels[0]);
        labels.iter().any(|&label| seed(label) != first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where, of `points`, labels 1 and 2 are equal: each point of the graph has edges of weight 0.25 from itself and from those that
    /// `edges` names, and `seeds` of 0.5.
    fn equal_at(edges: &[&[u32]], seeds: &[&[u32]], points: &[u32]) -> Vec<u32> {
        let rows: Vec<Vec<u32>> = (0..)
            .zip(edges)
            .map(|(i, from)| [&[i], *from].concat())
            .collect();
        let offsets = (0..=rows.len()).map(|i| rows[..i].iter().map(Vec::len).sum());
        let columns = rows.concat();
        let weights = vec![0.25; columns.len()];
        let a = PointGraph::from_csr(offsets.collect(), columns, weights).unwrap();
        let b = PixelLabels {
            offsets: (0..=seeds.len())
                .map(|i| seeds[..i].iter().map(|of_row| of_row.len()).sum())
                .collect(),
            labels: seeds.concat(),
            weights: vec![0.5; seeds.concat().len()],
            mass: vec![1.0; seeds.len()],
        };
        let mut followed = Followed::new(&a, &b, Cancel::never()).unwrap();
        let mut find = || followed.equal_at(points, &[1, 2], 0.0, Cancel::never());
        let (first, second) = (find().unwrap(), find().unwrap());
        assert_eq!(first, second, "nothing is left of the first time");
        assert!(followed.known.iter().all(|known| *known == Known::Nothing));
        first
    }

    const BOTH: &[u32] = &[1, 2];

    #[test]
    fn labels_are_equal_where_no_seed_that_differs_flows_to() {
        // 0 <- 1 <- 2 <-> 3, and 4 with a seed of one label flows to 0 alone
        let edges: [&[u32]; 5] = [&[1, 4], &[2], &[3], &[2], &[]];
        let seeds = [BOTH, &[], BOTH, &[], &[2]];
        assert_eq!(equal_at(&edges, &seeds, &[3, 0, 1, 2, 4]), [3, 1, 2]);
    }

    #[test]
    fn what_a_walk_in_vain_has_met_beside_its_way_may_still_be_equal() {
        // 1 is met from 0 before 2, whose seed differs
        let edges: [&[u32]; 3] = [&[1, 2], &[], &[]];
        assert_eq!(equal_at(&edges, &[&[], BOTH, &[1]], &[0, 1, 2]), [1]);
    }

    #[test]
    fn a_long_way_is_followed_where_many_points_are_asked_about() {
        let n = 2 * FOLLOWED_ANYWAY as u32;
        let edges: Vec<Vec<u32>> = (0..n).map(|i| vec![(i + 1) % n]).collect();
        let edges: Vec<&[u32]> = edges.iter().map(Vec::as_slice).collect();
        let seeds = vec![BOTH; n as usize];
        let all: Vec<u32> = (0..n).collect();
        assert_eq!(equal_at(&edges, &seeds, &all), all);
        assert!(equal_at(&edges, &seeds, &[0]).is_empty());
    }
}
