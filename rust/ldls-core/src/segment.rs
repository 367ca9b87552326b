//! The method on one screen: points, masks and cameras in, one label a point out.

use crate::confidence::{judge, of_cleared};
use crate::diffusion::diffuse;
use crate::graph::{PointGraph, remove_outliers_by_index};
use crate::ground::{is_cleared, is_ground};
use crate::masks::{LabelImage, PixelLabels};
use crate::memory::{collect, filled, push};
use crate::neighbors::{self, Adjacency, arrange};
use crate::projection::{Cloud, Sighting};
use crate::report::{Report, Timings, timed};
use crate::ring::{Images, Objects, View};
use crate::{Cancel, Error, Params, Real, Result};
use rayon::prelude::*;
use std::iter::repeat;
use std::mem::take;
use std::time::Duration;

/// Label of points that no image sees.
const OUT_OF_VIEW: i32 = -1;
/// Points up to which depth is seen and neighbours are searched at the same time; of more the memory of both counts.
const MOST_SIDE_BY_SIDE: usize = 1 << 20;
/// Most edges of a graph: what 32 bits index.
const MAX_EDGES: u64 = u32::MAX as u64;

/// Labels of all points of a cloud.
#[derive(Debug, Clone)]
pub struct Segmentation {
    /// Label of every point: -1 out of view, 0 background, l object l.
    pub labels: Vec<i32>,
    /// Labels before outlier removal.
    pub diffused_labels: Vec<i32>,
    /// How sure each label is, from 0 to 1; 0 out of view.
    pub confidence: Vec<f32>,
    /// Rows of the points in view, ascending.
    pub in_view: Vec<u32>,
    /// The points in view that each image sees of its own moment.
    pub sightings: Vec<Sighting>,
    /// The objects that labels stand for; those of a single image are its instances.
    pub objects: Objects,
    /// Findings about the input and the run.
    pub report: Report,
    /// Time of each step.
    pub timings: Timings,
}

/// Segments `cloud` by the instance masks of the images that one camera or several took, at one moment or at several.
///
/// Instances of two images become one object if, of the points that both see and that fall on one of the two masks, at
/// least the share `same_object` falls on both. Points at exactly (0, 0, 0) are taken for missing returns unless
/// `keep_origin` is set.
///
/// # Errors
/// Whatever [`Params::check`] and [`crate::project`] refuse, [`Error::TooManyPoints`], [`Error::Mismatch`] where a view has
/// not one category and one score a mask, [`Error::OutOfMemory`] and [`Error::Cancelled`].
pub fn segment(
    cloud: Cloud,
    views: &[View],
    same_object: f64,
    params: &Params,
    keep_origin: bool,
    cancel: &Cancel,
) -> Result<Segmentation> {
    check(cloud, views, params)?;
    let mut t = Timings::default();
    let painted = timed(&mut t.pixel_labels, || {
        let images = views.par_iter();
        let painted = images.map(|view| LabelImage::paint(view.masks, cancel));
        painted.collect::<Result<_>>()
    })?;
    let (mut in_view, mut images) = timed(&mut t.project, || {
        Images::project(cloud, views, painted, keep_origin, cancel)
    })?;
    let points = take(&mut in_view.points);
    timed(&mut t.depth, || images.see_ground(&points, params, cancel))?;
    timed(&mut t.project, || {
        images.find_objects(&points, same_object, params, cancel)
    })?;
    let in_graph = in_graph(&images.heights, params, cancel)?;
    let mut beside = Duration::ZERO;
    let search = || nearest_of(&points, in_graph, params, cancel);
    let mut depth = || timed(&mut beside, || images.see_depth(&points, params, cancel));
    let (seen, nearest) = timed(&mut t.neighbors, || match points.len() {
        // parts of each are for one thread alone
        ..=MOST_SIDE_BY_SIDE => rayon::join(depth, search),
        _ => (depth(), search()),
    });
    t.neighbors -= beside;
    t.depth += beside;
    drop(points);
    seen?;
    let (scene, nearest) = (&images, &nearest?);
    let order = &nearest.order;
    let heights = &arrange(order, &scene.heights, cancel)?;
    let pixels = || scene.pixel_labels(order, params, cancel);
    let pixel_labels = timed(&mut t.pixel_labels, pixels)?;
    let (a, b) = timed(&mut t.graph, || {
        normalize(nearest, pixel_labels, heights, params, cancel)
    })?;
    let exact = |among: Option<&[u32]>| {
        let pixels = || b.counted(among, |row| a.own_weight(row), params.pixel_weight, cancel);
        let Some(places) = among else {
            return normalize(nearest, pixels()?, heights, params, cancel);
        };
        let nearest = nearest.among(places, cancel)?;
        let heights = arrange(places, heights, cancel)?;
        normalize(&nearest, pixels()?, &heights, params, cancel)
    };
    let diffused = timed(&mut t.diffusion, || {
        diffuse(&a, &b, scene.n_labels(), params.iterations, exact, cancel)
    })?;
    let rows = Rows {
        cloud: cloud.len(),
        in_view: &in_view.indices,
        of_graph: arrange(order, &in_view.indices, cancel)?,
    };
    let components = || {
        timed(&mut t.components, || {
            let place = |row: usize| cloud.xyz(rows.of_graph[row] as usize);
            remove_outliers(&a, &diffused.labels, order, params, place, cancel)
        })
    };
    let (kept, diffused_labels) = rayon::join(components, || rows.labels(&diffused.labels, cancel));
    let mut kept = kept?;
    let confidence = judge(&mut kept, &diffused, &scene.scores(), params, cancel)?;
    let (labels, confidence) = rayon::join(
        || rows.labels(&kept, cancel),
        || rows.scatter([0.0, of_cleared(params)], confidence, cancel),
    );
    let (sightings, objects) = images.into_parts();
    Ok(Segmentation {
        labels: labels?,
        diffused_labels: diffused_labels?,
        confidence: confidence?,
        report: Report::new(in_view.counts, nearest, diffused.convergence),
        in_view: in_view.indices,
        sightings,
        objects,
        timings: t,
    })
}

