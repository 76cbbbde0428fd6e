"""Which thing do the words mean? Detectors turn queries into segments."""

from .protocol import Detector, Match

__all__ = ["Detector", "Match"]
