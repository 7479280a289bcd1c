"""The program that draws with VTK, run in a process of its own: ``python render_child.py job.npz``.

Off-screen VTK may kill its interpreter where no graphics library is found, so nothing of the package may import this
module, and it imports nothing of the package. The job holds the arrays of every view and a JSON text with the rest;
each view becomes an image array in the job's folder. Translucent surfaces show their front side only, without VTK's
depth peeling, which some software drivers cannot do. The only place that imports pyvista.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np


def main(job_file: str) -> int:
    """Draw every view of a job; returns the exit code."""
    import pyvista as pv

    # views are drawn finer and averaged; a software driver pays dearly for smoothing them as well
    pv.global_theme.multi_samples = 1
    pv.global_theme.anti_aliasing = None
    job = Path(job_file)
    with np.load(job) as arrays:
        data = {name: arrays[name] for name in arrays.files}
    spec = json.loads(data["spec"].item())
    for view in spec["views"]:
        draw(pv, view, spec, data, job.with_name(view["file"]))
    return 0


def draw(pv: Any, view: dict[str, Any], spec: dict[str, Any], data: dict[str, Any], file: Path) -> None:
    """Draw one view on white with parallel projection and save it."""
    plotter = pv.Plotter(off_screen=True, window_size=view["pixels"], lighting="none")
    plotter.set_background("white")
    for direction, strength in spec["lights"]:
        plotter.add_light(pv.Light(position=direction, light_type="camera light", intensity=strength))
    for key in view["layers"]:
        add_layer(pv, plotter, spec["layers"][key], key, spec["ambient"], view, data)
    right, up, back = np.array(view["axes"])
    focus = view["centre"][0] * right + view["centre"][1] * up + view["depth"] * back
    camera = plotter.camera
    camera.focal_point = focus
    camera.position = focus + view["distance"] * back
    camera.up = up
    camera.parallel_projection = True
    camera.parallel_scale = view["half_height"]
    camera.clipping_range = (0.01 * view["distance"], 2.0 * view["distance"])
    image = np.asarray(plotter.screenshot(None, return_img=True))[:, :, :3]
    plotter.close()
    fine = spec["supersampling"]
    high, wide = image.shape[0] // fine, image.shape[1] // fine
    small = image.reshape(high, fine, wide, fine, 3).mean(axis=(1, 3), dtype=np.float32)
    np.save(file, (small + 0.5).astype(np.uint8), allow_pickle=False)


def add_layer(
    pv: Any, plotter: Any, layer: dict[str, Any], key: str, ambient: float, view: dict[str, Any], data: dict[str, Any]
) -> None:
    """Add a layer's triangles, which share no vertices and carry their normals, and its lines."""
    points = data.get(f"{key}/points")
    if points is not None:
        faces = np.column_stack([np.full(len(points) // 3, 3), np.arange(len(points)).reshape(-1, 3)])
        surface = pv.PolyData(points, faces.ravel())
        surface.point_data["normals"] = data[f"{key}/normals"]
        surface.GetPointData().SetActiveNormals("normals")
        look: dict[str, Any] = {"color": layer["colour"]}
        if f"{key}/values" in data and view["limits"] is not None:
            surface.point_data["values"] = data[f"{key}/values"]
            table = pv.LookupTable(values=data[f"{view['colours']}/table"], scalar_range=view["limits"])
            look = {"scalars": "values", "cmap": table, "clim": view["limits"], "show_scalar_bar": False}
        actor = plotter.add_mesh(
            surface,
            opacity=layer["opacity"],
            lighting=layer["lit"],
            ambient=ambient if layer["lit"] else 0.0,
            diffuse=1.0,
            specular=0.0,
            culling="back" if layer["opacity"] < 1.0 else None,
            interpolate_before_map=True,
            **look,
        )
        actor.prop.interpolation = "Phong"
    lines = data.get(f"{key}/lines")
    if lines is not None:
        pairs = np.column_stack([np.full(len(lines) // 2, 2), np.arange(len(lines)).reshape(-1, 2)])
        drawn = pv.PolyData(lines + np.array(view["axes"][2]) * view["lift"], lines=pairs.ravel())
        width = layer["edge_width"] * view["line_scale"]
        plotter.add_mesh(drawn, color=layer["edge_colour"], line_width=width, lighting=False, opacity=layer["opacity"])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