/// Refuses parameters out of range, clouds too large and views without a category and a score for each mask.
fn check(cloud: Cloud, views: &[View], params: &Params) -> Result<()> {
    params.check()?;
    check_edges(cloud.len(), params.neighbors)?;
    views.iter().try_for_each(View::check)
}

fn check_edges(points: usize, neighbors: usize) -> Result<()> {
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

/// The points in view that the graph has, by their heights: all but the cleared ones, or none named where that is all.
fn in_graph(heights: &[f64], params: &Params, cancel: &Cancel) -> Result<Option<Vec<u32>>> {
    let cleared = |height| is_cleared(height, params.ground_clearance);
    if !heights.iter().any(|&height| cleared(height)) {
        return Ok(None);
    }
    let mut in_graph = Vec::new();
    for (point, &height) in heights.iter().enumerate() {
        if point % Cancel::ITEMS_A_LOOK == 0 {
            cancel.check()?;
        }
        if !cleared(height) {
            push(&mut in_graph, point as u32)?;
        }
    }
    Ok(Some(in_graph))
}

/// The neighbours of the points of the graph among each other, in an order that names them by their place in view.
fn nearest_of(
    points: &[[f64; 3]],
    in_graph: Option<Vec<u32>>,
    params: &Params,
    cancel: &Cancel,
) -> Result<Adjacency> {
    let Some(in_graph) = in_graph else {
        return neighbors::search(points, params.neighbors, cancel);
    };
    let own = arrange(&in_graph, points, cancel)?;
    let mut nearest = neighbors::search(&own, params.neighbors, cancel)?;
    nearest.order = arrange(&nearest.order, &in_graph, cancel)?;
    Ok(nearest)
}

/// A and b of the method: the weights of point edges and of pixel edges, in rows that sum to 1 together.
fn normalize<T: Real>(
    nearest: &Adjacency,
    mut b: PixelLabels<T>,
    heights: &[f64],
    params: &Params,
    cancel: &Cancel,
) -> Result<(PointGraph<T>, PixelLabels<T>)> {
    let mut a = PointGraph::from_adjacency(nearest, params.sigma, cancel)?;
    if params.ground_edges < 1.0 {
        let ground = collect(heights.iter().map(|&height| is_ground(height)), cancel)?;
        a.weaken_ground_edges(&ground, params.ground_edges, cancel)?;
    }
    a.normalize_rows(&mut b, cancel)?;
    Ok((a, b))
}

/// The labels of the largest component of each instance and the parts near it, where the parameters ask for it.
fn remove_outliers(
    a: &PointGraph,
    labels: &[u32],
    order: &[u32],
    params: &Params,
    place: impl Fn(usize) -> [f64; 3] + Sync,
    cancel: &Cancel,
) -> Result<Vec<u32>> {
    if !params.remove_outliers {
        return collect(labels.iter().copied(), cancel);
    }
    remove_outliers_by_index(a, labels, order, params.part_gap, place, cancel)
}

/// Where in the cloud the points of a result lie.
struct Rows<'a> {
    /// Number of points of the cloud.
    cloud: usize,
    in_view: &'a [u32],
    /// Those that the graph has, in the order of the values to lay out; the others in view are cleared.
    of_graph: Vec<u32>,
}

