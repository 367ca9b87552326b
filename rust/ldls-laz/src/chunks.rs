//! Records packed one after the other, in chunks that each begin anew.

use crate::Source;
use crate::times::Times;
use laz::errors::LasZipError;
use laz::las::{v1, v2};
use laz::laszip::ChunkTable;
use laz::record::{RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{LazItem, LazItemType, LazVlr};
use std::io;
use std::iter::repeat;

/// Ways of packing, as LASzip's record names them: all records in one chunk, or in several.
const ONE_CHUNK: u16 = 1;
const CHUNKS: u16 = 2;

type Records<'a> = SequentialPointRecordDecompressor<'a, Source<'a>>;

/// The records of a file, and where its chunks end.
pub struct Chunks<'a> {
    records: Records<'a>,
    items: Vec<LazItem>,
    /// Numbers of records of the chunks to come.
    counts: Box<dyn Iterator<Item = u64> + Send + Sync>,
    left: u64,
}

impl<'a> Chunks<'a> {
    /// The records at the position of `source`, packed as `packing` and `vlr` say.
    pub fn new(mut source: Source<'a>, packing: u16, vlr: &LazVlr) -> laz::Result<Self> {
        let counts: Box<dyn Iterator<Item = u64> + Send + Sync> = match packing {
            ONE_CHUNK => Box::new(repeat(u64::MAX)),
            CHUNKS if vlr.uses_variable_size_chunks() => {
                let table = ChunkTable::read_from(&mut source, vlr)?;
                let counts: Vec<_> = (0..table.len()).map(|at| table[at].point_count).collect();
                Box::new(counts.into_iter())
            }
            CHUNKS => {
                source.set_position(source.position() + ChunkTable::OFFSET_SIZE as u64);
                Box::new(repeat(vlr.chunk_size().into()))
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
            counts,
            left: 0,
        })
    }

    /// Unpacks the next record.
    pub fn next(&mut self, record: &mut [u8]) -> laz::Result<()> {
        if self.left == 0 {
            let next = self.counts.find(|&count| count > 0);
            self.left = next.ok_or_else(|| io::Error::other("more points than in all chunks"))?;
            self.begin()?;
        }
        self.left -= 1;
        Ok(self.records.decompress_next(record)?)
    }

    /// Forgets what the last chunk had shown.
    fn begin(&mut self) -> laz::Result<()> {
        self.records.reset();
        for item in &self.items {
            add(&mut self.records, *item)?;
        }
        Ok(())
    }
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
