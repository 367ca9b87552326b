"""Cameras from calibration files and messages: one module a source."""
