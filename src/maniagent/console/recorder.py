"""Writes the run folder while the run goes on, so that a crash or a kill loses at most the last second.

events.jsonl                     one line an event, flushed as it happens
observations/turn-01-main.png    each view of each turn; turn-01-main-depth.png is its depth in colours
observations/turn-01.npz         the rest of what was seen, without loss: depth, cameras, joints (replay/looks.py)
detections/turn-01.png           the main view with what was found and how it will be grasped
sequences/turn-01.json           the action sequence
video.mp4                        the main view while the arm moves, captioned
summary.json, report.html        at the end
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ..replay.looks import save_look
from ..replay.rigs import rig_to_plain
from ..types import ActionSequence, Event, Observation
from .annotate import colour_depth, draw_detections
from .folder import DETECTIONS, EVENTS, OBSERVATIONS, SEQUENCES, SUMMARY, VIDEO, look_name, picture_name, prepare
from .journal import to_line
from .report import write_report
from .summary import summarise
from .video import Video

_PNG_EFFORT = 2
"""zlib level: pictures are written while the robot waits."""


class Recorder:
    """An Observer that keeps a run in a folder.

    An earlier run in the folder is replaced, and nothing else ever is: UsageError where the folder holds anything
    that no recorder wrote. `frame_rate` is the video's, frames per second of robot time.
    """

    def __init__(self, folder: Path, frame_rate: float = 10.0) -> None:
        self.folder = Path(folder)
        prepare(self.folder)
        self._log = (self.folder / EVENTS).open("w", encoding="utf-8")
        self._video = Video(self.folder / VIDEO, frame_rate)
        self._observation: Observation | None = None
        self._task: str | None = None
        self._seed = 0
        self._title, self._move = "", ""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def on_event(self, event: Event) -> None:
        """Write down one event and whatever belongs to it."""
        if event.kind == "frame":
            self._video.write(event.data["rgb"], event.data["robot_time"], self._title, self._move)
            return
        if event.kind == "begun":
            event = replace(event, data={**event.data, "rig": rig_to_plain(event.data["rig"])})
        files = self._keep(event)
        extra: dict[str, Any] = {"video_time": round(self._video.seconds, 2)} | ({"files": files} if files else {})
        self._log.write(to_line(event, **extra) + "\n")
        self._log.flush()
        if event.kind == "run_finished":
            self._finish(event)

    def close(self) -> None:
        """Finish the video and write the report; of an interrupted run it tells as much as there is."""
        if self._log.closed:
            return
        self._log.close()
        self._video.close()
        write_report(self.folder)

    def _keep(self, event: Event) -> dict[str, str]:
        """Take note of what later events need, and write what is too big for a line; returns the files by name."""
        data = event.data
        match event.kind:
            case "run_started":
                self._task, self._seed, self._title = data["task"], data["seed"], data["instruction"]
            case "observed":
                self._observation = data["observation"]
                return self._keep_observation(data["turn"], data["observation"])
            case "reasoned":
                self._title, self._move = data["subtask"].text or self._title, ""
            case "located" if self._observation is not None:
                frame = self._observation.main_frame
                picture = draw_detections(frame, data["detections"], data["objects"])
                return {"detections": self._save(picture, DETECTIONS, f"turn-{data['turn']:02d}.png")}
            case "planned":
                return {"sequence": self._keep_sequence(data["turn"], data["sequence"])}
            case "move":
                self._move = data["description"]
        return {}

    def _keep_observation(self, turn: int, observation: Observation) -> dict[str, str]:
        files = {}
        for name, frame in observation.frames.items():
            depth = colour_depth(frame.depth)
            files[name] = self._save(frame.rgb, OBSERVATIONS, picture_name(turn, name))
            files[f"{name} depth"] = self._save(depth, OBSERVATIONS, picture_name(turn, name, "depth"))
        save_look(self.folder / OBSERVATIONS / look_name(turn), observation)
        return files

    def _keep_sequence(self, turn: int, sequence: ActionSequence) -> str:
        relative = f"{SEQUENCES}/turn-{turn:02d}.json"
        self._write(relative, sequence.model_dump_json(indent=2))
        return relative

    def _save(self, picture: NDArray[np.uint8], folder: str, name: str) -> str:
        path = self.folder / folder / name
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(picture).save(path, compress_level=_PNG_EFFORT)
        return f"{folder}/{name}"

    def _finish(self, event: Event) -> None:
        summary = summarise(
            event.data["result"], task=self._task, seed=self._seed, achieved=event.data["achieved"], out=self.folder
        )
        self._write(SUMMARY, json.dumps(summary, ensure_ascii=False, indent=2))
        self.close()

    def _write(self, relative: str, text: str) -> None:
        path = self.folder / relative
        path.parent.mkdir(exist_ok=True)
        path.write_text(text + "\n", encoding="utf-8")
