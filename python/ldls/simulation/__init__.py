"""Street scenes with perfect labels."""

from ldls.simulation.street import SimulatedFrame, street_scene

__all__ = ["SimulatedFrame", "street_scene"]
