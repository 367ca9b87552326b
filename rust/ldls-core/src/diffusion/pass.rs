//! One pass over the graph: the values of some labels at all points.

use super::convergence::{Convergence, MOST_SWEEPS, enough};
use super::lanes::{Lane, Lanes};
use super::plan::PROBE_GROUP;
use super::schedule::{Activity, ROWS_A_TASK, Schedule};
use super::seeds::Seeds;
use super::series::Series;
use super::sweep::{Step, take_steps};
use super::values::Values;
use crate::graph::PointGraph;
use crate::masks::Most;
use crate::memory::tabulate;
use crate::{Cancel, Error, Result};
use rayon::prelude::*;

/// How far likelihoods, and their sum, may leave what seeds may come to, as a share of the most of one label.
const SLACK: f64 = 1e-3;

/// The values of the lanes of one pass at all points, and how far they have come.
pub(super) struct Pass<'a, T, const WIDTH: usize> {
    a: &'a PointGraph<T>,
    schedule: &'a Schedule,
    seeds: &'a Seeds<T>,
    activity: Activity<'a>,
    /// Values.
    z: Values<T, WIDTH>,
    /// Values before the last step, which the next one overwrites.
    previous: Values<T, WIDTH>,
    /// Values that this leg of the series began with, but for the first, which begins with zeros.
    initial: Values<T, WIDTH>,
    /// Steps taken.
    taken: usize,
    /// What a series may leave out at each point, going by the probe, and what rounding does, where the pass has a lane of the sum;
    /// nothing where it has none of both.
    pub(super) errors: Vec<f32>,
    pub(super) convergence: Convergence,
}

impl<'a, T: Lane<WIDTH>, const WIDTH: usize> Pass<'a, T, WIDTH> {
    /// Runs `iterations` products, endlessly many for `None`, or the `series` that stands for them.
    pub(super) fn run(
        a: &'a PointGraph<T>,
        schedule: &'a Schedule,
        seeds: &'a Seeds<T>,
        series: Option<&Series>,
        iterations: Option<usize>,
        cancel: &Cancel,
    ) -> Result<Self> {
        // the first product yields the seeds, the first step of a series its last term
        let first = series.map_or(1.0, |series| series.coefficients[series.degree()]);
        let mut pass = Self::new(a, schedule, seeds, T::from_f64(first), cancel)?;
        cancel.check()?;
        match (series, iterations) {
            (Some(series), _) => pass.run_series(series, cancel)?,
            (None, Some(products)) => {
                pass.advance(&vec![Step::product(); products.saturating_sub(1)], cancel)?;
            }
            (None, None) => {
                let enough = enough(seeds.largest);
                while pass.largest_change() > enough && pass.taken + 1 < MOST_SWEEPS {
                    pass.advance(&[Step::product()], cancel)?;
                }
            }
        }
        if iterations.is_none() && pass.convergence.residual.is_none() {
            pass.measure_residual(cancel)?;
        }
        pass.convergence.sweeps = pass.taken + usize::from(series.is_none());
        Ok(pass)
    }

    /// Most steps that [`Self::run`] takes.
    pub(super) fn steps(series: Option<&Series>, iterations: Option<usize>) -> usize {
        match (series, iterations) {
            // one more for the residual
            (Some(series), products) => series
                .sweeps()
                .saturating_add(usize::from(products.is_none())),
            (None, Some(products)) => products.saturating_sub(1),
            (None, None) => usize::MAX,
        }
    }

    /// z = `scale` * s, and of the probe half of its seeds, as much as the values before lack.
    fn new(
        a: &'a PointGraph<T>,
        schedule: &'a Schedule,
        seeds: &'a Seeds<T>,
        scale: T,
        cancel: &Cancel,
    ) -> Result<Self> {
        let mut z = Values::zeros(0, a.len(), seeds.plan.groups, cancel)?;
        let mut previous = Values::zeros(1, a.len(), seeds.plan.groups, cancel)?;
        let half = T::from_f64(0.5);
        for group in 0..seeds.plan.groups {
            let tasks = z.group_mut(group).par_chunks_mut(ROWS_A_TASK);
            let tasks = tasks.zip(previous.group_mut(group).par_chunks_mut(ROWS_A_TASK));
            tasks.enumerate().try_for_each(|(task, (z, previous))| {
                cancel.check()?;
                let first = task * ROWS_A_TASK;
                seeds.put(group, first, z, scale);
                if group == PROBE_GROUP {
                    seeds.put_probe(first, z, half);
                    seeds.put_probe(first, previous, T::default() - half);
                }
                Ok::<(), Error>(())
            })?;
        }
        Ok(Self {
            a,
            schedule,
            seeds,
            activity: Activity::new(schedule, &seeds.groups(cancel)?),
            z,
            previous,
            initial: Values::none(),
            taken: 0,
            errors: Vec::new(),
            convergence: Convergence::default(),
        })
    }

