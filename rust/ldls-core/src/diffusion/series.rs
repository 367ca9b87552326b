//! Polynomials of a matrix as Chebyshev series.
//!
//! T products z <- A z + b from z = 0 yield p(A) b with p(x) = 1 + x + ... + x^(T - 1), and endlessly many
//! yield (1 - x)^(-1). Where the spectrum of A lies near a real interval, a Chebyshev series on that
//! interval comes as near to p(A) b with far fewer products. The more products, the more terms of eigenvalues that lie off it
//! grow before they shrink, so many products are divided into legs: T products from any z
//! yield p(A) b + A^T z.

use super::schedule::ROWS_A_TASK;
use super::sweep::Step;
use crate::Real;
use crate::graph::PointGraph;
use rayon::prelude::*;

/// What the eigenvalues of the graph of a cloud lie above: -0.25 to -0.34 is the least one of frames of 64 beams, where
/// Gershgorin's theorem says -0.82.
const USUAL_LOW: f64 = -0.5;
/// What series may leave out of a likelihood, as a share of the largest that there may be. On graphs where it would be more, the
/// terms left out grow, and the probe says too little.
const MOST_LEFT_OUT: f64 = 1e-4;
/// The same of those that begin at [`USUAL_LOW`]: in one frame of a hundred some dozen points have more than the others may,
/// and double precision decides the near-ties among them.
const MOST_LEFT_OUT_OF_SHORT: f64 = 1e-2;

/// Products for which one series stands: terms of more grow, at eigenvalues far from the interval, to where they leave no digits.
const MOST_PRODUCTS: usize = 256;

/// Ratio of one term of 1 / (1 - x) to the one before from which on they grow likewise, and legs are taken instead.
const MOST_RATIO: f64 = 0.87;

/// Coefficients below it are left out of a sum that is at least 1: far less than any tolerance, even a hundred thousand times.
const NOTHING: f64 = 1e-30;

/// `c_0 T_0 + c_1 T_1 + ...` on an interval.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Series {
    /// Mean of the ends of the interval.
    pub(super) middle: f64,
    /// Half the distance of the ends.
    pub(super) half_width: f64,
    /// `c_0`, `c_1` and so on; the degree is one less than their number.
    pub(super) coefficients: Vec<f64>,
    /// Those of the power of A that the values of one leg are multiplied by in the next, as many; none of a single leg.
    power: Vec<f64>,
    /// How often it is taken, each time from the values of the time before; `None` until they change next to nothing.
    pub(super) legs: Option<usize>,
    /// Products to be run after it.
    pub(super) products_left: usize,
    /// Sum of the coefficients left out, none of which is negative, over all legs.
    pub(super) tail: f64,
    /// What it may leave out of any likelihood, as a share of the largest that there may be: where that is more, it is given up.
    pub(super) most_left_out: f64,
}

impl Series {
    /// The series that stand for so many products with `a`, `None` for endlessly many, and leave out at most the share
    /// `tolerance` of the largest value: first that of an interval near which all eigenvalues lie, and which is never narrow,
    /// then a shorter one of where they lie as a rule. None that cannot be trusted or takes no fewer sweeps.
    pub(super) fn of_graph<T: Real>(
        a: &PointGraph<T>,
        iterations: Option<usize>,
        tolerance: f64,
    ) -> Vec<Self> {
        let sound = |[low, high]: [f64; 2]| -1.0 <= low && low < high && high <= 1.0;
        let ends = gershgorin(a).filter(|ends| sound(*ends) && a.may_be_of_cloud());
        let Some([low, high]) = ends else {
            return Vec::new();
        };
        // rounding is divided by the width, and in single precision may lead out of an interval that has next to none; where the
        // middle is not negative no coefficient is
        let low_or_less = low.min(USUAL_LOW);
        let wide = [low_or_less, high.max(-low_or_less)];
        let long = Self::on(wide, iterations, tolerance);
        let mut series: Vec<Self> = long.into_iter().collect();
        // a matrix that was read is asked for its values, which nothing decides again
        let of_cloud = a.degree().is_some() && iterations.is_some();
        if of_cloud && low < USUAL_LOW && USUAL_LOW < high && !series.is_empty() {
            let short = Self::on([USUAL_LOW, high], iterations, tolerance);
            series.extend(short.map(|short| Self {
                most_left_out: MOST_LEFT_OUT_OF_SHORT,
                ..short
            }));
        }
        series
    }

