//! The labels that win at some points in double precision: by the part of the graph that flows to the points, or where that is
//! much of it, by all of it.

use super::errors::Errors;
use super::lanes::WIDTH_F64;
use super::pass::Pass;
use super::plan::Planner;
use super::reach::Reach;
use super::schedule::{ROWS_A_TASK, Schedule};
use super::seeds::Seeds;
use super::series::Series;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::memory::{push, with_room};
use crate::{Cancel, Result};
use rayon::prelude::*;

/// Share of the largest value within which values in double precision are equal: what rounding leaves of equal ones.
const EQUAL: f64 = 1e-13;
/// By how many times what is left out of two values together may be more than estimated of one. Without rounding beside it, it is up to
/// 4.3 times as much, of half a million pairs of labels on clouds of all kinds.
const SAFETY: f64 = 10.0;

/// The leader of `candidates`, ascending, at each of `points`, where the `least` value is at best, with `series` in the place of the
/// products where there is one. `exact` is that of [`super::diffuse`].
///
/// # Errors
/// [`crate::Error::OutOfMemory`], [`crate::Error::Cancelled`], and whatever `exact` returns.
pub(super) fn leaders(
    a: &PointGraph,
    (points, least): (&[u32], f32),
    candidates: &[u32],
    (series, iterations): (Option<&Series>, Option<usize>),
    exact: impl Fn(Option<&[u32]>) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    cancel: &Cancel,
) -> Result<Vec<Leader>> {
    let steps = Pass::<f64, WIDTH_F64>::steps(series, iterations);
    // endlessly many products reach everything, and ask for a residual of all points
    let reach = match iterations {
        Some(_) => Reach::of(a, (points, least), steps, cancel)?,
        None => None,
    };
    let (exact_a, b) = exact(reach.as_ref().map(|reach| reach.points.as_slice()))?;
    let schedule = match &reach {
        Some(reach) => reach.schedule(&exact_a, cancel)?,
        None => Schedule::new(&exact_a, cancel)?,
    };
    let planner = Planner {
        schedule: &schedule,
        width: WIDTH_F64,
        probe: series.is_some(),
        sum: false,
        steps,
    };
    let mut leaders = with_room(points.len())?;
    leaders.resize(points.len(), Leader::default());
    for plan in planner.plan((&exact_a, &b), candidates, cancel)? {
        let seeds = Seeds::new(&b, plan, cancel)?;
        let mut pass: Pass<f64, WIDTH_F64> =
            Pass::run(&exact_a, &schedule, &seeds, series, iterations, cancel)?;
        cancel.check()?;
        // of a part, values of points farther away are not those of all steps
        let is_sound = |series: &Series| pass.is_sound(series.most_left_out, b.most(iterations));
        if reach.is_none() && !series.is_none_or(is_sound) {
            return self::leaders(
                a,
                (points, least),
                candidates,
                (None, iterations),
                exact,
                cancel,
            );
        }
        // the probe is in one pass alone
        let errors = Errors {
            a: &exact_a,
            estimates: std::mem::take(&mut pass.errors),
        };
        let offer = |(at, leader): (usize, &mut Leader)| {
            // points are the first of those that they reach
            let row = reach.as_ref().map_or(points[at] as usize, |_| at);
            leader.error += errors.at(row);
            let mut values = pass.at(row);
            values.try_for_each(|(label, value)| leader.offer(label, value))
        };
        let leaders = leaders.par_iter_mut().with_min_len(ROWS_A_TASK);
        leaders.enumerate().try_for_each(offer)?;
    }
    Ok(leaders)
}

/// The label that wins at a point in double precision, whatever the order in which labels are offered.
#[derive(Debug, Clone, Default)]
pub(super) struct Leader {
    /// The labels whose values are [`EQUAL`] to the largest, and these values.
    equal: Vec<(u32, f64)>,
    /// The largest value that is not.
    next: f64,
    /// What the series may leave out, going by the probe.
    error: f64,
}

impl Leader {
    fn offer(&mut self, label: u32, value: f64) -> Result<()> {
        if value <= 0.0 {
            // nothing of it came here
            return Ok(());
        }
        let largest = self.value().max(value);
        push(&mut self.equal, (label, value))?;
        let next = &mut self.next;
        self.equal.retain(|(_, value)| {
            let is_equal = *value >= largest * (1.0 - EQUAL);
            if !is_equal {
                *next = value.max(*next);
            }
            is_equal
        });
        Ok(())
    }

    fn value(&self) -> f64 {
        let values = self.equal.iter().map(|(_, value)| *value);
        values.fold(0.0, f64::max)
    }

    /// The lowest of equal ones.
    pub(super) fn label(&self) -> u32 {
        let labels = self.equal.iter().map(|(label, _)| *label);
        labels.min().unwrap_or(0)
    }

