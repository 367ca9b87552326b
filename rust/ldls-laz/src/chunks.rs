//! Records packed one after the other, in chunks that each begin anew.

use crate::Source;
use crate::times::Times;
use laz::errors::LasZipError;
use laz::las::{v1, v2};
use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItem, LazItemType, LazVlr};
use std::io;
use std::iter::repeat;

/// Ways of packing, as LASzip's record names them: all records in one chunk, or in several.
const ONE_CHUNK: u16 = 1;
const CHUNKS: u16 = 2;

type Records<'a> = SequentialPointRecordDecompressor<'a, Source<'a>>;

/// One chunk.
#[derive(Debug, Clone, Copy)]
struct Chunk {
    /// Where its bytes begin, if not after those of the one before.
    start: Option<u64>,
    n_records: u64,
}

impl Chunk {
    /// One of so many records, after the one before.
    fn next(n_records: u64) -> Self {
        let start = None;
        Self { start, n_records }
    }
}

/// The records of a file, and where its chunks end.
pub struct Chunks<'a> {
    records: Records<'a>,
    items: Vec<LazItem>,
    to_come: Box<dyn Iterator<Item = Chunk> + Send + Sync>,
    left: u64,
}

impl<'a> Chunks<'a> {
    /// The records at the position of `source`, packed as `packing` and `vlr` say.
    pub fn new(mut source: Source<'a>, packing: u16, vlr: &LazVlr) -> laz::Result<Self> {
        let to_come: Box<dyn Iterator<Item = Chunk> + Send + Sync> = match packing {
            ONE_CHUNK => Box::new(repeat(Chunk::next(u64::MAX))),
            CHUNKS if vlr.uses_variable_size_chunks() => {
                let table = ChunkTable::read_from(&mut source, vlr)?;
                Box::new(listed(&table, source.position()).into_iter())
            }
            CHUNKS => {
                source.set_position(source.position() + ChunkTable::OFFSET_SIZE as u64);
                Box::new(repeat(Chunk::next(vlr.chunk_size().into())))
            }
            other => {
                return Err(
                    io::Error::other(format!("way of packing {other}, expected 1 to 3")).into(),
                );
            }
        };
        Ok(Self {
            records: Records::new(source),
            items: vlr.items().clone(),
            to_come,
            left: 0,
        })
    }

    /// Unpacks the next record.
    pub fn next(&mut self, record: &mut [u8]) -> laz::Result<()> {
        if self.left == 0 {
            // a chunk without records may have bytes all the same
            let next = self.to_come.find(|chunk| chunk.n_records > 0);
            self.begin(next.ok_or_else(|| io::Error::other("more points than in all chunks"))?)?;
        }
        self.left -= 1;
        Ok(self.records.decompress_next(record)?)
    }

    /// Forgets what the last chunk had shown.
    fn begin(&mut self, chunk: Chunk) -> laz::Result<()> {
        self.left = chunk.n_records;
        self.records.reset();
        if let Some(start) = chunk.start {
            self.records.get_mut().set_position(start);
        }
        for item in &self.items {
            add(&mut self.records, *item)?;
        }
        Ok(())
    }
}

/// Chunks as they stand in `table`, the first from byte `start` on.
fn listed(table: &ChunkTable, mut start: u64) -> Vec<Chunk> {
    let chunk = |at| {
        let entry: &ChunkTableEntry = &table[at];
        let chunk = Chunk {
            start: Some(start),
            n_records: entry.point_count,
        };
        start = start.saturating_add(entry.byte_count);
        chunk
    };
    (0..table.len()).map(chunk).collect()
}

/// Adds the decoder of `item`.
fn add(records: &mut Records<'_>, item: LazItem) -> laz::Result<()> {
    use LazItemType::{Byte, GpsTime, Point10, RGB12, WavePacket13};
    match (item.version(), item.item_type()) {
        (1, Point10) => records.add_field_decompressor(v1::LasPoint0Decompressor::default()),
        (2, Point10) => records.add_field_decompressor(v2::LasPoint0Decompressor::default()),
        (1, GpsTime) => records.add_field_decompressor(v1::LasGpsTimeDecompressor::default()),
        (2, GpsTime) => records.add_field_decompressor(Times::default()),
        (1, RGB12) => records.add_field_decompressor(v1::LasRGBDecompressor::default()),
        (2, RGB12) => records.add_field_decompressor(v2::LasRGBDecompressor::default()),
        (1, Byte(count)) => {
            records.add_field_decompressor(v1::LasExtraByteDecompressor::new(count.into()));
        }
        (2, Byte(count)) => {
            records.add_field_decompressor(v2::LasExtraByteDecompressor::new(count.into()));
        }
        (1 | 2, WavePacket13) => {
            records.add_field_decompressor(v1::LasWavepacketDecompressor::default());
        }
        (version, kind) => return Err(LasZipError::UnsupportedLazItemVersion(kind, version)),
    }
    Ok(())
}
