"""The parameters of the method as options of a command."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from dataclasses import fields
from typing import Annotated, Any, TypeVar

import typer

from ldls.cli.options import refuse
from ldls.params import Params

R = TypeVar("R")

HELP = {
    "neighbors": "K: nearest neighbours a point.",
    "sigma": "Reach of point edges exp(-d^2/sigma), in square metres.",
    "pixel_weight": "lambda: weight of pixel edges.",
    "window": "Side of the pixel window of a point, odd.",
    "iterations": "Diffusion steps.",
    "remove_outliers": "Take an object's label from points off its main part and parts near it?",
    "ground_edges": "Factor on edges between the ground and what stands on it; 1 for none of it.",
    "ground_clearance": "Points of the ground lower than so many metres above it are background at once; 0 for none.",
    "local_ground": "Does the ground follow kerbs and lawns, or is it smooth?",
    "depth_gap": "Gap in metres before and behind the object of a mask; 0 for no depth groups.",
    "bridged_gap": "Gap in metres within an object that does not go on beside its mask; 0 for none of it.",
    "edge_margin": "Share of a mask's shorter side by which its edge may be off; 0 for none of it.",
    "part_gap": "Gap in metres to the main part of an object within which other parts stay; 0 for none of it.",
    "calibrated": "Is confidence the probability that a label is right, or the winner's share of likelihoods?",
    "abstain": "Labels of less confidence become background, 0 to 1.",
}
SWITCHES = {
    "remove_outliers": "--remove-outliers/--keep-outliers",
    "local_ground": "--local-ground/--smooth-ground",
    "calibrated": "--calibrated/--shares",
}
METAVARS = {int: "N", float: "X"}
PANEL = "Method"


def takes_params(command: Callable[..., R]) -> Callable[..., R]:
    """`command` with an option for each parameter of the method, and --paper, in place of its keyword `params`."""
    own = inspect.signature(command, eval_str=True)
    options = [
        _flag("paper", "The method as published: no ground, no depth."),
        *(_parameter_option(name) for name in HELP),
        _flag("converge", "Diffuse until nothing changes, however many steps it takes."),
    ]
    kept = [parameter for parameter in own.parameters.values() if parameter.name != "params"]
    parameters = [parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY) for parameter in kept] + options

    @functools.wraps(command)
    def with_options(**given: Any) -> R:  # noqa: ANN401 - what Typer parsed
        chosen = {name: given.pop(name) for name in ("paper", *HELP, "converge")}
        return command(**given, params=_params_of(**chosen))

    with_options.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_options.__annotations__ = {each.name: each.annotation for each in parameters}
    return with_options


def _params_of(*, paper: bool, converge: bool, **given: Any) -> Params:  # noqa: ANN401 - values of many types
    """The parameters that the options give.

    Raises:
        ParameterError: One is out of range, or says other than --converge.
    """
    if converge:
        refuse({"iterations": given["iterations"]}, "with --converge it takes as many as it takes")
    base = Params.paper() if paper else Params()
    values = {field.name: getattr(base, field.name) for field in fields(Params)}
    values |= {name: value for name, value in given.items() if value is not None}
    return Params(**values | ({"iterations": None} if converge else {}))


def _parameter_option(name: str) -> inspect.Parameter:
    best, published = (getattr(params, name) for params in (Params(threads=1), Params.paper(threads=1)))
    if name in SWITCHES:
        shown = SWITCHES[name].split("/")[not best].removeprefix("--")
        option = typer.Option(SWITCHES[name], help=HELP[name], show_default=shown, rich_help_panel=PANEL)
    else:
        shown = f"{best:g}" if best == published else f"{best:g}, the paper's {published:g}"
        option = typer.Option(metavar=METAVARS[type(best)], help=HELP[name], show_default=shown, rich_help_panel=PANEL)
    return _keyword(name, Annotated[type(best) | None, option], None)


def _flag(name: str, text: str) -> inspect.Parameter:
    return _keyword(name, Annotated[bool, typer.Option(f"--{name}", help=text, rich_help_panel=PANEL)], False)


def _keyword(name: str, annotation: Any, default: Any) -> inspect.Parameter:  # noqa: ANN401 - of any type
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)
