//! The passes over the graph that some labels take, by the shortest series that can be trusted.

use super::convergence::Convergence;
use super::lanes::{Lane, WIDTH_F32};
use super::pass::Pass;
use super::schedule::Schedule;
use super::seeds::{Seeds, plan};
use super::series::Series;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::{Cancel, Result};

/// Share of the largest likelihood that a series in single precision may leave out.
pub(super) const TOLERANCE_F32: f64 = 1e-7;
/// The same in double precision.
pub(super) const TOLERANCE_F64: f64 = 1e-13;

/// Calls `done` with each pass over the graph that `labels` take; how far they came, and the series that could be trusted, the
/// longest first.
pub(super) fn for_each_pass<T: Lane<WIDTH>, const WIDTH: usize>(
    a: &PointGraph<T>,
    b: &PixelLabels<T>,
    labels: &[u32],
    iterations: Option<usize>,
    cancel: &Cancel,
    mut done: impl FnMut(&Pass<T, WIDTH>) -> Result<()>,
) -> Result<(Convergence, Vec<Series>)> {
    // in single precision, a probe shows how large the terms left out may be
    let probed = WIDTH == WIDTH_F32;
    let tolerance = if probed { TOLERANCE_F32 } else { TOLERANCE_F64 };
    // parts of each are for one thread alone
    let (mut series, schedule) = rayon::join(
        || Series::of_graph(a, iterations, tolerance),
        || Schedule::new(a, cancel),
    );
    if !probed {
        // the short one goes unwatched
        series.truncate(1);
    }
    let schedule = schedule?;
    let largest = b.largest_shares();
    let mut convergence = Convergence::default();
    for lanes in plan(b, labels, WIDTH, probed) {
        let seeds = Seeds::new(b, lanes, cancel)?;
        let run =
            |series: &[Series]| Pass::run(a, &schedule, &seeds, series.last(), iterations, cancel);
        let mut pass = run(&series)?;
        while let Some(tried) = series.last() {
            if pass.is_sound(tried.most_left_out, largest) {
                break;
            }
            series.pop();
            drop(pass);
            pass = run(&series)?;
        }
        cancel.check()?;
        pass.drop_previous();
        done(&pass)?;
        convergence.merge(pass.convergence);
    }
    Ok((convergence, series))
}