    /// The series on the same interval that leaves out at most the share `tolerance`, if it takes fewer sweeps than as many
    /// `iterations`.
    pub(super) fn within(&self, tolerance: f64, iterations: Option<usize>) -> Option<Self> {
        let ends = [self.middle - self.half_width, self.middle + self.half_width];
        Self::on(ends, iterations, tolerance)
    }

    /// The series on the interval between `ends`, if there is one that takes fewer sweeps.
    fn on(ends: [f64; 2], iterations: Option<usize>, tolerance: f64) -> Option<Self> {
        let of_products = || Self::of_products(iterations, ends, tolerance);
        match iterations {
            Some(products) => Some(of_products()).filter(|series| series.sweeps() + 1 < products),
            None => Self::of_resolvent(ends, tolerance).or_else(|| Some(of_products())),
        }
    }

    /// The series of so many products, for an interval whose middle is not negative.
    fn of_products(products: Option<usize>, [low, high]: [f64; 2], tolerance: f64) -> Self {
        let (middle, half_width) = (f64::midpoint(high, low), (high - low) / 2.0);
        let legs = products.map(|products| products.div_ceil(MOST_PRODUCTS).max(1));
        let (of_leg, products_left) = match (products, legs) {
            (Some(products), Some(legs)) => (products / legs, products % legs),
            _ => (MOST_PRODUCTS, 0),
        };
        let mut coefficients = geometric_sum(of_leg, middle, half_width);
        let mut power = if legs == Some(1) {
            Vec::new()
        } else {
            power(of_leg, middle, half_width)
        };
        // all T_k are 1 at the upper end, where the sum is largest; values go on as they are, or shrink
        let largest: f64 = coefficients.iter().sum();
        let degree = degree_within(&coefficients, tolerance * largest);
        let degree = degree.max(degree_within(&power, tolerance));
        // what one leg leaves out stays, and each leaves out as much of the values before as of 1: of endlessly many, which end where
        // they change little, less than that
        let n = legs.unwrap_or(1) as f64;
        let tail = n * cut(&mut coefficients, degree)
            + n * (n - 1.0) / 2.0 * largest * cut(&mut power, degree);
        Self {
            middle,
            half_width,
            coefficients,
            power,
            legs,
            products_left,
            tail,
            most_left_out: MOST_LEFT_OUT,
        }
    }

    /// The series of 1 / (1 - x), if the interval ends so far below 1 that its terms soon shrink.
    fn of_resolvent([low, high]: [f64; 2], tolerance: f64) -> Option<Self> {
        let (middle, half_width) = (f64::midpoint(high, low), (high - low) / 2.0);
        // 1 / (a - t) = 2 / sqrt(a^2 - 1) * (1/2 + r T_1(t) + r^2 T_2(t) + ...), r = a - sqrt(a^2 - 1)
        let a = (1.0 - middle) / half_width;
        let root = ((a - 1.0) * (a + 1.0)).sqrt();
        let ratio = 1.0 / (a + root);
        if high >= 1.0 || ratio > MOST_RATIO {
            return None;
        }
        let degree = (tolerance.ln() / ratio.ln()).ceil() as usize;
        let scale = 2.0 / (root * half_width);
        let mut coefficients: Vec<f64> =
            (0..=degree).map(|k| scale * ratio.powi(k as i32)).collect();
        coefficients[0] /= 2.0;
        let next = scale * ratio.powi(degree as i32 + 1);
        coefficients[degree] -= next / (1.0 + ratio);
        let tail = next / (1.0 - ratio);
        Some(Self {
            middle,
            half_width,
            power: vec![0.0; coefficients.len()],
            coefficients,
            legs: Some(1),
            products_left: 0,
            tail,
            most_left_out: MOST_LEFT_OUT,
        })
    }

    /// Clenshaw's recurrence, from the last coefficient times b: `y_k = c_k b + 2 X y_(k+1) - y_(k+2)`, where X is
    /// (A - middle) / half width.
    pub(super) fn steps<T: Real>(&self) -> Vec<Step<T>> {
        let step = |k: usize| {
            // the last step takes X once, all others twice
            let times = if k == 0 { 1.0 } else { 2.0 };
            let along = times / self.half_width;
            Step::new(self.terms(k), along, -along * self.middle, -1.0)
        };
        (0..self.degree()).rev().map(step).collect()
    }