    fn run_series(&mut self, series: &Series, cancel: &Cancel) -> Result<()> {
        self.advance(&series.steps(), cancel)?;
        // the probe has gone through the recurrence as the mean of the last two terms
        self.errors = self.errors_of(series.tail, cancel)?;
        let mut legs = 1;
        while self.is_to_go_on(series, legs, cancel)? {
            legs += 1;
            std::mem::swap(&mut self.z, &mut self.initial);
            if self.z.is_empty() {
                self.z = Values::zeros(2, self.a.len(), self.seeds.plan.groups, cancel)?;
            }
            self.advance(&series.steps_on(), cancel)?;
        }
        self.initial = Values::none();
        self.advance(&vec![Step::product(); series.products_left], cancel)?;
        let rounding = self.rounding(cancel)?;
        let errors = self.errors.par_iter_mut().with_min_len(ROWS_A_TASK);
        errors
            .zip(rounding)
            .for_each(|(error, rounding)| *error += rounding);
        let errors = self.errors.par_iter().with_min_len(ROWS_A_TASK).copied();
        self.convergence.error = errors.reduce(|| 0.0, f32::max).into();
        Ok(())
    }

    /// Whether a leg of `series` follows the first `legs`.
    fn is_to_go_on(&mut self, series: &Series, legs: usize, cancel: &Cancel) -> Result<bool> {
        if let Some(all) = series.legs {
            return Ok(legs < all);
        }
        self.measure_residual(cancel)?;
        Ok(!self.convergence.converged() && self.taken < MOST_SWEEPS)
    }

    /// Applies `steps` one after the other; what was z before the last becomes the previous values.
    fn advance(&mut self, steps: &[Step<T>], cancel: &Cancel) -> Result<()> {
        let initial = Some(&self.initial).filter(|initial| !initial.is_empty());
        take_steps(
            self.a,
            self.seeds,
            self.schedule,
            (self.taken, steps),
            &self.activity,
            (initial, [&mut self.z, &mut self.previous]),
            cancel,
        )?;
        self.taken += steps.len();
        if steps.len() % 2 == 1 {
            std::mem::swap(&mut self.z, &mut self.previous);
        }
        Ok(())
    }

    /// One more product, for the residual; the values are those before it.
    fn measure_residual(&mut self, cancel: &Cancel) -> Result<()> {
        self.advance(&[Step::product()], cancel)?;
        self.convergence.residual = Some(self.largest_change());
        self.convergence.enough = Some(enough(self.seeds.largest));
        std::mem::swap(&mut self.z, &mut self.previous);
        Ok(())
    }

    /// Gives up the values before the last step, once no further one is to come.
    pub(super) fn drop_previous(&mut self) {
        self.previous = Values::none();
    }

    /// By how much a value may be off because smaller ones counted as zero on the way.
    pub(super) fn lost(&self) -> f64 {
        self.convergence.sweeps as f64 * self.seeds.least.to_f64()
    }

    /// The labels that may have come to a point, and their values.
    pub(super) fn at(&self, point: usize) -> impl Iterator<Item = (u32, T)> {
        let groups = self.z.groups().enumerate();
        groups.flat_map(move |(group, values)| {
            let labels = self.labels_at(point, group).zip(*values[point]);
            labels.filter_map(|(label, value)| Some((label?, value)))
        })
    }

    /// Label of each lane of a group at a point, if it has one there.
    #[inline]
    pub(super) fn labels_at(
        &self,
        point: usize,
        group: usize,
    ) -> impl Iterator<Item = Option<u32>> {
        self.seeds.plan.labels_at(point, group)
    }

