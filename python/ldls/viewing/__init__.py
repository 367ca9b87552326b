"""Pictures of labelled points."""

from ldls.viewing.overlay import overlay

__all__ = ["overlay"]
