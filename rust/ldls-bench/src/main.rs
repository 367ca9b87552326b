//! Instructions of each stage of the method, held against the counts recorded here: `make instructions`.
//!
//! Valgrind's callgrind counts them on one thread, so that other work on the machine moves nothing. It shows every processor
//! with AVX2 as one and the same, without AVX-512: the search for neighbours runs its AVX2 kernel here.

use ldls_bench::{Prepared, STAGES, Stage, Street};
use rayon::prelude::*;
use std::env;
use std::process::{Command, ExitCode};

/// Instructions of each stage, by Valgrind 3.19 with glibc 2.36.
const RECORDED: [(&str, u64); STAGES.len()] = [
    ("project", 2_897_675),
    ("ground", 7_855_917),
    ("depth groups", 2_260_799),
    ("pixel labels", 9_343_866),
    ("neighbors", 24_459_402),
    ("graph", 5_150_596),
    ("diffusion", 95_400_104),
    ("components", 1_343_420),
    ("whole frame, paper", 135_960_588),
    ("whole frame, defaults", 42_657_426),
];
/// The compiler whose instructions they are.
const RUSTC: &str = "rustc 1.95.0";
/// How many more a stage may take, in percent.
const MARGIN: f64 = 5.0;
const POINTS: usize = 10_000;

/// Counts all stages; with the name of a stage, runs that one, for callgrind to count.
fn main() -> ExitCode {
    if let Some(stage) = env::args().nth(1) {
        run(&stage);
        return ExitCode::SUCCESS;
    }
    if let Some(reason) = incomparable() {
        println!("not counted: {reason}");
        return ExitCode::SUCCESS;
    }
    let counts: Vec<u64> = RECORDED.par_iter().map(|(stage, _)| count(stage)).collect();
    let mut within = true;
    for ((stage, recorded), counted) in RECORDED.into_iter().zip(counts) {
        let percent = 100.0 * (counted as f64 / recorded as f64 - 1.0);
        let excess = percent > MARGIN;
        println!(
            "{stage:21} {counted:>11} instructions, {recorded:>11} recorded, {percent:+.2} %{}",
            if excess { ": too many" } else { "" }
        );
        within &= !excess;
    }
    if within {
        return ExitCode::SUCCESS;
    }
    eprintln!(
        "What is marked takes over {MARGIN} % more instructions than recorded. If that is meant, record the new counts in {}, \
         and give the reason in the commit.",
        file!()
    );
    ExitCode::FAILURE
}

fn run(stage: &str) {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1);
    pool.use_current_thread().build_global().expect("a pool");
    let street = Street::new(POINTS);
    let prepared = Prepared::new(&street);
    let named = STAGES.iter().find(|(name, _)| *name == stage);
    counted(named.expect("the name of a stage").1, &prepared);
}

/// Calls `run`; callgrind counts while this function, which it knows by name, is on the stack.
#[inline(never)]
fn counted(run: Stage, prepared: &Prepared) {
    run(prepared);
}

fn count(stage: &str) -> u64 {
    let own = env::current_exe().expect("the path of this program");
    // environment and path lie on the stack, whose alignment copies depend on: they are the same everywhere
    let outcome = Command::new("valgrind")
        .env_clear()
        .env("PATH", "/usr/local/bin:/usr/bin:/bin")
        .current_dir(own.parent().expect("a folder"))
        .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
        .args(["--toggle-collect=*instructions*counted*", "./instructions"])
        .arg(stage)
        .output()
        .expect("valgrind, by apt-get install valgrind");
    let said = String::from_utf8_lossy(&outcome.stderr);
    let collected = said.split_once("Collected : ");
    let number = collected.and_then(|(_, rest)| rest.split_whitespace().next()?.parse().ok());
    number.unwrap_or_else(|| panic!("no count of {stage}: {said}"))
}

/// Why counts here cannot be held against those recorded, if they cannot.
fn incomparable() -> Option<String> {
    if !has_avx2() {
        return Some("the counts recorded are of Linux on x86_64 with AVX2".into());
    }
    let outcome = Command::new("rustc").arg("--version").output();
    let version = String::from_utf8(outcome.expect("rustc").stdout).expect("a version");
    let differs = !version.starts_with(RUSTC);
    differs.then(|| {
        format!(
            "the counts recorded are of {RUSTC}, this is {}",
            version.trim()
        )
    })
}

#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
fn has_avx2() -> bool {
    false
}
