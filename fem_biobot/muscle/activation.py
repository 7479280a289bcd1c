"""Where and when a muscle is stimulated: the share of its stimulated tension as a formula, a table or a picture.

Each is a function of reference positions (3, k) [mm] and an instant [s] with values (k,), as `ActiveStress.activation`
takes one; a function of one's own does as well.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

from fem_biobot.design import Design
from fem_biobot.errors import DesignError, FileError

Array = NDArray[np.float64]

# what a formula may call, element by element, with how many arguments
_FUNCTIONS: dict[str, tuple[Callable[..., Any], int]] = {
    "sin": (np.sin, 1),
    "cos": (np.cos, 1),
    "tan": (np.tan, 1),
    "exp": (np.exp, 1),
    "log": (np.log, 1),
    "sqrt": (np.sqrt, 1),
    "tanh": (np.tanh, 1),
    "abs": (np.abs, 1),
    "floor": (np.floor, 1),
    "min": (np.minimum, 2),
    "max": (np.maximum, 2),
    "hypot": (np.hypot, 2),
    "where": (np.where, 3),
}
_BINARY: dict[type[ast.operator], Callable[..., Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.Mod: operator.mod,
}
_COMPARED: dict[type[ast.cmpop], Callable[..., Any]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_VARIABLES = ("x", "y", "z", "t")
_LONGEST = 500
_DEEPEST = 40


@dataclass(frozen=True)
class Formula:
    """Activation by a formula such as ``where(x > 0, 1, 0) * exp(-(y / 0.5) ** 2) * abs(sin(pi * t))``.

    Parameters
    ----------
    text
        Arithmetic (``+ - * / ** %``), comparisons, ``and``, ``or``, ``not``, ``a if b else c`` and the functions sin,
        cos, tan, exp, log, sqrt, tanh, abs, floor, min, max, hypot and where, of the reference coordinates x, y, z
        [mm], the time t [s], pi, and numbers. Nothing else is known, so that a formula can do nothing else.

    Raises
    ------
    DesignError
        The text is no formula, or has a name or an operation that is not known.
    """

    text: str

    def __post_init__(self) -> None:
        if not self.text.strip() or len(self.text) > _LONGEST:
            raise DesignError(
                f"activation formula: found {len(self.text)} characters, expected a formula of at most {_LONGEST}"
            )
        try:
            tree = ast.parse(self.text.strip(), mode="eval")
        except (SyntaxError, ValueError, MemoryError, RecursionError):
            raise DesignError(f"activation formula: found {self.text!r}, expected a formula in x, y, z and t") from None
        _check(tree.body, self.text, _DEEPEST)

    @cached_property
    def _tree(self) -> ast.expr:
        return ast.parse(self.text.strip(), mode="eval").body

    def __call__(self, X: Array, time: float) -> Array:
        """Values at positions (3, k) [mm] and an instant [s], (k,) [1]; what has no value there is not a number."""
        values = dict(zip(_VARIABLES, (*X, np.float64(time)), strict=True)) | {"pi": np.float64(np.pi)}
        with np.errstate(all="ignore"):
            found = _value(self._tree, values)
        return np.broadcast_to(np.asarray(found, dtype=float), X.shape[1:]).copy()


def _check(node: ast.AST, text: str, depth: int) -> None:
    """Refuse every part of a formula that is not known."""
    told = ast.get_source_segment(text.strip(), node) or type(node).__name__
    if depth == 0:
        raise DesignError(f"activation formula: found {told!r} in parentheses, expected fewer levels of them")
    known: bool
    inner: list[ast.AST] = []
    match node:
        case ast.Constant(value=value):
            known = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e100
        case ast.Name(id=name):
            known = name in _VARIABLES or name == "pi"
        case ast.BinOp(left=left, op=op, right=right):
            known, inner = type(op) in _BINARY, [left, right]
        case ast.UnaryOp(op=op, operand=operand):
            known, inner = isinstance(op, ast.UAdd | ast.USub | ast.Not), [operand]
        case ast.BoolOp(values=values):
            known, inner = True, list(values)
        case ast.Compare(left=left, ops=ops, comparators=others):
            known, inner = all(type(op) in _COMPARED for op in ops), [left, *others]
        case ast.IfExp(test=test, body=body, orelse=other):
            known, inner = True, [test, body, other]
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in _FUNCTIONS:
            known, inner = len(args) == _FUNCTIONS[name][1], list(args)
        case _:
            known = False
    if not known:
        functions = ", ".join(f"{name} of {n}" for name, (_, n) in _FUNCTIONS.items())
        raise DesignError(
            f"activation formula: found {told!r}, expected numbers, x, y, z, t, pi, arithmetic, comparisons, and the "
            f"functions {functions}"
        )
    for part in inner:
        _check(part, text, depth - 1)


def _value(node: ast.expr, values: dict[str, Any]) -> Any:
    """Value of a checked formula."""

    def of(part: ast.expr) -> Any:
        return _value(part, values)

    match node:
        case ast.Constant(value=value):
            return np.float64(value)  # type: ignore[arg-type]  # floats overflow to infinity, never to long integers
        case ast.Name(id=name):
            return values[name]
        case ast.BinOp(left=left, op=op, right=right):
            return _BINARY[type(op)](np.asarray(of(left), float), np.asarray(of(right), float))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return np.logical_not(of(operand))
        case ast.UnaryOp(op=op, operand=operand):
            return np.asarray(of(operand), float) * (-1.0 if isinstance(op, ast.USub) else 1.0)
        case ast.BoolOp(op=op, values=parts):
            join = np.logical_and if isinstance(op, ast.And) else np.logical_or
            return join.reduce(np.broadcast_arrays(*[of(part) for part in parts]))
        case ast.Compare(left=left, ops=ops, comparators=others):
            terms = [of(part) for part in (left, *others)]
            pairs = [_COMPARED[type(op)](terms[k], terms[k + 1]) for k, op in enumerate(ops)]
            return np.logical_and.reduce(np.broadcast_arrays(*pairs))
        case ast.IfExp(test=test, body=body, orelse=other):
            return np.where(of(test), of(body), of(other))
        case ast.Call(func=ast.Name(id=name), args=args):
            return _FUNCTIONS[name][0](*[of(part) for part in args])
    raise AssertionError(f"{ast.dump(node)} was checked")


@dataclass(frozen=True, eq=False)
class PointTable:
    """Activation given at points: linear between them, that of the nearest point beyond them.

    Parameters
    ----------
    axes
        Which coordinates the points have, out of ``"xyz"``; the activation does not depend on the others.
    points
        Their coordinates, (d, k) [mm].
    values
        Activation there, (k,) [1].
    """

    axes: str
    points: Array
    values: Array

    def __post_init__(self) -> None:
        points, values = np.asarray(self.points, dtype=float), np.asarray(self.values, dtype=float)
        if not self.axes or any(a not in "xyz" for a in self.axes) or len(set(self.axes)) != len(self.axes):
            raise DesignError(f"activation table: found axes {self.axes!r}, expected some of x, y, z, each once")
        if points.shape != (len(self.axes), *values.shape) or values.ndim != 1 or values.size < 2:
            raise DesignError(
                f"activation table: found points of shape {points.shape} with {values.size} values, expected "
                f"({len(self.axes)}, k) with k of at least 2"
            )
        if not (np.all(np.isfinite(points)) and np.all(np.isfinite(values)) and np.all(values >= 0.0)):
            raise DesignError("activation table: found values below 0 or no numbers, expected finite and at least 0")
        if np.unique(points, axis=1).shape[1] < values.size:
            raise DesignError("activation table: found a point twice, expected each once")
        centred = points - points.mean(axis=1, keepdims=True)
        if np.linalg.matrix_rank(centred, tol=1e-9 * np.abs(centred).max()) < len(self.axes):
            raise DesignError(
                f"activation table: found points that do not span {', '.join(self.axes)}, expected fewer columns"
            )

    @cached_property
    def _inside(self) -> Callable[[Array], Array]:
        points = np.asarray(self.points, dtype=float).T
        if len(self.axes) == 1:
            order = np.argsort(points[:, 0])
            return lambda at: np.interp(at[:, 0], points[order, 0], np.asarray(self.values, float)[order])
        return LinearNDInterpolator(points, self.values)

    def __call__(self, X: Array, time: float) -> Array:
        """Values at positions (3, k) [mm], the same at all times, (k,) [1]."""
        at = X[["xyz".index(axis) for axis in self.axes]].T
        found = np.asarray(self._inside(at), dtype=float)
        beyond = np.isnan(found)
        if np.any(beyond):
            found[beyond] = NearestNDInterpolator(np.asarray(self.points, float).T, self.values)(at[beyond])
        return found


def read_point_table(path: Path) -> PointTable:
    """Table of a CSV file with the header ``x,y,z,activation`` (or fewer coordinates); positions in mm."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise FileError(f"{path}: found no readable text ({type(error).__name__}), expected a CSV file") from None
    rows = [[cell.strip() for cell in line.split(",")] for line in lines if line.strip() and line.strip()[0] != "#"]
    header = [cell.lower().removesuffix("_mm").removesuffix("_1") for cell in rows[0]] if rows else []
    if not header or header[-1] != "activation" or any(name not in ("x", "y", "z") for name in header[:-1]):
        raise FileError(
            f"{path}: found the columns {', '.join(header) or 'none'}, expected some of x, y, z, activation"
        )
    try:
        numbers = np.array([[float(cell) for cell in row] for row in rows[1:]], dtype=float)
    except ValueError:
        raise FileError(
            f"{path}: found a cell that is no number or a row of another length, expected numbers"
        ) from None
    if numbers.ndim != 2 or numbers.shape[1] != len(header):
        raise FileError(f"{path}: found rows of another length than the header, expected {len(header)} numbers each")
    try:
        return PointTable("".join(header[:-1]), numbers[:, :-1].T, numbers[:, -1])
    except DesignError as error:
        raise FileError(f"{path}: {error}") from None


