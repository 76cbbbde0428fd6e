"""Whether the videos hold a picture for every frame, and pictures that show something."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from ....geometry import FloatArray
from ..findings import Check
from ..layout import DatasetError, Feature, Info, inside
from ..reading import Clip, Dataset, Episode
from ..video import TOLERANCE, Picture, Stream, all_pictures, pictures_at, probe

SAMPLE = 20
"""Episodes whose first and last pictures are decoded unless all are."""
_DARK = 4.0
"""Mean of 0 to 255, below which a picture shows nothing."""

Advance = Callable[[int, str], None]


class Videos:
    """Goes through the video files of all cameras, one after the other."""

    def __init__(self, root: Path, info: Info, episodes: tuple[Episode, ...], deep: bool) -> None:
        self._root, self._info, self._episodes, self._deep = root, info, episodes, deep
        self._sampled = {episodes[i].index for i in _spread(len(episodes), SAMPLE)}
        self.files: dict[str, list[Episode]] = defaultdict(list)
        for camera in info.cameras:
            for episode in episodes:
                self.files[episode.clips[camera].file].append(episode)
        self._cameras = {episode.clips[c].file: c for episode in episodes for c in info.cameras}
        self.frames = Check("video frames", "Has every frame a picture of its size, at its time?")
        how = "all are decoded" if deep else f"the first and last of up to {SAMPLE} episodes are decoded; --deep: all"
        self.pictures = Check("pictures", f"Do the pictures decode and show something? ({how})")
        self._in_tables = [name for name in info.pictures if name not in info.cameras]
        if not info.cameras:
            self.frames.skipped = "there are no videos"
        if not info.pictures:
            self.pictures.skipped = "there are no pictures"

    def run(self, advance: Advance) -> None:
        """Ask; `advance` is told of the episodes that are done."""
        for file, episodes in sorted(self.files.items()):
            camera = self._cameras[file]
            try:
                path = inside(self._root, file, file)
                stream = probe(path, file)
                self._count(camera, file, stream, episodes)
                if self._deep:
                    self._decode_all(path, file, camera, episodes)
                else:
                    self._decode_some(path, file, camera, episodes)
            except DatasetError as error:
                self.frames.broken(error)
            advance(len(episodes), file)
        for camera in self._in_tables:
            self._decode_from_tables(camera)

    def _decode_from_tables(self, camera: str) -> None:
        """Pictures that lie in the data files themselves, one by one."""
        dataset = Dataset(self._root, self._info, {}, self._episodes)
        for episode in self._episodes:
            if episode.length < 1 or not (self._deep or episode.index in self._sampled):
                continue
            frames = range(episode.length) if self._deep else sorted({0, episode.length - 1})
            try:
                pictures = dataset.pictures(episode, camera, frames)
            except DatasetError as error:
                self.pictures.broken(error)
                continue
            self._judge(f"{camera}, {episode.name}", list(zip(frames, pictures, strict=True)), episode.length)

    def _count(self, camera: str, file: str, stream: Stream, episodes: list[Episode]) -> None:
        height, width = _size(self._info.features[camera])
        if (stream.height, stream.width) != (height, width):
            what = f"its pictures are {stream.width} x {stream.height}, meta/info.json says {width} x {height}"
            self.frames.problem(file, what, "Encode it anew at that size.")
        for episode in episodes:
            self._count_clip(episode, camera, file, stream.times)
        wanted = sum(episode.length for episode in episodes)
        if len(stream.times) > wanted:
            what = f"holds {len(stream.times)} pictures, its episodes have {wanted} frames"
            self.frames.warning(file, what, "The others are never loaded; they only take space.")

    def _count_clip(self, episode: Episode, camera: str, file: str, times: FloatArray) -> None:
        clip, step = episode.clips[camera], 1 / self._info.fps
        where = f"{file}, {episode.name}"
        first, last = np.searchsorted(times, (clip.start - step / 2, clip.start + (episode.length - 0.5) * step))
        shown = times[first:last]
        if len(shown) != episode.length:
            what = f"has {len(shown)} pictures for {episode.length} frames from {clip.start:.3f} s"
            self.frames.problem(where, what, "Leave the episode out, or encode it anew.")
        elif len(shown):
            off = float(np.abs(shown - clip.start - np.arange(len(shown)) * step).max())
            if off > TOLERANCE:
                what = f"a picture is shown {1e3 * off:.2f} ms from its frame's time"
                self.frames.problem(where, what, "LeRobot refuses more than 0.1 ms: encode it anew at a constant rate.")
        if abs(clip.end - clip.start - episode.length * step) > step / 2:
            what = f"lasts {clip.end - clip.start:.3f} s by its metadata, its frames {episode.length * step:.3f} s"
            self.frames.problem(where, what, "Correct from_timestamp and to_timestamp.")

    def _decode_some(self, path: Path, file: str, camera: str, episodes: list[Episode]) -> None:
        for episode in episodes:
            if episode.index not in self._sampled or episode.length < 1:
                continue
            clip = episode.clips[camera]
            times = (clip.start, clip.start + (episode.length - 1) / self._info.fps)
            try:
                first, last = pictures_at(path, file, times, 0.5 / self._info.fps)
            except DatasetError as error:
                self.pictures.problem(f"{file}, {episode.name}", error.what, error.todo)
                continue
            self._judge(f"{file}, {episode.name}", [(0, first), (episode.length - 1, last)], episode.length)

    def _decode_all(self, path: Path, file: str, camera: str, episodes: list[Episode]) -> None:
        """Every picture, kept no longer than it takes to look at it."""
        clips = sorted(((episode.clips[camera], episode) for episode in episodes), key=lambda pair: pair[0].start)
        dark: dict[int, list[int]] = defaultdict(list)
        firsts: dict[int, Picture] = {}
        moved: set[int] = set()
        try:
            for frame, episode, picture in self._placed(path, file, clips):
                if picture.mean() < _DARK:
                    dark[episode.index].append(frame)
                before = firsts.setdefault(episode.index, picture)
                if episode.index not in moved and not np.array_equal(before, picture):
                    moved.add(episode.index)
        except DatasetError as error:
            self.pictures.broken(error)
        for episode in episodes:
            where = f"{file}, {episode.name}"
            if episode.index not in firsts:
                self.pictures.problem(where, "has no picture that decodes")
                continue
            self._tell_dark(where, dark[episode.index], episode.length)
            if episode.index not in moved and episode.length > 1:
                self._tell_still(where)

    def _placed(
        self, path: Path, file: str, clips: list[tuple[Clip, Episode]]
    ) -> Iterator[tuple[int, Episode, Picture]]:
        starts = np.array([clip.start for clip, _ in clips])
        for time, picture in all_pictures(path, file):
            at = int(np.searchsorted(starts, time + 0.5 / self._info.fps)) - 1
            if at >= 0:
                clip, episode = clips[at]
                frame = round((time - clip.start) * self._info.fps)
                if frame < episode.length:
                    yield frame, episode, picture

    def _judge(self, where: str, pictures: list[tuple[int, Picture]], length: int) -> None:
        self._tell_dark(where, [frame for frame, picture in pictures if picture.mean() < _DARK], length)
        if length > 1 and all(np.array_equal(pictures[0][1], picture) for _, picture in pictures[1:]):
            self._tell_still(where)

    def _tell_dark(self, where: str, frames: list[int], length: int) -> None:
        if {0, length - 1} & set(frames):
            self.pictures.problem(where, f"is black in frame {frames[0]}", "Leave the episode out.")
        elif frames:
            self.pictures.warning(where, f"is black in {len(frames)} frames, first in frame {frames[0]}", "Look at it.")

    def _tell_still(self, where: str) -> None:
        what = "the pictures don't change" if self._deep else "the last picture is the first one"
        self.pictures.warning(where, what, "Did the camera stop? Look at it: maniagent data view.")


def _size(feature: Feature) -> tuple[int, int]:
    """Height and width; some makers put the channels first."""
    first, second, third = feature.shape
    return (second, third) if first in (1, 3) and third not in (1, 3) else (first, second)


def _spread(count: int, wanted: int) -> list[int]:
    """Up to `wanted` of `count` numbers, spread evenly, first and last among them."""
    return sorted({round(i) for i in np.linspace(0, count - 1, min(count, wanted))}) if count else []
