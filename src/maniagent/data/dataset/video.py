"""The pictures in a video file: how many and when, without decoding; and decoded, at chosen times."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import av
import numpy as np
from numpy.typing import NDArray

from ...geometry import FloatArray
from .layout import DatasetError

Picture = NDArray[np.uint8]

TOLERANCE = 1e-4
"""s, how far from its time a picture may be: `tolerance_s`, with which LeRobot refuses to load it."""

_AGAIN = "Copy the file again from where the dataset was made."


@dataclass(frozen=True)
class Stream:
    """What a video file holds."""

    codec: str
    pixel_format: str
    width: int
    height: int
    times: FloatArray
    """(N,) s, when each picture is shown, ascending."""


def probe(path: Path, where: str) -> Stream:
    """Count a file's pictures by its packets, which reads the file but decodes nothing."""
    with _opened(path, where) as container:
        stream = container.streams.video[0]
        base = float(stream.time_base or 0)
        try:
            times = [packet.pts * base for packet in container.demux(stream) if packet.pts is not None and packet.size]
        except (av.FFmpegError, ValueError) as error:
            raise _broken(where, error) from error
        context = stream.codec_context
        return Stream(
            context.name, str(context.pix_fmt or ""), context.width, context.height, np.sort(np.array(times, float))
        )


def pictures_at(path: Path, where: str, times: Sequence[float], tolerance: float = TOLERANCE) -> list[Picture]:
    """(H, W, 3) RGB at each of `times` (s, ascending), by seeking; DatasetError where one isn't there."""
    pictures: list[Picture] = []
    with _opened(path, where) as container:
        stream = container.streams.video[0]
        for time in times:
            frame = _seek(container, stream, time, tolerance, where)
            if frame is None:
                raise DatasetError(where, f"has no picture at {time:.3f} s")
            pictures.append(_rgb(frame, where))
    return pictures


def all_pictures(path: Path, where: str) -> Iterator[tuple[float, Picture]]:
    """Every picture with its time (s), decoded one after the other."""
    with _opened(path, where) as container:
        stream = container.streams.video[0]
        base = float(stream.time_base or 0)
        frames = container.decode(stream)
        while True:
            try:
                frame = next(frames, None)
            except (av.FFmpegError, ValueError) as error:
                raise _broken(where, error) from error
            if frame is None:
                return
            yield (frame.pts or 0) * base, _rgb(frame, where)


def _opened(path: Path, where: str) -> Any:
    try:
        container = av.open(str(path))
    except FileNotFoundError:
        raise DatasetError(where, "is missing", _AGAIN) from None
    except (av.FFmpegError, OSError, ValueError) as error:
        raise _broken(where, error) from error
    if not container.streams.video or container.streams.video[0].codec_context is None:
        container.close()
        raise DatasetError(where, "holds no video that can be decoded", _AGAIN)
    return container


def _seek(container: Any, stream: Any, time: float, tolerance: float, where: str) -> Any:
    base = stream.time_base
    try:
        container.seek(max(0, round((time - tolerance) / base)), stream=stream)  # to the key frame before
        for frame in container.decode(stream):
            shown = (frame.pts or 0) * float(base)
            if shown >= time - tolerance:
                return frame if shown <= time + tolerance else None
    except (av.FFmpegError, ValueError, OverflowError, ZeroDivisionError, TypeError) as error:
        raise _broken(where, error) from error
    return None


def _rgb(frame: Any, where: str) -> Picture:
    try:
        picture: Picture = frame.to_ndarray(format="rgb24")
    except (av.FFmpegError, ValueError) as error:
        raise _broken(where, error) from error
    return picture


def _broken(where: str, error: Exception) -> DatasetError:
    text = (str(error).splitlines() or [type(error).__name__])[0][:200]
    return DatasetError(where, f"can't be decoded ({text})", _AGAIN)
