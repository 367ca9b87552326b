//! Points that the crate `laz` packs come back, and bytes that it did not pack do no harm.

use laz::{LasZipCompressor, LazItemRecordBuilder, LazItemType, LazVlrBuilder};
use ldls_laz::{Error, Points};
use proptest::prelude::*;
use proptest::sample::Index;
use std::io::Cursor;
use std::ops::Range;

/// Bytes before the packed points.
const OFFSET: u64 = 5;
/// Where LASzip's record has the number of points of a chunk.
const CHUNK_SIZE: Range<usize> = 12..16;

#[derive(Debug, Clone)]
struct Point {
    steps: [i32; 3],
    intensity: u16,
    rest: Vec<u8>,
}

/// Kinds of items, and the bytes of a record beyond positions and intensities.
#[derive(Debug, Clone)]
struct Format(Vec<LazItemType>, usize);

fn formats() -> impl Strategy<Value = Format> {
    use LazItemType::{
        Byte, Byte14, GpsTime, Point10, Point14, RGB12, RGB14, RGBNIR14, WavePacket13,
    };
    prop_oneof![
        Just(Format(vec![Point10], 6)),
        Just(Format(vec![Point10, GpsTime], 14)),
        Just(Format(vec![Point10, RGB12], 12)),
        Just(Format(vec![Point10, GpsTime, RGB12, Byte(3)], 23)),
        Just(Format(vec![Point10, GpsTime, WavePacket13], 43)),
        Just(Format(vec![Point14], 16)),
        Just(Format(vec![Point14, RGB14, Byte14(2)], 24)),
        Just(Format(vec![Point14, RGBNIR14], 24)),
    ]
}

/// Points that are made up, with times of two scanners by turns.
fn points(format: &Format, count: usize) -> Vec<Point> {
    let mut state = 1_u64;
    let mut number = move || {
        state = state.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
        (state >> 33) as u32
    };
    let has_times = format.0.contains(&LazItemType::GpsTime);
    let point = |i: usize| {
        let mut rest: Vec<_> = (0..format.1).map(|_| (number() >> 24) as u8).collect();
        if has_times {
            let time = [1000.5, -1e-5][i % 7 / 5] * (i as f64);
            rest[6..14].copy_from_slice(&time.to_le_bytes());
        }
        let steps = [(); 3].map(|()| (number() % 9000) as i32 - 4500);
        let intensity = number() as u16;
        Point {
            steps,
            intensity,
            rest,
        }
    };
    (0..count).map(point).collect()
}

/// The packer of a file, and LASzip's record; chunks are of any size where none is given.
fn packer(
    format: &Format,
    chunk: Option<u32>,
) -> (LasZipCompressor<'static, Cursor<Vec<u8>>>, Vec<u8>) {
    let mut items = LazItemRecordBuilder::new();
    for item in &format.0 {
        items.add_item(*item);
    }
    let vlr = LazVlrBuilder::new(items.build());
    let vlr = match chunk {
        Some(size) => vlr.with_fixed_chunk_size(size),
        None => vlr.with_variable_chunk_size(),
    }
    .build();
    let mut laszip = Vec::new();
    vlr.write_to(&mut laszip).unwrap();
    let mut file = Cursor::new(vec![0; OFFSET as usize]);
    file.set_position(OFFSET);
    (LasZipCompressor::new(file, vlr).unwrap(), laszip)
}

fn pack(packer: &mut LasZipCompressor<'_, Cursor<Vec<u8>>>, point: &Point) {
    let mut record: Vec<_> = point.steps.into_iter().flat_map(i32::to_le_bytes).collect();
    record.extend(point.intensity.to_le_bytes());
    record.extend(&point.rest);
    packer.compress_one(&record).unwrap();
}

fn packed(format: &Format, points: &[Point], chunk: u32) -> (Vec<u8>, Vec<u8>) {
    let (mut packer, laszip) = packer(format, Some(chunk));
    for point in points {
        pack(&mut packer, point);
    }
    packer.done().unwrap();
    (packer.into_inner().into_inner(), laszip)
}

