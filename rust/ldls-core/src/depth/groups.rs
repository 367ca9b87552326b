//! Groups of the points of a mask by their distance to the camera.

use crate::Params;

/// Gap between two groups as a share of the distance, where that is more than `depth_gap`: points thin out.
const GAP_SHARE: f64 = 0.03;
/// The same for gaps that are bridged.
const BRIDGED_SHARE: f64 = 0.1;
/// A group that goes on beside the mask, with more than this share of its points there, is background: not bridged to.
const MOST_BESIDE: f64 = 0.25;
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
/// of equals, and some slack. `beside` are the distances, ascending, of the points beside the mask.
///
/// The long side of a vehicle seen from behind has gaps of metres. Groups apart by no more than `bridged_gap` are one
/// unless the lighter one goes on beside the mask, as a wall behind a person does.
pub(super) fn object_of(
    mut members: Vec<Member>,
    beside: &[f64],
    params: &Params,
) -> Option<[f64; 2]> {
    members.sort_unstable_by(|one, other| one.distance.total_cmp(&other.distance));
    let mut groups: Vec<Group> = Vec::new();
    for Member { distance, weight } in members {
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
    let goes_on = |group: &Group| {
        let first = beside.partition_point(|&distance| distance < group.near - SLACK_M);
        let last = beside.partition_point(|&distance| distance <= group.far + SLACK_M);
        let beside = (last - first) as f64;
        beside > MOST_BESIDE * (beside + group.points as f64)
    };
    let one_object = |before: &Group, group: &Group| {
        let bridged = params.bridged_gap.max(BRIDGED_SHARE * before.far);
        let lighter = if group.weight <= before.weight {
            group
        } else {
            before
        };
        params.bridged_gap > 0.0 && group.near - before.far <= bridged && !goes_on(lighter)
    };
    let chains = groups.chunk_by(one_object);
    let weight = |chain: &[Group]| chain.iter().map(|group| group.weight).sum::<u64>();
    let object = chains.rev().max_by_key(|chain| weight(chain))?;
    Some([
        object[0].near - SLACK_M,
        object[object.len() - 1].far + SLACK_M,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn object(distances: &[f64], beside: &[f64]) -> [f64; 2] {
        let members = distances.iter().map(|&distance| Member {
            distance,
            weight: 1,
        });
        object_of(members.collect(), beside, &Params::default()).unwrap()
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
        assert_eq!(object(&[20.0, 9.0], &[]), [9.0 - SLACK_M, 9.0 + SLACK_M]);
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
    fn no_point_makes_no_object() {
        assert!(object_of(Vec::new(), &[1.0], &Params::default()).is_none());
    }
}
