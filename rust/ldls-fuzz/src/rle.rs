//! Run lengths, plain and compressed: each refused or decoded as a slow decoder says, pixel by pixel.

use crate::{Bytes, Outcome};
use ldls_core::Rle;

/// Most pixels of an image.
const MOST_PIXELS: u128 = 178_956_970;
/// Most pixels of an image that is decoded pixel by pixel.
const MOST_DECODED: u128 = 4096;

/// A mask of which the runs are right, or right but for a few faults, or anything.
///
/// # Panics
/// If fast and slow differ.
pub fn rle(data: &[u8]) -> Outcome {
    let mut bytes = Bytes::new(data);
    let [mut height, mut width] = std::array::from_fn(|_| side(&mut bytes));
    let compressed = bytes.below(3) > 0;
    let faults = [0, 0, 1, 1, 2, 5][bytes.below(6)];
    let mut runs = random_runs(&mut bytes, height, width);
    let (found, expected) = if compressed {
        let mut counts = if bytes.below(8) == 0 {
            bytes.rest().to_vec()
        } else {
            compress(&runs)
        };
        (0..faults).for_each(|_| spoil_bytes(&mut bytes, &mut counts));
        if faults == 5 {
            (height, width) = (width, height.wrapping_add(1));
        }
        let expected = decompress(&counts).filter(|runs| covers(runs, height, width));
        (Rle::from_compressed(height, width, &counts), expected)
    } else {
        (0..faults).for_each(|_| spoil_runs(&mut bytes, &mut runs));
        let expected = covers(&runs, height, width).then(|| runs.clone());
        (Rle::from_runs(height, width, runs), expected)
    };
    check(found.as_ref().ok(), expected.as_deref(), height, width)
}

/// A side of an image: small, nothing, or beyond any memory.
fn side(bytes: &mut Bytes<'_>) -> usize {
    match bytes.below(64) {
        0 => 0,
        1 => bytes.below(1 << 20),
        2 => usize::MAX - bytes.below(3),
        3 => (1 << 32) - 1 + bytes.below(3),
        _ => 1 + bytes.below(40),
    }
}

/// Runs that cover the image, if it is one.
fn random_runs(bytes: &mut Bytes<'_>, height: usize, width: usize) -> Vec<u32> {
    let mut left = height.saturating_mul(width).min(MOST_PIXELS as usize);
    let longest = 1 + bytes.below(left.clamp(1, 4 * height.clamp(1, 1 << 20)));
    let mut runs = Vec::new();
    while left > 0 && runs.len() < 600 {
        let run = bytes.below(longest + 1).min(left);
        runs.push(run as u32);
        left -= run;
    }
    if left > 0 {
        runs.push(left as u32);
    }
    runs
}

fn spoil_runs(bytes: &mut Bytes<'_>, runs: &mut Vec<u32>) {
    let at = bytes.below(runs.len().max(1));
    match bytes.below(5) {
        0 => runs.truncate(at),
        1 => runs.insert(at.min(runs.len()), bytes.number() as u32),
        // two faults that make up for one another: the mask is whole again, and another one
        2 if at + 1 < runs.len() && runs[at] > 0 => {
            runs[at] -= 1;
            runs[at + 1] += 1;
        }
        3 => runs.insert(at.min(runs.len()), 0),
        _ => {
            if let Some(run) = runs.get_mut(at) {
                *run = run.wrapping_add(1 << bytes.below(32));
            }
        }
    }
}

fn spoil_bytes(bytes: &mut Bytes<'_>, counts: &mut Vec<u8>) {
    let at = bytes.below(counts.len().max(1));
    match bytes.below(6) {
        0 => counts.truncate(at),
        1 => counts.insert(at.min(counts.len()), bytes.byte()),
        2 => counts.insert(at.min(counts.len()), 48 + bytes.byte() % 64),
        3 if !counts.is_empty() => drop(counts.remove(at)),
        // the sign and more bits than a run has
        4 => counts
            .splice(at.min(counts.len())..at.min(counts.len()), *b"ooooooO")
            .for_each(drop),
        _ => {
            if let Some(byte) = counts.get_mut(at) {
                *byte ^= 1 << bytes.below(8);
            }
        }
    }
}

/// True for the run lengths of an image: as many as it has pixels, and no more pixels than an image may have.
fn covers(runs: &[u32], height: usize, width: usize) -> bool {
    let pixels = height as u128 * width as u128;
    let sum: u128 = runs.iter().map(|&run| u128::from(run)).sum();
    (1..=MOST_PIXELS).contains(&pixels) && sum == pixels
}

