"""What planning knows of the gripper and the objects as a sequence goes on."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import MotionRejected
from ..geometry import FloatArray, invert_transform
from ..types import Gripper, KeyPoint, OrientedBox
from .collision import HeldBox, PlacedBox
from .kinematics import ArmModel


class Hand:
    """Finger opening, the box in the gripper, and where the other boxes stand at this point of the sequence."""

    def __init__(self, model: ArmModel, opening: float, boxes: Mapping[int, OrientedBox]) -> None:
        self._model = model
        self._placed = {index: PlacedBox.of(box) for index, box in boxes.items()}
        self.opening = opening
        """m between the pads."""
        self.held: HeldBox | None = None
        self.held_index: int | None = None
        self.just_released: int | None = None
        """Index of the object that the fingers still surround, because they let go of it at the last key point."""

    @property
    def obstacles(self) -> dict[int, PlacedBox]:
        """Every box that isn't in the gripper."""
        return {index: box for index, box in self._placed.items() if index != self.held_index}

    def take(self, index: int, T_base_tcp: FloatArray) -> None:
        """Object `index` is in the gripper from here on; the fingers rest on its sides.

        Raises MotionRejected for an index that is not among the objects.
        """
        if index not in self._placed:
            raise MotionRejected(f"There is no object {index} to carry.")
        box = self._placed[index]
        self.held = HeldBox(invert_transform(T_base_tcp) @ box.T_base_box, box.half_extent)
        self.held_index = index
        half_width = np.abs(T_base_tcp[:3, 1] @ box.T_base_box[:3, :3]) @ box.half_extent
        self.opening = float(np.clip(2 * half_width, self._model.min_opening, self.opening))

    def release(self, T_base_tcp: FloatArray) -> None:
        """The object in the gripper stays where it is now."""
        if self.held is not None and self.held_index is not None:
            T_base_box = T_base_tcp @ self.held.T_tcp_box
            self._placed[self.held_index] = PlacedBox(T_base_box, self.held.half_extent)
            self.just_released = self.held_index
        self.held = self.held_index = None

    def act(self, point: KeyPoint, T_base_tcp: FloatArray, next_held: int | None) -> None:
        """The gripper action of a key point, done at `T_base_tcp`; `next_held` is what the next one carries."""
        self.just_released = None
        if point.gripper is Gripper.OPEN:
            self.release(T_base_tcp)
            self.opening = self._model.max_opening if point.opening is None else point.opening
        elif point.gripper is Gripper.CLOSE and next_held is not None:
            self.take(next_held, T_base_tcp)
        elif point.gripper is Gripper.CLOSE:
            self.opening = self._model.min_opening
