//! Feeds targets bytes from a seed: `cargo run --release -p ldls-fuzz -- knn --count 10000 --seed 0`.

use ldls_fuzz::{Outcome, TARGETS, Target, adversarial_clouds, check_neighbors, random_bytes};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::time::{Duration, Instant};

const USAGE: &str =
    "usage: ldls-fuzz [TARGET] [--count N] [--seed S]; targets: knn rle polygon diffusion";
/// Points of each adversarial cloud.
const ADVERSARIAL_POINTS: usize = 3000;
/// Faults after which a target is left.
const MOST_FAULTS: usize = 5;

fn main() -> ExitCode {
    let (mut wanted, mut count, mut seed) = (None, 10_000, 0);
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut number = || words.next().and_then(|text| text.parse::<u64>().ok());
        match (
            word.as_str(),
            TARGETS.iter().find(|(name, _)| *name == word),
        ) {
            ("--count", _) => match number() {
                Some(given) => count = given,
                None => return usage(),
            },
            ("--seed", _) => match number() {
                Some(given) => seed = given,
                None => return usage(),
            },
            (_, Some(target)) => wanted = Some(*target),
            _ => return usage(),
        }
    }
    println!(
        "{:<22} {:>9} {:>9} {:>9} {:>7} {:>12} {:>8}",
        "target", "inputs", "accepted", "refused", "faults", "slowest", "in all"
    );
    let targets = wanted.map_or(TARGETS.to_vec(), |target| vec![target]);
    let mut sound = true;
    for (name, target) in targets {
        if name == "knn" {
            sound &= adversarial().print("knn, adversarial");
        }
        sound &= random(name, target, count, seed).print(name);
    }
    ExitCode::from(u8::from(!sound))
}

fn usage() -> ExitCode {
    eprintln!("{USAGE}");
    ExitCode::from(2)
}

#[derive(Default)]
struct Tally {
    accepted: u64,
    refused: u64,
    faults: usize,
    slowest: Duration,
    in_all: Duration,
}

impl Tally {
    /// Runs one input, which a fault is told of with.
    fn run(&mut self, place: impl Fn() -> String, work: impl FnOnce() -> Outcome) {
        let start = Instant::now();
        match catch_unwind(AssertUnwindSafe(work)) {
            Ok(Outcome::Accepted) => self.accepted += 1,
            Ok(Outcome::Refused) => self.refused += 1,
            Err(_) => {
                self.faults += 1;
                eprintln!("fault of {}", place());
            }
        }
        let took = start.elapsed();
        self.slowest = self.slowest.max(took);
        self.in_all += took;
    }

    /// Prints a row of the table; true without faults.
    fn print(&self, name: &str) -> bool {
        let inputs = self.accepted + self.refused + self.faults as u64;
        println!(
            "{name:<22} {inputs:>9} {:>9} {:>9} {:>7} {:>9.1} ms {:>6.1} s",
            self.accepted,
            self.refused,
            self.faults,
            self.slowest.as_secs_f64() * 1e3,
            self.in_all.as_secs_f64()
        );
        self.faults == 0
    }
}

fn random(name: &str, target: Target, count: u64, seed: u64) -> Tally {
    let mut tally = Tally::default();
    for number in 0..count {
        let data = random_bytes(seed, number);
        tally.run(
            || format!("{name}, input {number} of seed {seed}: {data:02x?}"),
            || target(&data),
        );
        if tally.faults == MOST_FAULTS {
            break;
        }
    }
    tally
}

fn adversarial() -> Tally {
    let mut tally = Tally::default();
    for (name, points) in adversarial_clouds(ADVERSARIAL_POINTS) {
        let check = || {
            for k in [1, 10, 11, 255] {
                check_neighbors(&points, k);
            }
            Outcome::Accepted
        };
        tally.run(|| format!("cloud {name:?}"), check);
    }
    tally
}
