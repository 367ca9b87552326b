//! One pass over the graph: the values of some labels at all points, and how they are come to.

use super::Convergence;
use super::lanes::{Lane, LaneSeeds};
use super::series::{Interval, Series, Tolerance};
use super::state::{Rows, State};
use super::sweeps::{Step, Sweep};
use super::values::Values;
use crate::Real;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use rayon::prelude::*;

/// By how much the terms that a series leaves out are taken to exceed what the probe says of them.
const CAUTION: f64 = 1.0;
/// Error from which on a series is given up for plain products.
const LARGEST_ERROR: f64 = 1e-3;
/// How far likelihoods may leave [0, 1], and their sum what the seeds allow.
const SLACK: f32 = 1e-3;
/// Where one more product changes nothing by more, the solution counts as converged.
pub(crate) const CONVERGED: f64 = 1e-5;
/// Sweeps after which a run without a bound gives up.
pub(crate) const MOST_SWEEPS: usize = 20_000;
/// Rows handled by one task of the thread pool.
const BLOCK: usize = 2048;

/// How to come to z.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Scheme {
    /// So many products.
    Products(usize),
    /// Products until nothing changes.
    UntilConverged,
    /// A Chebyshev series that stands for so many products.
    Series(Series),
    /// A Chebyshev series that stands for endlessly many.
    ConvergedSeries(Series),
}

/// What one pass came to.
pub(crate) struct Pass<T, const WIDTH: usize> {
    pub(crate) z: Values<T, WIDTH>,
    sweeps: usize,
    residual: Option<f64>,
    /// What the terms left out may amount to.
    error: f64,
}

impl Scheme {
    pub(crate) fn choose<T: Real>(
        a: &PointGraph<T>,
        iterations: Option<usize>,
        tolerance: Tolerance,
    ) -> Self {
        let interval =
            gershgorin(a).filter(|interval| interval.low >= -1.0 && interval.high <= 1.0);
        match (interval, iterations) {
            (Some(interval), Some(products)) => {
                let series = Series::of_geometric_sum(products, interval, tolerance);
                if series.degree() + 1 < products {
                    Self::Series(series)
                } else {
                    Self::Products(products)
                }
            }
            (Some(interval), None) if interval.high < 1.0 => {
                Self::ConvergedSeries(Series::of_resolvent(interval, tolerance, MOST_SWEEPS))
            }
            (_, Some(products)) => Self::Products(products),
            (_, None) => Self::UntilConverged,
        }
    }

    pub(crate) fn run<T: Sweep<WIDTH>, const WIDTH: usize>(
        &self,
        rows: &Rows<T>,
        seeds: &LaneSeeds<T>,
    ) -> Pass<T, WIDTH> {
        // the first product yields the seeds, the first step of a series its last term
        let first = match self {
            Self::Products(_) | Self::UntilConverged => 1.0,
            Self::Series(series) | Self::ConvergedSeries(series) => {
                series.coefficients[series.degree()]
            }
        };
        let state = State::new(rows, seeds, T::from_f64(first));
        match self {
            Self::Products(products) => run_products(state, *products),
            Self::UntilConverged => run_until_converged(state),
            Self::Series(series) => run_series(state, series, false),
            Self::ConvergedSeries(series) => run_series(state, series, true),
        }
    }
}

/// z <- A z + b as it stands.
const PRODUCT: (f64, f64, f64, f64) = (1.0, 1.0, 0.0, 0.0);

fn step<T: Real>((seeds, along, stay, back): (f64, f64, f64, f64)) -> Step<T> {
    let [seeds, along, stay, back] = [seeds, along, stay, back].map(T::from_f64);
    Step {
        seeds,
        along,
        stay,
        back,
    }
}

fn run_products<T: Sweep<WIDTH>, const WIDTH: usize>(
    mut state: State<T, WIDTH>,
    products: usize,
) -> Pass<T, WIDTH> {
    state.run(&vec![step(PRODUCT); products.saturating_sub(1)]);
    Pass {
        z: state.z,
        sweeps: products,
        residual: None,
        error: 0.0,
    }
}

fn run_until_converged<T: Sweep<WIDTH>, const WIDTH: usize>(
    mut state: State<T, WIDTH>,
) -> Pass<T, WIDTH> {
    let mut sweeps = 1;
    while largest_change(&state) > CONVERGED && sweeps < MOST_SWEEPS {
        state.run(&[step(PRODUCT)]);
        sweeps += 1;
    }
    last_product(state, sweeps, 0.0)
}

/// Clenshaw's recurrence: `y_k = c_k b + 2 X y_(k+1) - y_(k+2)`, `X = (A - middle) / half width`.
fn run_series<T: Sweep<WIDTH>, const WIDTH: usize>(
    mut state: State<T, WIDTH>,
    series: &Series,
    until_converged: bool,
) -> Pass<T, WIDTH> {
    let (middle, half_width) = (series.interval.middle(), series.interval.half_width());
    let degree = series.degree();
    let step_of = |k: usize| {
        // the last step takes X once, all others twice
        let times = if k == 0 { 1.0 } else { 2.0 };
        let (along, stay) = (times / half_width, times * middle / half_width);
        step((series.coefficients[k], along, stay, 1.0))
    };
    let steps: Vec<Step<T>> = (0..degree).rev().map(step_of).collect();
    state.run(&steps);
    let error = CAUTION * series.tail * largest_probe(&state);
    if until_converged {
        return last_product(state, degree, error);
    }
    Pass {
        z: state.z,
        sweeps: degree,
        residual: None,
        error,
    }
}