@dataclass(frozen=True, eq=False)
class Spot:
    """Activation by a grey picture laid over the muscle's plane, as of projected light; none outside it.

    Parameters
    ----------
    grey
        Brightness of the pixels, row by row from the top, (rows, columns), 0 black to 1 white [1].
    left, right, bottom, top
        Edges of the picture in the reference body: x of the left and right, y of the lower and upper edge [mm]. Swapped
        edges mirror it.

    Notes
    -----
    A pixel's value is that of its middle; between middles it is interpolated bilinearly, and over the outer half of the
    border pixels it stays theirs. The light reaches through the whole thickness: nothing depends on z.
    """

    grey: Array
    left: float
    right: float
    bottom: float
    top: float

    def __post_init__(self) -> None:
        grey = np.asarray(self.grey, dtype=float)
        if grey.ndim != 2 or not grey.size or not np.all((grey >= 0.0) & (grey <= 1.0)):
            raise DesignError(f"activation image: found shape {grey.shape}, expected rows of brightness from 0 to 1")
        if not (np.all(np.isfinite([self.left, self.right, self.bottom, self.top]))) or (
            self.left == self.right or self.bottom == self.top
        ):
            raise DesignError("activation image: found edges that enclose nothing, expected four different lengths")

    def __call__(self, X: Array, time: float) -> Array:
        """Values at positions (3, k) [mm], the same at all times, (k,) [1]."""
        grey = np.asarray(self.grey, dtype=float)
        rows, columns = grey.shape
        across = (X[0] - self.left) / (self.right - self.left)
        down = (self.top - X[1]) / (self.top - self.bottom)
        inside = (across >= 0.0) & (across <= 1.0) & (down >= 0.0) & (down <= 1.0)
        j = np.clip(across * columns - 0.5, 0.0, columns - 1.0)
        i = np.clip(down * rows - 0.5, 0.0, rows - 1.0)
        j0, i0 = np.minimum(j.astype(int), max(columns - 2, 0)), np.minimum(i.astype(int), max(rows - 2, 0))
        j1, i1 = np.minimum(j0 + 1, columns - 1), np.minimum(i0 + 1, rows - 1)
        a, b = i - i0, j - j0
        upper = grey[i0, j0] * (1.0 - b) + grey[i0, j1] * b
        lower = grey[i1, j0] * (1.0 - b) + grey[i1, j1] * b
        return np.where(inside, upper * (1.0 - a) + lower * a, 0.0)


