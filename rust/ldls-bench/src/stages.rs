//! The stages of the method on a street, each run on what the stages before it made.

use crate::street::{HEIGHT, Street, WIDTH};
use ldls_core::{
    Cancel, DepthGroups, Diffused, InView, LabelImage, Neighbors, Params, PixelLabels, PointGraph,
    Real, Segmentation, diffuse, ground_heights, is_ground, project, remove_outliers, segment,
};
use std::hint::black_box;

const PAPER: Params = Params::paper();

/// Runs a stage once.
pub type Stage = fn(&Prepared);

/// Name of each stage, and what runs it once. Ground and depth groups have the default parameters, other stages the paper's.
pub const STAGES: [(&str, Stage); 10] = [
    ("project", |s| done(in_view(s.street))),
    ("ground", |s| done(heights(s.street, &s.in_view))),
    ("depth groups", |s| {
        done(depth_groups(s.street, &s.in_view, &s.heights));
    }),
    ("pixel labels", |s| {
        done(pixel_labels::<f32>(s.street, &s.in_view));
    }),
    ("neighbors", |s| done(neighbors(&s.in_view))),
    ("graph", |s| done(graph::<f32>(&s.in_view, &s.neighbors))),
    ("diffusion", |s| {
        done(diffused(s.street, &s.in_view, &s.neighbors, &s.normalized));
    }),
    ("components", |s| {
        done(components(&s.normalized.0, &s.in_view, &s.diffused));
    }),
    ("whole frame, paper", |s| {
        done(segmentation(s.street, &Params::paper()));
    }),
    ("whole frame, defaults", |s| {
        done(segmentation(s.street, &Params::default()));
    }),
];

/// A street, and what each stage makes of it.
pub struct Prepared<'a> {
    street: &'a Street,
    /// The points in view.
    pub in_view: InView,
    heights: Vec<f64>,
    neighbors: Neighbors,
    normalized: (PointGraph, PixelLabels),
    diffused: Diffused,
}

impl<'a> Prepared<'a> {
    /// Runs every stage once.
    pub fn new(street: &'a Street) -> Self {
        let in_view = in_view(street);
        let neighbors = neighbors(&in_view);
        let normalized = normalized(street, &in_view, &neighbors);
        Self {
            heights: heights(street, &in_view),
            diffused: diffused(street, &in_view, &neighbors, &normalized),
            street,
            in_view,
            neighbors,
            normalized,
        }
    }
}

/// Drops what a stage made, which the compiler has to make therefore.
fn done<T>(made: T) {
    drop(black_box(made));
}

fn in_view(street: &Street) -> InView {
    let images = [(&street.camera, [HEIGHT, WIDTH])];
    project(street.cloud(), &images, false, Cancel::never()).expect("points in view")
}

fn heights(street: &Street, in_view: &InView) -> Vec<f64> {
    let local = Params::default().local_ground;
    ground_heights(&in_view.points, &street.camera, local, Cancel::never()).expect("heights")
}

fn depth_groups(street: &Street, in_view: &InView, heights: &[f64]) -> DepthGroups {
    let distance = |point| street.camera.distance(point);
    let distances = in_view.points.iter().map(distance).collect();
    let standing: Vec<bool> = heights.iter().map(|&height| !is_ground(height)).collect();
    let (uv, params) = (&in_view.sightings[0].uv, Params::default());
    let groups = (street.masks).depth_groups(uv, distances, &standing, &params, Cancel::never());
    groups.expect("depth groups")
}

fn pixel_labels<T: Real>(street: &Street, in_view: &InView) -> PixelLabels<T> {
    let (uv, window, weight) = (&in_view.sightings[0].uv, PAPER.window, PAPER.pixel_weight);
    let image = LabelImage::paint(&street.masks, Cancel::never()).expect("an image");
    let labels = image.pixel_labels(uv, window, weight, |_, _| true, Cancel::never());
    labels.expect("labels")
}

fn neighbors(in_view: &InView) -> Neighbors {
    Neighbors::search(&in_view.points, PAPER.neighbors, Cancel::never()).expect("neighbours")
}

fn graph<T: Real>(in_view: &InView, neighbors: &Neighbors) -> PointGraph<T> {
    PointGraph::from_neighbors(&in_view.points, neighbors, PAPER.sigma, Cancel::never())
        .expect("a graph")
}

/// A and b, rows that sum to 1 together.
fn normalized<T: Real>(
    street: &Street,
    in_view: &InView,
    neighbors: &Neighbors,
) -> (PointGraph<T>, PixelLabels<T>) {
    let mut a = graph(in_view, neighbors);
    let mut b = pixel_labels(street, in_view);
    a.normalize_rows(&mut b, Cancel::never()).expect("rows");
    (a, b)
}

fn diffused(
    street: &Street,
    in_view: &InView,
    neighbors: &Neighbors,
    (a, b): &(PointGraph, PixelLabels),
) -> Diffused {
    let exact = |among: Option<&[u32]>| {
        let (a, b) = normalized(street, in_view, neighbors);
        Ok(match among {
            Some(points) => (a.among(points), b.among(points)),
            None => (a, b),
        })
    };
    let n_labels = street.masks.len() + 1;
    diffuse(a, b, n_labels, PAPER.iterations, exact, Cancel::never()).expect("labels")
}

fn components(a: &PointGraph, in_view: &InView, diffused: &Diffused) -> Vec<u32> {
    let place = |row: usize| in_view.points[row];
    remove_outliers(a, &diffused.labels, PAPER.part_gap, place, Cancel::never()).expect("labels")
}

fn segmentation(street: &Street, params: &Params) -> Segmentation {
    let views = [street.view()];
    segment(street.cloud(), &views, 0.5, params, false, Cancel::never()).expect("labels")
}
