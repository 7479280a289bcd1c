"""Pictures of bodies, drawn off-screen by VTK in a child process, or by the built-in renderer where that fails.

Off-screen VTK does not raise where no graphics library is installed: it kills the interpreter. So it runs in a process
of its own, once for all pictures of a run, and what comes back is looked at. The environment variable
``FEM_BIOBOT_RENDERER`` chooses: ``auto`` (the default: VTK, else built-in), ``pyvista`` (VTK or an error),
``matplotlib`` (the built-in renderer at once; no graphics library is touched).
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem_biobot.errors import DesignError, FileError
from fem_biobot.files import file_error
from fem_biobot.view import raster
from fem_biobot.view.compose import compose
from fem_biobot.view.layout import lay_out, used_points
from fem_biobot.view.scene import Bar, Layer, Panel, Picture, View, colour_map
from fem_biobot.view.surface import corner_normals

VARIABLE = "FEM_BIOBOT_RENDERER"
CHOICES = ("auto", "pyvista", "matplotlib")
Image = NDArray[np.uint8]

# run by path and isolated (-P), so that nothing of this package is imported in the child
_CHILD = (sys.executable, "-P", str(Path(__file__).with_name("render_child.py")))
_SCALE = raster.SUPERSAMPLING
_known_failure: str | None = None  # why VTK failed in this process, so that it is asked once only


@dataclass(frozen=True)
class Drawn:
    """What `draw_pictures` did: the files in order, ``"pyvista"`` or ``"matplotlib"``, and what to tell the user.

    `note` is empty unless something was replaced by something lesser.
    """

    files: tuple[Path, ...]
    renderer: str
    note: str = ""


class RenderError(Exception):
    """The child drew nothing; the text says why. Never leaves this module's callers: they replace or report it."""


def draw_pictures(
    pictures: Sequence[Picture],
    folder: str | os.PathLike[str],
    *,
    renderer: str | None = None,
    width: int = 1600,
    timeout: float = 90.0,
) -> Drawn:
    """Draw pictures into a folder as ``<name>.png``, each whole or not at all.

    Parameters
    ----------
    pictures
        What to draw.
    folder
        An existing folder.
    renderer
        One of `CHOICES`; from the environment if left out.
    width
        Width of a picture [pixels]; the height follows from what it shows.
    timeout
        How long VTK may take, for all of them [s].

    Raises
    ------
    DesignError
        The renderer asked for is none of `CHOICES`.
    FileError
        ``pyvista`` was asked for and cannot draw; a file cannot be written.
    """
    choice = _choice(renderer)
    layouts = [lay_out(picture, width=width) for picture in pictures]
    views = [frame.view for layout in layouts for frame in layout.frames]
    used, note = "matplotlib", ""
    images: list[Image] | None = None
    if choice != "matplotlib" and views:
        try:
            images, used = _render_in_child(views, timeout), "pyvista"
        except RenderError as failure:
            if choice == "pyvista":
                refusal = f"{VARIABLE} = pyvista, but off-screen rendering failed ({failure}); {_remedy()}"
                raise FileError(refusal) from None
            note = _note(str(failure))
    if images is None:
        images = [raster.render(view) for view in views]
    files = []
    for picture, layout in zip(pictures, layouts, strict=True):
        path = Path(folder) / f"{picture.name}.png"
        own, images = images[: len(layout.frames)], images[len(layout.frames) :]
        compose(path, picture, layout, own)
        files.append(path)
    return Drawn(tuple(files), used, note)


def renderer_status(*, timeout: float = 60.0) -> tuple[str, str]:
    """Which renderer pictures will come from, tried by drawing one triangle, and the note that goes with it.

    Returns
    -------
    tuple
        ``"pyvista"`` or ``"matplotlib"``, and the note (empty if nothing is missing).
    """
    if _choice(None) == "matplotlib":
        return "matplotlib", f"{VARIABLE} = matplotlib: pictures drawn by the built-in renderer"
    triangle = Layer(np.eye(3), np.array([[0], [1], [2]]))
    view = lay_out(Picture("probe", "", [Panel([triangle])]), width=200).frames[0].view
    try:
        _render_in_child([view], timeout)
    except RenderError as failure:
        return "matplotlib", _note(str(failure))
    return "pyvista", ""


def _choice(renderer: str | None) -> str:
    choice = renderer if renderer is not None else os.environ.get(VARIABLE, "auto") or "auto"
    if choice not in CHOICES:
        raise DesignError(f"{VARIABLE} = {choice!r}, expected one of {', '.join(CHOICES)}")
    return choice


def _note(reason: str) -> str:
    return f"pictures drawn by matplotlib: off-screen rendering failed ({reason}); {_remedy()}"


def _remedy() -> str:
    """The one command that brings full pictures."""
    if "No module named" in (_known_failure or ""):
        return "`pip install pyvista` brings full pictures"
    if sys.platform.startswith("linux"):
        return "`apt-get install -y libosmesa6` (or libegl1) brings full pictures"
    return "a working OpenGL driver brings full pictures"


