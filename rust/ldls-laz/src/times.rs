//! Times of pulses, the second version of their packing: four sequences side by side, as of four scanners.
//!
//! A time differs from the last of its sequence by about a whole multiple of the difference before it; what is packed
//! is the multiple and what is left. Source: LASzip's item `GPSTIME11`, version 2.

use laz::decoders::ArithmeticDecoder;
use laz::decompressors::{IntegerDecompressor, IntegerDecompressorBuilder};
use laz::models::{ArithmeticModel, ArithmeticModelBuilder};
use laz::record::FieldDecompressor;
use std::io::{self, ErrorKind, Read};

const SEQUENCES: usize = 4;
/// Multiples beyond these are taken for them.
const MOST: i32 = 500;
const LEAST: i32 = -10;
/// Symbols after those of the multiples: 0 to `MOST`, then -1 to `LEAST`.
const SAME: i32 = MOST - LEAST + 1;
const FAR: i32 = SAME + 1;
/// Extremes in a row after which a difference is the new measure.
const EXTREMES: u32 = 3;

/// Contexts of the numbers that are left.
mod context {
    pub const FIRST: u32 = 0;
    pub const ONCE: u32 = 1;
    pub const SMALL: u32 = 2;
    pub const LARGE: u32 = 3;
    pub const MOST: u32 = 4;
    pub const BACK: u32 = 5;
    pub const LEAST: u32 = 6;
    pub const NONE: u32 = 7;
    pub const HIGH_HALF: u32 = 8;
    pub const COUNT: u32 = 9;
}

/// Multiples up to this are small.
const SMALL: i32 = 9;

/// One of the four.
#[derive(Debug, Clone, Copy, Default)]
struct Sequence {
    /// The bits of the last time.
    time: i64,
    /// The difference that multiples are of; 0 where none is known.
    step: i32,
    extremes: u32,
}

/// How a time follows from those before.
enum Change {
    Same,
    /// By about so many times the step; of a sequence without one, by anything that is no more than 32 bits long.
    Steps(i32),
    /// Nothing is near it: it begins a sequence anew.
    Far,
    /// It is one of the sequence so many places on.
    Switch(usize),
}

/// The decoder.
pub struct Times {
    sequences: [Sequence; SEQUENCES],
    current: usize,
    /// The sequence that began last.
    newest: usize,
    multiple: ArithmeticModel,
    first: ArithmeticModel,
    left: IntegerDecompressor,
}

impl Default for Times {
    fn default() -> Self {
        let others = SEQUENCES as u32 - 1;
        Self {
            sequences: Default::default(),
            current: 0,
            newest: 0,
            multiple: ArithmeticModelBuilder::new(FAR as u32 + 1 + others).build(),
            first: ArithmeticModelBuilder::new(3 + others).build(),
            left: IntegerDecompressorBuilder::new()
                .bits(32)
                .contexts(context::COUNT)
                .build_initialized(),
        }
    }
}

impl<R: Read> FieldDecompressor<R> for Times {
    fn size_of_field(&self) -> usize {
        size_of::<f64>()
    }

    fn decompress_first(&mut self, source: &mut R, time: &mut [u8]) -> io::Result<()> {
        let mut bytes = [0; size_of::<f64>()];
        source.read_exact(&mut bytes)?;
        time.copy_from_slice(&bytes);
        self.sequences[0].time = i64::from_le_bytes(bytes);
        Ok(())
    }

    fn decompress_with(
        &mut self,
        decoder: &mut ArithmeticDecoder<R>,
        time: &mut [u8],
    ) -> io::Result<()> {
        let mut change = self.change(decoder)?;
        if let Change::Switch(places) = change {
            self.current = (self.current + places) % SEQUENCES;
            change = self.change(decoder)?;
        }
        match change {
            Change::Same => {}
            Change::Steps(multiple) => self.step(multiple, decoder)?,
            Change::Far => self.begin(decoder)?,
            // whoever packs switches to the sequence that the time is near to
            Change::Switch(_) => {
                return Err(io::Error::new(
                    ErrorKind::InvalidData,
                    "a time that is of two sequences",
                ));
            }
        }
        time.copy_from_slice(&self.sequences[self.current].time.to_le_bytes());
        Ok(())
    }
}

impl Times {
    fn change<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<Change> {
        if self.sequences[self.current].step == 0 {
            return Ok(match decoder.decode_symbol(&mut self.first)? {
                0 => Change::Same,
                1 => Change::Steps(0),
                2 => Change::Far,
                places => Change::Switch(places as usize - 2),
            });
        }
        Ok(match decoder.decode_symbol(&mut self.multiple)? as i32 {
            multiple @ 0..=MOST => Change::Steps(multiple),
            SAME => Change::Same,
            FAR => Change::Far,
            back if back < SAME => Change::Steps(MOST - back),
            places => Change::Switch((places - FAR) as usize),
        })
    }

