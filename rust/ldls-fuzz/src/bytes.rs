//! Numbers from bytes: those given, then as many more as are asked for.

/// Bytes that are read from the front. What comes after their end follows from all of them, so that a few bytes make a
/// large input, and many decide each of its numbers.
#[derive(Debug, Clone)]
pub struct Bytes<'a> {
    data: &'a [u8],
    state: u64,
}

impl<'a> Bytes<'a> {
    /// The bytes of `data`.
    pub fn new(data: &'a [u8]) -> Self {
        // FNV-1a
        let state = data.iter().fold(0xcbf2_9ce4_8422_2325, |hash: u64, &byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
        });
        Self { data, state }
    }

    /// The next byte.
    pub fn byte(&mut self) -> u8 {
        match self.data.split_first() {
            Some((&first, rest)) => {
                self.data = rest;
                first
            }
            None => (next(&mut self.state) >> 56) as u8,
        }
    }

    /// The next eight bytes as a number.
    pub fn number(&mut self) -> u64 {
        if self.data.is_empty() {
            return next(&mut self.state);
        }
        u64::from_le_bytes(std::array::from_fn(|_| self.byte()))
    }

    /// A number from 0 to `end` - 1, of four bytes.
    pub fn below(&mut self, end: usize) -> usize {
        let number = u32::from_le_bytes(std::array::from_fn(|_| self.byte()));
        number as usize % end
    }

    /// A number in [0, 1), of four bytes.
    pub fn unit(&mut self) -> f64 {
        self.below(1 << 32) as f64 / (1_u64 << 32) as f64
    }

    /// A number in [`low`, `high`).
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// The bytes that are left of those given.
    pub fn rest(&self) -> &'a [u8] {
        self.data
    }
}

/// The bytes of input `number` of a run with `seed`: up to 64 of them, often few.
pub fn random_bytes(seed: u64, number: u64) -> Vec<u8> {
    let mut state =
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ number.wrapping_mul(0xd1b5_4a32_d192_ed03);
    let length = next(&mut state) % 65;
    (0..length)
        .map(|_| (next(&mut state) >> 56) as u8)
        .collect()
}

/// The next number of the generator `SplitMix64`.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
