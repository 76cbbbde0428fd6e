"""Collected demonstrations: how episodes are recorded, staged, judged, and made into datasets."""
