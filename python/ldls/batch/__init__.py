"""Many frames: all of a source, crash-safe, on one machine or on a cluster."""

from ldls.batch.run import run
from ldls.batch.settings import RunSettings
from ldls.batch.summary import Failure, Summary

__all__ = ["Failure", "RunSettings", "Summary", "run"]
