//! Labels that are twins in a part of the graph that hangs together: their seeds are the same at all of its points, and so are
//! their values. One of them speaks for all, where others differ from both.

use super::schedule::ROWS_A_TASK;
use crate::graph::{DisjointSets, PointGraph};
use crate::masks::PixelLabels;
use crate::memory::{push, tabulate};
use crate::{Cancel, Result};

/// The seeds in `b` of those of `labels` that have no lower twin in the part of `a` that their point is in.
///
/// # Errors
/// [`crate::Error::OutOfMemory`] and [`crate::Error::Cancelled`].
pub(super) fn without_twins(
    (a, b): (&PointGraph<f64>, PixelLabels<f64>),
    labels: &[u32],
    cancel: &Cancel,
) -> Result<PixelLabels<f64>> {
    let mut parts = DisjointSets::new(a.len(), cancel)?;
    for row in 0..a.len() {
        if row % ROWS_A_TASK == 0 {
            cancel.check()?;
        }
        let edges = a.row(row);
        edges.for_each(|(column, _)| parts.join(row as u32, column as u32));
    }
    let seeds = |row: usize| {
        let seeds = b.row(row).map(|(label, weight)| (label as u32, weight));
        seeds.filter(|(label, _)| labels.binary_search(label).is_ok())
    };
    // of each part, in the place of its root
    let mut alike = tabulate(a.len(), |_| Alike::default(), cancel)?;
    for row in 0..a.len() {
        alike[parts.root(row as u32) as usize].tell_apart(seeds(row));
    }
    let (mut offsets, mut kept, mut weights) = (vec![0], Vec::new(), Vec::new());
    for row in 0..a.len() {
        let alike = &alike[parts.root(row as u32) as usize];
        for (label, weight) in seeds(row).filter(|&(label, _)| alike.has_no_lower(label)) {
            push(&mut kept, label)?;
            push(&mut weights, weight)?;
        }
        push(&mut offsets, kept.len())?;
    }
    Ok(PixelLabels {
        offsets,
        labels: kept,
        weights,
        mass: b.mass,
    })
}

/// Which labels have had the same seeds at all points looked at.
#[derive(Debug, Clone, Default)]
struct Alike {
    /// Each label that had a seed, and the number that it shares with those like it; 0 is for those without one.
    numbers: Vec<(u32, u32)>,
    /// The highest number so far.
    last: u32,
}

impl Alike {
    /// Looks at a point with these seeds of labels.
    fn tell_apart(&mut self, seeds: impl Iterator<Item = (u32, f64)>) {
        // what number labels had, with what seed, and which they get for it
        let mut new: Vec<(u32, f64, u32)> = Vec::new();
        for (label, seed) in seeds {
            let known = self.numbers.iter().position(|&(known, _)| known == label);
            let at = known.unwrap_or_else(|| {
                self.numbers.push((label, 0));
                self.numbers.len() - 1
            });
            let before = self.numbers[at].1;
            let like = new.iter().find(|like| (like.0, like.1) == (before, seed));
            let number = if let Some(like) = like {
                like.2
            } else {
                self.last += 1;
                new.push((before, seed, self.last));
                self.last
            };
            self.numbers[at].1 = number;
        }
    }

    fn has_no_lower(&self, label: u32) -> bool {
        let number = |&(_, number): &(u32, u32)| number;
        let own = self
            .numbers
            .iter()
            .find(|known| known.0 == label)
            .map(number);
        let mut lower = self.numbers.iter().filter(|known| known.0 < label);
        lower.all(|known| Some(number(known)) != own)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::seeds_by_point;

    /// Labels with a seed at each of points that stand in a row, with edges from one to the next but where a part ends.
    fn kept(ends: &[usize], seeds: &[&[(u32, f64)]], labels: &[u32]) -> Vec<Vec<usize>> {
        let n = seeds.len();
        let next = |i: usize| if ends.contains(&(i + 1)) { i } else { i + 1 };
        let columns = (0..n).flat_map(|i| [i as u32, next(i) as u32]);
        let offsets = (0..=n).map(|i| 2 * i).collect();
        let a = PointGraph::from_csr(offsets, columns.collect(), vec![0.5; 2 * n]).unwrap();
        let b = without_twins((&a, seeds_by_point(n, seeds)), labels, Cancel::never()).unwrap();
        let labels = |row| b.row(row).map(|(label, _)| label).collect();
        (0..n).map(labels).collect()
    }

    #[test]
    fn the_lowest_of_labels_with_the_same_seeds_stays() {
        let both: &[(u32, f64)] = &[(2, 0.5), (5, 0.5)];
        assert_eq!(
            kept(&[3], &[both, &[(7, 0.5)], both], &[2, 5, 7]),
            [vec![2], vec![7], vec![2]]
        );
    }

    #[test]
    fn labels_that_differ_at_any_point_stay_there_and_are_twins_elsewhere() {
        let both: &[(u32, f64)] = &[(2, 0.5), (5, 0.5)];
        let seeds = [both, &[(2, 0.5), (5, 0.25)], both, both];
        assert_eq!(
            kept(&[2, 4], &seeds, &[2, 5]),
            [vec![2, 5], vec![2, 5], vec![2], vec![2]]
        );
        let seeds = [both, &[(5, 0.5)], both];
        assert_eq!(
            kept(&[3], &seeds, &[2, 5]),
            [vec![2, 5], vec![5], vec![2, 5]]
        );
    }

    #[test]
    fn labels_that_nobody_asks_for_go() {
        let both: &[(u32, f64)] = &[(2, 0.5), (5, 0.5)];
        assert_eq!(kept(&[1], &[both], &[5]), [vec![5]]);
    }
}