fn unpacked(file: &[u8], laszip: &[u8], count: usize) -> Result<Vec<([i32; 3], u16)>, Error> {
    let mut found = Vec::new();
    Points::new(file, OFFSET, laszip)?
        .read(count, |steps, intensity| found.push((steps, intensity)))?;
    Ok(found)
}

proptest! {
    #[test]
    fn what_was_packed_comes_back(
        format in formats(),
        count in 1_usize..600,
        chunk in 1_u32..900,
    ) {
        let points = points(&format, count);
        let (file, laszip) = packed(&format, &points, chunk);
        let expected: Vec<_> = points.iter().map(|point| (point.steps, point.intensity)).collect();
        prop_assert_eq!(unpacked(&file, &laszip, points.len()), Ok(expected));
    }

    #[test]
    fn changed_bytes_are_points_or_an_error(
        format in formats(),
        count in 1_usize..600,
        changes in prop::collection::vec((any::<Index>(), any::<u8>()), 1..8),
    ) {
        let points = points(&format, count);
        let (mut file, laszip) = packed(&format, &points, 50);
        // beyond the numbers of chunks and layers, which the caller holds against the file
        let table = u64::from_le_bytes(file[OFFSET as usize..][..8].try_into().unwrap()) as usize;
        let first = OFFSET as usize + 8 + 14 + format.1 + 64;
        for (at, byte) in changes {
            if first < table {
                let at = first + at.index(table - first);
                file[at] = byte;
            }
        }
        let found = unpacked(&file, &laszip, points.len());
        prop_assert!(found.is_err() || found.is_ok_and(|found| found.len() == points.len()));
    }
}

#[test]
fn one_chunk_without_a_table_is_read_to_its_end() {
    let format = Format(vec![LazItemType::Point10, LazItemType::GpsTime], 14);
    let points = points(&format, 99);
    let (mut file, mut laszip) = packed(&format, &points, 1000);
    file.drain(OFFSET as usize..OFFSET as usize + 8);
    laszip[0] = 1;
    let found = unpacked(&file, &laszip, 99).unwrap();
    assert_eq!(found[98], (points[98].steps, points[98].intensity));
}

#[test]
fn chunks_of_several_sizes_have_them_in_the_table() {
    let format = Format(vec![LazItemType::Point10, LazItemType::GpsTime], 14);
    let points = points(&format, 10);
    let (mut packer, laszip) = packer(&format, None);
    for (i, point) in points.iter().enumerate() {
        pack(&mut packer, point);
        // one of three points, one of one, and one of none
        if i == 2 {
            packer.finish_current_chunk().unwrap();
        }
        if i == 3 {
            packer.finish_current_chunk().unwrap();
            packer.finish_current_chunk().unwrap();
        }
    }
    packer.done().unwrap();
    let file = packer.into_inner().into_inner();
    // a size of 0 says the same
    let mut unsized_chunks = laszip.clone();
    unsized_chunks[CHUNK_SIZE].fill(0);
    for laszip in [laszip, unsized_chunks] {
        let found = unpacked(&file, &laszip, 10).unwrap();
        assert!(
            found
                .into_iter()
                .eq(points.iter().map(|point| (point.steps, point.intensity)))
        );
        let error = unpacked(&file, &laszip, 11).unwrap_err();
        assert!(error.to_string().contains("all chunks"));
    }
}

#[test]
fn records_of_unknown_items_are_refused() {
    let format = Format(vec![LazItemType::Point10], 6);
    let (file, laszip) = packed(&format, &[], 50);
    for (at, value) in [(0, 4), (0, 3), (34, 10), (38, 9)] {
        let mut laszip = laszip.clone();
        laszip[at] = value;
        assert!(unpacked(&file, &laszip, 1).is_err(), "byte {at}");
    }
    assert!(unpacked(&file, &laszip[..30], 1).is_err());
}
