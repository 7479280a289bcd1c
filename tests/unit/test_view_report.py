"""The report is one page that holds everything, shows numbers as numbers and text as text."""

from __future__ import annotations

import base64
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fem_biobot.errors import FileError
from fem_biobot.view.report import heading, write_report

PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
VOID = {"meta", "img"}


class Page(HTMLParser):
    """Checks that tags are closed in order and keeps what stands where."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.cells: list[tuple[str, str]] = []
        self.images: list[str] = []
        self.tags: list[str] = []
        self.words = ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        values = dict(attrs)
        if tag not in VOID:
            self.open.append(tag)
        if tag in ("td", "th"):
            self.cells.append((values.get("class") or "", ""))
        if tag == "img":
            self.images.append(values["src"] or "")

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words += data
        if self.open and self.open[-1] in ("td", "th"):
            self.cells[-1] = (self.cells[-1][0], self.cells[-1][1] + data)


def page(folder: Path, summary: dict[str, Any] | None = None, **parts: Any) -> Page:
    given = {"figures": [], "tables": [], "notes": [], **parts}
    write_report(folder / "report.html", summary or {}, **given)
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def test_the_page_holds_its_images_and_asks_for_nothing_else(tmp_path: Path) -> None:
    """Catches: links to files that do not travel with the page, scripts."""
    (tmp_path / "a.png").write_bytes(PIXEL)
    found = page(tmp_path, figures=[(tmp_path / "a.png", "the machine")])
    head, _, data = found.images[0].partition(",")
    assert head == "data:image/png;base64"
    assert base64.b64decode(data) == PIXEL
    assert "the machine" in found.words
    assert not {"script", "link", "iframe"} & set(found.tags)


def test_text_is_never_taken_for_markup(tmp_path: Path) -> None:
    """Catches: one of the places where text enters the page without being escaped."""
    (tmp_path / "a.png").write_bytes(PIXEL)
    evil = "<script>\"&'</script>"
    found = page(
        tmp_path,
        {"design_digest": evil, "versions": {evil: evil}, "mesh": {evil: evil}, "timings_s": {evil: evil}},
        figures=[(tmp_path / "a.png", evil)],
        tables=[(evil, [evil], [[evil]])],
        notes=[evil],
        title=evil,
    )
    assert "script" not in found.tags
    # title twice, digest twice, note, table title, header, cell, caption, versions twice, mesh twice, timings twice
    assert found.words.count(evil) == 15


def test_numbers_stand_right_with_four_digits_and_text_left(tmp_path: Path) -> None:
    """Catches: numpy numbers taken for text, None printed, sixteen digits, numeric headers left-aligned."""
    rows = [["passive", 0.123456, np.float64(-1234.56), 3, True], ["peak", None, np.float32(2.0), np.int64(41), False]]
    found = page(tmp_path, tables=[("t", ["state", "tip_closing_mm", "force_mN", "count_1", "ok"], rows)])
    assert found.cells[:5] == [
        ("", "state"), ("number", "tip closing [mm]"), ("number", "force [mN]"), ("number", "count"), ("", "ok"),
    ]  # fmt: skip
    assert found.cells[5:10] == [
        ("", "passive"),
        ("number", "0.1235"),
        ("number", "−1235"),
        ("number", "3"),
        ("", "yes"),
    ]
    assert found.cells[10:] == [("", "peak"), ("number", "–"), ("number", "2"), ("number", "41"), ("", "no")]


def test_notes_come_first_and_the_provenance_last(tmp_path: Path) -> None:
    """Catches: a replacement mentioned at the end, a report that does not say what made it."""
    summary = {
        "design_digest": "d1ge57", "versions": {"numpy": "2.4"}, "mesh": {"volume_mm3": {"muscle": 3.25}},
        "timings_s": {"solve": 12.5},
    }  # fmt: skip
    words = page(tmp_path, summary, notes=["pictures drawn by matplotlib"], tables=[("States", ["a"], [[1]])]).words
    places = [words.index(w) for w in ("drawn by matplotlib", "States", "volume [mm³], muscle", "12.5", "numpy 2.4")]
    assert places == sorted(places)
    assert "Design digest: d1ge57" in words


def test_keys_become_words_with_units() -> None:
    """Catches: a unit cut off, a plain word taken for a key, a unit invented."""
    cases = {
        "ball_von_mises_kPa": "ball von mises [kPa]", "fibre_stretch_1": "fibre stretch", "work_uJ": "work [µJ]",
        "tip closing [mm]": "tip closing [mm]", "state": "state", "n_elements": "n elements",
    }  # fmt: skip
    assert {key: heading(key) for key in cases} == cases


def test_what_cannot_be_shown_is_refused_by_name(tmp_path: Path) -> None:
    """Catches: a report with a hole, a table with shifted columns, a piece of a report left on the disk."""
    with pytest.raises(FileError, match=r"gone\.png: cannot read"):
        page(tmp_path, figures=[(tmp_path / "gone.png", "x")])
    with pytest.raises(FileError, match=r"data\.csv: not an image"):
        page(tmp_path, figures=[(tmp_path / "data.csv", "x")])
    with pytest.raises(FileError, match="'States': a row has 1 cells, expected 2"):
        page(tmp_path, tables=[("States", ["a", "b"], [[1]])])
    assert list(tmp_path.iterdir()) == []
