//! The method on one screen: points, masks and a camera in, one label a point out.

use crate::diffusion::{Convergence, diffuse};
use crate::graph::{PointGraph, keep_largest_by_index};
use crate::masks::{InstanceMasks, PixelLabels};
use crate::neighbors::{Adjacency, KdTree, arrange};
use crate::projection::{Camera, Cloud, View, ViewCounts};
use crate::{Error, Params, Real, Result};
use std::time::{Duration, Instant};

/// Label of points that the image does not see.
const OUT_OF_VIEW: i32 = -1;
/// Most edges of a graph: what 32 bits index.
const MAX_EDGES: u64 = u32::MAX as u64;

/// Labels of all points of a cloud.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// Label of every point: -1 out of view, 0 background, m instance m.
    pub labels: Vec<i32>,
    /// The same before outlier removal.
    pub diffused_labels: Vec<i32>,
    /// Share of the winner in the values of all labels at a point; 0 out of view.
    pub confidence: Vec<f32>,
    /// Points in view: their rows, coordinates and pixels.
    pub view: View,
    /// What was noticed on the way.
    pub report: Report,
    /// How long each step took.
    pub timings: Timings,
}

/// What a caller should know about the input and the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Report {
    /// Points left out, and why.
    pub counts: ViewCounts,
    /// Points in view that share their place with another one in view.
    pub duplicates: usize,
    /// Whether every point has more than K copies, so that the graph falls into islands.
    pub only_islands: bool,
    /// Neighbours a point really has.
    pub k_effective: usize,
    /// How far the diffusion came.
    pub convergence: Convergence,
}

/// Time of each step.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Timings {
    /// Projection to pixels.
    pub project: Duration,
    /// K nearest neighbours, and the order of their tree.
    pub neighbors: Duration,
    /// Labels of the pixels around each point.
    pub pixel_labels: Duration,
    /// Point graph and row sums.
    pub graph: Duration,
    /// Diffusion and argmax.
    pub diffusion: Duration,
    /// Outlier removal.
    pub components: Duration,
}

/// Segments `cloud` by the instance masks of the image that `camera` took.
///
/// Points at exactly (0, 0, 0) are taken for missing returns unless `keep_origin` is set.
///
/// # Errors
/// Whatever [`Params::check`] and [`Camera::view`] refuse, and [`Error::TooManyPoints`].
pub fn segment(
    cloud: Cloud,
    masks: &InstanceMasks,
    camera: &Camera,
    params: &Params,
    keep_origin: bool,
) -> Result<Segmentation> {
    params.check()?;
    check_edges(cloud.len(), params.neighbors)?;
    let clock = Stopwatch::start();
    let mut view = camera.view(cloud, masks.height(), masks.width(), keep_origin)?;
    let uv = std::mem::take(&mut view.uv);
    let seeds = OneImage { masks, uv: &uv };
    let mut segmentation = label_points(cloud.len(), view, &seeds, params, clock)?;
    segmentation.view.uv = uv;
    Ok(segmentation)
}

/// The pixel edges of the points in view, from which labels spread.
pub(crate) trait Seeds: Sync {
    /// Number of labels, the background counted.
    fn labels(&self) -> usize;

    /// The pixel edges of the points in `order`.
    fn pixel_labels<T: Real>(&self, order: &[u32], params: &Params) -> Result<PixelLabels<T>>;
}

/// The pixels of one image, and where each point in view falls on it.
struct OneImage<'a> {
    masks: &'a InstanceMasks,
    uv: &'a [[f64; 2]],
}

impl Seeds for OneImage<'_> {
    fn labels(&self) -> usize {
        self.masks.len() + 1
    }

    fn pixel_labels<T: Real>(&self, order: &[u32], params: &Params) -> Result<PixelLabels<T>> {
        let uv = arrange(order, self.uv);
        let labels = self
            .masks
            .pixel_labels(&uv, params.window, params.pixel_weight)?;
        Ok(labels)
    }
}

/// Labels the points of `view`, of a cloud of `n` points; `clock` has run since the call began.
pub(crate) fn label_points(
    n: usize,
    mut view: View,
    seeds: &impl Seeds,
    params: &Params,
    mut clock: Stopwatch,
) -> Result<Segmentation> {
    let project = clock.lap();
    // from here on, rows are in the order of the tree: near points are near in memory
    let tree = KdTree::new(&view.points);
    let points = arrange(&tree.order, &std::mem::take(&mut view.points));
    let adjacency = Adjacency::search(&tree, &points, params.neighbors);
    let order = tree.into_order();
    let neighbors = clock.lap();
    let pixels = seeds.pixel_labels(&order, params)?;
    let pixel_labels = clock.lap();
    let (a, b) = normalized_graph::<f32>(&points, &adjacency, pixels, params)?;
    let graph = clock.lap();
    let exact = || {
        let pixels = seeds.pixel_labels(&order, params)?;
        normalized_graph::<f64>(&points, &adjacency, pixels, params)
    };
    let diffused = diffuse(&a, &b, seeds.labels(), params.iterations, exact)?;
    let diffusion = clock.lap();
    let kept = if params.remove_outliers {
        Some(keep_largest_by_index(&a, &diffused.labels, &order)?)
    } else {
        None
    };
    let components = clock.lap();

    let rows = arrange(&order, &view.indices);
    let whole_cloud =
        |labels: &[u32]| scatter(n, &rows, OUT_OF_VIEW, labels.iter().map(|&m| m as i32));
    let segmentation = Segmentation {
        labels: whole_cloud(kept.as_ref().unwrap_or(&diffused.labels)),
        diffused_labels: whole_cloud(&diffused.labels),
        confidence: scatter(n, &rows, 0.0, diffused.confidence.iter().copied()),
        report: Report {
            counts: view.counts,
            duplicates: adjacency.duplicates(&points),
            only_islands: adjacency.only_islands(&points),
            k_effective: adjacency.degree - 1,
            convergence: diffused.convergence,
        },
        timings: Timings {
            project,
            neighbors,
            pixel_labels,
            graph,
            diffusion,
            components,
        },
        view,
    };
    Ok(segmentation)
}

/// A and b of the method: the weights of point edges and of pixel edges, in rows that sum to 1 together.
fn normalized_graph<T: Real>(
    points: &[[f64; 3]],
    adjacency: &Adjacency,
    mut pixels: PixelLabels<T>,
    params: &Params,
) -> Result<(PointGraph<T>, PixelLabels<T>)> {
    let mut graph = PointGraph::from_adjacency(points, adjacency, params.sigma);
    graph.normalize_rows(&mut pixels)?;
    Ok((graph, pixels))
}

pub(crate) fn check_edges(points: usize, neighbors: usize) -> Result<()> {
    if (points as u64).saturating_mul(neighbors as u64 + 1) <= MAX_EDGES {
        return Ok(());
    }
    Err(Error::TooManyPoints {
        points,
        neighbors,
        limit: MAX_EDGES,
        of: "edges",
    })
}

/// `values` laid out over the whole cloud, each in its row.
fn scatter<T: Copy>(
    n: usize,
    rows: &[u32],
    elsewhere: T,
    values: impl Iterator<Item = T>,
) -> Vec<T> {
    let mut all = vec![elsewhere; n];
    for (&row, value) in rows.iter().zip(values) {
        all[row as usize] = value;
    }
    all
}

/// Measures one step after the other.
pub(crate) struct Stopwatch(Instant);

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self(Instant::now())
    }

    /// Time since the start or the last lap.
    fn lap(&mut self) -> Duration {
        let now = Instant::now();
        now - std::mem::replace(&mut self.0, now)
    }
}