    /// How far it is ahead of the next: not at all of equal ones.
    fn lead(&self) -> f64 {
        match self.equal[..] {
            [(_, value)] => value - self.next,
            _ => 0.0,
        }
    }

    /// True if what the series may leave out does not matter.
    pub(super) fn is_sure(&self) -> bool {
        match self.equal.len() {
            1 => SAFETY * self.error <= self.lead(),
            _ => SAFETY * self.error <= EQUAL * self.value(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::chain;
    use proptest::prelude::*;

    fn leader(values: &[(u32, f64)]) -> Leader {
        let mut leader = Leader::default();
        for &(label, value) in values {
            leader.offer(label, value).unwrap();
        }
        leader
    }

    #[test]
    fn of_values_that_rounding_tells_apart_the_lowest_label_leads() {
        let below = 0.5 * (1.0 - f64::EPSILON);
        let found = leader(&[(3, 0.5), (0, below), (7, 0.25)]);
        assert_eq!((found.label(), found.lead()), (0, 0.0));
        assert_eq!(leader(&[(3, 0.0), (5, 0.0)]).label(), 0, "nothing came");
        let below = 0.5 * (1.0 - 1e-12);
        let found = leader(&[(1, 0.5), (0, below), (2, 0.5)]);
        assert_eq!((found.label(), found.lead()), (1, 0.0));
        let found = leader(&[(1, below), (0, 0.25), (2, 0.5)]);
        assert_eq!((found.label(), found.lead()), (2, 0.5 - below));
    }

    #[test]
    fn a_leader_is_sure_as_far_as_it_is_ahead_and_of_equal_ones_as_far_as_rounding() {
        let with_error = |values: &[(u32, f64)], error| Leader {
            error,
            ..leader(values)
        };
        let ahead = |error| with_error(&[(1, 0.5), (2, 0.25)], error).is_sure();
        assert_eq!([0.025, 0.0251, f64::NAN].map(ahead), [true, false, false]);
        let equal = |error| with_error(&[(1, 0.5), (2, 0.5)], error).is_sure();
        assert_eq!([5e-15, 6e-15, f64::NAN].map(equal), [true, false, false]);
    }

    proptest! {
        #[test]
        fn the_order_in_which_labels_are_offered_does_not_matter(
            values in proptest::collection::vec(0..8_u8, 1..9).prop_map(|steps| {
                // each differs from the next as much as rounding may make equal ones differ
                let value = |step: u8| 0.5 * (1.0 + 0.7 * EQUAL * f64::from(step));
                (0..).zip(steps.into_iter().map(value)).collect::<Vec<(u32, f64)>>()
            }),
            seed in any::<u64>(),
        ) {
            let largest = values.iter().map(|(_, value)| *value).fold(0.0, f64::max);
            let first = values.iter().find(|(_, value)| *value >= largest * (1.0 - EQUAL));
            let mut shuffled = values.clone();
            shuffled.sort_by_key(|(label, _)| (u64::from(*label) + 1).wrapping_mul(seed | 1));
            let [one, other] = [&values, &shuffled].map(|values| leader(values));
            prop_assert_eq!(Some(one.label()), first.map(|(label, _)| *label));
            prop_assert_eq!((one.label(), one.lead()), (other.label(), other.lead()));
        }
    }

    #[test]
    fn leaders_are_those_of_the_products_and_of_equal_labels_the_lowest() {
        fn system<T: crate::Real>() -> (PointGraph<T>, PixelLabels<T>) {
            let seeds: [&[(u32, f64)]; 5] = [
                &[(3, 0.01)],
                &[(1, 0.5)],
                &[(1, 0.5), (2, 0.5)],
                &[(2, 0.5)],
                &[(0, 0.75)],
            ];
            chain(&[0.25; 600], &seeds)
        }
        let asked = std::cell::Cell::new(0);
        let exact = |among: Option<&[u32]>| {
            let (a, b) = system::<f64>();
            let points = among.unwrap_or_default();
            asked.set(points.len());
            Ok((a.among(points), b.among(points)))
        };
        let labels_after = |products: usize, points: &[u32]| {
            let (a, _) = system::<f32>();
            let run = (None, Some(products));
            let found = leaders(
                &a,
                (points, 1.0),
                &[0, 1, 2, 3],
                run,
                exact,
                Cancel::never(),
            );
            let found = found.unwrap().into_iter();
            found.map(|leader| leader.label()).collect::<Vec<u32>>()
        };
        // point 2 has label 1 from itself, and label 2 from itself and from the next; nothing comes to point 5
        assert_eq!(labels_after(3, &[1, 2, 3, 5]), [1, 2, 2, 0]);
        assert_eq!(
            asked.get(),
            10,
            "points within as many edges as there are products, and two more"
        );
        assert_eq!(labels_after(1, &[2]), [1]);
    }
}
