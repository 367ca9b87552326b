//! The values of the labels at all points, and how steps change them.

use super::activity::Activity;
use super::blocks::{BLOCK, Blocks};
use super::lanes::{BACKGROUND_LANE, LaneSeeds};
use super::sweeps::{Inputs, Step, Sweep};
use super::tiles::Tiles;
use super::values::{SharedValues, Values, Window};
use crate::Real;
use crate::graph::PointGraph;
use rayon::prelude::*;

/// Rows that one task of the thread pool seeds.
const ROWS_A_TASK: usize = 4096;

/// A graph, the order in which its rows are worked on included.
#[derive(Debug)]
pub(crate) struct Rows<'a, T> {
    pub(crate) a: &'a PointGraph<T>,
    blocks: Blocks,
    tiles: Tiles,
}

impl<'a, T: Real> Rows<'a, T> {
    pub(crate) fn new(a: &'a PointGraph<T>) -> Self {
        let blocks = Blocks::new(a);
        let tiles = Tiles::new(&blocks);
        Self { a, blocks, tiles }
    }
}

/// Values of the lanes of one pass at all points, and those of the step before.
pub(crate) struct State<'a, T, const WIDTH: usize> {
    rows: &'a Rows<'a, T>,
    seeds: &'a LaneSeeds<T>,
    /// Values after the last step.
    pub(crate) z: Values<T, WIDTH>,
    /// Values before it, which the next step overwrites.
    pub(crate) previous: Values<T, WIDTH>,
    activity: Activity<'a>,
}

impl<'a, T: Sweep<WIDTH>, const WIDTH: usize> State<'a, T, WIDTH> {
    /// z = `scale` * s, with the probe's seeds as they are.
    pub(crate) fn new(rows: &'a Rows<'a, T>, seeds: &'a LaneSeeds<T>, scale: T) -> Self {
        let (points, groups) = (rows.a.len(), seeds.lanes.div_ceil(WIDTH).max(1));
        let mut z = Values::zero(points, groups);
        let previous = Values::zero(points, groups);
        let first = z.group_mut(0).par_iter_mut().zip(&seeds.background);
        first.with_min_len(ROWS_A_TASK).for_each(|(row, &weight)| {
            row[BACKGROUND_LANE] = scale * weight;
        });
        for &(i, lane, weight) in seeds.of_rows(0..points) {
            z.group_mut(lane as usize / WIDTH)[i as usize][lane as usize % WIDTH] = scale * weight;
        }
        if let Some((lane, seeds)) = &seeds.probe {
            let group = z.group_mut(lane / WIDTH).par_iter_mut().zip(seeds);
            group
                .with_min_len(ROWS_A_TASK)
                .for_each(|(row, &seed)| row[lane % WIDTH] = seed);
        }
        let activity = Activity::new(&rows.blocks, seeds.groups(BLOCK, WIDTH), groups);
        Self {
            rows,
            seeds,
            z,
            previous,
            activity,
        }
    }

    /// Number of points.
    pub(crate) fn points(&self) -> usize {
        self.rows.a.len()
    }

    /// Lane of the probe, if there is one.
    pub(crate) fn probe(&self) -> Option<usize> {
        self.seeds.probe.as_ref().map(|(lane, _)| *lane)
    }

    /// Applies `steps` one after the other; what was z before the last becomes the previous values.
    #[expect(unsafe_code, reason = "threads share values by rows")]
    pub(crate) fn run(&mut self, steps: &[Step<T>]) {
        let (mut z, mut previous) = (
            std::mem::take(&mut self.z),
            std::mem::take(&mut self.previous),
        );
        let values = [SharedValues::new(&mut z), SharedValues::new(&mut previous)];
        self.rows.tiles.run(steps.len(), |rows, step| {
            let inputs = Inputs::new(self.rows.a, self.seeds, steps[step]);
            // SAFETY: nobody else is in these rows, and what they have edges from lies in them or in tiles next to
            // them, which neither are behind `step`, so have its z, nor ahead of the step after it, so have not lost it
            let window = unsafe { Window::new(&values[step % 2], &values[(step + 1) % 2], rows) };
            T::sweep(&inputs, &self.activity, window);
        });
        if steps.len() % 2 == 1 {
            std::mem::swap(&mut z, &mut previous);
        }
        (self.z, self.previous) = (z, previous);
    }
}
