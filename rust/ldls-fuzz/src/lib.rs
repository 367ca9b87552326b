//! Fast paths of `ldls-core` held against slow ones, on inputs that are made of bytes.
//!
//! Each target takes bytes, makes an input of them, and panics where fast and slow differ. `cargo run --release -p
//! ldls-fuzz` feeds them bytes from a seed; the folder `fuzz/` hands the same targets to cargo-fuzz, which searches for
//! bytes that reach new code.

#![forbid(unsafe_code)]

mod adversarial;
mod bytes;
mod clouds;
mod diffusion;
mod knn;
mod polygon;
mod rle;

pub use adversarial::adversarial_clouds;
pub use bytes::{Bytes, random_bytes};
pub use diffusion::diffusion;
pub use knn::{check_neighbors, knn};
pub use polygon::polygon;
pub use rle::rle;

/// What became of an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// It was taken, and the fast path came to what the slow one came to.
    Accepted,
    /// It was refused, by the slow path too.
    Refused,
}

/// A target: makes an input of bytes and panics where the fast path differs from the slow one.
pub type Target = fn(&[u8]) -> Outcome;

/// All targets by name.
pub const TARGETS: [(&str, Target); 4] = [
    ("knn", knn),
    ("rle", rle),
    ("polygon", polygon),
    ("diffusion", diffusion),
];

#[cfg(test)]
mod tests {
    use super::*;

    /// Some inputs of each target; `make fuzz` runs many.
    #[test]
    fn fast_paths_equal_slow_ones_on_random_inputs() {
        for (count, (name, target)) in [150, 3000, 300, 60].into_iter().zip(TARGETS) {
            let outcomes: Vec<Outcome> = (0..count)
                .map(|number| target(&random_bytes(1, number)))
                .collect();
            assert!(outcomes.contains(&Outcome::Accepted), "{name}");
        }
    }

    #[test]
    fn neighbors_of_adversarial_clouds_equal_brute_force() {
        let clouds = adversarial_clouds(300);
        assert!(clouds.len() >= 21);
        for (_, points) in clouds {
            for k in [1, 10, 255] {
                check_neighbors(&points, k);
            }
        }
    }
}
