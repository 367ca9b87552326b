//! Label diffusion z <- A z + b (method, steps 5 and 6).
//!
//! The products are not run one by one: their result is a polynomial of A times b, which a Chebyshev series
//! reaches with a third of the sweeps, in single precision. Both leave an error, which is estimated; where two
//! labels are nearer to one another than that, they are diffused again in double precision. Where the graph
//! is such that the series cannot be trusted, the products are run as they stand.

use crate::chebyshev::{Interval, Series, Tolerance};
use crate::lanes::{Lane, LaneSeeds, plan};
use crate::state::{Rows, State};
use crate::sweeps::{Step, Sweep, WIDTH_F32, WIDTH_F64};
use crate::values::Values;
use crate::{Error, Memory, PixelLabels, PointGraph, Real, Result};
use rayon::prelude::*;

/// What a series in single precision may leave out.
const TOLERANCE_F32: Tolerance = Tolerance(1e-7);
/// What a series in double precision may leave out.
const TOLERANCE_F64: Tolerance = Tolerance(1e-13);
/// Rounding of single precision, as a share of the largest likelihood of a point: 1e-5 on real frames, no bound.
const ROUNDING: f32 = 2.5e-5;
/// By how much the terms that a series leaves out are taken to exceed what the probe says of them.
const CAUTION: f64 = 1.0;
/// Error from which on a series is given up for plain products.
const LARGEST_ERROR: f64 = 1e-3;
/// How far likelihoods may leave [0, 1], and their sum what the seeds allow.
const SLACK: f32 = 1e-3;
/// Where one more product changes nothing by more, the solution counts as converged.
const CONVERGED: f64 = 1e-5;
/// Sweeps after which a run without a bound gives up.
const MOST_SWEEPS: usize = 20_000;
/// Rows handled by one task of the thread pool.
const BLOCK: usize = 2048;

/// How far a diffusion came.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Convergence {
    /// Sweeps over the graph that were computed for a label.
    pub sweeps: usize,
    /// Largest change of any likelihood that one more product would make, where that bounded the run.
    pub residual: Option<f64>,
    /// Estimate of the largest error of a likelihood from the terms that the series leaves out.
    pub error: f64,
    /// Points whose label was decided in double precision.
    pub refined: usize,
}

/// The winning label of every point.
#[derive(Debug, Clone, PartialEq)]
pub struct Diffused {
    /// argmax over the labels; of equal ones the lowest.
    pub labels: Vec<u32>,
    /// Value of the winner over the sum of all values; 0 where nothing reached the point.
    pub confidence: Vec<f32>,
    /// How far the diffusion came.
    pub convergence: Convergence,
}

impl Diffused {
    /// Keeps the vectors, which are no longer needed.
    pub(crate) fn keep_in(self, memory: &mut Memory) {
        memory.keep(self.labels);
        memory.keep(self.confidence);
    }
}

/// How to come to z.
#[derive(Debug, Clone, PartialEq)]
enum Scheme {
    /// So many products.
    Products(usize),
    /// Products until nothing changes.
    UntilConverged,
    /// A Chebyshev series that stands for so many products.
    Series(Series),
    /// A Chebyshev series that stands for endlessly many.
    ConvergedSeries(Series),
}

impl Convergence {
    /// Whether the run went on until one more product would change next to nothing.
    pub fn converged(&self) -> bool {
        self.residual.is_some_and(|residual| residual <= CONVERGED)
    }

    fn merge(&mut self, other: Self) {
        self.sweeps = self.sweeps.max(other.sweeps);
        self.residual = self
            .residual
            .into_iter()
            .chain(other.residual)
            .reduce(f64::max);
        self.error = self.error.max(other.error);
    }
}

