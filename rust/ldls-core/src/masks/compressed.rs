//! COCO's compressed string for run lengths.

use super::rle::{Rle, check_size};
use crate::{Error, Result};

impl Rle {
    /// A mask from COCO's compressed string: 5 bits a byte, least significant first, bit 5 set where more follow,
    /// offset by 48; from the third run on, the difference to the run before last.
    ///
    /// # Errors
    /// [`Error::RleString`] with the offset of the byte at fault, and as [`Rle::from_runs`].
    pub fn from_compressed(height: usize, width: usize, counts: &[u8]) -> Result<Self> {
        check_size(height, width)?;
        let mut runs: Vec<u32> = Vec::new();
        let mut offset = 0;
        while offset < counts.len() {
            let (value, next) = read_number(counts, offset)?;
            let before_last = if runs.len() > 2 {
                i64::from(runs[runs.len() - 2])
            } else {
                0
            };
            let run = u32::try_from(value + before_last).map_err(|_| Error::RleString {
                offset,
                problem: "the run is negative or over 32 bits",
            })?;
            runs.push(run);
            offset = next;
        }
        Self::from_runs(height, width, runs)
    }

    /// The runs as COCO's compressed string; see [`Rle::from_compressed`].
    pub fn to_compressed(&self) -> Vec<u8> {
        let runs = self.runs();
        let mut counts = Vec::with_capacity(2 * runs.len());
        for (i, &run) in runs.iter().enumerate() {
            let before_last = if i > 2 { runs[i - 2] } else { 0 };
            write_number(i64::from(run) - i64::from(before_last), &mut counts);
        }
        counts
    }
}

/// Appends a number as [`read_number`] reads it, in as few digits as hold it.
fn write_number(number: i64, counts: &mut Vec<u8>) {
    let mut rest = number;
    loop {
        let digit = (rest & 0x1f) as u8;
        rest >>= 5;
        let negative = digit & 0x10 != 0;
        let done = rest == if negative { -1 } else { 0 };
        counts.push(48 + digit + if done { 0 } else { 0x20 });
        if done {
            return;
        }
    }
}

/// The signed number that starts at `offset`, and the offset behind it.
fn read_number(counts: &[u8], offset: usize) -> Result<(i64, usize)> {
    let mut value = 0_i64;
    for digit in 0..7 {
        let at = offset + digit;
        let byte = *counts.get(at).ok_or(Error::RleString {
            offset: at,
            problem: "the string ends within a number",
        })?;
        if !(48..=111).contains(&byte) {
            return Err(Error::RleString {
                offset: at,
                problem: "the byte is outside 48 to 111",
            });
        }
        let bits = i64::from(byte - 48);
        value |= (bits & 0x1f) << (5 * digit);
        let more = bits & 0x20 != 0;
        if !more {
            let negative = bits & 0x10 != 0;
            let sign = if negative { -1 << (5 * (digit + 1)) } else { 0 };
            return Ok((value | sign, at + 1));
        }
    }
    Err(Error::RleString {
        offset,
        problem: "the number has more than 7 digits",
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn compressed_strings_with_faults_are_refused_with_the_offset() {
        for (counts, at) in [
            (&b"!"[..], 0),
            (b"PP", 2),
            (b"\x7f", 0),
            (b"PPPPPPPP", 0),
            (b"@", 0),
        ] {
            match Rle::from_compressed(4, 4, counts).unwrap_err() {
                Error::RleString { offset, .. } => assert_eq!(offset, at, "{counts:?}"),
                other => panic!("{counts:?}: {other}"),
            }
        }
    }

    proptest! {
        #[test]
        fn compressed_strings_survive_the_round_trip(runs in proptest::collection::vec(0_u32..3_000_000, 1..40)) {
            let width = runs.iter().sum::<u32>().max(1) as usize;
            let runs = if runs.iter().all(|&run| run == 0) { vec![1] } else { runs };
            let rle = Rle::from_runs(1, width, runs).unwrap();
            prop_assert_eq!(&Rle::from_compressed(1, width, &rle.to_compressed()).unwrap(), &rle);
        }

        #[test]
        fn no_string_panics(counts in proptest::collection::vec(40_u8..120, 0..40)) {
            let _ = Rle::from_compressed(20, 20, &counts);
        }
    }
}
