"""RLDS datasets (TFDS on disk) of LeRobot datasets that maniagent collected: what OpenVLA and CogACT fine-tune on.

    export_rlds(Path("carrots/dataset"), Path("rlds/carrots"))

They are written by tensorflow_datasets itself, in whichever environment it lives.
"""

from .client import WriterFailure
from .export import Exported, export_rlds

__all__ = ["Exported", "WriterFailure", "export_rlds"]
