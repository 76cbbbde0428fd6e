"""Real loading, encoding, generation and post-processing of the detectors with weights, on tiny random ones."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from tables import Look, arrange, block

from maniagent.errors import DetectionFailure, SetupError
from maniagent.perception.detectors import make_detector
from maniagent.perception.detectors.pretrained import BoxDetector
from maniagent.perception.detectors.protocol import Box, box_of

RGB = np.random.default_rng(0).integers(0, 255, (48, 64, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """By the detector's name: a folder of tiny random weights."""
    pytest.importorskip("torch", reason="needs the extra `detectors`")
    pytest.importorskip("transformers", reason="needs the extra `detectors`")
    import tiny_models

    folder = tmp_path_factory.mktemp("weights")
    return {
        "florence2": tiny_models.save_florence2(folder / "florence2"),
        "grounding-dino": tiny_models.save_grounding_dino(folder / "dino"),
        "owlv2": tiny_models.save_owlv2(folder / "owl"),
    }


@pytest.fixture(autouse=True)
def short_answers(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("maniagent.perception.detectors.florence2.MAX_TOKENS", 24)


@pytest.fixture(scope="module")
def seen() -> Look:
    return arrange({"tower": (block("blue", 0.05), 0.25, -0.1, 10.0), "dish": ("dish", 0.26, 0.13, 0.0)})


def model_of(detector: object) -> object:
    assert isinstance(detector, BoxDetector)
    return detector._model


NAMES = ("florence2", "grounding-dino", "owlv2")

# What runs on any weights -----------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_detector_with_weights_runs_from_loading_to_matches(name, weights, seen):
    detector = make_detector(f"{name}:{weights[name]}")
    assert detector.name == f"{name}:{weights[name]}"
    queries = ("the red pepper", "block", "very long words " * 30)
    found = detector.detect(queries, seen.view, seen.observation)
    assert len(found) == 3
    for query, matches in zip(queries, found, strict=True):
        assert all(match.detection.query == query and 0 <= match.detection.score <= 1 for match in matches)


@pytest.mark.parametrize("name", ["grounding-dino", "owlv2"])
def test_boxes_come_out_in_pixels_of_the_picture(name, weights, monkeypatch):
    import torch

    model = model_of(make_detector(f"{name}:{weights[name]}"))
    logits = torch.full((1, 2, 8), -9.0)
    logits[0, 0, 1] = 4.0  # the other box stays below the threshold
    # OWLv2 sees the picture padded to a square: the middle half of that, in height as in width.
    middle = [0.5, 0.5, 0.5, 0.5] if name == "grounding-dino" else [0.5, 24 / 64, 0.5, 24 / 64]
    fixed = SimpleNamespace(
        logits=logits, pred_boxes=torch.tensor([[middle, middle]]), input_ids=torch.zeros(1, 8).long()
    )
    monkeypatch.setattr(model, "_loaded", replace(model._loaded, model=lambda **inputs: fixed))
    ((box, score),) = model.boxes("every thing", RGB)
    assert box == pytest.approx((16, 12, 48, 36))
    assert score == pytest.approx(0.982, abs=1e-3)


def test_florence2_reads_boxes_and_outlines_and_nothing_else(weights):
    model = model_of(make_detector(f"florence2:{weights['florence2']}"))

    def read(text: str) -> list[Box]:
        return [box for box, _ in model.read(text, 1000, 500)]

    boxed = "</s><s>every pepper<loc_100><loc_200><loc_300><loc_400><loc_0><loc_0><loc_999><loc_999></s>"
    assert read(boxed) == [(100.0, 100.0, 300.0, 200.0), (0.0, 0.0, 999.0, 499.0)]
    outline = "<loc_100><loc_200><loc_300><loc_220><loc_200><loc_400>"
    assert read(f"every pepper<poly>{outline}</poly>") == [(100.0, 100.0, 300.0, 200.0)]
    for nothing in ("", "</s><s></s>", "no pepper", "pepper<loc_1><loc_2>", "<poly></poly>", "pepper<poly></poly>"):
        assert read(nothing) == []


# What is no set of weights ----------------------------------------------------------------------------------------


def damaged(source: Path, folder: Path, damage: Callable[[Path], object]) -> str:
    shutil.copytree(source, folder)
    damage(folder)
    return f"owlv2:{folder}"


def without_one(folder: Path) -> None:
    from safetensors.torch import load_file, save_file

    tensors = load_file(folder / "model.safetensors")
    tensors.pop("box_head.dense0.bias")
    save_file(tensors, folder / "model.safetensors", metadata={"format": "pt"})


@pytest.mark.parametrize(
    ("damage", "complaint"),
    [
        (lambda folder: (folder / "model.safetensors").write_bytes(bytes(100)), "can't be loaded"),
        (lambda folder: (folder / "model.safetensors").unlink(), "can't be loaded"),
        (lambda folder: (folder / "config.json").write_text("{"), "can't be loaded"),
        (without_one, "not complete: 1 are missing, 'box_head.dense0.bias'"),
    ],
    ids=["garbage", "no tensors", "no config", "one missing"],
)
def test_damaged_weights_are_refused_by_name(damage, complaint, weights, tmp_path):
    name = damaged(weights["owlv2"], tmp_path / "w", damage)
    with pytest.raises(SetupError, match=complaint) as refusal:
        make_detector(name)
    assert str(tmp_path / "w") in str(refusal.value)


def test_the_weights_of_another_architecture_are_refused(weights):
    with pytest.raises(SetupError, match="those of a 'owlv2'; 'florence2' is wanted"):
        make_detector(f"florence2:{weights['owlv2']}")


@pytest.mark.parametrize("where", ["/no/such/folder", "a b:c", "."])
def test_what_is_no_place_for_weights_is_refused(where, weights):
    with pytest.raises(SetupError, match="can't be loaded"):
        make_detector(f"florence2:{where}")


def test_without_the_extra_its_name_is_told(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(SetupError, match=r"pip install 'maniagent\[detectors\]'"):
        make_detector("florence2")


# What needs no weights --------------------------------------------------------------------------------------------


class DrawnBoxes:
    """A `BoxModel` that draws what it is told to, and remembers what it was asked."""

    def __init__(self, **boxes: list[tuple[Box, float]]) -> None:
        self.drawn = boxes
        self.asked: list[str] = []

    def boxes(self, phrase, rgb):
        self.asked.append(phrase)
        return self.drawn.get(phrase.split()[-1], [])


def test_each_query_is_asked_for_on_its_own_and_keeps_its_boxes(seen):
    tower, dish = (seen.segment_of(name) for name in ("tower", "dish"))
    model = DrawnBoxes(block=[(box_of(tower.masks["main"]), 0.9)], dish=[(box_of(dish.masks["main"]), 0.8)])
    found = BoxDetector("drawn", model).detect(("the dish", "unicorn", "A blue block"), seen.view, seen.observation)
    assert model.asked == ["every dish", "every unicorn", "every blue block"]
    assert [[match.segment for match in matches] for matches in found] == [[dish], [], [tower]]
    assert found[2][0].detection.query == "A blue block"


def test_a_query_without_words_is_a_failed_detection(seen):
    with pytest.raises(DetectionFailure, match="holds no words"):
        BoxDetector("drawn", DrawnBoxes()).detect(("<>...",), seen.view, seen.observation)
