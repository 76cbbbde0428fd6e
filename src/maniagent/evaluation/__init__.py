"""Measure an actor on a suite of tasks: many episodes, honest intervals, nothing lost when a process dies."""