def _render_in_child(views: Sequence[View], timeout: float) -> list[Image]:
    """Images of the views by VTK, or `RenderError`; after one failure it is not tried again in this process."""
    global _known_failure
    if _known_failure is not None:
        raise RenderError(_known_failure)
    environments = [{key: value for key, value in os.environ.items() if key != "DISPLAY"}]
    if "DISPLAY" in os.environ:  # without one first: VTK then draws off-screen and does not complain about the server
        environments.append(dict(os.environ))
    reason = ""
    try:
        with tempfile.TemporaryDirectory(prefix="fem_biobot_") as folder:
            job = Path(folder) / "job.npz"
            names = _write_job(job, views)
            for environment in environments:
                reason = _run_child(job, environment, timeout)
                if not reason:
                    images = [_read_image(job.with_name(name), view) for name, view in zip(names, views, strict=True)]
                    if all(image is not None for image in images):
                        return [image for image in images if image is not None]
                    reason = "no picture came back"
    except OSError as error:
        raise file_error(error, tempfile.gettempdir(), doing="prepare the pictures") from error
    _known_failure = reason
    raise RenderError(reason)


def _run_child(job: Path, environment: dict[str, str], timeout: float) -> str:
    """Run the child on a job; empty, or why it failed. Nothing it says reaches the terminal."""
    try:
        done = subprocess.run(
            [*_CHILD, str(job)], cwd=job.parent, env=environment, timeout=timeout, stdin=subprocess.DEVNULL,
            capture_output=True, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no answer within {timeout:g} s"
    if done.returncode == 0:
        return ""
    if done.returncode < 0:
        try:
            return f"child ended by signal {-done.returncode}, {signal.Signals(-done.returncode).name}"
        except ValueError:
            return f"child ended by signal {-done.returncode}"
    said = [line.strip() for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
    return said[-1][:200] if said else f"child ended with code {done.returncode}"


def _read_image(file: Path, view: View) -> Image | None:
    """A rendered image; None if it is missing, broken, of another size or of one colour."""
    try:
        image = np.load(file, allow_pickle=False)
    except (OSError, EOFError, ValueError):  # what a missing or broken file raises
        return None
    width, height = view.pixels
    return image if image.shape == (height, width, 3) and np.ptp(image) > 0 else None


def _write_job(job: Path, views: Sequence[View]) -> list[str]:
    """Write what the child needs; returns the names of the image files it shall make."""
    data: dict[str, NDArray[Any]] = {}
    layers: dict[str, dict[str, Any]] = {}
    keys: dict[int, str] = {}
    specs = []
    for number, view in enumerate(views):
        for layer in view.layers:
            if id(layer) not in keys:
                keys[id(layer)] = f"layer{len(keys)}"
                layers[keys[id(layer)]] = _pack_layer(data, keys[id(layer)], layer)
        specs.append(_pack_view(data, number, view, [keys[id(layer)] for layer in view.layers]))
    spec: dict[str, Any] = {"views": specs, "layers": layers, "supersampling": _SCALE}
    spec |= {"lights": raster.LIGHTS, "ambient": raster.AMBIENT}
    data["spec"] = np.array(json.dumps(spec))
    np.savez(job, allow_pickle=False, **data)
    return [view["file"] for view in specs]


def _pack_layer(data: dict[str, NDArray[Any]], key: str, layer: Layer) -> dict[str, Any]:
    """Arrays of a layer into `data`, the rest returned. Triangles share no vertices, so sharp edges stay sharp."""
    if layer.triangles.shape[1]:
        order = layer.triangles.T.ravel()
        data[f"{key}/points"] = layer.points[:, order].T.astype(np.float32)
        normals = corner_normals(layer.points, layer.triangles).transpose(2, 1, 0).reshape(-1, 3)
        data[f"{key}/normals"] = normals.astype(np.float32)
        if layer.values is not None:
            data[f"{key}/values"] = np.asarray(layer.values)[order].astype(np.float32)
    if layer.edges.shape[1]:
        data[f"{key}/lines"] = layer.points[:, layer.edges.T.ravel()].T.astype(np.float32)
    return {
        "colour": layer.colour,
        "opacity": layer.opacity,
        "lit": layer.lit,
        "edge_colour": layer.edge_colour,
        "edge_width": layer.edge_width,
    }


def _pack_view(data: dict[str, NDArray[Any]], number: int, view: View, keys: list[str]) -> dict[str, Any]:
    """Everything of a view but its layers' arrays."""
    near = np.concatenate([view.axes[2] @ used_points(layer) for layer in view.layers])
    bar: Bar | None = view.bar
    if bar is not None:
        table = (255.0 * np.asarray(colour_map(bar.colours)(np.linspace(0.0, 1.0, 256)))).round().astype(np.uint8)
        data[f"{bar.colours}/table"] = table
    return {
        "file": f"view{number}.npy",
        "layers": keys,
        "axes": view.axes.tolist(),
        "centre": view.centre,
        "depth": float((near.min() + near.max()) / 2.0),
        "distance": float(near.max() - near.min() + 1.0) * 2.0,
        "lift": 0.008 * view.half_height,
        "half_height": view.half_height,
        "pixels": [_SCALE * p for p in view.pixels],
        "line_scale": _SCALE,
        "limits": None if bar is None else list(bar.limits),
        "colours": None if bar is None else bar.colours,
    }