    /// The same from the values of the leg before, which are the initial ones: `d_k z_0` comes to each `c_k b`.
    pub(super) fn steps_on<T: Real>(&self) -> Vec<Step<T>> {
        let mut steps = self.steps();
        if let Some(step) = steps.first_mut() {
            // before the first two there are values of that leg
            step.back = T::default();
        }
        steps.insert(0, Step::new(self.terms(self.degree()), 0.0, 0.0, 0.0));
        steps
    }

    /// What `T_k` has of b, and of the values of the leg before.
    fn terms(&self, k: usize) -> [f64; 2] {
        [self.coefficients[k], self.power[k]]
    }

    /// Most sweeps over the graph, those of the products left among them.
    pub(super) fn sweeps(&self) -> usize {
        let of_leg = self.degree() + 1;
        // the first begins with the last term
        let of_legs = self.legs.map(|legs| legs * of_leg - 1);
        of_legs.map_or(usize::MAX, |sweeps| sweeps + self.products_left)
    }

    /// Highest k of `T_k`.
    pub(super) fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }
}

/// An interval on which the real parts of all eigenvalues lie, if no weight is negative.
fn gershgorin<T: Real>(a: &PointGraph<T>) -> Option<[f64; 2]> {
    let row = |i: usize| {
        let (columns, weights) = a.slices(i..i + 1);
        let (mut sum, mut own, mut positive) = (0.0, 0.0, true);
        for (&column, weight) in columns.iter().zip(weights) {
            let weight = weight.to_f64();
            sum += weight;
            own += if column as usize == i { weight } else { 0.0 };
            positive &= weight >= 0.0;
        }
        positive.then_some([2.0 * own - sum, sum])
    };
    let hull = |a: [f64; 2], b: [f64; 2]| [a[0].min(b[0]), a[1].max(b[1])];
    let rows = (0..a.len()).into_par_iter().with_min_len(ROWS_A_TASK);
    rows.map(row).try_reduce(
        || [f64::INFINITY, f64::NEG_INFINITY],
        |a, b| Some(hull(a, b)),
    )
}

/// The coefficients of 1 + x + ... + x^(`terms` - 1) but for those that are next to nothing. None is negative where `middle` is not, so
/// that none cancels another and the smallest keep their digits.
fn geometric_sum(terms: usize, middle: f64, half_width: f64) -> Vec<f64> {
    // what further terms add is next to nothing
    let enough = NOTHING.ln() / (middle + half_width).ln();
    let terms = if enough > 0.0 {
        terms.min(enough.ceil() as usize)
    } else {
        terms
    };
    let sum = (1..terms).fold(vec![2.0], |sum, _| {
        let mut sum = times_x(sum, middle, half_width);
        sum[0] += 2.0;
        sum
    });
    halve_first(sum)
}

/// Those of x^`exponent`, likewise.
fn power(exponent: usize, middle: f64, half_width: f64) -> Vec<f64> {
    let power = (0..exponent).fold(vec![2.0], |power, _| times_x(power, middle, half_width));
    halve_first(power)
}

/// Those of a polynomial times x, the first of both doubled, but for the last ones that are next to nothing.
fn times_x(mut coefficients: Vec<f64>, middle: f64, half_width: f64) -> Vec<f64> {
    // 2 t T_k = T_(k + 1) + T_(k - 1), where T_(-1) is T_1: as those of an even function are, of which the first is there once
    coefficients.extend([0.0; 2]);
    let first = middle * coefficients[0] + half_width * coefficients[1];
    let inner = coefficients.windows(3);
    let inner = inner.map(|c| middle * c[1] + half_width / 2.0 * (c[0] + c[2]));
    let mut product: Vec<f64> = std::iter::once(first).chain(inner).collect();
    let last = product.iter().rposition(|c| *c > NOTHING);
    product.truncate(last.map_or(1, |last| last + 1));
    product
}

fn halve_first(mut coefficients: Vec<f64>) -> Vec<f64> {
    coefficients[0] /= 2.0;
    coefficients
}

