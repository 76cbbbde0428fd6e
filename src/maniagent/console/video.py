"""The video of a run: H.264, playable at any moment, also after the process was killed."""

from __future__ import annotations

import functools
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Self

import av
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

BAR_HEIGHT = 48
"""px, height of the caption bar above the picture (players lay their controls over the lower edge)."""

_LIVE = {"movflags": "frag_keyframe+empty_moov+default_base_moof", "flush_packets": "1"}
_FINAL = {"movflags": "faststart"}


class Video:
    """Writes captioned frames to an MP4 file.

    While it is written the file is a fragmented MP4, one fragment a second, so that it plays up to the last
    fragment whatever happens. `close` rewrites the index, without encoding again, so that every player can seek.
    """

    def __init__(self, path: Path, frame_rate: float = 10.0) -> None:
        self.path = path
        self._rate = Fraction(frame_rate).limit_denominator(1000)
        self._container: av.container.OutputContainer | None = None
        self._stream: av.VideoStream | None = None
        self._tick = -1
        self._last_time = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def seconds(self) -> float:
        """Length of the video so far, s."""
        return float((self._tick + 1) / self._rate)

    def write(self, rgb: NDArray[np.uint8], time: float, title: str, detail: str) -> None:
        """Append one frame.

        `rgb` is (H, W, 3) uint8, of one size throughout; `time` (s) is the clock that paces the video: pauses longer
        than a second are cut to one second. `title` and `detail` are the caption's two lines.
        """
        picture = np.concatenate([caption_bar(rgb.shape[1], title, detail), rgb])
        picture = np.ascontiguousarray(picture[: picture.shape[0] // 2 * 2, : picture.shape[1] // 2 * 2])
        if self._container is None or self._stream is None:
            self._open(picture.shape[1], picture.shape[0])
            self._last_time = time
        assert self._container is not None and self._stream is not None  # noqa: S101, PT018 - just opened
        frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
        self._tick += self._ticks_since(time)
        frame.pts = self._tick
        for packet in self._stream.encode(frame):
            self._container.mux(packet)

    def _ticks_since(self, time: float) -> int:
        elapsed = time - self._last_time
        self._last_time = time
        return int(np.clip(round(elapsed * self._rate), 1, max(1, round(self._rate))))

    def _open(self, width: int, height: int) -> None:
        self._container = av.open(str(self.path), "w", format="mp4", options=_LIVE)
        self._stream = self._container.add_stream("libx264", rate=self._rate)
        self._stream.width, self._stream.height, self._stream.pix_fmt = width, height, "yuv420p"
        self._stream.time_base = self._stream.codec_context.time_base = 1 / self._rate
        self._stream.codec_context.gop_size = max(1, round(self._rate))  # a fragment starts at each key frame
        self._stream.options = {"preset": "veryfast", "crf": "23", "tune": "zerolatency"}

    def close(self) -> None:
        """Finish the file; harmless when called again or when nothing was written."""
        if self._container is None or self._stream is None:
            return
        for packet in self._stream.encode(None):
            self._container.mux(packet)
        self._container.close()
        self._container = self._stream = None
        _index(self.path)


def _index(path: Path) -> None:
    """Copy the packets of a fragmented MP4 into one with an index up front, then take its place."""
    whole = path.with_suffix(".part")
    with av.open(str(path)) as source, av.open(str(whole), "w", format="mp4", options=_FINAL) as target:
        stream = target.add_stream_from_template(source.streams.video[0])
        for packet in source.demux(video=0):
            if packet.dts is not None:  # the last, empty packet only flushes
                packet.stream = stream
                target.mux(packet)
    whole.replace(path)


@functools.lru_cache(maxsize=8)
def caption_bar(width: int, title: str, detail: str) -> NDArray[np.uint8]:
    """The (BAR_HEIGHT, width, 3) strip with two lines of text; what does not fit is cut with an ellipsis."""
    image = Image.new("RGB", (width, BAR_HEIGHT), (17, 20, 26))
    draw = ImageDraw.Draw(image)
    for text, size, top, colour in ((title, 16, 5, (245, 246, 248)), (detail, 13, 27, (148, 163, 184))):
        font = ImageFont.load_default(size)
        draw.text((12, top), _fit(draw, text, font, width - 24), font=font, fill=colour)
    return np.asarray(image)


def _fit(draw: ImageDraw.ImageDraw, text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont, width: float) -> str:
    text = " ".join(text.split())[:300]
    if draw.textlength(text, font=font) <= width:
        return text
    while text and draw.textlength(text + "…", font=font) > width:
        text = text[:-1]
    return text + "…"
