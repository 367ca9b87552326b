//! A smooth ground: a surface of degree 5 through the lowest points of polar cells, fitted so that what stands on the
//! ground does not count.

use crate::memory::tabulate;
use crate::{Cancel, Result};
use multiversion::multiversion;
use nalgebra::{SMatrix, SVector};

/// Degree of the surface in x and y, and how many terms that is.
const DEGREE: usize = 5;
const TERMS: usize = terms(DEGREE);
/// Coordinates are counted in this many metres, so that all terms are of one size.
const UNIT_M: f64 = 30.0;
/// Sectors of a quadrant, by |y| / (|x| + |y|), which needs no arc tangent: 2.0 to 3.8 degrees wide.
const SECTORS_A_QUADRANT: usize = 30;
const SECTORS: usize = 4 * SECTORS_A_QUADRANT;
/// Rings, equally wide, in which the distance doubles.
const RINGS_A_DOUBLING: usize = 9;
const RINGS: usize = 80;
/// Nearer points are of the vehicle itself; farther ones than the rings reach fall into the last one.
const NEAREST_M: f64 = 0.5;
/// Fewer cells, or fewer of them on the surface, make no ground.
const LEAST_CELLS: usize = 12;
const ON_SURFACE_M: f64 = 0.15;
/// Weight of a cell above the first plane: most cells have no ground in them.
const ABOVE: f64 = 0.05;
/// Rounds of that plane.
const FIRST_ROUNDS: usize = 12;
/// Degree of the surface, and the residual in metres that leaves a cell below it a quarter of its weight, round by round:
/// a stiff surface may be far from the ground that it bends towards later, so trust narrows as it bends.
const ROUNDS: [(usize, f64); 7] = [
    (1, 1.0),
    (2, 0.5),
    (3, 0.5),
    (4, 0.4),
    (5, 0.3),
    (5, 0.2),
    (5, 0.1),
];
/// What stands on the ground lies above it, and nothing but noise below: a residual above counts as so many below.
const ABOVE_COUNTS: f64 = 2.5;
/// Share of the number of cells added to the diagonal for terms of each degree: where there is no ground, the surface goes
/// on flat.
const RIDGE: [f64; DEGREE + 1] = [0.0, 1e-5, 1e-4, 5e-4, 1e-3, 2e-3];

type Terms = SVector<f64, TERMS>;
type Normal = SMatrix<f64, TERMS, TERMS>;
/// The lowest place of a cell and its terms.
type Cell = ([f64; 3], Terms);

/// z = f(x, y) of the ground, in metres.
pub(super) struct Surface {
    coefficients: Terms,
}

impl Surface {
    /// The surface below `places`, relative to where they were seen from; none where too few of the lowest places lie on
    /// one, or where it lies above.
    pub(super) fn fit(places: &[[f64; 3]], cancel: &Cancel) -> Result<Option<Self>> {
        let cells = lowest(places, cancel)?;
        Ok(Self::through(cells))
    }

    /// The surface through the lowest places of cells.
    fn through(cells: Vec<[f64; 3]>) -> Option<Self> {
        if cells.len() < LEAST_CELLS {
            return None;
        }
        let cells: Vec<Cell> = cells
            .into_iter()
            .map(|place| (place, terms_at(&place)))
            .collect();
        let mut surface = Self::weighted(&cells, 1, |_| 1.0)?;
        for _ in 0..FIRST_ROUNDS {
            surface = Self::weighted(&cells, 1, |cell| {
                if surface.height_of(cell) > 0.0 {
                    ABOVE
                } else {
                    1.0 - ABOVE
                }
            })?;
        }
        for (degree, scale) in ROUNDS {
            surface = Self::weighted(&cells, degree, |cell| {
                let height = surface.height_of(cell);
                let counts = if height > 0.0 { ABOVE_COUNTS } else { 1.0 };
                let relative = counts * height / scale;
                (1.0 + relative * relative).powi(-2)
            })?;
        }
        let on_it = cells
            .iter()
            .filter(|cell| surface.height_of(cell).abs() < ON_SURFACE_M);
        let below = surface.height(&[0.0; 3]) > 0.0;
        (below && on_it.count() >= LEAST_CELLS).then_some(surface)
    }