    /// Values of each group at all points, and one for each of its lanes, zero for those of no label.
    pub(super) fn groups(&self) -> impl Iterator<Item = (&[Lanes<T, WIDTH>], [T; WIDTH])> {
        self.z.groups().enumerate().map(|(group, values)| {
            let mut counts = [T::from_f64(1.0); WIDTH];
            let beside = self.seeds.plan.beside_labels();
            for lane in beside.filter(|lane| lane / WIDTH == group) {
                counts[lane % WIDTH] = T::default();
            }
            (values, counts)
        })
    }

    fn largest_change(&self) -> f64 {
        let beside: Vec<usize> = self.seeds.plan.beside_labels().collect();
        let of_group = |group: usize| {
            let change_at = |(z, previous): (&Lanes<T, WIDTH>, &Lanes<T, WIDTH>)| {
                let lanes = (0..WIDTH).filter(|lane| !beside.contains(&(group * WIDTH + lane)));
                let changes = lanes.map(|lane| (z[lane] - previous[lane]).to_f64().abs());
                changes.fold(0.0, f64::max)
            };
            let rows = self.z.group(group).par_iter();
            let rows = rows.zip(self.previous.group(group));
            let rows = rows.with_min_len(ROWS_A_TASK);
            rows.map(change_at).reduce(|| 0.0, f64::max)
        };
        (0..self.z.groups().count())
            .map(of_group)
            .fold(0.0, f64::max)
    }

    /// What the series, whose coefficients left out sum to `tail`, may leave out at each point, going by the probe there; nothing
    /// where there is no probe.
    fn errors_of(&self, tail: f64, cancel: &Cancel) -> Result<Vec<f32>> {
        let Some(first) = self.seeds.plan.probe.filter(|_| tail > 0.0) else {
            return Ok(Vec::new());
        };
        let values = self.z.group(PROBE_GROUP);
        let error = |point: usize| {
            let [x, y] = [0, 1].map(|lane| values[point][first + lane].to_f64());
            (tail * (x * x + y * y).sqrt()) as f32
        };
        tabulate(self.a.len(), error, cancel)
    }

    /// By how much the values of all labels at each point sum to another number than went through the recurrence as their sum;
    /// nothing where there is no lane of that.
    fn rounding(&self, cancel: &Cancel) -> Result<Vec<f32>> {
        let Some(lane) = self.seeds.plan.sum else {
            return Ok(Vec::new());
        };
        let groups: Vec<_> = self.groups().collect();
        let sum = self.z.group(lane / WIDTH);
        let rounding = |point: usize| {
            let of_group = |(values, counts): &(&[Lanes<T, WIDTH>], [T; WIDTH])| {
                let lanes = (0..WIDTH).map(|lane| (counts[lane] * values[point][lane]).to_f64());
                lanes.sum::<f64>()
            };
            let of_labels: f64 = groups.iter().map(of_group).sum();
            (sum[point][lane % WIDTH].to_f64() - of_labels).abs() as f32
        };
        tabulate(self.a.len(), rounding, cancel)
    }