/// One more product, for the residual; the values are those before it.
fn last_product<T: Sweep<WIDTH>, const WIDTH: usize>(
    mut state: State<T, WIDTH>,
    sweeps: usize,
    error: f64,
) -> Pass<T, WIDTH> {
    state.run(&[step(PRODUCT)]);
    let residual = largest_change(&state);
    Pass {
        z: state.previous,
        sweeps: sweeps + 1,
        residual: Some(residual),
        error,
    }
}

/// An interval on which the real parts of all eigenvalues lie, if no weight is negative.
fn gershgorin<T: Real>(a: &PointGraph<T>) -> Option<Interval> {
    let row = |i: usize| {
        let (mut sum, mut diagonal) = (0.0, 0.0);
        for (j, weight) in a.row(i) {
            if weight < T::default() {
                return None;
            }
            sum += weight.to_f64();
            diagonal += if i == j { weight.to_f64() } else { 0.0 };
        }
        Some(Interval {
            low: 2.0 * diagonal - sum,
            high: sum,
        })
    };
    let hull = |a: Interval, b: Interval| Interval {
        low: a.low.min(b.low),
        high: a.high.max(b.high),
    };
    let empty = Interval {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };
    let found = (0..a.len())
        .into_par_iter()
        .with_min_len(BLOCK)
        .map(row)
        .try_reduce(|| empty, |a, b| Some(hull(a, b)))?;
    (found.low < found.high).then_some(found)
}

fn largest_change<T: Sweep<WIDTH>, const WIDTH: usize>(state: &State<T, WIDTH>) -> f64 {
    let lanes = (0..state.z.lanes()).filter(|lane| Some(*lane) != state.probe());
    let change_at = |lane, i| {
        (state.z.get(i, lane) - state.previous.get(i, lane))
            .to_f64()
            .abs()
    };
    let points = (0..state.points()).into_par_iter().with_min_len(BLOCK);
    lanes
        .map(|lane| {
            points
                .clone()
                .map(|i| change_at(lane, i))
                .reduce(|| 0.0, f64::max)
        })
        .fold(0.0, f64::max)
}

fn largest_probe<T: Sweep<WIDTH>, const WIDTH: usize>(state: &State<T, WIDTH>) -> f64 {
    let Some(lane) = state.probe() else {
        return 0.0;
    };
    (0..state.points())
        .map(|i| state.z.get(i, lane).to_f64().abs())
        .fold(0.0, f64::max)
}

/// Most labels that a pixel edge counts for, taken over a window: what the likelihoods of a point may sum to.
pub(crate) fn largest_overlap<T: Real>(b: &PixelLabels<T>) -> f64 {
    let overlap = |i: usize| {
        let mass = b.mass[i].to_f64();
        let weights: f64 = b.row(i).map(|(_, weight)| weight.to_f64()).sum();
        if mass > 0.0 {
            weights / mass
        } else {
            f64::INFINITY
        }
    };
    (0..b.rows()).map(overlap).fold(1.0, f64::max)
}

impl<T: Real, const WIDTH: usize> Pass<T, WIDTH> {
    pub(crate) fn convergence(&self) -> Convergence {
        let Self {
            sweeps,
            residual,
            error,
            ..
        } = *self;
        Convergence {
            sweeps,
            residual,
            error,
            refined: 0,
        }
    }

    /// Whether little is left out, and no likelihood is negative or too large.
    pub(crate) fn is_sound(&self, lanes: &[Lane], overlap: f64) -> bool {
        let slack = f64::from(SLACK);
        let lanes = label_values(lanes, &self.z);
        let row_is_sound = |i: usize| {
            let mut sum = 0.0;
            lanes.iter().all(|(_, values)| {
                let value = values.at(i).to_f64();
                sum += value;
                value >= -slack
            }) && sum <= overlap + slack
        };
        self.error <= LARGEST_ERROR
            && (0..self.z.points())
                .into_par_iter()
                .with_min_len(BLOCK)
                .all(row_is_sound)
    }
}

/// Label and lane of the lanes that carry a label.
pub(crate) fn labels_of(lanes: &[Lane]) -> impl Iterator<Item = (u32, usize)> {
    lanes
        .iter()
        .enumerate()
        .filter_map(|(lane, carried)| match carried {
            Lane::Label(label) => Some((*label, lane)),
            Lane::Probe => None,
        })
}

/// The values of one lane.
pub(crate) struct LaneValues<'a, T, const WIDTH: usize> {
    group: &'a [[T; WIDTH]],
    lane: usize,
}

impl<T: Real, const WIDTH: usize> LaneValues<'_, T, WIDTH> {
    /// The value at point `i`.
    #[inline(always)]
    pub(crate) fn at(&self, i: usize) -> T {
        self.group[i][self.lane]
    }
}

/// Labels of the lanes that carry one, and their values.
pub(crate) fn label_values<'a, T: Real, const WIDTH: usize>(
    lanes: &[Lane],
    z: &'a Values<T, WIDTH>,
) -> Vec<(u32, LaneValues<'a, T, WIDTH>)> {
    let values = |(label, lane): (u32, usize)| {
        let (group, lane) = (z.group(lane / WIDTH), lane % WIDTH);
        (label, LaneValues { group, lane })
    };
    labels_of(lanes).map(values).collect()
}
