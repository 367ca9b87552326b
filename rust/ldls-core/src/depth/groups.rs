//! Groups of the points of a mask by their distance to the camera.

use crate::Params;

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

/// A point on a mask that stands on the ground.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    /// Distance to the camera, in metres.
    pub(super) distance: f64,
    /// Steps to the edge of the mask: the nearer to its middle, the surer.
    pub(super) weight: u64,
}

/// Points without a gap between them.
#[derive(Debug, Clone, Copy)]
struct Group {
    near: f64,
    far: f64,
    points: usize,
    weight: u64,
}

/// Nearest and farthest distance of the object that `members` show, in metres: those of the heaviest group, the nearest
/// of equals, and some slack. `beside` are the distances of the points beside the mask; both ascend.
///
/// What lies behind an object goes on beside its mask and is hidden by what is before it, so the weight of a group is
/// that of its points on the mask, times the square of their share of all at its distances, over the square root of the
/// nearest. Of 2,981 masks of simulated cars and people 2.4 % are then at another distance than their object; by weight
/// and share alone 2.9 %, by seventeen properties of a group and weights fitted to them 2.0 %.
///
/// The long side of a vehicle seen from behind has gaps of metres: groups apart by no more than `bridged_gap` are one
/// unless the lighter one goes on beside the mask.
pub(super) fn object_of(members: &[Member], beside: &[f64], params: &Params) -> Option<[f64; 2]> {
    let mut groups: Vec<Group> = Vec::new();
    for &Member { distance, weight } in members {
        match groups.last_mut() {
            Some(group) if distance - group.far <= params.depth_gap.max(GAP_SHARE * group.far) => {
                group.far = distance;
                group.points += 1;
                group.weight += weight;
            }
            _ => groups.push(Group {
                near: distance,
                far: distance,
                points: 1,
                weight,
            }),
        }
    }
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

    fn object(distances: &[f64], beside: &[f64]) -> [f64; 2] {
        let member = |&distance| Member {
            distance,
            weight: 1,
        };
        let members: Vec<Member> = distances.iter().map(member).collect();
        object_of(&members, beside, &Params::default()).unwrap()
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
        assert!(object_of(&[], &[1.0], &Params::default()).is_none());
    }
}
