"""The parameters of the method."""

from __future__ import annotations

from dataclasses import dataclass, fields

import ldls._ldls as _ldls
from ldls.checks import checked, hold_python_values, whole_number


@checked
@dataclass(frozen=True, kw_only=True)
class Params:
    """Parameters of the method; the defaults are the best known, for any lidar. Checked when made.

    Attributes:
        neighbors: K, the nearest neighbours that every point is joined to; 1 to 255.
        sigma: sigma of the weight exp(-d^2 / sigma) of the edge between two points, in square metres.
        pixel_weight: lambda, the weight of an edge from a pixel to a point.
        window: Side in pixels of the square window that joins pixels to a point; odd, 1 to 101.
        iterations: Number of products z <- A z + b, 1 to 100000; `None` for the converged solution.
        remove_outliers: True if an instance keeps only its largest connected component, and the parts near it.
        ground_edges: Factor on the weight of an edge between a point of the ground and one that is not, 0 to 1: labels
            leak along the ground, whose points lie close together along a scan line. 1 for none of it. Needs the
            ground, which takes about 1 ms for 20,000 points in view.
        ground_clearance: Points of the ground lower than this above it, in metres, are background and have no part in
            the graph: what touches the ground cannot be told from it, and labels would run along it; 0 to 1, 0 for none
            of it. Saves the time of those points, a third to two thirds of all in view.
        local_ground: True if the ground follows kerbs and lawns where enough of it is seen, and not a smooth surface
            only. Costs about as much again as the surface.
        depth_gap: Gap in metres between the object of a mask and what is seen before and behind it: of the mask's
            points off the ground, in groups by their distance to the camera, the group with the most weight is the
            object, and others get no label from the mask. From 20 m on gaps are 3 % of the distance. 0 for no depth
            groups. Costs about 2 ms for 20 masks.
        bridged_gap: Gap in metres, 10 % of the distance from 15 m on, across which groups are one object unless the
            lighter one goes on beside the mask: the long side of a bus has such gaps, and a wall behind a person goes
            on. 0 for none of it. Part of the depth groups.
        edge_margin: Share of the shorter side of a mask by which its edge may be off, at least 3 pixels and at most 10.
            Points so near to it and as far away as its object get no label from background pixels, and their neighbours
            decide. 0 for none of it. Part of the depth groups.
        part_gap: Gap in metres across which outlier removal keeps other components of an object beside its largest: a
            pole splits a car, and the lines of 16 beams fall apart. 0 for the largest alone.
        calibrated: True if confidence is the probability that a label is of the right class, from the winner's share of
            the likelihoods and the score of its mask, as fitted on simulated frames of four lidars; else the share.
        abstain: Labels of less confidence become background, 0 to 1: `Segmentation.abstained` says which. 0 for none.
        threads: Threads to use; `None` for the environment variable `LDLS_NUM_THREADS` or else all cores that the
            process may use. Results do not depend on it.

    Raises:
        ParameterError: A value is out of range or of the wrong type.
    """

    neighbors: int = 10
    sigma: float = 0.1
    pixel_weight: float = 0.001
    window: int = 5
    iterations: int | None = 10
    remove_outliers: bool = True
    ground_edges: float = 0.02
    ground_clearance: float = 0.02
    local_ground: bool = True
    depth_gap: float = 0.6
    bridged_gap: float = 1.5
    edge_margin: float = 0.15
    part_gap: float = 1.5
    calibrated: bool = True
    abstain: float = 0.0
    threads: int | None = None

    def __post_init__(self) -> None:
        hold_python_values(self)
        for field in fields(self):
            value = getattr(self, field.name)
            if str(field.type).startswith("int") and value is not None:
                whole_number(field.name, value, 0)
        _ldls.check_params(self)

    @classmethod
    @checked
    def paper(cls, *, threads: int | None = None) -> Params:
        """The parameters of Wang et al. 2019, with nothing added to the method."""
        return cls(
            sigma=1.0,
            iterations=200,
            ground_edges=1.0,
            ground_clearance=0.0,
            local_ground=False,
            depth_gap=0.0,
            bridged_gap=0.0,
            edge_margin=0.0,
            part_gap=0.0,
            calibrated=False,
            threads=threads,
        )
