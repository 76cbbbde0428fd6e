"""maniagent: an instruction and RGB-D images in, a carried-out manipulation task out; no training.

Implements ManiAgent (arXiv 2510.11660).
"""

__version__ = "0.1.0"
