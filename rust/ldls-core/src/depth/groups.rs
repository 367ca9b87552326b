//! Groups of the points of a mask by their distance to the camera.

use crate::memory::push;
use crate::{Params, Result};
use std::collections::BTreeMap;

/// Gap between two groups as a share of the distance, where that is more than `depth_gap`: points thin out.
const GAP_SHARE: f64 = 0.03;
/// The same for gaps that are bridged.
const BRIDGED_SHARE: f64 = 0.1;
/// A group with a smaller share of its points on the mask, the others beside it, goes on as background does: it is not
/// bridged to.
const LEAST_ON_MASK: f64 = 0.75;
/// Distance, in metres, from which on the nearer of two groups weighs more.
const LEAST_M: f64 = 0.3;
/// Distance, in metres, by which an object reaches beyond its group.
const SLACK_M: f64 = 0.3;
/// Cells up to which each has a place of its own, empty or not: some hundred are in use, and are found at once.
const NEAR_CELLS: usize = 1 << 10;
/// Length, in metres, of the shortest cells: there is no gap so short, whatever `depth_gap` is.
const LEAST_CELL_M: f64 = 1e-9;

/// Points without a gap between them.
#[derive(Debug, Clone, Copy)]
struct Group {
    near: f64,
    far: f64,
    points: usize,
    weight: u64,
}

/// The points on a mask that stand on the ground, in cells of distance so short that there is no gap within one.
#[derive(Debug)]
pub(super) struct Cells {
    /// Length of each, half of the shortest gap.
    cell_m: f64,
    /// The first [`NEAR_CELLS`], as far as there are points.
    near: Vec<Group>,
    /// Those beyond that have points, by their number.
    far: BTreeMap<u64, Group>,
}

impl Cells {
    pub(super) fn new(params: &Params) -> Self {
        Self {
            cell_m: (params.depth_gap / 2.0).max(LEAST_CELL_M),
            near: Vec::new(),
            far: BTreeMap::new(),
        }
    }

    /// Adds a point at a `distance` to the camera, in metres. Its `weight` are the steps to the edge of the mask: the nearer to its
    /// middle, the surer.
    ///
    /// # Errors
    /// [`crate::Error::OutOfMemory`].
    pub(super) fn add(&mut self, distance: f64, weight: u64) -> Result<()> {
        let cell = (distance / self.cell_m) as u64;
        let group = if cell < NEAR_CELLS as u64 {
            while self.near.len() as u64 <= cell {
                push(&mut self.near, Group::NONE)?;
            }
            &mut self.near[cell as usize]
        } else {
            self.far.entry(cell).or_insert(Group::NONE)
        };
        group.add(Group {
            near: distance,
            far: distance,
            points: 1,
            weight,
        });
        Ok(())
    }

    /// The groups that they are of, the nearest first.
    fn groups(&self, params: &Params) -> Vec<Group> {
        let mut groups: Vec<Group> = Vec::new();
        let cells = self.near.iter().chain(self.far.values());
        for &cell in cells.filter(|cell| cell.points > 0) {
            match groups.last_mut() {
                Some(group)
                    if cell.near - group.far <= params.depth_gap.max(GAP_SHARE * group.far) =>
                {
                    group.add(cell);
                }
                _ => groups.push(cell),
            }
        }
        groups
    }
}

impl Group {
    const NONE: Self = Self {
        near: f64::INFINITY,
        far: 0.0,
        points: 0,
        weight: 0,
    };

    fn add(&mut self, other: Self) {
        self.near = self.near.min(other.near);
        self.far = self.far.max(other.far);
        self.points += other.points;
        self.weight += other.weight;
    }
}

/// Nearest and farthest distance of the object that the points in `cells` show, in metres: those of the heaviest group, the
/// nearest of equals, and some slack. `beside` are the distances of the points beside the mask, ascending.
///
/// What lies behind an object goes on beside its mask and is hidden by what is before it, so the weight of a group is
/// that of its points on the mask, times the square of their share of all at its distances, over the square root of the
/// nearest. Of 2,981 masks of simulated cars and people 2.4 % are then at another distance than their object; by weight
/// and share alone 2.9 %, by seventeen properties of a group and weights fitted to them 2.0 %.
///
/// The long side of a vehicle seen from behind has gaps of metres: groups apart by no more than `bridged_gap` are one
/// unless the lighter one goes on beside the mask.
pub(super) fn object_of(cells: &Cells, beside: &[f64], params: &Params) -> Option<[f64; 2]> {
    let groups = cells.groups(params);
    // share of the points at the distances of a group that lie on the mask, the others beside it
    let on_mask = |groups: &[Group]| {
        let [near, far] = interval(groups);
        let first = beside.partition_point(|&distance| distance < near);
        let last = beside.partition_point(|&distance| distance <= far);
        let points = groups.iter().map(|group| group.points).sum::<usize>() as f64;
        points / (points + (last - first) as f64)
    };
    let one_object = |before: &Group, group: &Group| {
        let bridged = params.bridged_gap.max(BRIDGED_SHARE * before.far);
        let lighter = if group.weight <= before.weight {
            group
        } else {
            before
        };
        params.bridged_gap > 0.0
            && group.near - before.far <= bridged
            && on_mask(std::slice::from_ref(lighter)) >= LEAST_ON_MASK
    };
    let weight = |chain: &[Group]| {
        let weight = chain.iter().map(|group| group.weight).sum::<u64>();
        weight as f64 * on_mask(chain).powi(2) / chain[0].near.max(LEAST_M).sqrt()
    };
    let chains = groups.chunk_by(one_object).rev();
    let heaviest = chains.max_by(|one, other| weight(one).total_cmp(&weight(other)));
    heaviest.map(interval)
}