    /// Height of a place above the surface, in metres.
    pub(super) fn height(&self, place: &[f64; 3]) -> f64 {
        let (x, y) = (place[0] / UNIT_M, place[1] / UNIT_M);
        let mut z = 0.0;
        // Horner's scheme, in x over those in y, which do not wait for one another
        for of_x in (0..=DEGREE).rev() {
            let mut factor = 0.0;
            for of_y in (0..=DEGREE - of_x).rev() {
                factor = factor * y + self.coefficients[terms(of_x + of_y) - of_x - 1];
            }
            z = z * x + factor;
        }
        place[2] - z
    }

    /// Height of a cell above the surface, in metres.
    fn height_of(&self, (place, terms): &Cell) -> f64 {
        place[2] - self.coefficients.dot(terms)
    }

    /// The surface of a degree with the least sum of weighted squares.
    fn weighted(cells: &[Cell], degree: usize, weight: impl Fn(&Cell) -> f64) -> Option<Self> {
        let terms = terms(degree);
        let (mut normal, mut right) = (Normal::identity(), Terms::zeros());
        let ridges = RIDGE
            .iter()
            .enumerate()
            .flat_map(|(of, &ridge)| vec![ridge; of + 1]);
        for (term, ridge) in ridges.take(terms).enumerate() {
            normal[(term, term)] = ridge * cells.len() as f64;
        }
        let weights: Vec<f64> = cells.iter().map(weight).collect();
        add_up(cells, &weights, terms, &mut normal, &mut right);
        let coefficients = normal.cholesky()?.solve(&right);
        let finite = coefficients
            .iter()
            .all(|coefficient| coefficient.is_finite());
        finite.then_some(Self { coefficients })
    }
}

/// Adds the first `terms` of weighted cells to the normal equations: to the lower half of `normal`, which is all that is
/// read of it.
#[multiversion(targets("x86_64+avx2"))]
fn add_up(cells: &[Cell], weights: &[f64], terms: usize, normal: &mut Normal, right: &mut Terms) {
    for ((place, values), weight) in cells.iter().zip(weights) {
        for across in 0..terms {
            let weighted = weight * values[across];
            right[across] += weighted * place[2];
            let below = across * (TERMS + 1)..across * TERMS + terms;
            let sums = normal.as_mut_slice()[below].iter_mut();
            sums.zip(&values.as_slice()[across..terms])
                .for_each(|(sum, value)| *sum += weighted * value);
        }
    }
}

/// How many terms a polynomial of a degree in x and y has.
const fn terms(degree: usize) -> usize {
    (degree + 1) * (degree + 2) / 2
}

/// The products of powers of x and y, degree by degree; of one degree those with more of x first.
fn terms_at(place: &[f64; 3]) -> Terms {
    let (x, y) = (place[0] / UNIT_M, place[1] / UNIT_M);
    let mut terms = Terms::repeat(1.0);
    let mut first = 0;
    for degree in 1..=DEGREE {
        let next = first + degree;
        for before in first..next {
            terms[before + degree] = x * terms[before];
        }
        terms[next + degree] = y * terms[next - 1];
        first = next;
    }
    terms
}

/// The lowest place of each cell that has one, in the order of the cells; of equally low ones the first.
fn lowest(places: &[[f64; 3]], cancel: &Cancel) -> Result<Vec<[f64; 3]>> {
    let cells = tabulate(places.len(), |i| cell(&places[i]), cancel)?;
    let mut lowest: Vec<Option<[f64; 3]>> = vec![None; RINGS * SECTORS];
    for (place, cell) in places.iter().zip(cells) {
        let Some(cell) = cell else { continue };
        if lowest[cell].is_none_or(|known| place[2] < known[2]) {
            lowest[cell] = Some(*place);
        }
    }
    Ok(lowest.into_iter().flatten().collect())
}

fn cell([x, y, _]: &[f64; 3]) -> Option<usize> {
    let ratio = (x * x + y * y).sqrt() / NEAREST_M;
    if !(ratio > 1.0) {
        return None;
    }
    // how often the distance doubles, with a straight line from one doubling to the next
    let exponent = (ratio.to_bits() >> 52) - 1023;
    let doublings = exponent as f64 + ratio / f64::from_bits((exponent + 1023) << 52) - 1.0;
    let ring = (doublings * RINGS_A_DOUBLING as f64) as usize;
    // a quarter of a turn is 1: from -1 to the right over 0 ahead and 1 to the left to 3
    let across = y / (x.abs() + y.abs());
    let turn = if *x >= 0.0 { across } else { 2.0 - across };
    let sector = ((turn + 1.0) * SECTORS_A_QUADRANT as f64) as usize;
    Some(ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1))
}
