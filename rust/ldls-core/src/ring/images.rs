//! The pixel edges of several images added up: what the points of a ring of cameras are labelled by.

use super::RingView;
use super::sightings::{Sighting, UNSEEN};
use crate::masks::PixelLabels;
use crate::segment::Seeds;
use crate::{Params, Real, Result};

/// The pixels of all images.
pub(crate) struct Images<'a> {
    pub(crate) views: &'a [RingView<'a>],
    pub(crate) sightings: &'a [Sighting],
    pub(crate) slots: &'a [Vec<u32>],
    /// Label of each instance of each view.
    pub(crate) labels: Vec<Vec<u32>>,
    pub(crate) count: usize,
}

impl Seeds for Images<'_> {
    fn labels(&self) -> usize {
        self.count
    }

    fn pixel_labels<T: Real>(&self, order: &[u32], params: &Params) -> Result<PixelLabels<T>> {
        let mut parts = Vec::with_capacity(self.views.len());
        for (camera, view) in self.views.iter().enumerate() {
            let slots = &self.slots[camera];
            let seen = order.iter().map(|&point| slots[point as usize]);
            let uv: Vec<[f64; 2]> = seen
                .filter(|&slot| slot != UNSEEN)
                .map(|slot| self.sightings[camera].uv[slot as usize])
                .collect();
            let labels = view
                .masks
                .pixel_labels::<T>(&uv, params.window, params.pixel_weight)?;
            parts.push(labels);
        }
        Ok(self.together(order, &parts))
    }
}

impl Images<'_> {
    /// Rows of all cameras that see a point added up, their instances named by the objects they show.
    fn together<T: Real>(&self, order: &[u32], parts: &[PixelLabels<T>]) -> PixelLabels<T> {
        let mut next = vec![0; parts.len()];
        let mut all = PixelLabels {
            offsets: vec![0],
            ..PixelLabels::default()
        };
        let mut row: Vec<(u32, T)> = Vec::new();
        for &point in order {
            row.clear();
            let mut mass = T::default();
            for (camera, part) in parts.iter().enumerate() {
                if self.slots[camera][point as usize] == UNSEEN {
                    continue;
                }
                let at = next[camera];
                next[camera] += 1;
                mass += part.mass[at];
                for (instance, weight) in part.row(at) {
                    let label = self.labels[camera][instance];
                    match row.iter_mut().find(|(known, _)| *known == label) {
                        Some((_, sum)) => *sum += weight,
                        None => row.push((label, weight)),
                    }
                }
            }
            row.sort_unstable_by_key(|&(label, _)| label);
            all.labels.extend(row.iter().map(|&(label, _)| label));
            all.weights.extend(row.iter().map(|&(_, weight)| weight));
            all.mass.push(mass);
            all.offsets.push(all.labels.len());
        }
        all
    }
}

/// Label of each instance of each view: the number of its object; entry 0 is the background.
pub(crate) fn labels_of(views: &[RingView], objects: &[Vec<(usize, u32)>]) -> Vec<Vec<u32>> {
    let mut labels: Vec<Vec<u32>> = views
        .iter()
        .map(|view| vec![0; view.masks.len() + 1])
        .collect();
    for (label, members) in (1..).zip(objects) {
        for &(camera, m) in members {
            labels[camera][m as usize] = label;
        }
    }
    labels
}