    /// The time differs by about `multiple` steps.
    fn step<R: Read>(
        &mut self,
        multiple: i32,
        decoder: &mut ArithmeticDecoder<R>,
    ) -> io::Result<()> {
        let sequence = &mut self.sequences[self.current];
        let is_first = sequence.step == 0;
        let context = match multiple {
            _ if is_first => context::FIRST,
            LEAST => context::LEAST,
            ..0 => context::BACK,
            0 => context::NONE,
            1 => context::ONCE,
            2..=SMALL => context::SMALL,
            MOST => context::MOST,
            _ => context::LARGE,
        };
        let expected = multiple.wrapping_mul(sequence.step);
        let difference = self.left.decompress(decoder, expected, context)?;
        sequence.time = sequence.time.wrapping_add(difference.into());
        match multiple {
            _ if is_first => sequence.step = difference,
            1 => sequence.extremes = 0,
            LEAST | 0 | MOST if sequence.extremes == EXTREMES => {
                (sequence.step, sequence.extremes) = (difference, 0);
            }
            LEAST | 0 | MOST => sequence.extremes += 1,
            _ => {}
        }
        Ok(())
    }

    /// The time begins a sequence.
    fn begin<R: Read>(&mut self, decoder: &mut ArithmeticDecoder<R>) -> io::Result<()> {
        let expected = (self.sequences[self.current].time >> 32) as i32;
        let high = self
            .left
            .decompress(decoder, expected, context::HIGH_HALF)?;
        let low = decoder.read_int()?;
        self.newest = (self.newest + 1) % SEQUENCES;
        self.current = self.newest;
        self.sequences[self.current] = Sequence {
            time: i64::from(high) << 32 | i64::from(low),
            ..Sequence::default()
        };
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use laz::encoders::ArithmeticEncoder;
    use laz::las::v2::GpsTimeCompressor;
    use laz::record::FieldCompressor;
    use proptest::prelude::*;
    use std::io::Cursor;

    /// Unit of differences of times.
    const STEP: i64 = 1000;

    /// Times of six clocks by turns that stay, jump, and go on by about so many steps, the same several times over.
    fn times() -> impl Strategy<Value = Vec<i64>> {
        let multiple = prop_oneof![-12_i64..-7, -2_i64..4, 7_i64..12, 497_i64..504];
        let change = (0..24_usize, multiple, -9_i64..10, 1..7_usize);
        prop::collection::vec(change, 1..400).prop_map(|changes| {
            let mut clocks: [i64; 6] = [0, 1 << 50, -(1 << 50), 1 << 40, -(1 << 55), 77];
            let (mut clock, mut times) = (0, vec![0, STEP]);
            for (kind, multiple, more, count) in changes {
                match kind {
                    0..6 => clock = kind,
                    6 => {
                        clocks[clock] += multiple << 45;
                        times.push(clocks[clock]);
                        clocks[clock] += STEP;
                    }
                    7 => {}
                    _ => {
                        for _ in 0..count {
                            clocks[clock] += multiple * STEP + more;
                            times.push(clocks[clock]);
                        }
                    }
                }
                times.push(clocks[clock]);
            }
            times
        })
    }

    fn packed(times: &[i64]) -> io::Result<Vec<u8>> {
        let (mut packer, mut bytes) = (GpsTimeCompressor::default(), Vec::new());
        packer.compress_first(&mut &mut bytes, &times[0].to_le_bytes())?;
        let mut encoder = ArithmeticEncoder::new(&mut bytes);
        for time in &times[1..] {
            packer.compress_with(&mut encoder, &time.to_le_bytes())?;
        }
        encoder.done()?;
        Ok(bytes)
    }

    fn unpacked(bytes: Vec<u8>, count: usize) -> io::Result<Vec<i64>> {
        let (mut times, mut bytes, mut time) = (Times::default(), Cursor::new(bytes), [0; 8]);
        times.decompress_first(&mut bytes, &mut time)?;
        let mut found = vec![i64::from_le_bytes(time)];
        let mut decoder = ArithmeticDecoder::new(bytes);
        decoder.read_init_bytes()?;
        while found.len() < count {
            times.decompress_with(&mut decoder, &mut time)?;
            found.push(i64::from_le_bytes(time));
        }
        Ok(found)
    }

    proptest! {
        #[test]
        fn times_that_were_packed_come_back(times in times()) {
            let bytes = packed(&times).unwrap();
            prop_assert_eq!(unpacked(bytes, times.len()).unwrap(), times);
        }
    }

    #[test]
    fn whoever_switches_for_ever_is_an_error() {
        let (mut bytes, mut first) = (vec![0; 8], Times::default().first);
        let mut encoder = ArithmeticEncoder::new(&mut bytes);
        for _ in 0..3 {
            encoder.encode_symbol(&mut first, 3).unwrap();
        }
        encoder.done().unwrap();
        let error = unpacked(bytes, 2).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::InvalidData);
    }
}
