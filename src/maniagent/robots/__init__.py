"""Robots behind one protocol: the twin's now, the WidowX-250s's and the benchmark bridge's next."""
