"""What of a design's laws, tension, fibres and oxygen goes together: refusals in one line each."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fem_biobot.design_kinds import FIBRE_LAWS, LAW_PARAMETERS
from fem_biobot.errors import DesignError
from fem_biobot.units import format_quantity, shown

if TYPE_CHECKING:
    from fem_biobot.design import Design
    from fem_biobot.design_parts import Muscle


def check_tissue(design: Design) -> None:
    """Refuse laws with parameters of others, and ways of stating tension, fibres and oxygen that exclude each other."""
    _check_laws(design)
    _check_tension(design)
    _check_attachment(design)
    _check_oxygen(design)
    _check_activation(design)


def _check_laws(design: Design) -> None:
    """Parameters of other laws than the one chosen, and fibres where there are none."""
    for name in ("skeleton", "muscle"):
        part = getattr(design, name)
        if part is None:
            continue
        law, own = part.material.law, LAW_PARAMETERS[part.material.law]
        if name == "skeleton" and law in FIBRE_LAWS:
            raise DesignError(f"skeleton.material.law: found {law}, expected a law without fibres for the hydrogel")
        for key in {key: None for keys in LAW_PARAMETERS.values() for key in keys}:
            value = getattr(part.material, key)
            if value is not None and key not in own:
                expected = f"one of {', '.join(own)}" if own else "none"
                raise DesignError(
                    f"{name}.material.{key}: found {value:g}, a parameter that the law {law} does not have, "
                    f"expected {expected}"
                )


def _check_tension(design: Design) -> None:
    """Ways of stating the tension that do not go together."""
    muscle = design.muscle
    if muscle is None:
        return
    _check_fibres(muscle)
    if muscle.optimal_stretch is not None and muscle.force_length == "none":
        raise DesignError(
            f"muscle.optimal_stretch: found {muscle.optimal_stretch:g}, expected none without muscle.force_length"
        )
    if muscle.transverse > 0.0 and muscle.force_length != "none":
        raise DesignError(
            f"muscle.transverse: found {muscle.transverse:g}, expected 0 with muscle.force_length {muscle.force_length}"
        )
    if muscle.transverse > 0.0 and muscle.force_velocity is not None:
        raise DesignError(f"muscle.transverse: found {muscle.transverse:g}, expected 0 with muscle.force_velocity")
    extras = {
        "spread": muscle.spread,
        "transverse": muscle.transverse,
        "force_length": muscle.force_length != "none",
        "force_velocity": muscle.force_velocity is not None,
    }
    if muscle.convention == "active_strain" and any(extras.values()):
        key = next(name for name, given in extras.items() if given)
        raise DesignError(f"muscle.{key}: found with muscle.convention active_strain, expected it with a tension only")


def _check_attachment(design: Design) -> None:
    """Friction for rings that slide, and what these do not go with."""
    muscle = design.muscle
    if muscle is None:
        return
    frictions = ("pillar_friction", "pillar_axial_friction")
    if muscle.attachment == "bonded":
        for name in frictions:
            if (value := getattr(muscle, name)) is not None:
                raise DesignError(
                    f"muscle.{name}: found {value:g} with muscle.attachment bonded, expected none, or contact"
                )
        return
    if design.kind != "bot":
        raise DesignError(f"muscle.attachment: found contact with kind {design.kind}, expected bonded without pillars")
    if muscle.pillar_friction is None:
        raise DesignError("muscle.pillar_friction: missing, expected a number for muscle.attachment contact")
    if muscle.reference != "as_moulded":
        raise DesignError(
            f"muscle.reference: found {muscle.reference} with muscle.attachment contact, expected as_moulded"
        )
    if design.mesh.element == "P2-P1":
        raise DesignError("mesh.element: found P2-P1 with muscle.attachment contact, expected P2 or P1")
    axial = muscle.pillar_friction if muscle.pillar_axial_friction is None else muscle.pillar_axial_friction
    if axial == 0.0:
        name = frictions[muscle.pillar_axial_friction is not None]
        raise DesignError(
            f"muscle.{name}: found 0, with which nothing keeps the rings from sliding off their pillars, expected "
            "above 0, or muscle.pillar_axial_friction above 0 for rings without friction around the pillars only"
        )


def _check_activation(design: Design) -> None:
    """One way of giving it, a picture with its edges, and a tension that has a stimulated part."""
    muscle = design.muscle
    field = None if muscle is None else muscle.activation
    if muscle is None or field is None:
        return
    given = [f"muscle.activation.{name}" for name in ("formula", "table", "image") if getattr(field, name)]
    if len(given) != 1:
        raise DesignError(
            f"muscle.activation: found {' and '.join(given) or 'nothing'}, expected one of formula, table and image"
        )
    edges = ("image_left", "image_right", "image_bottom", "image_top")
    for name in edges:
        if (getattr(field, name) is None) == bool(field.image):
            found = "missing" if field.image else "found without a picture"
            raise DesignError(f"muscle.activation.{name}: {found}, expected all four edges with image and none without")
    if field.image and (field.image_left == field.image_right or field.image_bottom == field.image_top):
        raise DesignError("muscle.activation.image_right: found a picture of no extent, expected edges that differ")
    if muscle.convention == "active_strain":
        raise DesignError(
            "muscle.activation: found with muscle.convention active_strain, expected it with a tension only"
        )


def _check_oxygen(design: Design) -> None:
    """A threshold that the medium itself misses, a gel without its diffusivity, a viable share stated twice."""
    muscle = design.muscle
    oxygen = None if muscle is None else muscle.oxygen
    if muscle is None or oxygen is None:
        return
    if oxygen.threshold >= oxygen.supply:
        raise DesignError(
            f"muscle.oxygen.threshold: found {format_quantity(oxygen.threshold, 'mM')}, expected less than "
            f"muscle.oxygen.supply ({format_quantity(oxygen.supply, 'mM')})"
        )
    if (oxygen.gel == "permeable") != (oxygen.gel_diffusivity is not None):
        raise DesignError(
            "muscle.oxygen.gel_diffusivity: missing, expected a diffusivity for a permeable gel"
            if oxygen.gel == "permeable"
            else 'muscle.oxygen.gel_diffusivity: found with muscle.oxygen.gel "sealed", expected it with "permeable"'
        )
    if oxygen.tension != "none" and muscle.gamma != 1.0:
        raise DesignError(
            f"muscle.gamma: found {muscle.gamma:g} together with muscle.oxygen, which gives the viable share itself; "
            'expected 1, or muscle.oxygen.tension "none"'
        )
    if oxygen.tension != "none" and muscle.gamma_scales != "both":
        raise DesignError(
            f'muscle.gamma_scales: found "{muscle.gamma_scales}" together with muscle.oxygen, whose viable share '
            'scales both tensions; expected "both", or muscle.oxygen.tension "none"'
        )


def _check_fibres(muscle: Muscle) -> None:
    for name in ("fibres", "orientation", "orientation_image"):
        text = getattr(muscle, name)
        if text is not None and not (text.strip() and text.isprintable()):
            expected = "smooth, piecewise or a file" if name == "fibres" else "a printable text"
            raise DesignError(f"muscle.{name}: found {shown(text)}, expected {expected}")
    if muscle.orientation is None:
        for name, given in (
            ("orientation_image", muscle.orientation_image is not None and shown(muscle.orientation_image)),
            (
                "orientation_axis",
                muscle.orientation_axis and format_quantity(muscle.orientation_axis, "rad", digits=12),
            ),
        ):
            if given:
                raise DesignError(f"muscle.{name}: found {given} without muscle.orientation, expected none")
