//! Each stage of the method and all of it, on a made-up street of 20 instances: `cargo bench`.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use ldls_bench::{Prepared, STAGES, Street};
use ldls_core::Params;
use rayon::prelude::*;
use std::hint::black_box;
use std::num::NonZero;

const SIZES: [usize; 4] = [10_000, 100_000, 1_000_000, 10_000_000];

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
    for n in SIZES {
        let street = Street::new(n);
        let prepared = Prepared::new(&street);
        let points = &prepared.in_view.points;
        let mut group = criterion.benchmark_group("stage");
        group
            .throughput(Throughput::Elements(points.len() as u64))
            .sample_size(10);
        for (name, run) in STAGES {
            group.bench_function(BenchmarkId::new(name, n), |b| b.iter(|| run(&prepared)));
        }
        // the peer, whose queries run on all threads as ours do
        group.bench_function(BenchmarkId::new("neighbors of kiddo", n), |b| {
            b.iter(|| black_box(neighbors_of_kiddo(points, Params::paper().neighbors)));
        });
        group.finish();
    }
}

criterion_group!(benches, stages);
criterion_main!(benches);
