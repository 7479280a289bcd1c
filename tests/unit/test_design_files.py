"""Files that a design names: where they are looked for, theta and spread measured in them, digests of their content."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fem_biobot.config import digest, load_design, to_toml
from fem_biobot.design import Design
from fem_biobot.design_files import named_files
from fem_biobot.errors import BiobotError, DesignError, FileError


def histogram(path: Path, mean: float = 80.0, width: float = 15.0) -> Path:
    """A plug-in's table with one image whose fibres lie `mean` degrees counter-clockwise from its right."""
    degrees = -90.0 + 2.0 * np.arange(90)
    away = (degrees - mean + 90.0) % 180.0 - 90.0
    shares = np.exp(-0.5 * (away / width) ** 2)
    shares /= shares.sum()
    rows = [f"{d:.9f},{s:.9f},{s:.9f}" for d, s in zip(degrees, shares, strict=True)]
    path.write_text("\n".join(["Direction (°),a.tif,a.tif-fit", *rows, ""]), encoding="utf-8")
    return path


def design_file(folder: Path, keys: str, base: str = "junction_bot", name: str = "d.toml") -> Path:
    (folder / name).write_text(f'base = "{base}"\n[muscle]\n{keys}\n')
    return folder / name


def test_theta_and_spread_come_from_the_table(tmp_path: Path) -> None:
    """Fibres at 80 degrees in the picture, whose machine points to 70 degrees: theta is 90 - 10 = 80 degrees.

    By hand: 10 degrees counter-clockwise from x is 80 degrees clockwise from y, and theta turns from y to x.

    Catches: theta left at the base's 90 degrees, the axis added, the spread in degrees.
    """
    histogram(tmp_path / "h.csv")
    design = load_design(design_file(tmp_path, 'orientation = "h.csv"\norientation_axis = "70 deg"'))
    assert design.muscle is not None
    assert np.degrees(design.muscle.theta) == pytest.approx(80.0, abs=1e-3)
    assert np.degrees(design.muscle.spread) == pytest.approx(15.0, abs=1e-3)
    assert named_files(design) == {"muscle.orientation": tmp_path / "h.csv"}
    # as a setting, from the current folder or by its whole path
    other = load_design("junction_bot", [f"muscle.orientation={tmp_path / 'h.csv'}", "muscle.orientation_axis=70 deg"])
    assert other.muscle == design.muscle


def test_a_resolved_design_with_files_reads_back_as_itself(tmp_path: Path) -> None:
    """The written design holds the file and what it gave, and is the identical design again, also as a base.

    Catches: theta beside orientation refused in a run's own file, a base's measured angles kept over new ones.
    """
    histogram(tmp_path / "h.csv")
    histogram(tmp_path / "other.csv", mean=60.0, width=20.0)
    design = load_design(design_file(tmp_path, 'orientation = "h.csv"'))
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    (folder / "design.toml").write_text(to_toml(design))
    again = load_design(folder / "design.toml")
    assert again.muscle == design.muscle
    assert digest(again) == digest(design)
    above = load_design(design_file(folder, 'orientation = "../other.csv"', "design.toml", "above.toml"))
    assert np.degrees(above.value("muscle.theta")) == pytest.approx(30.0, abs=1e-3)
    without = load_design(design_file(tmp_path, 'orientation = ""'))
    assert without.value("muscle.orientation") is None
    assert without.value("muscle.theta") == load_design("junction_bot").value("muscle.theta")


def test_digests_see_the_content_of_files_and_not_their_place(tmp_path: Path) -> None:
    """A copy elsewhere is the same design; one digit more in the file is another.

    Catches: the path in the digest, a digest blind to the file.
    """
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        histogram(tmp_path / name / f"{name}.csv")
    one, two = (
        load_design(design_file(tmp_path / name, f'orientation = "{name}.csv"', name="d.toml"))
        for name in ("one", "two")
    )
    assert digest(one) == digest(two)
    before = digest(one)
    text = (tmp_path / "one" / "one.csv").read_text(encoding="utf-8")
    (tmp_path / "one" / "one.csv").write_text(text + "\n", encoding="utf-8")
    assert digest(one) != before
    (tmp_path / "two" / "two.csv").unlink()
    with pytest.raises(FileError, match=r"two.csv: cannot be read \(No such file.*expected a file"):
        digest(two)


@pytest.mark.parametrize(
    ("keys", "sets", "error", "words"),
    [
        ('orientation = "h.csv"\ntheta = "85 deg"', [], DesignError, r"muscle.theta: found 85 deg beside"),
        ('orientation = "h.csv"', ["muscle.spread=3 deg"], DesignError, r"muscle.spread: found 3 deg beside"),
        ('orientation = "none.csv"', [], FileError, r"muscle.orientation: .*none.csv: cannot be read .*a file$"),
        (
            'orientation = "h.csv"\norientation_image = "b.tif"',
            [],
            DesignError,
            "no image b.tif, expected one of: a.tif",
        ),
        ('fibres = "a\\u0000b"', [], DesignError, "muscle.fibres: found"),
        ('orientation = "a\\u0000b"', [], (DesignError, FileError), "muscle.orientation: "),
        (
            'fibres = "smoth"',
            [],
            FileError,
            r"muscle.fibres: .*smoth: cannot be read .*expected a file or one of: smooth, piecewise",
        ),
        ('fibres = ""', [], DesignError, 'muscle.fibres: found "", expected smooth, piecewise or a file'),
        ('orientation_image = "a.tif"', [], DesignError, "muscle.orientation_image: found .a.tif. without"),
        ('orientation_axis = "9 deg"', [], DesignError, "muscle.orientation_axis: found 9 deg without"),
        ("orientation = 3", [], DesignError, "muscle.orientation: found 3, expected a text"),
    ],
)
def test_keys_of_files_that_do_not_fit_are_refused(
    tmp_path: Path, keys: str, sets: list[str], error: type[BiobotError], words: str
) -> None:
    """Two answers for one angle, a missing file, an image that the table has not, keys of an absent file.

    Catches: one of two clashing keys taken in silence.
    """
    histogram(tmp_path / "h.csv")
    with pytest.raises(error, match=words):
        load_design(design_file(tmp_path, keys), sets)


def test_a_design_made_in_python_may_name_a_file(tmp_path: Path) -> None:
    """`with_values` keeps the text; nothing is read until the design is.

    Catches: a description that reads files.
    """
    design = load_design("strip").with_values({"muscle.fibres": str(tmp_path / "none.csv")})
    assert isinstance(design, Design)
    assert named_files(design) == {"muscle.fibres": tmp_path / "none.csv"}
