"""The parameters of the method, as commands take them; the defaults are the paper's."""

from __future__ import annotations

from typing import Annotated

import typer

from ldls.params import Params

NeighborsOption = Annotated[int, typer.Option(help="K: nearest neighbours a point.")]
SigmaOption = Annotated[float, typer.Option(help="Reach of point edges exp(-d^2/sigma), in square metres.")]
PixelWeightOption = Annotated[float, typer.Option(help="lambda: weight of pixel edges.")]
WindowOption = Annotated[int, typer.Option(help="Side of the pixel window of a point, odd.")]
IterationsOption = Annotated[int, typer.Option(help="Diffusion steps.")]
ConvergeOption = Annotated[
    bool, typer.Option("--converge", help="Diffuse until nothing changes, however many steps it takes.")
]
OutliersOption = Annotated[
    bool, typer.Option("--keep-outliers/--remove-outliers", help="Keep points off an object's main part?")
]

PAPER = Params.paper()
ITERATIONS = 200
"""The paper's, beside --converge, which has none."""


def params_of(
    *,
    neighbors: int,
    sigma: float,
    pixel_weight: float,
    window: int,
    iterations: int,
    converge: bool,
    keep_outliers: bool,
    threads: int | None = None,
) -> Params:
    """The parameters that the options give.

    Raises:
        ParameterError: One is out of range.
    """
    return Params(
        neighbors=neighbors,
        sigma=sigma,
        pixel_weight=pixel_weight,
        window=window,
        iterations=None if converge else iterations,
        remove_outliers=not keep_outliers,
        threads=threads,
    )
