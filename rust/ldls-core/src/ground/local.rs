//! The local offset of the ground from its smooth surface: kerbs, lawns, ramps.

use crate::memory::{push, tabulate, with_room, zeros};
use crate::{Cancel, Result};
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};

/// Side of a cell, in metres; a cell looks at itself and the eight around it.
const CELL_M: f64 = 1.0;
/// Heights, in metres, among which the ground is looked for, below and above the surface.
const NEAR_M: f64 = 0.22;
/// Steps in which heights are counted, and how many of them are as thick as the ground.
const STEP_M: f64 = 0.02;
const STEPS: usize = (2.0 * NEAR_M / STEP_M + 0.5) as usize;
const THICKNESS: usize = 3;
/// Points that a level must have, and their share of those near the surface: the foot of an object is none.
const LEAST_POINTS: u32 = 20;
const LEAST_SHARE: f64 = 0.3;
/// Most levels around a cell: a road, a kerb and a lawn.
const MOST_LEVELS: usize = 3;
/// Noise, in metres, by which a point may lie below the level that it is on.
const NOISE_M: f64 = 0.03;

/// Fewest points for a task of the thread pool.
const POINTS_A_TASK: usize = 4096;

type Cell = (i64, i64);
type Histogram = [u32; STEPS];

/// Heights of the ground around a cell above the smooth surface, ascending; infinite where there are no more.
type Levels = [f64; MOST_LEVELS];

/// The cells that hold places, by number, and the number of the cell of each place.
#[derive(Default)]
pub(super) struct Cells {
    all: Vec<Cell>,
    numbers: HashMap<Cell, u32, BuildHasherDefault<CellHasher>>,
    of_places: Vec<u32>,
}

impl Cells {
    pub(super) fn of(places: &[[f64; 3]], cancel: &Cancel) -> Result<Self> {
        let (mut cells, mut of_places) = (Self::default(), with_room(places.len())?);
        let mut last = ((i64::MIN, i64::MIN), 0);
        for (at, place) in places.iter().enumerate() {
            if at % Cancel::ITEMS_A_LOOK == 0 {
                cancel.check()?;
            }
            let cell = cell(place);
            // neighbours on a scan line share a cell
            if cell != last.0 {
                last = (cell, cells.number(cell)?);
            }
            of_places.push(last.1);
        }
        cells.of_places = of_places;
        Ok(cells)
    }

    /// Turns the `heights` of the places above the smooth surface, in metres, into those above the ground around each.
    pub(super) fn level(&self, heights: &mut [f64], cancel: &Cancel) -> Result<()> {
        let mut counts: Vec<Histogram> = zeros(self.all.len(), cancel)?;
        for (&number, height) in self.of_places.iter().zip(heights.iter()) {
            let step = (height + NEAR_M) / STEP_M;
            if (0.0..STEPS as f64).contains(&step) {
                counts[number as usize][step as usize] += 1;
            }
        }
        cancel.check()?;
        let of_cell = |number| levels_of(&self.around(&counts, number));
        let levels = tabulate(self.all.len(), of_cell, cancel)?;
        let heights = heights.par_iter_mut().zip(&self.of_places);
        let heights = heights.with_min_len(POINTS_A_TASK);
        heights.for_each(|(height, &number)| *height -= below(*height, &levels[number as usize]));
        Ok(())
    }

    /// The number of `cell`, which gets one where it has none.
    fn number(&mut self, cell: Cell) -> Result<u32> {
        let next = self.all.len() as u32;
        let number = *self.numbers.entry(cell).or_insert(next);
        if number == next {
            push(&mut self.all, cell)?;
        }
        Ok(number)
    }

    /// The heights counted in the cell of a number and the eight around it.
    fn around(&self, counts: &[Histogram], number: usize) -> Histogram {
        let (column, row) = self.all[number];
        let mut sum = [0; STEPS];
        for at in (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (column + dx, row + dy))) {
            let Some(&number) = self.numbers.get(&at) else {
                continue;
            };
            sum.iter_mut()
                .zip(&counts[number as usize])
                .for_each(|(sum, count)| *sum += count);
        }
        sum
    }
}

fn cell([x, y, _]: &[f64; 3]) -> Cell {
    let along = |axis: &f64| {
        // rounds down, which `floor` needs a call for on older processors
        let cell = (axis / CELL_M) as i64;
        cell - i64::from(axis / CELL_M < cell as f64)
    };
    (along(x), along(y))
}

/// The mean heights of the lowest layers that are fuller than those beside them, and full enough to be the ground.
fn levels_of(histogram: &Histogram) -> Levels {
    let points = |layer: &[u32]| layer.iter().sum::<u32>();
    let least = LEAST_SHARE * f64::from(points(histogram));
    let full = |first: usize| histogram.get(first..first + THICKNESS).map_or(0, points);
    let height = |step: usize| (step as f64 + 0.5) * STEP_M - NEAR_M;
    let is_level = |&first: &usize| {
        let own = full(first);
        let fuller = own >= full(first + 1) && (first == 0 || own > full(first - 1));
        fuller && own >= LEAST_POINTS && f64::from(own) >= least
    };
    let mean = |first: usize| {
        let layer = first..first + THICKNESS;
        let sum: f64 = layer
            .map(|step| f64::from(histogram[step]) * height(step))
            .sum();
        sum / f64::from(full(first))
    };
    let mut levels = [f64::INFINITY; MOST_LEVELS];
    let found = (0..=STEPS - THICKNESS).filter(is_level).map(mean);
    levels
        .iter_mut()
        .zip(found)
        .for_each(|(level, found)| *level = found);
    levels
}

/// The level that a point at `height` stands on: the highest that is not above it, the lowest where all are; 0 where
/// there is none.
fn below(height: f64, levels: &Levels) -> f64 {
    let highest = levels
        .iter()
        .rev()
        .find(|level| **level <= height + NOISE_M);
    let level = *highest.unwrap_or(&levels[0]);
    if level.is_finite() { level } else { 0.0 }
}

/// Hashes the two numbers of a cell in a few instructions: nobody picks points to make cells collide.
#[derive(Default)]
struct CellHasher(u64);

impl Hasher for CellHasher {
    fn finish(&self) -> u64 {
        self.0 ^ (self.0 >> 32)
    }

    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_i64(i64::from(byte));
        }
    }

    fn write_i64(&mut self, number: i64) {
        self.0 =
            (self.0.rotate_left(5) ^ number.cast_unsigned()).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    }
}
