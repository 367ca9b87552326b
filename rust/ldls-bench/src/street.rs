//! A made-up street of 20 instances: its points, and the camera and masks of an image of it.

use ldls_core::{Camera, Cloud, InstanceMasks, Rle, View};

pub(crate) const HEIGHT: usize = 375;
pub(crate) const WIDTH: usize = 1242;
const INSTANCES: usize = 20;

/// A street with the camera and the masks of its image.
pub struct Street {
    values: Vec<f32>,
    pub(crate) camera: Camera,
    pub(crate) masks: InstanceMasks,
}

impl Street {
    /// A street of `n` points in view.
    pub fn new(n: usize) -> Self {
        Self {
            values: points(n),
            camera: camera(),
            masks: masks(),
        }
    }

    pub(crate) fn cloud(&self) -> Cloud<'_> {
        Cloud::F32 {
            values: &self.values,
            columns: 3,
        }
    }

    pub(crate) fn view(&self) -> View<'_> {
        View {
            masks: &self.masks,
            categories: &[0; INSTANCES],
            scores: &[1.0; INSTANCES],
            camera: &self.camera,
            rows: View::ALL_ROWS,
        }
    }
}

/// `n` points in view, scan line by scan line: ground below, a wall ahead, and a pillar for each instance.
fn points(n: usize) -> Vec<f32> {
    let lines = 64.max(n / 4000);
    let columns = n / lines;
    let mut points = Vec::with_capacity(3 * n);
    for line in 0..lines {
        let pitch = 0.03 - 0.25 * line as f32 / lines as f32;
        for column in 0..columns {
            let yaw = 0.7 * (0.5 - column as f32 / columns as f32);
            let noise = 0.02 * ((column * 7919 + line * 104_729) % 1000) as f32 / 1000.0;
            let pillar = column * INSTANCES / columns;
            let on_pillar = (column * INSTANCES * 3 / columns) % 3 == 1;
            let wall = if on_pillar { 8.0 + pillar as f32 } else { 40.0 };
            let ground = if pitch < 0.0 {
                -1.7 / pitch
            } else {
                f32::INFINITY
            };
            let range = wall.min(ground) + noise;
            points.extend([range * yaw.cos(), range * yaw.sin(), range * pitch]);
        }
    }
    points
}

fn camera() -> Camera {
    let projection = [720., 0., 620., 0., 0., 720., 180., 0., 0., 0., 1., 0.];
    let t_camera_lidar = [
        0., -1., 0., 0., 0., 0., -1., -0.1, 1., 0., 0., -0.3, 0., 0., 0., 1.,
    ];
    Camera::new(&projection, &t_camera_lidar, 0.1).expect("a camera")
}

fn masks() -> InstanceMasks {
    let rles = (0..INSTANCES).map(|instance| {
        let left = (620.0 - 720.0 * (0.35 - 0.7 * (instance as f64 + 0.3) / 20.0).tan()) as usize;
        let pixels: Vec<bool> = (0..HEIGHT * WIDTH)
            .map(|i| (left..left + 11).contains(&(i % WIDTH)) && (150..300).contains(&(i / WIDTH)))
            .collect();
        Rle::from_pixels(HEIGHT, WIDTH, &pixels).expect("a mask")
    });
    InstanceMasks::new(HEIGHT, WIDTH, rles.collect()).expect("masks")
}