/// Diffuses labels 0 to `n_labels` - 1 from their seeds `b` over the graph `a` and picks the winner at every
/// point. `iterations` is the number of products, `None` as many as it takes. `exact` yields `a` and `b` in
/// double precision, for points at which single precision does not tell the winner. Works in `memory`.
///
/// # Errors
/// [`Error::Mismatch`] where `b` does not fit `a` or `n_labels`, and whatever `exact` returns.
pub fn diffuse(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
    exact: impl FnOnce(&mut Memory) -> Result<(PointGraph<f64>, PixelLabels<f64>)>,
    memory: &mut Memory,
) -> Result<Diffused> {
    check(a, b, n_labels)?;
    let mut best = memory.filled(a.len(), Best::default());
    let labels: Vec<u32> = (0..n_labels as u32).collect();
    let choose = |lanes: &[Lane], z: &Values<f32, WIDTH_F32>| update(&mut best, lanes, z);
    let mut convergence = for_each_pass(a, b, &labels, iterations, choose, memory);
    let contested = Contested::among(&best, convergence.error);
    if !contested.points.is_empty() {
        let (a, b) = exact(memory)?;
        let labels = contested.labels(&best, n_labels);
        let mut refined = vec![(0, f64::NEG_INFINITY); contested.points.len()];
        let choose = |lanes: &[Lane], z: &Values<f64, WIDTH_F64>| {
            contested.refine(&mut refined, lanes, z);
        };
        for_each_pass(&a, &b, &labels, iterations, choose, memory);
        a.keep_in(memory);
        b.keep_in(memory);
        for (&point, &(label, _)) in contested.points.iter().zip(&refined) {
            best[point as usize].labels[0] = label;
        }
        convergence.refined = contested.points.len();
    }
    let best_of = best.par_iter().with_min_len(BLOCK);
    let labels = memory.collect(best_of.clone().map(|best| best.labels[0]));
    let confidence = memory.collect(best_of.map(Best::confidence));
    memory.keep(best);
    Ok(Diffused {
        labels,
        confidence,
        convergence,
    })
}

/// The likelihoods that [`diffuse`] compares, in single precision: `a.len()` rows of `n_labels`, row by row.
///
/// # Errors
/// As [`diffuse`].
pub fn likelihoods(
    a: &PointGraph,
    b: &PixelLabels,
    n_labels: usize,
    iterations: Option<usize>,
) -> Result<(Vec<f32>, Convergence)> {
    check(a, b, n_labels)?;
    let mut all = vec![0.0; a.len() * n_labels];
    let labels: Vec<u32> = (0..n_labels as u32).collect();
    let write = |lanes: &[Lane], z: &Values<f32, WIDTH_F32>| {
        for (i, row) in all.chunks_mut(n_labels).enumerate() {
            for (label, lane) in labels_of(lanes) {
                row[label as usize] = z.get(i, lane);
            }
        }
    };
    let memory = &mut Memory::of_one_frame();
    let convergence = for_each_pass(a, b, &labels, iterations, write, memory);
    Ok((all, convergence))
}

fn check(a: &PointGraph, b: &PixelLabels, n_labels: usize) -> Result<()> {
    let mismatch = |problem: String| {
        Err(Error::Mismatch {
            name: "pixel_labels",
            problem,
        })
    };
    if b.rows() != a.len() {
        return mismatch(format!("{} rows, the graph has {}", b.rows(), a.len()));
    }
    match b.labels.iter().find(|&&label| label as usize >= n_labels) {
        Some(label) => mismatch(format!("label {label}, expected labels below {n_labels}")),
        None => Ok(()),
    }
}