    /// True if at most `most_left_out` of the `largest` likelihood is left out, none is negative or larger than that, and those of no
    /// point sum to more than those of all labels may.
    pub(super) fn is_sound(&self, most_left_out: f64, largest: Most) -> bool {
        let slack = SLACK * largest.one;
        let groups: Vec<_> = self.groups().collect();
        let zeros = [T::default(); WIDTH];
        let row_is_sound = |i: usize| {
            let (mut sums, mut least, mut most) = (zeros, zeros, zeros);
            for (values, counts) in &groups {
                for lane in 0..WIDTH {
                    let value = counts[lane] * values[i][lane];
                    sums[lane] += value;
                    least[lane] = if value < least[lane] {
                        value
                    } else {
                        least[lane]
                    };
                    most[lane] = if value > most[lane] {
                        value
                    } else {
                        most[lane]
                    };
                }
            }
            let sum: f64 = sums.iter().map(|sum| sum.to_f64()).sum();
            let negative = least.iter().any(|value| value.to_f64() < -slack);
            let beyond = most
                .iter()
                .any(|value| value.to_f64() > largest.one + slack);
            sum.is_finite() && sum <= largest.all + slack && !negative && !beyond
        };
        let points = (0..self.a.len()).into_par_iter().with_min_len(ROWS_A_TASK);
        self.convergence.error <= most_left_out * largest.one && points.all(row_is_sound)
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::Planner;
    use super::*;
    use crate::masks::PixelLabels;
    use crate::test_support::seeds_by_point;

    /// Two points without neighbours whose seeds of labels 0 and 1 are what likelihoods are after one product.
    fn pass_is_sound(likelihoods: [[f32; 2]; 2], error: f64, overlap: f64) -> bool {
        let a = PointGraph::from_csr(vec![0, 1, 2], vec![0, 1], vec![0.5; 2]).unwrap();
        let b = PixelLabels {
            offsets: vec![0, 2, 4],
            labels: vec![0, 1, 0, 1],
            weights: likelihoods.concat(),
            mass: vec![0.5; 2],
        };
        let never = Cancel::never();
        let schedule = Schedule::new(&a, never).unwrap();
        let planner = Planner {
            schedule: &schedule,
            width: 8,
            probe: false,
            sum: false,
            steps: 0,
        };
        let plan = planner.plan((&a, &b), &[0, 1], never).unwrap().remove(0);
        let seeds = Seeds::new(&b, plan, never).unwrap();
        let mut pass = Pass::<f32, 8>::run(&a, &schedule, &seeds, None, Some(1), never).unwrap();
        pass.convergence.error = error;
        pass.is_sound(
            1e-3,
            Most {
                all: overlap,
                one: 1.0,
            },
        )
    }

    #[test]
    fn the_probe_shows_the_mean_of_the_last_two_terms() {
        // points that are joined to themselves alone
        let own = [0.9, 0.5, 0.2];
        let a = PointGraph::from_csr(vec![0, 1, 2, 3], vec![0, 1, 2], own.to_vec()).unwrap();
        let seeds: &[(u32, f64)] = &[(1, 0.1)];
        let b = seeds_by_point(3, &[seeds; 3]);
        let (never, products) = (Cancel::never(), Some(200));
        let series = Series::of_graph(&a, products, 1e-7).pop().unwrap();
        let schedule = Schedule::new(&a, never).unwrap();
        let planner = Planner {
            schedule: &schedule,
            width: 4,
            probe: true,
            sum: false,
            steps: 200,
        };
        let plan = planner.plan((&a, &b), &[1], never).unwrap().remove(0);
        let seeds = Seeds::new(&b, plan, never).unwrap();
        let pass = Pass::<f64, 4>::run(&a, &schedule, &seeds, Some(&series), products, never);
        let errors = pass.unwrap().errors.into_iter().zip(&seeds.probe);
        for (own, (error, [x, y])) in own.into_iter().zip(errors) {
            let angle = ((own - series.middle) / series.half_width).acos();
            let term = |k: usize| (k as f64 * angle).cos();
            let mean = f64::midpoint(term(series.degree()), term(series.degree() - 1));
            let expected = x.hypot(*y) * series.tail * mean.abs();
            assert!(
                (f64::from(error) - expected).abs() < 1e-6 * series.tail,
                "{own}"
            );
        }
    }

    #[test]
    fn likelihoods_are_sound_within_their_bounds() {
        assert!(pass_is_sound([[0.5, 0.5], [0.0, 1.0]], 0.0, 1.0));
        assert!(pass_is_sound([[0.5, -0.0005], [0.0, 1.0]], 1e-3, 1.0));
    }

    #[test]
    fn a_negative_likelihood_is_unsound() {
        assert!(!pass_is_sound([[0.5, 0.5], [0.5, -0.01]], 0.0, 1.0));
    }

    #[test]
    fn likelihoods_that_sum_to_more_than_their_pixel_edges_count_for_are_unsound() {
        assert!(!pass_is_sound([[0.6, 0.6], [0.0, 1.0]], 0.0, 1.0));
        assert!(pass_is_sound([[0.6, 0.6], [0.0, 1.0]], 0.0, 1.2));
    }

    #[test]
    fn a_likelihood_larger_than_any_share_of_pixel_edges_is_unsound() {
        assert!(pass_is_sound([[1.0, 1.0], [0.0, 1.0]], 0.0, 2.0));
        assert!(!pass_is_sound([[1.08, 0.5], [0.0, 1.0]], 0.0, 2.0));
    }

    #[test]
    fn terms_left_out_that_may_be_large_are_unsound() {
        assert!(!pass_is_sound([[0.5, 0.5], [0.0, 1.0]], 1.1e-3, 1.0));
    }
}
