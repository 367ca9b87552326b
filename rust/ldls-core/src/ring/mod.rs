//! Several cameras around one lidar: one graph over all points that any of them sees.
//!
//! Every camera adds the pixel edges of the points that it sees, so that where images overlap, they vote. An object that
//! two images show has an instance in each; the two are one label if the points that both cameras see agree.

mod images;
mod same_objects;
mod sightings;

pub use sightings::Sighting;

use crate::masks::InstanceMasks;
use crate::projection::{Camera, Cloud, check_points};
use crate::segment::{Stopwatch, check_edges, label_points};
use crate::{Params, Result, Segmentation};
use images::{Images, labels_of};
use same_objects::same_objects;
use sightings::sight_all;

/// What one camera of a ring took.
#[derive(Debug, Clone, Copy)]
pub struct RingView<'a> {
    /// Instance masks of its image.
    pub masks: &'a InstanceMasks,
    /// Category of each of them: only instances of one category become one object.
    pub categories: &'a [i32],
    /// The camera.
    pub camera: &'a Camera,
}

/// Labels of all points of a cloud by several images.
#[derive(Debug, Clone)]
pub struct RingSegmentation {
    /// Labels of points; its view has no pixels of its own.
    pub segmentation: Segmentation,
    /// What each camera sees.
    pub sightings: Vec<Sighting>,
    /// The instances that object l = 1, 2, ... consists of, at `objects[l - 1]`: camera and instance, the latter from 1.
    pub objects: Vec<Vec<(usize, u32)>>,
}

/// Segments `cloud` by the instance masks of the images that several cameras took at one moment; otherwise as
/// [`crate::segment()`].
///
/// Instances of two images become one object if, of the points that both cameras see and that fall on one of the two
/// masks, at least the share `same_object` falls on both.
///
/// # Errors
/// As [`crate::segment()`]; [`crate::Error::Mismatch`] where a view has not one category a mask.
pub fn segment_ring(
    cloud: Cloud,
    views: &[RingView],
    same_object: f64,
    params: &Params,
    keep_origin: bool,
) -> Result<RingSegmentation> {
    params.check()?;
    check_points(cloud.len())?;
    check_edges(cloud.len(), params.neighbors)?;
    for view in views {
        view.check()?;
    }
    let clock = Stopwatch::start();
    let (view, sightings) = sight_all(cloud, views, keep_origin)?;
    let slots: Vec<Vec<u32>> = sightings
        .iter()
        .map(|sighting| sighting.slots(view.indices.len()))
        .collect();
    let objects = same_objects(views, &sightings, &slots, same_object);
    let seeds = Images {
        views,
        sightings: &sightings,
        slots: &slots,
        labels: labels_of(views, &objects),
        count: objects.len() + 1,
    };
    let segmentation = label_points(cloud.len(), view, &seeds, params, clock)?;
    Ok(RingSegmentation {
        segmentation,
        sightings,
        objects,
    })
}

impl RingView<'_> {
    fn check(&self) -> Result<()> {
        if self.masks.len() == self.categories.len() {
            return Ok(());
        }
        Err(crate::Error::Mismatch {
            name: "categories",
            problem: format!("{} for {} masks", self.categories.len(), self.masks.len()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_support::{camera, masks, segment, wall};

    #[test]
    fn a_ring_of_one_camera_gives_what_the_camera_gives() {
        let (masks, camera) = (masks(&[[5, 5, 10, 12], [8, 20, 12, 9]]), camera(20.0));
        let view = RingView {
            masks: &masks,
            categories: &[1, 1],
            camera: &camera,
        };
        let ring = segment(&[view]);
        let values = wall();
        let cloud = Cloud::F64 {
            values: &values,
            columns: 3,
        };
        let single = crate::segment(cloud, &masks, &camera, &Params::paper(), false).unwrap();
        assert_eq!(ring.segmentation.labels, single.labels);
        assert_eq!(ring.segmentation.confidence, single.confidence);
        assert_eq!(ring.segmentation.view.indices, single.view.indices);
        assert_eq!(ring.sightings[0].uv, single.view.uv);
        assert_eq!(ring.objects, [[(0, 1)], [(0, 2)]]);
    }
}
