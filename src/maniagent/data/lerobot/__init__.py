"""LeRobot datasets (v3) of collected episodes, written with lerobot itself, in whichever environment it lives.

    with Writer() as writer:
        publish(Path("demos"), writer=writer)

`publish` moves the valid staged episodes of a collection into its dataset; `merge` and `split` make datasets of
datasets. All three change what they make at one moment, so that a kill leaves the old or the new.
"""

from .client import Writer, WriterFailure
from .publish import Published, publish
from .tools import merge, split

__all__ = ["Published", "Writer", "WriterFailure", "merge", "publish", "split"]
