"""README's pictures come from one command, which makes all of them and no others."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from tests.studies.loading import load_study


def test_one_command_renews_every_picture_of_the_readme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a coarse mesh, and the walk for a stroke: both are drawn and in colour.

    Catches: a picture in README that nothing makes, one that is empty or stands still.
    """
    pictures = load_study("make_pictures")
    monkeypatch.setenv("FEM_BIOBOT_RENDERER", "matplotlib")
    monkeypatch.setattr(pictures, "DURATION", 1.0)
    monkeypatch.setattr(pictures, "SHOWN", 0.5)
    assert pictures.shown_by() == {pictures.STRESS, pictures.WALK}
    pictures.stress(tmp_path / pictures.STRESS, 4.0)
    pictures.gait(tmp_path / pictures.WALK)
    still, moving = Image.open(tmp_path / pictures.STRESS), Image.open(tmp_path / pictures.WALK)
    assert len(still.convert("RGB").getcolors(1 << 22) or []) > 500
    assert getattr(moving, "n_frames", 1) > 5
