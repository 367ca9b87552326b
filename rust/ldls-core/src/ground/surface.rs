//! A smooth ground: a cubic surface through the lowest points of polar cells, fitted so that what stands on the ground
//! does not count.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

/// Terms of a cubic in x and y.
const TERMS: usize = 10;
/// Coordinates are counted in this many metres, so that all terms are of one size.
const UNIT_M: f64 = 30.0;
/// Width of a cell, in degrees.
const SECTOR_DEG: f64 = 3.0;
/// The outer radius of a cell over its inner one.
const RING_RATIO: f64 = 1.08;
/// Nearer points are of the vehicle itself; farther ones fall into the last ring.
const NEAREST_M: f64 = 0.5;
const RINGS: usize = 80;
const SECTORS: usize = (360.0 / SECTOR_DEG) as usize;
/// Fewer cells, or fewer of them on the surface, make no ground.
const LEAST_CELLS: usize = 12;
const ON_SURFACE_M: f64 = 0.15;
/// Weight of a cell above the first plane: most cells have no ground in them.
const ABOVE: f64 = 0.05;
const FIRST_ROUNDS: usize = 12;
/// Terms of the surface and the residual, in metres, that halves the trust in a cell below it, round by round.
const ROUNDS: [(usize, f64); 8] = [
    (3, 1.0),
    (3, 0.5),
    (3, 0.3),
    (6, 0.2),
    (6, 0.15),
    (10, 0.1),
    (10, 0.1),
    (10, 0.1),
];
/// Share of the number of cells added to the diagonal for terms of degree 1, 2 and 3: where there is no ground, the
/// surface goes on flat.
const RIDGE: [f64; 4] = [0.0, 1e-5, 1e-3, 1e-2];
const DEGREES: [usize; TERMS] = [0, 1, 1, 2, 2, 2, 3, 3, 3, 3];

type Terms = SVector<f64, TERMS>;

/// z = f(x, y) of the ground, in metres.
pub(super) struct Surface {
    coefficients: Terms,
}

impl Surface {
    /// The surface below `places`, relative to where they were seen from; none where too few of the lowest places lie on
    /// one, or where it lies above.
    pub(super) fn fit(places: &[[f64; 3]]) -> Option<Self> {
        let cells = lowest(places);
        if cells.len() < LEAST_CELLS {
            return None;
        }
        let mut surface = Self::weighted(&cells, 3, |_| 1.0)?;
        for _ in 0..FIRST_ROUNDS {
            surface = Self::weighted(&cells, 3, |place| {
                if surface.height(place) > 0.0 {
                    ABOVE
                } else {
                    1.0 - ABOVE
                }
            })?;
        }
        for (terms, scale) in ROUNDS {
            surface = Self::weighted(&cells, terms, |place| {
                let height = surface.height(place);
                // what stands on the ground lies above it, and nothing but noise below
                let relative = if height > 0.0 {
                    2.0 * height / scale
                } else {
                    height / scale
                };
                (1.0 + relative * relative).powi(-2)
            })?;
        }
        let on_it = cells
            .iter()
            .filter(|place| surface.height(place).abs() < ON_SURFACE_M);
        let below = surface.height(&[0.0; 3]) > 0.0;
        (below && on_it.count() >= LEAST_CELLS).then_some(surface)
    }

    /// Height of a place above the surface, in metres.
    pub(super) fn height(&self, place: &[f64; 3]) -> f64 {
        place[2] - self.coefficients.dot(&terms_at(place))
    }

    /// The surface of the first `terms` terms with the least sum of weighted squares.
    fn weighted(
        cells: &[[f64; 3]],
        terms: usize,
        weight: impl Fn(&[f64; 3]) -> f64,
    ) -> Option<Self> {
        let mut normal = SMatrix::<f64, TERMS, TERMS>::identity();
        let mut right = Terms::zeros();
        for term in 0..terms {
            normal[(term, term)] = RIDGE[DEGREES[term]] * cells.len() as f64;
        }
        for place in cells {
            let (row, weight) = (terms_at(place), weight(place));
            // the decomposition reads the lower half only
            for across in 0..terms {
                let weighted = weight * row[across];
                right[across] += weighted * place[2];
                for down in across..terms {
                    normal[(down, across)] += weighted * row[down];
                }
            }
        }
        let coefficients = normal.cholesky()?.solve(&right);
        let finite = coefficients
            .iter()
            .all(|coefficient| coefficient.is_finite());
        finite.then_some(Self { coefficients })
    }
}

fn terms_at(place: &[f64; 3]) -> Terms {
    let (x, y) = (place[0] / UNIT_M, place[1] / UNIT_M);
    Terms::from([
        1.0,
        x,
        y,
        x * x,
        x * y,
        y * y,
        x * x * x,
        x * x * y,
        x * y * y,
        y * y * y,
    ])
}

/// The lowest place of each cell that has one, in the order of the cells; of equally low ones the first.
fn lowest(places: &[[f64; 3]]) -> Vec<[f64; 3]> {
    let cells: Vec<Option<usize>> = places.par_iter().with_min_len(4096).map(cell).collect();
    let mut lowest: Vec<Option<[f64; 3]>> = vec![None; RINGS * SECTORS];
    for (place, cell) in places.iter().zip(cells) {
        let Some(cell) = cell else { continue };
        if lowest[cell].is_none_or(|known| place[2] < known[2]) {
            lowest[cell] = Some(*place);
        }
    }
    lowest.into_iter().flatten().collect()
}

fn cell([x, y, _]: &[f64; 3]) -> Option<usize> {
    let ratio = (x * x + y * y).sqrt() / NEAREST_M;
    if !(ratio > 1.0) {
        return None;
    }
    let ring = (ratio.ln() / RING_RATIO.ln()) as usize;
    let sector = ((y.atan2(*x).to_degrees() + 180.0) / SECTOR_DEG) as usize;
    Some(ring.min(RINGS - 1) * SECTORS + sector.min(SECTORS - 1))
}
