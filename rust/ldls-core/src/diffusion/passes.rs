//! The passes over the graph that some labels take in single precision, by the shortest series that can be trusted.

use super::convergence::Convergence;
use super::lanes::WIDTH_F32;
use super::pass::Pass;
use super::plan::Planner;
use super::schedule::Schedule;
use super::seeds::Seeds;
use super::series::Series;
use super::sweep::PAPER_DEGREE;
use crate::graph::PointGraph;
use crate::masks::PixelLabels;
use crate::{Cancel, Result};

/// Share of the largest likelihood that a series may leave out.
pub(super) const TOLERANCE: f64 = 5e-8;

/// Calls `done` with each pass over the graph that `labels` take; how far they came, the series that could be trusted, the
/// longest first, and the schedule of the graph.
pub(super) fn for_each_pass(
    a: &PointGraph,
    b: &PixelLabels,
    labels: &[u32],
    iterations: Option<usize>,
    cancel: &Cancel,
    mut done: impl FnMut(&mut Pass<f32, WIDTH_F32>) -> Result<()>,
) -> Result<(Convergence, Vec<Series>, Schedule)> {
    // parts of each are for one thread alone
    let (mut series, schedule) = rayon::join(
        || Series::of_graph(a, iterations, TOLERANCE),
        || Schedule::new(a, cancel),
    );
    let schedule = schedule?;
    // how far rounding goes is known of one series on graphs of the paper's degree, and measured where it may grow more
    let is_usual = |series: &Series| series.legs == Some(1) && a.degree() == Some(PAPER_DEGREE);
    let most = b.most(iterations);
    let mut convergence = Convergence::default();
    // a probe shows how large the terms left out may be
    let (mut labels, mut probe) = (labels.to_vec(), true);
    'planned: loop {
        let planner = Planner {
            schedule: &schedule,
            width: WIDTH_F32,
            probe,
            sum: probe && series.last().is_some_and(|series| !is_usual(series)),
            steps: Pass::<f32, WIDTH_F32>::steps(series.last(), iterations),
        };
        for plan in planner.plan((a, b), &labels, cancel)? {
            let seeds = Seeds::new(b, plan, cancel)?;
            let mut pass = Pass::run(a, &schedule, &seeds, series.last(), iterations, cancel)?;
            let tried = series.last();
            if tried.is_some_and(|tried| !pass.is_sound(tried.most_left_out, most)) {
                // another takes more steps, in which labels come farther
                series.pop();
                continue 'planned;
            }
            cancel.check()?;
            pass.drop_previous();
            done(&mut pass)?;
            convergence.merge(pass.convergence);
            probe = false;
            labels.retain(|label| seeds.plan.lanes.iter().all(|(other, _)| other != label));
        }
        return Ok((convergence, series, schedule));
    }
}
