//! Each stage of the method and all of it, on a made-up street of 20 instances: `cargo bench`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use ldls_core::{
    Camera, Cancel, Cloud, InstanceMasks, Neighbors, Params, PointGraph, Rle, View, diffuse,
    project, remove_outliers, segment,
};
use rayon::prelude::*;
use std::hint::black_box;
use std::num::NonZero;

const HEIGHT: usize = 375;
const WIDTH: usize = 1242;
const INSTANCES: usize = 20;
const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 10_000_000];

/// `n` points in view, scan line by scan line: ground below, a wall ahead, and a pillar for each instance.
fn street(n: usize) -> Vec<f32> {
    let lines = 64.max(n / 4000);
    let columns = n / lines;
    let mut points = Vec::with_capacity(3 * n);
    for line in 0..lines {
        let pitch = 0.03 - 0.25 * line as f32 / lines as f32;
        for column in 0..columns {
            let yaw = 0.7 * (0.5 - column as f32 / columns as f32);
            let noise = 0.02 * ((column * 7919 + line * 104_729) % 1000) as f32 / 1000.0;
            let pillar = column * INSTANCES / columns;
            let on_pillar = (column * INSTANCES * 3 / columns) % 3 == 1;
            let wall = if on_pillar { 8.0 + pillar as f32 } else { 40.0 };
            let ground = if pitch < 0.0 {
                -1.7 / pitch
            } else {
                f32::INFINITY
            };
            let range = wall.min(ground) + noise;
            points.extend([range * yaw.cos(), range * yaw.sin(), range * pitch]);
        }
    }
    points
}

fn camera() -> Camera {
    let projection = [720., 0., 620., 0., 0., 720., 180., 0., 0., 0., 1., 0.];
    let t_camera_lidar = [
        0., -1., 0., 0., 0., 0., -1., -0.1, 1., 0., 0., -0.3, 0., 0., 0., 1.,
    ];
    Camera::new(&projection, &t_camera_lidar, 0.1).expect("a camera")
}

fn masks() -> InstanceMasks {
    let rles = (0..INSTANCES).map(|instance| {
        let left = (620.0 - 720.0 * (0.35 - 0.7 * (instance as f64 + 0.3) / 20.0).tan()) as usize;
        let pixels: Vec<bool> = (0..HEIGHT * WIDTH)
            .map(|i| (left..left + 11).contains(&(i % WIDTH)) && (150..300).contains(&(i / WIDTH)))
            .collect();
        Rle::from_pixels(HEIGHT, WIDTH, &pixels).expect("a mask")
    });
    InstanceMasks::new(HEIGHT, WIDTH, rles.collect()).expect("masks")
}

/// The points themselves and their `k` nearest neighbours, by kiddo.
fn neighbors_of_kiddo(points: &[[f64; 3]], k: usize) -> Vec<u32> {
    let tree = ImmutableKdTree::<f64, 3>::new_from_slice(points).expect("a tree");
    let wanted = NonZero::new(k + 1).expect("one at least");
    let nearest = |point: &[f64; 3]| {
        let query = tree.query(point);
        query.nearest_n::<SquaredEuclidean<f64>>(wanted).execute()
    };
    let rows = points.par_iter().flat_map_iter(nearest);
    rows.map(|item| item.item).collect()
}

fn stages(criterion: &mut Criterion) {
    let (camera, masks, params) = (camera(), masks(), Params::paper());
    let never = Cancel::never();
    let view = View {
        masks: &masks,
        categories: &[0; INSTANCES],
        scores: &[1.0; INSTANCES],
        camera: &camera,
    };
    for n in SIZES {
        let values = street(n);
        let cloud = Cloud::F32 {
            values: &values,
            columns: 3,
        };
        let images = [(&camera, [HEIGHT, WIDTH])];
        let in_view = project(cloud, &images, false, never).expect("points in view");
        let (points, uv) = (&in_view.points, &in_view.sightings[0].uv);
        let mut labels = masks
            .pixel_labels(uv, params.window, params.pixel_weight, |_, _| true, never)
            .expect("labels");
        let neighbors = Neighbors::search(points, params.neighbors, never).expect("neighbours");
        let mut graph = PointGraph::<f32>::from_neighbors(points, &neighbors, params.sigma, never)
            .expect("a graph");
        graph.normalize_rows(&mut labels, never).expect("rows");
        let exact = |among: Option<&[u32]>| {
            let mut a = PointGraph::<f64>::from_neighbors(points, &neighbors, params.sigma, never)?;
            let mut b =
                masks.pixel_labels(uv, params.window, params.pixel_weight, |_, _| true, never)?;
            a.normalize_rows(&mut b, never)?;
            Ok(match among {
                Some(points) => (a.among(points), b.among(points)),
                None => (a, b),
            })
        };
        let diffused = diffuse(
            &graph,
            &labels,
            masks.len() + 1,
            params.iterations,
            exact,
            never,
        )
        .expect("labels");

        let mut group = criterion.benchmark_group("stage");
        group
            .throughput(Throughput::Elements(points.len() as u64))
            .sample_size(10);
        group.bench_function(BenchmarkId::new("project", n), |b| {
            b.iter(|| black_box(project(cloud, &images, false, never)));
        });
        group.bench_function(BenchmarkId::new("pixel labels", n), |b| {
            let (window, weight) = (params.window, params.pixel_weight);
            let everywhere = |_, _| true;
            b.iter(|| masks.pixel_labels::<f32>(uv, window, weight, everywhere, never));
        });
        group.bench_function(BenchmarkId::new("neighbors", n), |b| {
            b.iter(|| black_box(Neighbors::search(points, params.neighbors, never)));
        });
        // the peer: kiddo's tree, whose queries run on all threads as ours do
        group.bench_function(BenchmarkId::new("neighbors of kiddo", n), |b| {
            b.iter(|| black_box(neighbors_of_kiddo(points, params.neighbors)));
        });
        group.bench_function(BenchmarkId::new("graph", n), |b| {
            b.iter(|| PointGraph::<f32>::from_neighbors(points, &neighbors, params.sigma, never));
        });
        group.bench_function(BenchmarkId::new("diffusion", n), |b| {
            b.iter(|| {
                black_box(diffuse(
                    &graph,
                    &labels,
                    masks.len() + 1,
                    params.iterations,
                    exact,
                    never,
                ))
            });
        });
        group.bench_function(BenchmarkId::new("components", n), |b| {
            b.iter(|| {
                black_box(remove_outliers(
                    &graph,
                    &diffused.labels,
                    1.0,
                    |_, _| true,
                    never,
                ))
            });
        });
        group.bench_function(BenchmarkId::new("whole frame", n), |b| {
            b.iter(|| black_box(segment(cloud, &[view], 0.5, &params, false, never)));
        });
        group.finish();
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
