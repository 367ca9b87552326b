"""Kinds of scenes, one a module: where their things stand."""

from ldls.simulation.layouts.campus import campus
from ldls.simulation.layouts.street import street

LAYOUTS = {"street": street, "campus": campus}
"""Each kind of scene: a random generator in, a plan out."""
