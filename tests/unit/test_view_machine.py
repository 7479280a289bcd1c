"""The pictures of a run show the right parts, fields and shapes."""

from __future__ import annotations

import numpy as np
import pytest
import skfem

from fem_biobot.view.machine import GEL, MUSCLE, Machine, Shape, machine_pictures


def body(**changes: object) -> Machine:
    """A box whose right half is muscle, on quadratic elements."""
    mesh = skfem.MeshTet.init_tensor(np.linspace(-2.0, 2.0, 7), np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.2, 4))
    corner = mesh.p[:, mesh.t]
    volume = np.linalg.det((corner[:, 1:] - corner[:, :1]).transpose(2, 0, 1))
    mesh = skfem.MeshTet(mesh.p, np.where(volume > 0, mesh.t, mesh.t[[1, 0, 2, 3]]))
    basis = skfem.Basis(mesh, skfem.ElementTetP2(), intorder=1)
    right = mesh.p[0, mesh.t].mean(axis=0) > 0.0
    regions = {"skeleton": np.flatnonzero(~right), "muscle": np.flatnonzero(right)}
    settings = {"regions": regions, "name": "box", **changes}
    return Machine(basis.doflocs, basis.element_dofs, **settings)


def shape(machine: Machine, key: str, scale: float, **fields: np.ndarray | None) -> Shape:
    n_elements = machine.cells.shape[1]
    rng = np.random.default_rng(11)
    values = {
        "von_mises": scale * rng.uniform(2.0, 3.0, n_elements),
        "fibre_stretch": np.where(machine.muscle, rng.uniform(0.7, 0.8, n_elements), np.nan),
        "fibre_stress": np.where(machine.muscle, rng.uniform(9.0, 11.0, n_elements), np.nan),
        **fields,
    }
    return Shape(key, f"{key}, {scale} kPa", scale * 0.02 * machine.points[[1, 2, 0]], **values)


def test_a_run_has_its_pictures_in_order() -> None:
    """Catches: a picture forgotten, two pictures with one name."""
    machine = body()
    names = [p.name for p in machine_pictures(machine, [shape(machine, "passive", 1.0), shape(machine, "peak", 2.0)])]
    assert names == ["machine", "shapes", "von_mises_passive", "von_mises_peak", "fibre_stretch", "fibre_stress"]


def test_parts_are_red_muscle_and_grey_gel() -> None:
    """Catches: regions swapped, region taken from doubled nodes of the other part."""
    machine = body()
    layers = {layer.colour: layer for layer in machine_pictures(machine, [])[1].panels[0].layers}
    muscle, gel = layers[MUSCLE], layers[GEL]
    assert (muscle.points[0, muscle.triangles].mean(axis=0) > 0.0).all()
    assert (gel.points[0, gel.triangles].mean(axis=0) < 0.0).all()
    assert muscle.triangles.shape[1] == gel.triangles.shape[1] > 100


def test_a_state_is_drawn_where_it_went_with_its_own_values() -> None:
    """Catches: displacement forgotten or doubled, fields of another state, muscle and gel averaged together."""
    machine = body()
    marked = np.where(machine.muscle, 7.0, 3.0)
    states = [shape(machine, "passive", 1.0, von_mises=marked), shape(machine, "peak", 2.0, von_mises=5.0 * marked)]
    picture = machine_pictures(machine, states)[3]
    (layer,) = [layer for layer in picture.panels[0].layers if layer.values is not None]
    n = machine.points.shape[1]
    assert np.allclose(layer.points[:, :n], machine.points + 0.04 * machine.points[[1, 2, 0]], rtol=1e-14)
    assert set(np.round(np.unique(layer.values), 9)) == {15.0, 35.0}
    assert "peak" in picture.title


def test_stress_pictures_share_a_bar_from_zero_to_the_99th_percentile_and_say_so() -> None:
    """Catches: each state scaled by itself, one hot element washing out the rest, the true maximum hidden."""
    machine = body()
    hot = np.ones(machine.cells.shape[1])
    lonely = np.flatnonzero(np.bincount(machine.cells.ravel()) == 1)[0]  # a node of one element, so on the surface
    hot[(machine.cells == lonely).any(axis=0)] = 900.0
    states = [shape(machine, "passive", 1.0), shape(machine, "peak", 2.0, von_mises=hot)]
    bars = [p.bar for p in machine_pictures(machine, states) if p.name.startswith("von_mises")]
    assert bars[0] == bars[1]
    assert bars[0] is not None
    assert bars[0].limits[0] == 0.0
    assert 1.0 < bars[0].limits[1] < 500.0
    assert bars[0].extend == "max"
    assert "900 kPa" in bars[0].note
    assert "[kPa]" in bars[0].label


def test_fibre_pictures_show_the_muscle_alone_in_the_last_state() -> None:
    """Catches: NaN of the gel leaking in, the first state shown, gel drawn as muscle."""
    machine = body()
    last = shape(machine, "peak", 2.0)
    pictures = machine_pictures(machine, [shape(machine, "passive", 1.0), last])
    for picture, low, high in ((pictures[4], 0.7, 0.8), (pictures[5], 9.0, 11.0)):
        (layer,) = [layer for layer in picture.panels[0].layers if layer.values is not None]
        drawn = np.unique(layer.triangles)
        values = np.asarray(layer.values)[drawn]
        assert values.min() >= low
        assert values.max() <= high
        assert machine.points[0, machine.split[0][drawn]].min() == 0.0
        assert "peak" in picture.title
        assert picture.bar is not None
        assert low < picture.bar.limits[0] < picture.bar.limits[1] < high


def test_bodies_of_one_part_and_states_without_fields_are_drawn_too() -> None:
    """Catches: a strip or a cantilever, which have one region, ending in an error; a constant field with no range."""
    for regions in ({"skeleton": np.arange(216)}, {"muscle": np.arange(216)}):
        machine = body(regions=regions, ground=False)
        assert machine.cells.shape[1] == 216
        flat = np.full(216, 4.0)
        pictures = machine_pictures(machine, [shape(machine, "a", 1.0, von_mises=None, fibre_stretch=flat)])
        names = [picture.name for picture in pictures]
        assert names == ["machine", "shapes"] + (["fibre_stretch", "fibre_stress"] if "muscle" in regions else [])
        assert all(p.bar.limits[0] < p.bar.limits[1] for p in pictures if p.bar is not None)


def test_the_inset_follows_its_point() -> None:
    """Catches: the inset left where the point was before the deformation."""
    machine = body(focus=(2.0, 1.0, 1.2))
    picture = machine_pictures(machine, [shape(machine, "peak", 2.0)])[2]
    inset = picture.panels[0].inset
    assert inset is not None
    assert inset.centre == pytest.approx((2.0 + 0.04 * 1.0, 1.0 + 0.04 * 1.2, 1.2 + 0.04 * 2.0))
