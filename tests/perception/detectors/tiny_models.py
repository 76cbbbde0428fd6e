"""Detectors of a few thousand random weights, saved as the real ones are: what runs on them is the real code.

Their tokenizers know a handful of words; their boxes mean nothing.
"""

from __future__ import annotations

from pathlib import Path

import torch
import transformers as hf

WORDS = ["every", "red", "green", "pepper", "plate", "block", "thing", ".", "locate", "in", "the", "image"]


def save_florence2(folder: Path) -> Path:
    """A Florence-2 on 64 x 64 pixels whose answers are at most as long as the real one's."""
    specials = ["<s>", "<pad>", "</s>", "<unk>", "<mask>"]
    letters = [chr(c) for c in range(33, 127)] + ["\u0120"]
    vocab = {token: i for i, token in enumerate([*specials, *letters])}
    tokenizer = hf.RobertaTokenizer(vocab=vocab, merges=[], extra_special_tokens={"image_token": "<image>"})
    places = [f"<loc_{i}>" for i in range(1000)]
    tokenizer.add_special_tokens({"additional_special_tokens": ["<poly>", "</poly>", "<sep>", *places]})
    images = hf.CLIPImageProcessor(size={"height": 64, "width": 64}, do_center_crop=False)
    images.image_seq_length = 5
    parsing = {"description_with_bboxes_or_polygons": {"PATTERN": None}, "phrase_grounding": {}}
    processor = hf.Florence2Processor(images, tokenizer, post_processor_config=parsing)
    config = hf.Florence2Config(
        vision_config={
            "depths": (1, 1, 1, 1),
            "embed_dim": (8, 8, 16, 16),
            "num_heads": (1, 1, 2, 2),
            "num_groups": (1, 1, 2, 2),
            "window_size": 4,
            "projection_dim": 16,
        },
        text_config={
            "model_type": "bart",
            "vocab_size": len(tokenizer),
            "d_model": 16,
            "encoder_layers": 1,
            "decoder_layers": 1,
            "encoder_attention_heads": 2,
            "decoder_attention_heads": 2,
            "encoder_ffn_dim": 16,
            "decoder_ffn_dim": 16,
            "max_position_embeddings": 600,
            "bos_token_id": 0,
            "pad_token_id": 1,
            "eos_token_id": 2,
            "decoder_start_token_id": 2,
            "forced_eos_token_id": 2,
        },
        image_token_id=tokenizer.image_token_id,
    )
    torch.manual_seed(0)
    return _save(folder, processor, hf.Florence2ForConditionalGeneration(config))


def save_grounding_dino(folder: Path) -> Path:
    """A Grounding DINO with one layer of each kind."""
    vocab = {word: i for i, word in enumerate(["[PAD]", "[UNK]", "[CLS]", "[SEP]", "[MASK]", "?", *WORDS])}
    processor = hf.GroundingDinoProcessor(
        hf.GroundingDinoImageProcessor(size={"shortest_edge": 64, "longest_edge": 96}), hf.BertTokenizer(vocab=vocab)
    )
    config = hf.GroundingDinoConfig(
        backbone_config=hf.SwinConfig(
            image_size=64, embed_dim=8, depths=[1, 1, 1, 1], num_heads=[1, 1, 2, 2], window_size=4,
            out_features=["stage2", "stage3", "stage4"],
        ),
        text_config=hf.BertConfig(
            vocab_size=len(vocab), hidden_size=16, num_hidden_layers=1, num_attention_heads=2, intermediate_size=16
        ),
        d_model=32, encoder_layers=1, decoder_layers=2, encoder_attention_heads=2, decoder_attention_heads=2,
        encoder_ffn_dim=16, decoder_ffn_dim=16, num_queries=12, num_feature_levels=4,
    )  # fmt: skip
    torch.manual_seed(0)
    return _save(folder, processor, hf.GroundingDinoForObjectDetection(config))


def save_owlv2(folder: Path) -> Path:
    """An OWLv2 on 64 x 64 pixels."""
    tokens = ["<|startoftext|>", "<|endoftext|>", "!", *(chr(c) for c in range(97, 123))]
    vocab = {token: i for i, token in enumerate([*tokens, *(f"{token}</w>" for token in tokens[2:])])}
    tokenizer = hf.CLIPTokenizer(vocab=vocab, merges=[], pad_token="!", model_max_length=16)  # noqa: S106  # no password
    processor = hf.Owlv2Processor(hf.Owlv2ImageProcessor(size={"height": 64, "width": 64}), tokenizer)
    layers = {"hidden_size": 16, "intermediate_size": 16, "num_hidden_layers": 1, "num_attention_heads": 2}
    config = hf.Owlv2Config(
        text_config=layers
        | {"vocab_size": len(vocab), "max_position_embeddings": 16}
        | {"bos_token_id": 0, "eos_token_id": 1, "pad_token_id": 2},
        vision_config=layers | {"image_size": 64, "patch_size": 16},
        projection_dim=16,
    )  # fmt: skip
    torch.manual_seed(0)
    return _save(folder, processor, hf.Owlv2ForObjectDetection(config))


def _save(folder: Path, processor: hf.ProcessorMixin, model: hf.PreTrainedModel) -> Path:
    processor.save_pretrained(folder)
    model.save_pretrained(folder)
    return folder
