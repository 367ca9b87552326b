//! For tests of several images, a wall of points before cameras whose masks are rectangles; for those of diffusion, a graph of
//! two points, a chain of them, and pixel labels by their seeds.

use crate::{
    Camera, Cancel, Cloud, InstanceMasks, Params, PixelLabels, PointGraph, Real, Rle, Segmentation,
    View,
};

pub(crate) const IDENTITY: [f64; 16] = [
    1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.,
];

pub(crate) const PROJECTION: [f64; 12] = [20., 0., 20., 0., 0., 20., 15., 0., 0., 0., 1., 0.];

/// A camera whose image begins `left` pixels to the left of the axis, 40 x 30 pixels.
pub(crate) fn camera(left: f64) -> Camera {
    let mut projection = PROJECTION;
    projection[2] = left;
    Camera::new(&projection, &IDENTITY, 0.1).unwrap()
}

/// A camera that looks away from the wall.
pub(crate) fn looking_back() -> Camera {
    let mut turned = IDENTITY;
    (turned[0], turned[10]) = (-1.0, -1.0);
    Camera::new(&PROJECTION, &turned, 0.1).unwrap()
}

pub(crate) fn masks(rectangles: &[[usize; 4]]) -> InstanceMasks {
    let rle = |&[top, left, height, width]: &[usize; 4]| {
        let pixels: Vec<bool> = (0..30 * 40)
            .map(|at| {
                (top..top + height).contains(&(at / 40))
                    && (left..left + width).contains(&(at % 40))
            })
            .collect();
        Rle::from_pixels(30, 40, &pixels).unwrap()
    };
    InstanceMasks::new(30, 40, rectangles.iter().map(rle).collect()).unwrap()
}

/// A wall of points at z = 1, one every tenth.
pub(crate) fn wall() -> Vec<f64> {
    let steps = |n: i32| (-n..=n).map(|i| f64::from(i) / 10.0);
    steps(30)
        .flat_map(|x| steps(6).flat_map(move |y| [x, y, 1.0]))
        .collect()
}

pub(crate) fn segment(views: &[View]) -> Segmentation {
    let values = wall();
    let cloud = Cloud::F64 {
        values: &values,
        columns: 3,
    };
    crate::segment(cloud, views, 0.5, &Params::paper(), false, Cancel::never()).unwrap()
}

/// Two points, each joined to the other with weight 1/4 and to its own pixel with weight 1/2.
pub(crate) fn pair() -> (PointGraph, PixelLabels) {
    let a = PointGraph::from_csr(vec![0, 2, 4], vec![0, 1, 0, 1], vec![0.25; 4]).unwrap();
    let b = PixelLabels {
        offsets: vec![0, 1, 2],
        labels: vec![0, 1],
        weights: vec![0.5; 2],
        mass: vec![0.5; 2],
    };
    (a, b)
}

/// Pixel labels of so many points of which each label has one seed, label l at point `seeds[l]`.
pub(crate) fn one_seed_each(points: usize, seeds: &[usize]) -> PixelLabels {
    let mut at: Vec<(usize, u32)> = seeds.iter().copied().zip(0..).collect();
    at.sort_unstable();
    PixelLabels {
        offsets: (0..=points)
            .map(|i| at.iter().filter(|(seed, _)| *seed < i).count())
            .collect(),
        labels: at.iter().map(|(_, label)| *label).collect(),
        weights: vec![0.25; seeds.len()],
        mass: vec![0.25; points],
    }
}

/// Pixel labels of so many points: label and weight of each seed of the first ones.
pub(crate) fn seeds_by_point<T: Real>(points: usize, seeds: &[&[(u32, f64)]]) -> PixelLabels<T> {
    let mut b = PixelLabels {
        offsets: vec![0],
        labels: vec![],
        weights: vec![],
        mass: vec![T::from_f64(0.5); points],
    };
    for row in seeds {
        b.labels.extend(row.iter().map(|(label, _)| *label));
        b.weights
            .extend(row.iter().map(|(_, weight)| T::from_f64(*weight)));
        b.offsets.push(b.labels.len());
    }
    b.offsets.resize(points + 1, b.labels.len());
    b
}

/// A chain of points whose edges lead to themselves and to the next one, by the weight given, with the seeds of the first ones.
pub(crate) fn chain<T: Real>(
    weights: &[f64],
    seeds: &[&[(u32, f64)]],
) -> (PointGraph<T>, PixelLabels<T>) {
    let n = weights.len();
    let columns = (0..n as u32).flat_map(|i| [i, (i + 1).min(n as u32 - 1)]);
    let weights = weights.iter().flat_map(|&weight| [0.1, weight]);
    let a = PointGraph::from_csr(
        (0..=n).map(|i| 2 * i).collect(),
        columns.collect(),
        weights.map(T::from_f64).collect(),
    );
    (a.unwrap(), seeds_by_point(n, seeds))
}
