//! Clouds at random.

use crate::Bytes;

/// A point in metres.
pub type Point = [f64; 3];

/// A cloud of a kind and a size that the first bytes say.
pub fn random_cloud(bytes: &mut Bytes<'_>) -> Vec<Point> {
    let kind = KINDS[usize::from(bytes.byte()) % KINDS.len()];
    let most = [4, 40, 300, 300, 700, 1500][usize::from(bytes.byte()) % 6];
    let count = bytes.below(most + 1);
    kind(bytes, count)
}

const KINDS: [fn(&mut Bytes<'_>, usize) -> Vec<Point>; 10] = [
    uniform,
    rings,
    lattice,
    duplicates,
    line,
    plane,
    far_away,
    single_precision,
    clusters,
    any,
];

pub fn uniform(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let sizes: Point = std::array::from_fn(|_| 10_f64.powf(bytes.between(-3.0, 3.0)));
    let mut point = || sizes.map(|size| bytes.between(-size, size));
    (0..count).map(|_| point()).collect()
}

/// Beams of a spinning lidar over a floor and walls.
fn rings(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let beams = 1 + bytes.below(64);
    let a_turn = count.div_ceil(beams);
    let mut point = |i: usize| {
        let (beam, step) = (i % beams, i / beams);
        let elevation = -0.4 + 0.45 * beam as f64 / beams as f64;
        let azimuth = std::f64::consts::TAU * step as f64 / a_turn as f64;
        let wall = 8.0 + 30.0 * (3.0 * azimuth).sin().abs();
        let floor = if elevation < 0.0 {
            1.7 / -elevation.tan()
        } else {
            f64::INFINITY
        };
        let range = wall.min(floor) + bytes.between(-0.02, 0.02);
        [
            range * azimuth.cos(),
            range * azimuth.sin(),
            range * elevation.tan(),
        ]
    };
    (0..count).map(&mut point).collect()
}

fn lattice(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let step = [1.0, 0.1, 0.001, 0.25][bytes.below(4)];
    let sides: [usize; 3] = std::array::from_fn(|_| 1 + bytes.below(20));
    let mut point = || sides.map(|side| bytes.below(side) as f64 * step);
    (0..count).map(|_| point()).collect()
}

fn duplicates(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let places = bytes.below(count.min(40) + 1) + 1;
    let places = uniform(bytes, places);
    (0..count)
        .map(|_| places[bytes.below(places.len())])
        .collect()
}

fn line(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let from: Point = std::array::from_fn(|_| bytes.between(-50.0, 50.0));
    let along: Point = std::array::from_fn(|_| [0.0, 1.0, bytes.unit()][bytes.below(3)]);
    let mut point = || {
        let at = bytes.between(-20.0, 20.0);
        std::array::from_fn(|axis| from[axis] + at * along[axis])
    };
    (0..count).map(|_| point()).collect()
}

fn plane(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let (flat, at, slope) = (
        bytes.below(3),
        bytes.between(-5.0, 5.0),
        [0.0, bytes.unit()][bytes.below(2)],
    );
    let mut points = uniform(bytes, count);
    for point in &mut points {
        point[flat] = at + slope * point[(flat + 1) % 3];
    }
    points
}

fn far_away(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let offset: Point = std::array::from_fn(|_| bytes.between(-9.9e6, 9.9e6));
    let mut points = uniform(bytes, count);
    for point in &mut points {
        *point = std::array::from_fn(|axis| offset[axis] + point[axis]);
    }
    points
}

fn single_precision(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let points = if bytes.below(2) == 0 {
        uniform(bytes, count)
    } else {
        far_away(bytes, count)
    };
    points
        .iter()
        .map(|point| point.map(|x| f64::from(x as f32)))
        .collect()
}

/// Clusters whose sizes differ by orders of magnitude.
fn clusters(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let centres: Vec<(Point, f64)> = (0..=bytes.below(9))
        .map(|_| {
            (
                std::array::from_fn(|_| bytes.between(-100.0, 100.0)),
                10_f64.powf(bytes.between(-9.0, 1.0)),
            )
        })
        .collect();
    let mut point = || {
        let (centre, size) = centres[bytes.below(centres.len())];
        centre.map(|x| x + bytes.between(-size, size))
    };
    (0..count).map(|_| point()).collect()
}

/// Any numbers that a coordinate may be: all signs and exponents, zeros and denormals.
fn any(bytes: &mut Bytes<'_>, count: usize) -> Vec<Point> {
    let mut coordinate = || {
        let value = f64::from_bits(bytes.number());
        if value.abs() <= 1e7 { value } else { 0.0 }
    };
    (0..count)
        .map(|_| std::array::from_fn(|_| coordinate()))
        .collect()
}
