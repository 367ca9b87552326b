//! Clouds on which searches for neighbours fail.

use crate::Bytes;
use crate::clouds::{Point, uniform};

/// Clouds of about `count` points by name.
pub fn adversarial_clouds(count: usize) -> Vec<(&'static str, Vec<Point>)> {
    let mut bytes = Bytes::new(b"adversarial");
    let scattered: Vec<Point> = uniform(&mut bytes, count)
        .iter()
        .enumerate()
        .map(|(i, point)| std::array::from_fn(|axis| point[axis] + (i % 7) as f64))
        .collect();
    let each = |point: fn(f64) -> Point| (0..count).map(|i| point(i as f64)).collect::<Vec<_>>();
    let of_scattered = |point: fn(&Point) -> Point| scattered.iter().map(point).collect::<Vec<_>>();
    let mut ascending = scattered.clone();
    ascending.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let descending: Vec<Point> = ascending.iter().rev().copied().collect();
    let mut outlier = scattered.clone();
    outlier[count / 2] = [9e6, -9e6, 9e6];
    let side = (count as f64).cbrt() as usize;
    let cube = (0..side * side * side).map(|i| [i % side, i / side % side, i / side / side]);
    let mut shell = sphere(1001);
    shell.truncate(count);
    shell.insert(shell.len() / 2, [0.0; 3]);
    vec![
        ("no point", vec![]),
        ("one point", vec![[1.0, 2.0, 3.0]]),
        ("two points", vec![[0.0; 3], [0.0, 0.0, 1.0]]),
        ("two points in one place", vec![[5.0; 3]; 2]),
        ("fewer points than neighbours", scattered[..8].to_vec()),
        ("one point more than neighbours", scattered[..11].to_vec()),
        ("all in one place", vec![[1.5, -2.5, 0.1]; count]),
        (
            "all in pairs",
            each(|i| [(i / 2.0).floor().sin(), (i / 2.0).floor(), 0.0]),
        ),
        (
            "more copies than neighbours",
            each(|i| [(i / 40.0).floor(), 0.0, 0.0]),
        ),
        (
            "two clusters far apart",
            each(|i| [if i % 2.0 == 0.0 { -9e6 } else { 9e6 }, i.sin(), i.cos()]),
        ),
        ("a lattice on a line", each(|i| [0.0, i * 0.1, 0.0])),
        (
            "a lattice on a plane",
            each(|i| [(i / 30.0).floor() * 0.1, (i % 30.0) * 0.1, -1.7]),
        ),
        (
            "a lattice in space",
            cube.map(|place| place.map(|x| x as f64 * 0.25)).collect(),
        ),
        ("an oblique line", each(|i| [i * 0.3, i * -0.7, i * 0.11])),
        (
            "an oblique plane",
            of_scattered(|p| [p[0], p[1], 0.3 * p[0] - 0.8 * p[1]]),
        ),
        (
            "denormals",
            each(|i| [i * f64::from_bits(1), -i * 1e-310, i * 1e-200]),
        ),
        (
            "zeros of both signs",
            each(|i| {
                [
                    if i % 2.0 == 0.0 { 0.0 } else { -0.0 },
                    (i / 9.0).floor(),
                    -0.0,
                ]
            }),
        ),
        (
            "millimetres, five thousand kilometres away",
            of_scattered(|p| p.map(|x| 5e6 + 0.001 * x)),
        ),
        (
            "single precision far away",
            of_scattered(|p| p.map(|x| f64::from((5e6 + x) as f32))),
        ),
        (
            "a geometric progression",
            each(|i| [1e7 * 0.98_f64.powf(i), 0.0, 0.0]),
        ),
        ("a sphere and its centre", shell),
        ("sorted", ascending),
        ("sorted backwards", descending),
        ("one far away", outlier),
        ("rounded to a metre", of_scattered(|p| p.map(f64::round))),
    ]
}

/// Points of whole coordinates at the same distance from the origin, exactly.
fn sphere(squared_radius: i32) -> Vec<Point> {
    let most = f64::from(squared_radius).sqrt() as i32;
    let axis = -most..=most;
    let mut points = Vec::new();
    for x in axis.clone() {
        for y in axis.clone() {
            for z in axis
                .clone()
                .filter(|z| x * x + y * y + z * z == squared_radius)
            {
                points.push([x, y, z].map(f64::from));
            }
        }
    }
    points
}
