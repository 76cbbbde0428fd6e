"""Which thing do the words mean? Detectors turn queries into segments."""

from .protocol import Detector, Match
from .registry import Factory, detector_names, make_detector

__all__ = ["Detector", "Factory", "Match", "detector_names", "make_detector"]
