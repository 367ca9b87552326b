//! Positions and intensities of LAZ files, unpacked by the decoders of the crate `laz`, whatever bytes they are made of.
//!
//! Two of that crate's ways end the process where a file is damaged: its decoder of times calls itself as often as the
//! bytes say, until the stack is full, so the times of point formats 1 to 5 are decoded by [`times`]; and those of
//! formats 6 to 10, in layers of their own, are not decoded at all. Its panics become errors.
//!
//! Source: LASzip's compression, <https://lastools.github.io/download/laszip.pdf>.

mod chunks;
mod times;

use chunks::Chunks;
use laz::errors::LasZipError;
use laz::{DecompressionSelection, LasZipDecompressor, LazVlr};
use std::io::{self, Cursor};
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Where x y z stand in a record, each in four bytes, in every point format.
const POSITION: Range<usize> = 0..12;
/// Where the intensity does.
const INTENSITY: Range<usize> = 12..14;

/// The way of packing that has layers, as LASzip's record names it.
const LAYERED: u16 = 3;

/// A whole file.
type Source<'a> = Cursor<&'a [u8]>;

/// Bytes that no points were packed into.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("packed points are damaged: {0}")]
pub struct Error(String);

/// The points of a file, in its order.
pub struct Points<'a> {
    records: Records<'a>,
    record: Vec<u8>,
}

/// Either way of packing.
enum Records<'a> {
    /// Point formats 0 to 5: record after record.
    Pointwise(Box<Chunks<'a>>),
    /// Point formats 6 to 10: all values of a kind, then all of the next.
    Layered(Box<LasZipDecompressor<'a, Source<'a>>>),
}

impl<'a> Points<'a> {
    /// The points of `file`, whose packed points begin at byte `offset`, packed as the record `laszip` says.
    ///
    /// The decoders take the memory that sizes of layers and numbers of chunks ask for: the caller holds those against
    /// the size of the file.
    ///
    /// # Errors
    /// [`Error`] if the record is broken, or of items that nobody knows.
    pub fn new(file: &'a [u8], offset: u64, laszip: &[u8]) -> Result<Self, Error> {
        guarded(|| {
            let vlr = LazVlr::from_buffer(laszip)?;
            let size = usize::try_from(vlr.items_size()).unwrap_or(usize::MAX);
            if !(INTENSITY.end..=usize::from(u16::MAX)).contains(&size) {
                return Err(io::Error::other(format!("items of {size} bytes")).into());
            }
            let mut source = Cursor::new(file);
            source.set_position(offset);
            let records = match u16::from_le_bytes([laszip[0], laszip[1]]) {
                LAYERED => Records::Layered(Box::new(layers(source, vlr)?)),
                packing => Records::Pointwise(Box::new(Chunks::new(source, packing, &vlr)?)),
            };
            Ok(Self {
                records,
                record: vec![0; size],
            })
        })
    }

    /// Gives the next `count` points to `take`: steps along x y z, and the intensity.
    ///
    /// # Errors
    /// [`Error`] if the bytes end before that, or were never packed so; the points are of no use from there on.
    pub fn read(&mut self, count: usize, mut take: impl FnMut([i32; 3], u16)) -> Result<(), Error> {
        guarded(|| {
            for _ in 0..count {
                match &mut self.records {
                    Records::Pointwise(chunks) => chunks.next(&mut self.record)?,
                    Records::Layered(layers) => layers.decompress_one(&mut self.record)?,
                }
                let (words, _) = self.record[POSITION].as_chunks();
                let intensity = &self.record[INTENSITY];
                take(
                    [words[0], words[1], words[2]].map(i32::from_le_bytes),
                    u16::from_le_bytes([intensity[0], intensity[1]]),
                );
            }
            Ok(())
        })
    }
}

/// Layers at the position of `source`, those of positions and intensities alone.
fn layers(source: Source<'_>, vlr: LazVlr) -> laz::Result<LasZipDecompressor<'_, Source<'_>>> {
    // of items of older versions the crate would unpack record after record
    if let Some(old) = vlr.items().iter().find(|item| item.version() < 3) {
        let (kind, version) = (old.item_type(), old.version());
        return Err(LasZipError::UnsupportedLazItemVersion(kind, version));
    }
    let wanted = DecompressionSelection::xy_returns_channel()
        .decompress_z()
        .decompress_intensity();
    LasZipDecompressor::selective(source, vlr, wanted)
}

/// What `work` finds; a panic of the decoders is one of their errors.
fn guarded<T>(work: impl FnOnce() -> laz::Result<T>) -> Result<T, Error> {
    match catch_unwind(AssertUnwindSafe(work)) {
        Ok(Ok(found)) => Ok(found),
        Ok(Err(LasZipError::IoError(error))) => Err(Error(error.to_string())),
        Ok(Err(error)) => Err(Error(error.to_string())),
        Err(_) => Err(Error("no bytes that LASzip makes".to_owned())),
    }
}
