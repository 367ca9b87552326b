"""Pictures of labelled points."""

from ldls.palette import palette
from ldls.viewing.overlay import overlay

__all__ = ["overlay", "palette"]
