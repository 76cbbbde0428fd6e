"""What all tests share."""

from hypothesis import settings

# How long one example takes says more about a shared machine than about the code; `--durations` tells that better.
settings.register_profile("maniagent", deadline=None)
settings.load_profile("maniagent")