/// Nearest and farthest distance of neighbouring groups, with slack, in metres.
fn interval(groups: &[Group]) -> [f64; 2] {
    [
        groups[0].near - SLACK_M,
        groups[groups.len() - 1].far + SLACK_M,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn cells(distances: &[f64], params: &Params) -> Cells {
        let mut cells = Cells::new(params);
        for &distance in distances {
            cells.add(distance, 1).unwrap();
        }
        cells
    }

    fn object(distances: &[f64], beside: &[f64]) -> [f64; 2] {
        let params = Params::default();
        object_of(&cells(distances, &params), beside, &params).unwrap()
    }

    proptest! {
        #[test]
        fn groups_end_where_there_is_a_gap_between_neighbouring_points(
            distances in proptest::collection::vec((0.0..1.0_f64).prop_map(|x| 0.1 + 1e4 * x.powi(6)), 1..200),
            depth_gap in prop_oneof![Just(0.0), 1e-6..1e-3, 0.1..2.0, Just(1e3)],
        ) {
            let params = Params { depth_gap, ..Params::default() };
            let mut ascending = distances.clone();
            ascending.sort_by(f64::total_cmp);
            let same = |one: &f64, other: &f64| other - one <= depth_gap.max(GAP_SHARE * one);
            let expected = ascending.chunk_by(same).map(|group| (group[0], group[group.len() - 1], group.len()));
            let found = cells(&distances, &params).groups(&params);
            let found = found.iter().map(|group| (group.near, group.far, group.points));
            prop_assert_eq!(found.collect::<Vec<_>>(), expected.collect::<Vec<_>>());
        }
    }

    #[test]
    fn the_heaviest_group_is_the_object() {
        let person_before_wall = [5.0, 5.1, 5.2, 5.3, 9.0, 9.1];
        assert_eq!(
            object(&person_before_wall, &[]),
            [5.0 - SLACK_M, 5.3 + SLACK_M]
        );
        let pole_before_car = [4.0, 9.0, 9.5, 10.0];
        assert_eq!(
            object(&pole_before_car, &[]),
            [9.0 - SLACK_M, 10.0 + SLACK_M]
        );
    }

    #[test]
    fn the_nearer_of_equal_groups_is_the_object() {
        assert_eq!(object(&[9.0, 20.0], &[]), [9.0 - SLACK_M, 9.0 + SLACK_M]);
    }

    #[test]
    fn a_side_seen_at_a_glance_is_bridged_and_a_wall_that_goes_on_is_not() {
        let rear_and_side = [10.0, 10.0, 10.1, 11.3, 12.6];
        assert_eq!(
            object(&rear_and_side, &[]),
            [10.0 - SLACK_M, 12.6 + SLACK_M]
        );
        assert_eq!(
            object(&rear_and_side, &[11.2, 12.5, 12.7]),
            [10.0 - SLACK_M, 10.1 + SLACK_M]
        );
    }

    #[test]
    fn what_goes_on_beside_the_mask_weighs_less() {
        let person_before_wall = [5.0, 5.1, 5.2, 9.0, 9.1, 9.2, 9.3, 9.4];
        assert_eq!(
            object(&person_before_wall, &[]),
            [9.0 - SLACK_M, 9.4 + SLACK_M]
        );
        let wall = [8.9, 9.0, 9.2];
        assert_eq!(
            object(&person_before_wall, &wall),
            [5.0 - SLACK_M, 5.2 + SLACK_M]
        );
    }

    #[test]
    fn the_nearer_group_outweighs_a_slightly_larger_one() {
        let nearer = [4.0 - SLACK_M, 4.1 + SLACK_M];
        let farther = [16.0 - SLACK_M, 16.1 + SLACK_M];
        // at four times the distance half the weight
        assert_eq!(object(&[4.0, 4.1, 16.0, 16.0, 16.0, 16.1], &[]), nearer);
        assert_eq!(
            object(&[4.0, 4.1, 16.0, 16.0, 16.0, 16.0, 16.1], &[]),
            farther
        );
    }

    #[test]
    fn no_point_makes_no_object() {
        let params = Params::default();
        assert!(object_of(&Cells::new(&params), &[1.0], &params).is_none());
    }
}