/// Calls `done` with the lanes of each pass and their values at all points.
fn for_each_pass<T: Sweep<WIDTH>, const WIDTH: usize>(
    a: &PointGraph<T>,
    b: &PixelLabels<T>,
    labels: &[u32],
    iterations: Option<usize>,
    mut done: impl FnMut(&[Lane], &Values<T, WIDTH>),
    memory: &mut Memory,
) -> Convergence {
    let tolerance = if WIDTH == WIDTH_F64 {
        TOLERANCE_F64
    } else {
        TOLERANCE_F32
    };
    let mut scheme = Scheme::choose(a, iterations, tolerance);
    let rows = Rows::new(a, memory);
    let mut convergence = Convergence::default();
    let probe = WIDTH == WIDTH_F32;
    for lanes in plan(b, labels, WIDTH, probe) {
        let seeds = LaneSeeds::new(b, &lanes, memory);
        let mut pass = scheme.run(&rows, &seeds, memory);
        if !matches!(scheme, Scheme::Products(_)) && !pass.is_sound(&lanes, largest_overlap(b)) {
            scheme = iterations.map_or(Scheme::UntilConverged, Scheme::Products);
            pass.keep_in(memory);
            pass = scheme.run(&rows, &seeds, memory);
        }
        done(&lanes, &pass.z);
        convergence.merge(pass.convergence());
        pass.keep_in(memory);
        seeds.keep_in(memory);
    }
    rows.keep_in(memory);
    convergence
}

/// What one pass came to.
struct Pass<T, const WIDTH: usize> {
    z: Values<T, WIDTH>,
    /// No longer needed.
    other: Values<T, WIDTH>,
    sweeps: usize,
    residual: Option<f64>,
    /// What the terms left out may amount to.
    error: f64,
}

