"""Small rings of cameras with random masks."""

import numpy as np

import ldls
from ldls.simulation import sample_frame


def random_ring(seed):
    """Clusters of points around three cameras that overlap, with masks about the clusters and at random."""
    generator = np.random.default_rng(seed)
    centres = np.stack([generator.uniform(-1.2, 1.2, 9), generator.uniform(4, 12, 9)], axis=1)
    towards = [[r * np.sin(a), generator.uniform(-0.5, 0.5), r * np.cos(a)] for a, r in centres]
    clusters = [generator.normal(at, 0.25, (60, 3)) for at in towards]
    points = np.vstack([*clusters, generator.uniform([-10, -1, 2], [10, 1, 14], (300, 3))])
    views = []
    for turn in (-0.7, 0.0, 0.7):
        cos, sin = np.cos(turn), np.sin(turn)
        T = np.array([[cos, 0, -sin, 0], [0, 1, 0, 0], [sin, 0, cos, 0], [0, 0, 0, 1.0]])
        one = ldls.Camera(projection=[[40, 0, 30], [0, 40, 20], [0, 0, 1]], T_camera_lidar=T)
        pixels = np.zeros((4, 40, 60), bool)
        for mask, cluster in zip(pixels, generator.permutation(9)[:4], strict=True):
            _, uv = ldls.stages.project(clusters[cluster], one, image_size=(40, 60))
            if len(uv):
                (left, top), (right, bottom) = np.floor(uv.min(axis=0)).astype(int), np.ceil(uv.max(axis=0)).astype(int)
                mask[max(top, 0) : bottom + 1, max(left, 0) : right + 1] = True
        views.append((pixels, generator.integers(1, 3, 4), one))
    return points, views


def street_ring():
    """Points of the simulated street, and its image as those of two cameras that look apart."""
    frame = sample_frame()
    (image,) = frame.images
    pixels, camera = image.masks.to_array(), image.camera
    width = pixels.shape[2]
    views = []
    for columns in (slice(0, width // 2 + 80), slice(width // 2 - 80, width)):
        projection = camera.projection.copy()
        projection[0] -= columns.start * projection[2]
        masks = ldls.InstanceMasks.from_array(pixels[:, :, columns], categories=image.masks.categories)
        views.append(ldls.View(masks, ldls.Camera(projection=projection, T_camera_lidar=camera.T_camera_lidar)))
    return frame.points, views


def as_views(views):
    """The views of `random_ring`, as `ldls.segment` takes them."""
    return [
        ldls.View(ldls.InstanceMasks.from_array(pixels, categories=categories), one)
        for pixels, categories, one in views
    ]
