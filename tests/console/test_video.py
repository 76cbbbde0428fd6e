from pathlib import Path

import av
import numpy as np
import pytest

from maniagent.console.video import BAR_HEIGHT, Video, caption_bar


def picture(value: int, width: int = 96, height: int = 64) -> np.ndarray:
    return np.full((height, width, 3), value, np.uint8)


def decode(path: Path) -> list[av.VideoFrame]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


def test_what_is_written_comes_back_below_its_caption(tmp_path: Path) -> None:
    with Video(tmp_path / "v.mp4") as video:
        for index in range(25):
            video.write(picture(10 * index), index / 10, "title", "detail")
        assert video.seconds == pytest.approx(2.5)
    frames = decode(tmp_path / "v.mp4")
    assert len(frames) == 25
    assert (frames[0].width, frames[0].height) == (96, 64 + BAR_HEIGHT)
    brightness = [frame.to_ndarray(format="rgb24")[BAR_HEIGHT + 8 :].mean() for frame in frames]
    assert brightness == pytest.approx([10 * index for index in range(25)], abs=6)


def test_it_is_h264_in_the_pixel_format_every_player_knows(tmp_path: Path) -> None:
    with Video(tmp_path / "v.mp4") as video:
        video.write(picture(90, 97, 63), 0.0, "odd sizes", "are cut to even ones")
    with av.open(str(tmp_path / "v.mp4")) as container:
        context = container.streams.video[0].codec_context
        assert (context.name, context.pix_fmt) == ("h264", "yuv420p")
        assert (context.width % 2, context.height % 2) == (0, 0)


def test_the_index_stands_in_front_once_it_is_closed(tmp_path: Path) -> None:
    with Video(tmp_path / "v.mp4") as video:
        for index in range(30):
            video.write(picture(index), index / 10, "", "")
    data = (tmp_path / "v.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")
    assert b"moof" not in data


def test_long_pauses_are_cut_to_a_second(tmp_path: Path) -> None:
    with Video(tmp_path / "v.mp4") as video:
        for time in (0.0, 0.1, 60.0, 60.1):
            video.write(picture(50), time, "", "")
    times = [frame.time for frame in decode(tmp_path / "v.mp4")]
    assert times == pytest.approx([0.0, 0.1, 1.1, 1.2])


def test_a_clock_that_stands_still_or_goes_back_does_no_harm(tmp_path: Path) -> None:
    with Video(tmp_path / "v.mp4") as video:
        for time in (0.0, 0.0, -5.0, 0.1):
            video.write(picture(50), time, "", "")
    times = [frame.time for frame in decode(tmp_path / "v.mp4")]
    assert times == sorted(times)
    assert len(times) == 4


def test_without_a_frame_there_is_no_file(tmp_path: Path) -> None:
    video = Video(tmp_path / "v.mp4")
    video.close()
    video.close()
    assert not (tmp_path / "v.mp4").exists()


def test_captions_always_fit() -> None:
    bar = caption_bar(200, "put " * 200, "\n\t unprintable \x00 and 漢字")
    assert bar.shape == (BAR_HEIGHT, 200, 3)
    assert (bar[:, -10:] == bar[0, 0]).all()