impl Scheme {
    fn choose<T: Real>(a: &PointGraph<T>, iterations: Option<usize>, tolerance: Tolerance) -> Self {
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

    fn run<T: Sweep<WIDTH>, const WIDTH: usize>(
        &self,
        rows: &Rows<T>,
        seeds: &LaneSeeds<T>,
        memory: &mut Memory,
    ) -> Pass<T, WIDTH> {
        // the first product yields the seeds, the first step of a series its last term
        let first = match self {
            Self::Products(_) | Self::UntilConverged => 1.0,
            Self::Series(series) | Self::ConvergedSeries(series) => {
                series.coefficients[series.degree()]
            }
        };
        let state = State::new(rows, seeds, T::from_f64(first), memory);
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
        other: state.previous,
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
        other: state.previous,
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
        other: state.z,
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
fn largest_overlap<T: Real>(b: &PixelLabels<T>) -> f64 {
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
    fn convergence(&self) -> Convergence {
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

    fn keep_in(self, memory: &mut Memory) {
        self.z.keep_in(memory);
        self.other.keep_in(memory);
    }

    /// Whether little is left out, and no likelihood is negative or too large.
    fn is_sound(&self, lanes: &[Lane], overlap: f64) -> bool {
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
fn labels_of(lanes: &[Lane]) -> impl Iterator<Item = (u32, usize)> {
    lanes
        .iter()
        .enumerate()
        .filter_map(|(lane, carried)| match carried {
            Lane::Label(label) => Some((*label, lane)),
            Lane::Probe => None,
        })
}

/// The values of one lane.
struct LaneValues<'a, T, const WIDTH: usize> {
    group: &'a [[T; WIDTH]],
    lane: usize,
}

impl<T: Real, const WIDTH: usize> LaneValues<'_, T, WIDTH> {
    /// The value at point `i`.
    #[inline(always)]
    fn at(&self, i: usize) -> T {
        self.group[i][self.lane]
    }
}

/// Labels of the lanes that carry one, and their values.
fn label_values<'a, T: Real, const WIDTH: usize>(
    lanes: &[Lane],
    z: &'a Values<T, WIDTH>,
) -> Vec<(u32, LaneValues<'a, T, WIDTH>)> {
    let values = |(label, lane): (u32, usize)| {
        let (group, lane) = (z.group(lane / WIDTH), lane % WIDTH);
        (label, LaneValues { group, lane })
    };
    labels_of(lanes).map(values).collect()
}

fn update<const WIDTH: usize>(best: &mut [Best], lanes: &[Lane], z: &Values<f32, WIDTH>) {
    let lanes = label_values(lanes, z);
    best.par_iter_mut()
        .enumerate()
        .with_min_len(BLOCK)
        .for_each(|(i, best)| {
            for (label, values) in &lanes {
                best.offer(*label, values.at(i));
            }
        });
}

/// The best labels of a point so far.
#[derive(Debug, Clone, Copy, Default)]
struct Best {
    /// The winner and the one behind it; of equal ones the lowest first.
    labels: [u32; 2],
    /// Their values and that of the third.
    values: [f32; 3],
    sum: f32,
}

impl Best {
    #[inline]
    fn offer(&mut self, label: u32, value: f32) {
        self.sum += value;
        if value <= self.values[2] {
            return;
        }
        let beats =
            |other: f32, other_label: u32| value > other || (value == other && label < other_label);
        if beats(self.values[0], self.labels[0]) {
            self.values = [value, self.values[0], self.values[1]];
            self.labels = [label, self.labels[0]];
        } else if beats(self.values[1], self.labels[1]) {
            self.values = [self.values[0], value, self.values[1]];
            self.labels[1] = label;
        } else {
            self.values[2] = value;
        }
    }

    /// Whether the value at `rank` may really be the largest, where each may be off by `error`.
    fn may_win(&self, rank: usize, error: f64) -> bool {
        let behind = f64::from(self.values[0] - self.values[rank]);
        self.values[rank] > 0.0 && behind <= f64::from(ROUNDING * self.values[0]) + 2.0 * error
    }

    fn confidence(&self) -> f32 {
        if self.sum > 0.0 {
            (self.values[0] / self.sum).min(1.0)
        } else {
            0.0
        }
    }
}

/// The points at which single precision does not tell the winner.
struct Contested {
    points: Vec<u32>,
    /// Error of the values in single precision.
    error: f64,
}

impl Contested {
    fn among(best: &[Best], error: f64) -> Self {
        let contested = best
            .iter()
            .enumerate()
            .filter(|(_, best)| best.may_win(1, error));
        Self {
            points: contested.map(|(point, _)| point as u32).collect(),
            error,
        }
    }

    /// The labels that may win at any of the points, ascending.
    fn labels(&self, best: &[Best], n_labels: usize) -> Vec<u32> {
        let at = |&point: &u32| &best[point as usize];
        if self
            .points
            .iter()
            .map(at)
            .any(|best| best.may_win(2, self.error))
        {
            return (0..n_labels as u32).collect();
        }
        let mut labels: Vec<u32> = self
            .points
            .iter()
            .flat_map(|point| at(point).labels)
            .collect();
        labels.sort_unstable();
        labels.dedup();
        labels
    }

    /// Keeps the best label of each point and its value in `refined`.
    fn refine<const WIDTH: usize>(
        &self,
        refined: &mut [(u32, f64)],
        lanes: &[Lane],
        z: &Values<f64, WIDTH>,
    ) {
        for (&point, best) in self.points.iter().zip(refined) {
            for (label, lane) in labels_of(lanes) {
                let value = z.get(point as usize, lane);
                if value > best.1 || (value == best.1 && label < best.0) {
                    *best = (label, value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Neighbors;
    use proptest::prelude::*;

    /// Two points, each joined to the other with weight 1/4 and to its own pixel with weight 1/2.
    fn pair() -> (PointGraph, PixelLabels) {
        let a = PointGraph::from_csr(vec![0, 2, 4], vec![0, 1, 0, 1], vec![0.25; 4]).unwrap();
        let b = PixelLabels {
            offsets: vec![0, 1, 2],
            labels: vec![0, 1],
            weights: vec![0.5; 2],
            mass: vec![0.5; 2],
        };
        (a, b)
    }

    fn never(_: &mut Memory) -> Result<(PointGraph<f64>, PixelLabels<f64>)> {
        panic!("single precision tells the winner")
    }

    #[test]
    fn the_first_product_yields_the_seeds_and_the_second_mixes_them() {
        let (a, b) = pair();
        assert_eq!(
            likelihoods(&a, &b, 2, Some(1)).unwrap().0,
            [0.5, 0.0, 0.0, 0.5]
        );
        assert_eq!(
            likelihoods(&a, &b, 2, Some(2)).unwrap().0,
            [0.625, 0.125, 0.125, 0.625]
        );
    }

    #[test]
    fn without_a_bound_it_runs_to_the_fixed_point() {
        let (a, b) = pair();
        let (z, convergence) = likelihoods(&a, &b, 2, None).unwrap();
        assert!(convergence.converged());
        for (value, expected) in z.iter().zip([0.75, 0.25, 0.25, 0.75]) {
            assert!((value - expected).abs() < 1e-5);
        }
    }

    #[test]
    fn a_point_that_nothing_reaches_is_background_without_confidence() {
        let a = PointGraph::from_csr(vec![0, 1], vec![0], vec![1.0]).unwrap();
        let b = PixelLabels {
            offsets: vec![0, 0],
            labels: vec![],
            weights: vec![],
            mass: vec![0.0],
        };
        let diffused = diffuse(&a, &b, 3, Some(5), never, &mut Memory::of_one_frame()).unwrap();
        assert_eq!((diffused.labels[0], diffused.confidence[0]), (0, 0.0));
    }

    #[test]
    fn a_graph_on_which_the_series_diverges_gets_its_products() {
        // a ring that passes values on: eigenvalues lie on a circle, far from any real interval
        let n = 1000_u32;
        let columns = (0..n).map(|i| (i + 1) % n).collect();
        let a =
            PointGraph::from_csr((0..=n as usize).collect(), columns, vec![0.99; 1000]).unwrap();
        let b = PixelLabels {
            offsets: (0..=n as usize).collect(),
            labels: (0..n).map(|i| i / 100).collect(),
            weights: vec![0.01; 1000],
            mass: vec![0.01; 1000],
        };
        let (z, convergence) = likelihoods(&a, &b, 10, Some(200)).unwrap();
        assert!(convergence.sweeps >= 200);
        let expected: f64 = (0..100).map(|k| 0.01 * 0.99_f64.powi(k)).sum();
        assert!((f64::from(z[0]) - expected).abs() < 1e-5);
    }

    fn plain_products(
        a: &PointGraph<f64>,
        b: &PixelLabels<f64>,
        n_labels: usize,
        iterations: usize,
    ) -> Vec<f64> {
        let mut z = vec![0.0; a.len() * n_labels];
        for _ in 0..iterations {
            let mut next = vec![0.0; z.len()];
            for i in 0..a.len() {
                for (label, weight) in b.row(i) {
                    next[i * n_labels + label] = weight;
                }
                for (j, weight) in a.row(i) {
                    for label in 0..n_labels {
                        next[i * n_labels + label] += weight * z[j * n_labels + label];
                    }
                }
            }
            z = next;
        }
        z
    }

    type System<T> = (PointGraph<T>, PixelLabels<T>);

    /// A and b of `points` of which each sees `pixels` windows of two labels, in both precisions.
    fn system<T: Real>(points: &[[f64; 3]], seen: &[(u32, u32)], lambda: f64) -> System<T> {
        let mut a =
            PointGraph::from_neighbors(points, &Neighbors::search(points, 10), 1.0).unwrap();
        let mut b = PixelLabels {
            offsets: vec![0],
            labels: vec![],
            weights: vec![],
            mass: vec![],
        };
        for &(label, count) in seen {
            for (label, count) in [(0, 25 - count), (label, count)] {
                if count > 0 {
                    b.labels.push(label);
                    b.weights.push(T::from_f64(lambda * f64::from(count)));
                }
            }
            b.offsets.push(b.labels.len());
            b.mass.push(T::from_f64(lambda * 25.0));
        }
        a.normalize_rows(&mut b, &mut Memory::of_one_frame())
            .unwrap();
        (a, b)
    }

    #[test]
    fn a_cloud_too_large_for_the_cache_gets_the_likelihoods_of_plain_products() {
        // a strip, and far points that are joined to both of its ends
        let strip = (0..100_000).map(|i| [f64::from(i / 20), f64::from(i % 20), 0.0]);
        let far = (0..40).map(|i| [2500.0, 3000.0 + f64::from(i % 2), f64::from(i)]);
        let points: Vec<[f64; 3]> = strip.chain(far).collect();
        let seen: Vec<(u32, u32)> = (0..points.len() as u32)
            .map(|i| (1 + i / 7000 % 2, i % 26))
            .collect();
        let (a, b) = system::<f32>(&points, &seen, 0.01);
        let (found, _) = likelihoods(&a, &b, 3, Some(60)).unwrap();
        let (a, b) = system::<f64>(&points, &seen, 0.01);
        let expected = plain_products(&a, &b, 3, 60);
        let largest = found
            .iter()
            .zip(&expected)
            .map(|(found, expected)| (f64::from(*found) - expected).abs())
            .fold(0.0, f64::max);
        assert!(largest < 1e-5, "likelihoods differ by {largest}");
    }

    fn clouds() -> impl Strategy<Value = Vec<[f64; 3]>> {
        let scattered = proptest::collection::vec([-5.0..5.0_f64, -5.0..5.0, -1.0..1.0], 1..400);
        let graded =
            proptest::collection::vec((0.0..8.0_f64, 0.0..6.3_f64), 1..400).prop_map(|points| {
                // density falls by orders of magnitude with the distance from the origin
                points
                    .iter()
                    .map(|&(power, angle)| (10_f64.powf(power - 6.0), angle))
                    .map(|(r, angle)| [r * angle.cos(), r * angle.sin(), 0.0])
                    .collect()
            });
        let nested = proptest::collection::vec((0_i32..5, 0_i32..9), 1..400).prop_map(|points| {
            // clusters within clusters, coincident points among them
            points
                .iter()
                .map(|&(level, place)| {
                    let size = 0.1_f64.powi(level);
                    [
                        f64::from(place % 3) * size,
                        f64::from(place / 3) * size,
                        size,
                    ]
                })
                .collect()
        });
        let coincident = (1_usize..40, 1_usize..30).prop_map(|(places, copies)| {
            (0..places * copies)
                .map(|i| [(i / copies) as f64 * 0.3, 0.0, 0.0])
                .collect()
        });
        prop_oneof![scattered, graded, nested, coincident]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]
        #[test]
        fn labels_equal_those_of_plain_products_in_double_precision(
            points in clouds(),
            seen in proptest::collection::vec((1_u32..30, 0_u32..26), 1200),
            iterations in prop_oneof![Just(1_usize), Just(20), Just(200), Just(1000)],
            lambda in prop_oneof![Just(0.001), Just(0.1), Just(1e-5)],
        ) {
            let seen = &seen[..points.len()];
            let (a, b) = system::<f32>(&points, seen, lambda);
            let double = |_: &mut Memory| Ok(system::<f64>(&points, seen, lambda));
            let found = diffuse(&a, &b, 30, Some(iterations), double, &mut Memory::of_one_frame()).unwrap();
            let (a, b) = system::<f64>(&points, seen, lambda);
            let expected = plain_products(&a, &b, 30, iterations);
            for (i, (label, z)) in found.labels.iter().zip(expected.chunks(30)).enumerate() {
                let best = z.iter().fold(0.0, |best: f64, &z| best.max(z));
                prop_assert!(
                    z[*label as usize] >= best * (1.0 - 1e-11),
                    "point {} has label {} with {:e}, the best has {:e}", i, label, z[*label as usize], best
                );
            }
        }
    }
}