/// The digits of a compressed string, as numbers of base 32.
fn compress(runs: &[u32]) -> Vec<u8> {
    let mut counts = Vec::new();
    for (i, &run) in runs.iter().enumerate() {
        let number = i128::from(run) - if i > 2 { i128::from(runs[i - 2]) } else { 0 };
        // as few digits as can tell it from all others: n digits tell 32^n numbers, half of them negative
        let digits =
            (1..=13).find(|&n| (-(1_i128 << (5 * n - 1))..1 << (5 * n - 1)).contains(&number));
        let digits = digits.expect("some number of digits is enough");
        let unsigned = number.rem_euclid(1 << (5 * digits));
        for digit in 0..digits {
            let value = (unsigned >> (5 * digit)) % 32;
            counts.push((48 + value + if digit + 1 < digits { 32 } else { 0 }) as u8);
        }
    }
    counts
}

/// The runs of a compressed string; `None` where it is none.
fn decompress(counts: &[u8]) -> Option<Vec<u32>> {
    let mut runs: Vec<u32> = Vec::new();
    let mut digits: Vec<i128> = Vec::new();
    for &byte in counts {
        let value = i128::from(byte.checked_sub(48)?);
        digits.push(value % 32);
        match value {
            32..64 if digits.len() < 7 => {}
            0..32 => {
                let unsigned: i128 = digits
                    .iter()
                    .rev()
                    .fold(0, |number, digit| 32 * number + digit);
                let all = 32_i128.pow(digits.len() as u32);
                let number = if 2 * unsigned >= all {
                    unsigned - all
                } else {
                    unsigned
                };
                let before_last = if runs.len() > 2 {
                    i128::from(runs[runs.len() - 2])
                } else {
                    0
                };
                runs.push(u32::try_from(number + before_last).ok()?);
                digits.clear();
            }
            _ => return None,
        }
    }
    digits.is_empty().then_some(runs)
}

fn check(found: Option<&Rle>, expected: Option<&[u32]>, height: usize, width: usize) -> Outcome {
    let (Some(found), Some(runs)) = (found, expected) else {
        assert_eq!(
            found.is_some(),
            expected.is_some(),
            "{height} x {width}: {found:?}, expected {expected:?}"
        );
        return Outcome::Refused;
    };
    let runs = without_empty(runs);
    assert_eq!(
        (found.height(), found.width(), found.runs()),
        (height, width, &runs[..])
    );
    assert_eq!(found.to_compressed(), compress(&runs));
    if height as u128 * width as u128 <= MOST_DECODED {
        check_pixels(found, &decode(&runs));
    }
    Outcome::Accepted
}

/// The same pixels in runs of which none but the first is empty.
fn without_empty(runs: &[u32]) -> Vec<u32> {
    let mut joined = Vec::new();
    for (at, &run) in runs.iter().enumerate() {
        if at == 0 || run > 0 && joined.len() % 2 == at % 2 {
            joined.push(run);
        } else if let Some(last) = joined.last_mut() {
            *last += run;
        }
    }
    joined
}

/// The pixels of runs, column by column.
fn decode(runs: &[u32]) -> Vec<bool> {
    let run = |(i, &run): (usize, &u32)| std::iter::repeat_n(i % 2 == 1, run as usize);
    runs.iter().enumerate().flat_map(run).collect()
}

/// Holds a mask against its pixels, column by column.
pub fn check_pixels(found: &Rle, pixels: &[bool]) {
    let (height, width) = (found.height(), found.width());
    let by_rows = |pixels: &[bool]| -> Vec<bool> {
        (0..height * width)
            .map(|at| pixels[at % width * height + at / width])
            .collect()
    };
    let rows = by_rows(pixels);
    assert_eq!(
        found.crop([0, 0, height, width]).as_deref(),
        Ok(rows.as_slice())
    );
    assert_eq!(found.area(), pixels.iter().filter(|&&pixel| pixel).count());
    let inside: Vec<[usize; 2]> = (0..pixels.len())
        .filter(|&at| pixels[at])
        .map(|at| [at % height, at / height])
        .collect();
    let ends = |axis: usize| {
        let first = inside.iter().map(|place| place[axis]).min()?;
        Some((
            first,
            inside.iter().map(|place| place[axis]).max()? + 1 - first,
        ))
    };
    let expected_box = match (ends(0), ends(1)) {
        (Some((top, high)), Some((left, wide))) => [top, left, high, wide],
        _ => [0; 4],
    };
    assert_eq!(found.bounding_box(), expected_box);
    let outside = found.complement();
    let inverted: Vec<bool> = rows.iter().map(|pixel| !pixel).collect();
    assert_eq!(outside.crop([0, 0, height, width]), Ok(inverted));
    let again = Rle::from_pixels(height, width, &rows).expect("it is an image");
    assert_eq!(&again, found);
    assert_eq!(found.union(&outside).area(), pixels.len());
    assert_eq!(found.difference(found).area(), 0);
}