def read_grey(path: Path) -> Array:
    """Brightness of a picture file (PNG, TIFF, ...), (rows, columns), 0 black to 1 white; colours by their luma."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            deep = {"I;16": 65535.0, "I;16L": 65535.0, "I;16B": 65535.0, "I": 65535.0}.get(picture.mode)
            if deep is not None:
                return np.clip(np.asarray(picture, dtype=float) / deep, 0.0, 1.0)
            if picture.mode == "F":
                raise FileError(f"{path}: found a picture of floating-point numbers, expected 8 or 16 bits a pixel")
            return np.asarray(picture.convert("L"), dtype=float) / 255.0
    except (OSError, UnidentifiedImageError, Image.DecompressionBombError, SyntaxError, ValueError):
        raise FileError(f"{path}: found no picture that can be read, expected a PNG or TIFF file") from None


def activation_of(design: Design) -> Formula | PointTable | Spot | None:
    """The activation that a design asks for; None where its muscle is stimulated evenly."""
    field = None if design.muscle is None else design.muscle.activation
    if field is None:
        return None
    if field.formula:
        return Formula(field.formula)
    if field.table:
        return read_point_table(Path(field.table))
    assert field.image_left is not None
    assert field.image_right is not None
    assert field.image_bottom is not None
    assert field.image_top is not None
    grey = read_grey(Path(field.image))
    return Spot(grey, field.image_left, field.image_right, field.image_bottom, field.image_top)
