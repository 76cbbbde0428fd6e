"""The contact sheet of the object library."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from maniagent.envs.gallery import render_gallery
from maniagent.envs.objects import object_names


@pytest.mark.slow
def test_the_gallery_shows_every_object_in_one_picture(tmp_path: Path) -> None:
    width, height, columns = 160, 120, 5
    path = render_gallery(tmp_path / "new" / "gallery.png", columns=columns, tile=(width, height))
    with Image.open(path) as image:
        assert image.format == "PNG"
        sheet = np.asarray(image.convert("RGB"), dtype=int)
    gap, caption, head = width // 20, height // 5, height // 3
    for index in range(len(object_names())):
        x = gap + (index % columns) * (width + gap)
        y = head + (index // columns) * (height + caption + gap)
        picture = sheet[y : y + height, x : x + width]
        background = picture[height // 2, 2]
        assert (np.abs(picture - background).sum(axis=-1) > 60).mean() > 0.01, object_names()[index]
        assert np.abs(picture[2, width // 2] - background).sum() < 40, "it is cut off"