impl Rows<'_> {
    fn labels(&self, labels: &[u32], cancel: &Cancel) -> Result<Vec<i32>> {
        let signed = labels.iter().map(|&label| label as i32);
        self.scatter([OUT_OF_VIEW, 0], signed, cancel)
    }

    /// `values` laid out over the cloud, each in its row, and what stands elsewhere: out of view, and at cleared points.
    fn scatter<T: Copy + Send + Sync>(
        &self,
        [out_of_view, cleared]: [T; 2],
        values: impl IntoIterator<Item = T>,
        cancel: &Cancel,
    ) -> Result<Vec<T>> {
        let mut all = filled(out_of_view, self.cloud, cancel)?;
        if self.of_graph.len() < self.in_view.len() {
            put(&mut all, self.in_view, repeat(cleared), cancel)?;
        }
        put(&mut all, &self.of_graph, values, cancel)?;
        Ok(all)
    }
}

fn put<T>(
    all: &mut [T],
    rows: &[u32],
    values: impl IntoIterator<Item = T>,
    cancel: &Cancel,
) -> Result<()> {
    let mut values = values.into_iter();
    for rows in rows.chunks(Cancel::ITEMS_A_LOOK) {
        cancel.check()?;
        for (&row, value) in rows.iter().zip(&mut values) {
            all[row as usize] = value;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::{MAX_EDGES, View, check_edges};
    use crate::test_support::{camera, looking_back, masks, segment};

    #[test]
    fn a_graph_has_at_most_as_many_edges_as_32_bits_index() {
        // 2^32 - 1 = 5 * 858,993,459
        let most = (MAX_EDGES / 5) as usize;
        assert!(check_edges(most, 4).is_ok());
        assert!(check_edges(most + 1, 4).is_err());
        assert!(check_edges(usize::MAX, 255).is_err());
    }

    #[test]
    fn a_second_image_that_sees_nothing_changes_no_label() {
        let (masks, camera) = (masks(&[[5, 5, 10, 12], [8, 20, 12, 9]]), camera(20.0));
        let mut turned = View {
            masks: &masks,
            categories: &[1, 1],
            scores: &[1.0, 1.0],
            camera: &camera,
            rows: View::ALL_ROWS,
        };
        let alone = segment(&[turned]);
        let beside = looking_back();
        turned.camera = &beside;
        let both = segment(&[
            View {
                camera: &camera,
                ..turned
            },
            turned,
        ]);
        assert_eq!(both.labels, alone.labels);
        assert_eq!(both.confidence, alone.confidence);
        assert_eq!(both.sightings[0], alone.sightings[0]);
        assert_eq!(alone.objects, [[(0, 1)], [(0, 2)]]);
        assert_eq!(alone.sightings[0].seen.len(), alone.in_view.len());
    }
}
