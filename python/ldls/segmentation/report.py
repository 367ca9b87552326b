"""Report of a run: counts of the input and measures of the diffusion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Report:
    """Counts and measures of one segmentation.

    Attributes:
        n_points: Points given.
        n_in_view: Points that the image sees; the method works on these.
        n_nonfinite: Points with a coordinate that is NaN or infinite; left out.
        n_origin: Points at exactly (0, 0, 0), taken for missing returns; left out.
        n_behind: Points behind the camera or nearer than its smallest depth.
        n_outside: Points in front of the camera but beside the image.
        n_duplicates: Points of the graph that share their place with another of them.
        k_effective: Neighbours that each point has: K, or one less than the points of the graph.
        n_refined: Points at which two labels were too near to one another for single precision.
        sweeps: Sweeps over the graph that were computed; a series saves most of the products.
        residual: Largest change of any likelihood that one more product would make; None where the number of
            iterations was given.
        converged: True if that change is at most 1e-5 and a hundredth of the largest weight of pixel edges to a label;
            False where the number of iterations was given.
        empty_masks: Labels of instances whose mask has no pixel.
        n_sweeps: Sweeps that were labelled together; all but `n_points`, `n_in_view` and `empty_masks` is of all of
            them.
    """

    n_points: int
    n_in_view: int
    n_nonfinite: int
    n_origin: int
    n_behind: int
    n_outside: int
    n_duplicates: int
    k_effective: int
    n_refined: int
    sweeps: int
    residual: float | None
    converged: bool
    empty_masks: tuple[int, ...]
    n_sweeps: int = 1