/// Least degree behind which the coefficients sum to at most `remainder`.
fn degree_within(coefficients: &[f64], remainder: f64) -> usize {
    let mut tail = 0.0;
    for degree in (1..coefficients.len()).rev() {
        tail += coefficients[degree].abs();
        if tail > remainder {
            return degree;
        }
    }
    0
}

/// Leaves only terms up to that of `degree`; the sum of the others, none of which is negative. At eigenvalues below the interval, where
/// `T_k` grow, these alternate in sign: to about as much as they sum to there comes to the last term that is left.
fn cut(coefficients: &mut Vec<f64>, degree: usize) -> f64 {
    let left_out = coefficients.iter().skip(degree + 1);
    let tail = left_out.clone().sum();
    let signs = [-1.0, 1.0].into_iter().cycle();
    let alternating: f64 = left_out.zip(signs).map(|(c, sign)| sign * c).sum();
    coefficients.resize(degree + 1, 0.0);
    coefficients[degree] += alternating;
    tail
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Cancel;
    use crate::masks::PixelLabels;
    use crate::neighbors::Neighbors;

    const LOW: f64 = -0.8;
    const HIGH: f64 = 0.998;

    /// `coefficients` as those of `T_0`, `T_1` and so on, on the interval of `series`.
    fn sum_of_terms(coefficients: &[f64], series: &Series, x: f64) -> f64 {
        let terms = coefficients.iter().enumerate();
        terms.map(|(k, c)| c * term(k, series, x)).sum()
    }

    /// `T_k` on the interval of `series`, or where x lies below it.
    fn term(k: usize, series: &Series, x: f64) -> f64 {
        let t = (x - series.middle) / series.half_width;
        if t < -1.0 {
            let sign = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            return sign * (k as f64 * (-t).acosh()).cosh();
        }
        (k as f64 * t.acos()).cos()
    }

    /// What a series makes of 1.
    fn evaluate(series: &Series, x: f64) -> f64 {
        let [b, power] = [&series.coefficients, &series.power];
        let [b, power] = [b, power].map(|coefficients| sum_of_terms(coefficients, series, x));
        let z = (0..series.legs.unwrap()).fold(0.0, |z, _| b + power * z);
        (0..series.products_left).fold(z, |z, _| x * z + 1.0)
    }

    fn points() -> impl Iterator<Item = f64> {
        (0..=1000).map(|i| LOW + f64::from(i) / 1000.0 * (HIGH - LOW))
    }

    #[test]
    fn graphs_of_clouds_have_a_long_series_and_a_short_one_and_others_the_long_one_or_none() {
        let points: Vec<[f64; 3]> = (0..400)
            .map(|i| [f64::from(i % 20) / 9.0, f64::from(i / 20) / 9.0, 0.0])
            .collect();
        let never = Cancel::never();
        let neighbors = Neighbors::search(&points, 10, never).unwrap();
        let mut a = PointGraph::<f32>::from_neighbors(&points, &neighbors, 1.0, never).unwrap();
        let mut b = PixelLabels {
            offsets: vec![0; 401],
            labels: vec![],
            weights: vec![],
            mass: vec![0.025; 400],
        };
        a.normalize_rows(&mut b, never).unwrap();
        let degrees = |a: &PointGraph, iterations| {
            let series = Series::of_graph(a, iterations, 1e-7);
            let degrees = series.iter().map(Series::degree);
            degrees.collect::<Vec<_>>()
        };
        assert_eq!(degrees(&a, Some(200)), [64, 58]);
        assert_eq!(degrees(&a, None).len(), 1);
        let (offsets, columns, weights) = a.clone().into_csr(never).unwrap();
        let read = PointGraph::from_csr(offsets.clone(), columns.clone(), weights.clone()).unwrap();
        assert_eq!(degrees(&read, Some(200)), [64]);
        let without_own = weights.iter().enumerate();
        let without_own = without_own.map(|(at, &weight)| if at % 11 == 0 { 0.0 } else { weight });
        let any = PointGraph::from_csr(offsets, columns, without_own.collect()).unwrap();
        assert!(degrees(&any, Some(200)).is_empty());
        let [long, short] = &Series::of_graph(&a, Some(200), 1e-7)[..] else {
            panic!("two series")
        };
        assert!(short.most_left_out > long.most_left_out);
        let within = short.within(1e-9, Some(200)).unwrap();
        assert!(short.degree() < within.degree() && within.degree() < 72);
        assert!(short.within(1e-9, Some(10)).is_none());
    }

    #[test]
    fn where_eigenvalues_lie_close_together_the_interval_is_as_wide_as_usual() {
        let own = PointGraph::<f32>::from_csr(vec![0, 1, 2], vec![0, 1], vec![0.9, 0.9 + 1e-7]);
        let series = Series::of_graph(&own.unwrap(), Some(200), 1e-7);
        let [series] = &series[..] else {
            panic!("one series")
        };
        assert!((series.middle - series.half_width - USUAL_LOW).abs() < 1e-9);
    }

    #[test]
    fn a_series_equals_the_sum_of_powers() {
        for (products, legs, most) in [
            (1, 1, 0),
            (2, 1, 1),
            (7, 1, 6),
            (200, 1, 64),
            (501, 2, 160),
            (5000, 20, 1600),
        ] {
            let series = Series::of_products(Some(products), [LOW, HIGH], 1e-7);
            // no term grows on the interval, so what is left out is twice the coefficients at most, and rounding
            let left_out = 2.0 * series.tail + 1e-9;
            for x in points() {
                let sum: f64 = (0..products).map(|k| x.powi(k as i32)).sum();
                assert!(
                    (evaluate(&series, x) - sum).abs() <= left_out,
                    "{products} products at {x}"
                );
            }
            assert_eq!(series.legs, Some(legs));
            assert!(
                series.sweeps() <= most,
                "{products} products took {} sweeps",
                series.sweeps()
            );
        }
    }

    #[test]
    fn below_the_interval_it_leaves_out_as_little_as_the_mean_of_the_last_two_terms() {
        let (products, resolvent) = (
            Series::of_products(Some(200), [LOW, HIGH], 1e-7),
            Series::of_resolvent([LOW, 0.99], 1e-7).unwrap(),
        );
        let sum = |x: f64| (0..200).map(|k| x.powi(k)).sum::<f64>();
        let inverse = |x: f64| 1.0 / (1.0 - x);
        let cases: [(&Series, &dyn Fn(f64) -> f64); 2] =
            [(&products, &sum), (&resolvent, &inverse)];
        for (series, exact) in cases {
            for step in 1..=40 {
                let x = LOW - f64::from(step) * 1e-3;
                let last = term(series.degree(), series, x);
                let mean = f64::midpoint(last, term(series.degree() - 1, series, x));
                let left_out = (evaluate(series, x) - exact(x)).abs();
                assert!(left_out <= series.tail * mean.abs(), "{left_out} at {x}");
                assert!(mean.abs() < 0.3 * last.abs(), "at {x}");
            }
        }
    }

    #[test]
    fn the_smallest_coefficients_keep_their_digits() {
        // x^n is the sum of C(n, k) T_(n - 2 k) over k from 0 to n, by 2^n, where T_(-m) is T_m
        let mut expected = vec![0.0; 100];
        for n in 0..100_usize {
            let mut term = 0.5_f64.powi(n as i32);
            for k in 0..=n {
                expected[n.abs_diff(2 * k)] += term;
                term *= (n - k) as f64 / (k + 1) as f64;
            }
        }
        let found = geometric_sum(100, 0.0, 1.0);
        assert_eq!(found.len(), 100, "the last is 2^-98, more than nothing");
        for (found, expected) in found.iter().zip(expected) {
            assert!(
                (found / expected - 1.0).abs() < 1e-13,
                "{found} for {expected}"
            );
        }
        let many = geometric_sum(1000, 0.0, 1.0);
        assert!((many.iter().sum::<f64>() - 1000.0).abs() < 1e-9);
        assert!(many.len() < 400 && many[many.len() - 1] > NOTHING);
    }

    #[test]
    fn a_series_equals_the_resolvent() {
        let series = Series::of_resolvent([LOW, 0.99], 1e-9).unwrap();
        for x in points().filter(|x| *x <= 0.99) {
            let expected = 1.0 / (1.0 - x);
            assert!(
                (evaluate(&series, x) - expected).abs() < 1e-7 * 100.0,
                "at {x}"
            );
        }
        assert!(series.degree() < 150);
        assert_eq!(Series::of_resolvent([LOW, HIGH], 1e-9), None);
    }
}
