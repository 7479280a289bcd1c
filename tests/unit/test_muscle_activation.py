"""Activation over space and time: formulas, tables, pictures, and strips of which a part is stimulated."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from fem_biobot.config import digest, load_design, to_toml
from fem_biobot.design import Design
from fem_biobot.errors import DesignError, FileError, ModelError
from fem_biobot.material import ActiveStress, NeoHooke
from fem_biobot.material.muscle_tension import MuscleTension, activation_at
from fem_biobot.muscle.activation import Formula, PointTable, Spot, activation_of, read_grey, read_point_table
from fem_biobot.rod.reduce import reduce
from fem_biobot.solid.from_design import tension_of, tension_step, tension_unit
from fem_biobot.solid.model import SolidModel, solve
from fem_biobot.solid.records import Fix, Step, Symmetry
from fem_biobot.solid.stress import cauchy_stress, probe
from tests.helpers import TIGHT, box_mesh, generator

SIZE = (1.3, 0.9, 2.0)
MESH = box_mesh(2, SIZE, shift=0.0)  # its middle planes are faces of elements
E, T = 12.0, 4.2
X_AXIS, Z_AXIS = np.eye(3)[0], np.eye(3)[2]
POINTS = generator(91).uniform(-2.0, 3.0, (3, 40))


def _model(activation: object, a0: np.ndarray, *more: object, standing: float = 0.0, **extra: object) -> SolidModel:
    muscle = ActiveStress(T, a0, standing=standing, activation=activation, **extra)  # type: ignore[arg-type]
    supports = [Symmetry("x0"), Symmetry("y0"), Symmetry("z0"), *more]
    return SolidModel(MESH, {"muscle": NeoHooke(E, 0.0)}, {"muscle": muscle}, supports)  # type: ignore[arg-type]


def _stretch(tension: float) -> float:
    """Of a free strip of nu = 0 under nominal tension: E/2 (s - 1/s) + T = 0."""
    return brentq(lambda s: 0.5 * E * (s - 1.0 / s) + tension, 0.2, 1.2, xtol=1e-14)


@pytest.mark.parametrize("given", ["function", "formula", "table", "picture"])
def test_a_strip_of_which_half_is_stimulated_shortens_by_that_half(given: str) -> None:
    """Series: the inactive half keeps its length, the active one has the stretch of the whole tension.

    The edge between them is a face of the mesh. Catches: the mean over the muscle, positions of nodes or of the
    deformed body, a picture upside down, the two halves swapped.
    """
    edge = 0.5 * SIZE[1]
    active = {
        "function": lambda X, t: np.where(X[1] > edge, 1.0, 0.0),
        "formula": Formula(f"where(y > {edge}, 1, 0)"),
        "table": PointTable("y", np.array([[0.0, edge - 1e-9, edge + 1e-9, 2.0]]), np.array([0.0, 0.0, 1.0, 1.0])),
        "picture": _half_white(edge),
    }[given]
    state = solve(_model(active, np.eye(3)[1]), [Step(1.0, 0.8)], settings=TIGHT).last
    s = _stretch(0.8 * T)
    np.testing.assert_allclose(state.at((0.3, edge, 1.1))[1], 0.0, atol=1e-10)
    assert state.at((0.3, SIZE[1], 1.1))[1] == pytest.approx((s - 1.0) * edge, rel=1e-9)


def _half_white(edge: float) -> Spot:
    """400 rows, white above the edge: the grey seam of one row lies where no quadrature point is."""
    grey = np.zeros((400, 1))
    grey[:200] = 1.0
    return Spot(grey, -1.0, 3.0, edge - 1.0, edge + 1.0)


def test_a_strip_stimulated_over_half_its_width_pulls_with_half_its_area() -> None:
    """Parallel, held: the force is the tension times the stimulated part of the section, and it follows the time.

    Catches: the instant of the step before, activation at the instant 0 whatever the step, the tension's factor lost.
    """
    edge = 0.5 * SIZE[2]
    wave = Formula(f"where(z < {edge}, sin(pi * t / 2) ** 2, 0.25)")
    model = _model(wave, X_AXIS, Fix("x1", "x"))
    steps = [Step(1.0, 0.7, time=t) for t in (0.4, 1.0, 1.7)]
    area = SIZE[1] * SIZE[2] / 2.0
    for state in solve(model, steps, settings=TIGHT).states:
        share = np.sin(np.pi * state.step.time / 2.0) ** 2 + 0.25
        assert state.reaction("x1")[0] == pytest.approx(0.7 * T * area * share, rel=1e-10)


def test_time_alone_moves_a_muscle_along_its_path() -> None:
    """Under one factor the stretch at each instant is that of the tension then, also over a long rise in one step.

    Catches: a path whose parameter leaves the time out, a long rise in time that is not divided.
    """
    model = _model(Formula("0.2 + 0.8 * t"), Z_AXIS)
    found = solve(model, [Step(time=0.0), Step(time=0.05), Step(time=1.0)], settings=TIGHT)
    for state in found.states:
        s = _stretch(T * (0.2 + 0.8 * state.step.time))
        assert state.at((0.2, 0.3, 2.0))[2] == pytest.approx(2.0 * (s - 1.0), rel=1e-9)


def test_activation_leaves_the_standing_tension_alone() -> None:
    """With a standing part the force of the dark half is that part; below it the factor raises it alone.

    Catches: activation of the whole tension, the standing part raised last, counted twice.
    """
    model = _model(Formula(f"where(z < {0.5 * SIZE[2]}, 1, 0)"), X_AXIS, Fix("x1", "x"), standing=0.6 * T)
    area = SIZE[1] * SIZE[2]
    for state in solve(model, [Step(1.0, 0.5), Step(1.0, 0.9)], settings=TIGHT).states:
        factor = state.step.tension
        expected = min(factor, 0.6) * T * area + max(factor - 0.6, 0.0) * T * area / 2.0
        assert state.reaction("x1")[0] == pytest.approx(expected, rel=1e-10)


def test_stress_between_the_quadrature_points_has_the_activation_there() -> None:
    """Probed anywhere in a blocked strip the stress is that point's own tension.

    Catches: the mean of the element, the value of its first point.
    """
    model = _model(Formula("0.3 + 0.1 * x + 0.2 * z"), X_AXIS, Fix("x1", "x"), Fix("y1", "y"), Fix("z1", "z"))
    state = solve(model, [Step(1.0, 0.9)], settings=TIGHT).last
    assert np.abs(state.u).max() > 1e-4  # the tension varies along the fibre
    X = np.array([[0.2, 0.61, 1.1], [0.3, 0.4, 0.7], [0.5, 1.2, 1.9]])
    at = probe(model.system, X)
    F = at.deformation_gradient(state)
    law = NeoHooke(E, 0.0)
    P = law.stress(F)
    P[:, 0] += 0.9 * T * (0.3 + 0.1 * X[0] + 0.2 * X[2]) * F[:, 0] / np.linalg.norm(F[:, 0], axis=0)
    J = np.linalg.det(np.moveaxis(F, -1, 0))
    np.testing.assert_allclose(at.cauchy_stress(state), np.einsum("ikn,jkn->ijn", P, F) / J, rtol=0.0, atol=1e-10)
    assert cauchy_stress(state.points).shape[:2] == (3, 3)


def test_the_tangent_has_the_activation() -> None:
    """Newton squares its residual with a field of activation and a curve on the stimulated part.

    Catches: activation in the stress alone.
    """
    seen: list[float] = []
    model = _model(Formula("0.2 + 0.3 * x + 0.1 * y * z"), Z_AXIS, standing=1.5, force_length="blemker_2005")
    found = solve(
        model,
        [0.2, 1.0],
        settings=TIGHT,
        observe=lambda kind, v: seen.append(v["residual"]) if kind == "iteration" else None,
    )
    assert found.halvings == 0
    assert seen[-2] < 1e-3
    assert seen[-1] < max(20.0 * seen[-2] ** 2, 1e-12)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x * y - z / 2 + t", lambda x, y, z, t: x * y - z / 2 + t),
        (
            "where(x > 0, 1, 0.25) * exp(-(y / 0.5) ** 2)",
            lambda x, y, z, t: np.where(x > 0, 1, 0.25) * np.exp(-(4 * y**2)),
        ),
        ("0 < x <= 1 and not z > 1 or y < -1", lambda x, y, z, t: ((x > 0) & (x <= 1) & ~(z > 1)) | (y < -1)),
        ("1 if t > 0.5 and x > 0 else abs(y)", lambda x, y, z, t: np.where((t > 0.5) & (x > 0), 1.0, np.abs(y))),
        ("min(max(x, 0), hypot(y, z))", lambda x, y, z, t: np.minimum(np.maximum(x, 0), np.hypot(y, z))),
        ("sqrt(abs(sin(pi * t))) + floor(t) % 2", lambda x, y, z, t: 0 * x + np.sqrt(abs(np.sin(np.pi * t)))),
        ("-x ** 2 + +3", lambda x, y, z, t: 3.0 - x**2),
        ("0.75", lambda x, y, z, t: 0.75 + 0 * x),
    ],
)
def test_formulas_mean_what_they_say(text: str, expected: object) -> None:
    """Arithmetic, comparisons in chains, logic and functions, element by element.

    Catches: precedence lost, a comparison of the first and last term only, a branch chosen for all points at once.
    """
    found = Formula(text)(POINTS, 0.7)
    np.testing.assert_allclose(found, np.asarray(expected(*POINTS, 0.7), dtype=float), rtol=1e-14)  # type: ignore[operator]


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "x.__class__",
        "(lambda: 1)()",
        "[1 for x in y]",
        "open('f')",
        "x if x else eval('1')",
        "'a' * 3",
        "w + 1",
        "sin(x, y)",
        "where(x > 0, 1)",
        "sin(x=1)",
        "x = 1",
        "x == 1",
        "True",
        "1e999",
        "x << 2",
        "(y := 3)",
        "",
        "x" + "+x" * 400,
        "(" * 45 + "x" + ")" * 45 + "+" + "-" * 45 + "x",
        "1 +",
    ],
)
def test_what_is_no_formula_is_refused(text: str) -> None:
    """Whatever could do more than arithmetic, and unknown names and arguments, are refused when read.

    Catches: eval; an attribute or a call let through in a branch; names known to Python.
    """
    with pytest.raises(DesignError, match="activation formula: found"):
        Formula(text)


def test_a_formula_cannot_take_for_ever() -> None:
    """Powers of powers are floats: they overflow at once, and what is no number is refused where it is used.

    Catches: long integers, which never end.
    """
    found = Formula("9 ** 9 ** 9 ** 9")(POINTS, 0.0)
    assert np.all(np.isinf(found))
    with pytest.raises(ModelError, match="expected finite and at least 0"):
        solve(_model(Formula("9 ** 9 ** 9 ** 9"), X_AXIS), [1.0])


@pytest.mark.parametrize(
    ("activation", "word"),
    [
        (lambda X, t: -0.1 + 0.0 * X[0], r"found -0.1 at \("),
        (lambda X, t: X[0] * np.nan, "found nan at"),
        (lambda X, t: X, "found shape"),
        (lambda X, t: np.array(["1"] * X.shape[1]), "found shape"),
    ],
)
def test_activations_that_are_no_shares_are_refused(activation: object, word: str) -> None:
    """Negative values, values that are no numbers, and other shapes are refused with the place.

    Catches: muscle that pushes.
    """
    with pytest.raises(ModelError, match=f"activation: {word}"):
        activation_at(activation, POINTS, 0.3)  # type: ignore[arg-type]


def test_tables_are_linear_between_their_points_and_constant_beyond() -> None:
    """In one, two and three coordinates; order of the columns and of the rows does not matter.

    Catches: the nearest point inside, zero or extrapolation outside, coordinates by place instead of by name.
    """
    corners = np.array([[0.0, 2.0, 0.0, 2.0, 0.0, 2.0, 0.0, 2.0], [0.0, 0.0, 1.0, 1.0] * 2, [0.0] * 4 + [3.0] * 4])
    values = 1.0 + 0.5 * corners[0] + 0.3 * corners[1] + 0.1 * corners[2]
    inside = generator(5).uniform(0.05, 0.95, (3, 30)) * np.array([[2.0], [1.0], [3.0]])
    solid = PointTable("xyz", corners, values)
    np.testing.assert_allclose(solid(inside, 9.0), 1.0 + np.array([0.5, 0.3, 0.1]) @ inside, rtol=1e-12)
    plane = PointTable("zx", np.array([[3.0, 0.0, 0.0], [0.0, 0.0, 2.0]]), np.array([1.3, 1.0, 2.0]))
    at = np.array([[0.4], [77.0], [0.6]])
    np.testing.assert_allclose(plane(at, 0.0), 1.0 + 0.5 * 0.4 + 0.1 * 0.6, rtol=1e-12)
    np.testing.assert_allclose(plane(np.array([[9.0], [0.0], [-9.0]]), 0.0), 2.0)
    line = PointTable("y", np.array([[1.0, 0.0]]), np.array([0.2, 0.6]))
    np.testing.assert_allclose(line(np.array([[0.0] * 3, [-5.0, 0.25, 5.0], [0.0] * 3]), 0.0), [0.6, 0.5, 0.2])


def test_pictures_lie_the_right_way_up() -> None:
    """Pixel middles have their brightness, rows count from the top, columns from the left, nothing lies outside.

    Catches: rows and columns swapped, y downwards, pixels at their corners.
    """
    grey = generator(12).uniform(0.0, 1.0, (3, 4))
    spot = Spot(grey, -1.0, 1.0, 2.0, 3.5)
    x, y = -1.0 + (np.arange(4) + 0.5) / 2.0, 3.5 - (np.arange(3) + 0.5) / 2.0
    xx, yy = np.meshgrid(x, y)
    at = np.stack([xx.ravel(), yy.ravel(), 0.0 * xx.ravel() + 7.0])
    np.testing.assert_allclose(spot(at, 0.0).reshape(3, 4), grey, atol=1e-14)
    middle = spot(np.array([[0.5 * (x[1] + x[2])], [0.5 * (y[0] + y[1])], [0.0]]), 0.0)
    np.testing.assert_allclose(middle, grey[:2, 1:3].mean(), rtol=1e-13)
    corner = np.array([[-0.99, 1.01, 0.0, 0.0], [2.01, 2.5, 1.99, 3.51], [0.0] * 4])
    np.testing.assert_allclose(spot(corner, 0.0), [grey[2, 0], 0.0, 0.0, 0.0], atol=1e-14)
    mirrored = Spot(grey, 1.0, -1.0, 2.0, 3.5)
    np.testing.assert_allclose(mirrored(at * np.array([[-1.0], [1.0], [1.0]]), 0.0).reshape(3, 4), grey, atol=1e-14)


@pytest.mark.parametrize("kind", ["png8", "png16", "tiff", "colour"])
def test_pictures_are_read_from_their_files(kind: str, tmp_path: Path) -> None:
    """8 and 16 bits and TIFF give brightness from 0 to 1.

    Catches: 16 bits over 255, colours as three pictures.
    """
    from PIL import Image

    exact = np.array([[0, 51, 255], [102, 204, 153]], dtype=np.uint8)
    path = tmp_path / ("p.tif" if kind == "tiff" else "p.png")
    if kind == "png16":
        Image.fromarray(exact.astype(np.uint16) * 257).save(path)
    elif kind == "colour":
        Image.fromarray(np.repeat(exact[:, :, None], 3, axis=2)).save(path)
    else:
        Image.fromarray(exact).save(path)
    np.testing.assert_allclose(read_grey(path), exact / 255.0, atol=1e-6)


def _written(path: Path, text: str) -> Path:
    path.write_text(text, encoding="utf-8")
    return path


def test_a_design_names_its_activation_and_its_files(tmp_path: Path) -> None:
    """Formula, table and picture from a design file: found beside it, written and read back as the same design.

    Catches: paths taken from the working folder, a digest blind to what the file holds.
    """
    from PIL import Image

    _written(tmp_path / "spot.csv", "# light\nx_mm, activation\n-1, 0.2\n3, 1\n")
    Image.fromarray(np.array([[255, 0]], dtype=np.uint8)).save(tmp_path / "spot.png")
    head = 'base = "strip"\n[muscle.activation]\n'
    table = load_design(_written(tmp_path / "a.toml", head + 'table = "spot.csv"\n'))
    found = activation_of(table)
    assert isinstance(found, PointTable)
    np.testing.assert_allclose(found(np.array([[1.0], [0.0], [0.0]]), 0.0), 0.6)
    again = load_design(_written(tmp_path / "b.toml", to_toml(table)))
    assert again.value("muscle.activation") == table.value("muscle.activation")
    edges = (
        'image = "spot.png"\nimage_left = "0 mm"\nimage_right = "2 mm"\nimage_bottom = "-1 mm"\nimage_top = "1 mm"\n'
    )
    picture = activation_of(load_design(_written(tmp_path / "c.toml", head + edges)))
    assert isinstance(picture, Spot)
    np.testing.assert_allclose(picture(np.array([[0.4, 1.6], [0.0, 0.0], [0.0, 0.0]]), 0.0), [1.0, 0.0])
    formula = activation_of(load_design("strip", ["muscle.activation.formula=abs(sin(pi * t))"]))
    assert formula == Formula("abs(sin(pi * t))")
    before = digest(table)
    _written(tmp_path / "spot.csv", "x, activation\n-1, 0.3\n3, 1\n")
    assert digest(load_design(tmp_path / "a.toml")) != before


def test_a_design_stimulates_where_it_says() -> None:
    """Of a design's model the standing tension acts everywhere, the stimulated one where and when the formula says.

    Catches: activation of the whole tension, the instant lost on the way.
    """
    keys = ["muscle.activation.formula=where(x > 0, t, 0)", "muscle.activation.instant=0.5 s"]
    design = load_design("strip", keys)
    step = tension_step(design, tension_unit(design))
    assert step.time == 0.5
    muscle = tension_of(design, X_AXIS)
    assert muscle.standing == pytest.approx(9.09)
    X = np.array([[-1.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    model = SolidModel(
        MESH, {"muscle": NeoHooke(E, 0.0)}, {"muscle": muscle}, [Symmetry(face) for face in ("x0", "y0", "z0")]
    )
    law = model.system.contractions[0].law_at(step)
    assert isinstance(law, MuscleTension)
    kept, added = law.at_positions(np.array([0, 0]), X).tensions()
    np.testing.assert_allclose(kept, 9.09, rtol=1e-12)
    np.testing.assert_allclose(added, [0.0, 0.65], rtol=1e-12)


@pytest.mark.parametrize(
    ("keys", "word"),
    [
        (["formula=1", "table=a.csv"], "formula and muscle.activation.table, expected one"),
        (["instant=1 s"], "found nothing, expected one of formula, table and image"),
        (["formula=1", "image_left=1 mm"], "image_left: found without a picture"),
        (["formula=1", "image_top=1 mm"], "image_top: found without a picture"),
    ],
)
def test_designs_whose_activation_does_not_fit_are_refused(keys: list[str], word: str) -> None:
    """Two ways at once, none, and edges without a picture.

    Catches: the first way taken, the other ignored.
    """
    with pytest.raises((DesignError, FileError), match=word):
        load_design("strip", [f"muscle.activation.{key}" for key in keys])


def _with(**values: object) -> Design:
    return load_design("strip").with_values({f"muscle.activation.{name}": value for name, value in values.items()})


def test_activations_that_a_design_cannot_have_are_refused() -> None:
    """Two ways given in Python, a picture without extent, active strain, and rods.

    Catches: checks in the reader alone.
    """
    with pytest.raises(DesignError, match=r"formula and muscle.activation.image, expected one"):
        _with(formula="1", image="a.png", image_left=0.0, image_right=1.0, image_bottom=0.0, image_top=1.0)
    with pytest.raises(DesignError, match="image_bottom: missing"):
        _with(image="a.png", image_left=0.0, image_right=1.0)
    with pytest.raises(DesignError, match="image_right: found a picture of no extent"):
        _with(image="a.png", image_left=1.0, image_right=1.0, image_bottom=0.0, image_top=1.0)
    with pytest.raises(DesignError, match=r"activation: found with muscle.convention active_strain"):
        load_design("strip", ["muscle.activation.formula=1", "muscle.convention=active_strain"])
    with pytest.raises(ModelError, match=r"muscle.activation: found one, expected none for a rod model"):
        reduce(load_design("junction_bot", ["muscle.activation.formula=1"]))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "found the columns none"),
        ("x,y\n1,2\n", "found the columns x, y"),
        ("x,depth,activation\n1,2,3\n", "found the columns x, depth, activation"),
        ("x,activation\n1,2\n3\n", "no number or a row of another length"),
        ("x,activation\n1,a\n2,1\n", "no number"),
        ("x,activation\n1,0.2,3\n2,1,3\n", "rows of another length"),
        ("x,activation\n", "rows of another length"),
        ("x,activation\n1,1\n", "k of at least 2"),
        ("x,activation\n1,1\n1,0.5\n", "a point twice"),
        ("x,activation\n1,1\n2,-1\n", "below 0"),
        ("x,y,activation\n1,1,1\n2,2,1\n3,3,1\n", "do not span x, y"),
        ("x,x,activation\n1,1,1\n2,2,1\n", "found axes 'xx'"),
    ],
)
def test_tables_that_are_none_are_refused(text: str, word: str, tmp_path: Path) -> None:
    """Each with the file's name and what was found.

    Catches: a short row filled up, points on a line interpolated in a plane.
    """
    with pytest.raises(FileError, match=word):
        read_point_table(_written(tmp_path / "t.csv", text))


def test_files_that_cannot_be_read_are_refused(tmp_path: Path) -> None:
    """A folder, a text as a picture, floating-point pixels; shapes that are no picture.

    Catches: a traceback of the library that reads pictures.
    """
    from PIL import Image

    with pytest.raises(FileError, match="found no readable text"):
        read_point_table(tmp_path)
    with pytest.raises(FileError, match="found no picture"):
        read_grey(_written(tmp_path / "p.png", "x,activation"))
    Image.fromarray(np.zeros((2, 2), dtype=np.float32)).save(tmp_path / "f.tif")
    with pytest.raises(FileError, match="floating-point"):
        read_grey(tmp_path / "f.tif")
    with pytest.raises(DesignError, match="found shape"):
        Spot(np.array([2.0]), 0.0, 1.0, 0.0, 1.0)
    with pytest.raises(DesignError, match="enclose nothing"):
        Spot(np.ones((2, 2)), 0.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("given", "word"),
    [
        ({"standing": 5.0}, "standing: found 5 kPa, expected at most the tension"),
        ({"standing": -1.0}, "tension: found -1"),
        ({"activation": 0.5}, "activation: found 0.5, expected a function"),
        ({"activation": abs, "convention": "active_strain"}, "activation: found with convention active_strain"),
    ],
)
def test_parts_of_a_tension_that_do_not_fit_are_refused(given: dict[str, object], word: str) -> None:
    """Catches: a standing tension above the whole; a number for a function."""
    with pytest.raises(ModelError, match=word):
        ActiveStress(4.0, X_AXIS, **given)  # type: ignore[arg-type]


def test_an_activation_without_positions_is_refused() -> None:
    """Catches: activation 1 where nothing is known."""
    from fem_biobot.material.active import active_law
    from fem_biobot.material.dispersion import Dispersion

    muscle = ActiveStress(4.0, X_AXIS, activation=lambda X, t: 0.0 * X[0])
    law = active_law(muscle, 3, np.arange(3), NeoHooke(E, 0.0))
    with pytest.raises(ModelError, match="activation: found no positions"):
        law.stress(np.eye(3)[:, :, None, None] * np.ones((3, 4)))
    with pytest.raises(ModelError, match="integrate: found with a standing tension, an activation or"):
        ActiveStress(4.0, X_AXIS, dispersion=Dispersion(0.2), integrate=True, standing=1.0)


def test_standing_tensions_over_elements_must_be_as_many() -> None:
    """Catches: a field of another region broadcast."""
    muscle = ActiveStress(4.0, X_AXIS, standing=np.array([1.0, 2.0]))
    with pytest.raises(ModelError, match=r"standing: found 2 values"):
        SolidModel(MESH, {"muscle": NeoHooke(E, 0.0)}, {"muscle": muscle}, [Fix("z0")])
