//! What a stream of frames allocates: counted by the allocator.

use ldls_core::{Camera, Cloud, InstanceMasks, Memory, Params, Rle, segment};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

static ALLOCATED: AtomicUsize = AtomicUsize::new(0);

struct Counting;

#[expect(unsafe_code, reason = "an allocator")]
// SAFETY: hands everything on to the system's allocator
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATED.fetch_add(layout.size(), Relaxed);
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// Bytes that `work` allocates.
fn bytes(work: impl FnOnce()) -> usize {
    let before = ALLOCATED.load(Relaxed);
    work();
    ALLOCATED.load(Relaxed) - before
}

#[test]
fn a_stream_allocates_only_its_result_after_the_first_frame() {
    let n = 60_000;
    // a wall at ten metres, with a window that the mask covers
    let values: Vec<f32> = (0..n)
        .flat_map(|i| {
            [
                10.0,
                (i % 300) as f32 * 0.02 - 3.0,
                (i / 300) as f32 * 0.02 - 2.0,
            ]
        })
        .collect();
    let cloud = Cloud::F32 {
        values: &values,
        columns: 3,
    };
    let projection = [100., 0., 50., 0., 0., 100., 50., 0., 0., 0., 1., 0.];
    let t_camera_lidar = [
        0., -1., 0., 0., 0., 0., -1., 0., 1., 0., 0., 0., 0., 0., 0., 1.,
    ];
    let camera = Camera::new(&projection, &t_camera_lidar, 0.1).unwrap();
    let covered: Vec<bool> = (0..100 * 100)
        .map(|i| (40..60).contains(&(i % 100)))
        .collect();
    let mask = Rle::from_pixels(100, 100, &covered).unwrap();
    let masks = InstanceMasks::new(100, 100, vec![mask]).unwrap();
    let mut memory = Memory::of_stream();
    let mut frame = || {
        let found = segment(cloud, &masks, &camera, &Params::paper(), false, &mut memory).unwrap();
        assert_eq!(found.view.indices.len(), n);
        assert!(found.labels.contains(&1));
    };
    let first = bytes(&mut frame);
    // rows, pixels, two labels and a confidence of each point
    let result = n * (4 + 16 + 4 + 4 + 4);
    for later in [bytes(&mut frame), bytes(&mut frame)] {
        let beside = later.saturating_sub(result);
        // coefficients of the series, jobs of the thread pool and the like
        assert!(
            beside < first / 500,
            "{first} bytes for the first frame; {beside} for a later one beside its result of {result}"
        );
    }
}
