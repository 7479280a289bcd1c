"""What the compiled kernels read of an assembly: tuples of arrays, made once by `rod.build`.

Letters of shapes: ``n`` nodes, ``m`` elements, ``k`` axial members, ``l`` loads, ``j`` joints, ``c`` contact
points, ``t`` nodes that touch other parts, ``s`` segments of what they touch, ``d`` lumps of drag, ``q`` curves. A node
is a rigid group at its centre of mass: a node of a rod, a body, or several of these joined rigidly. An offset leads
from a node to a point fixed to it, in the node's own frame. Node -1 is the world; its offset is a position.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fem_biobot.rod.element.arrays import Elements

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Inertia(NamedTuple):
    """Mass (n,) [kg] and inertia about the node in its own frame (n, 3, 3) [kg mm^2]; `held` (n,) 1 where fixed."""

    mass: Array
    J: Array
    held: Ints


class Members(NamedTuple):
    """Axial members: muscles and springs.

    Attributes
    ----------
    nodes, offset
        Ends, (k, 2) and (k, 2, 3) [mm].
    law
        0 spring, 1 muscle with the resistance of Eq. 2, 2 muscle with that of a neo-Hookean strip, (k,).
    stiffness
        Spring stiffness [mN/mm], or Young's modulus times section [mN], (k,).
    length
        Rest length (k,) [mm].
    viscosity
        Force per rate of length [mN s/mm], (k,).
    """

    nodes: Ints
    offset: Array
    law: Ints
    stiffness: Array
    length: Array
    viscosity: Array


class Activation(NamedTuple):
    """Active tension of the members, see `rod.activation`.

    Attributes
    ----------
    standing
        Force without stimulation, (k,) [mN].
    curve
        Numbers of the curves of stretch and of rate of stretch that multiply the stimulated force, (k, 2); -1 for none.
    low, spacing
        First knot and distance of the knots of each curve, (q,).
    table
        Value, and slope times distance, at the knots of each curve, (q, 1025, 2).
    """

    standing: Array
    curve: Ints
    low: Array
    spacing: Array
    table: Array


class Loads(NamedTuple):
    """Forces (l, 3) [mN] and moments (l, 3) [uJ] at points of nodes; `following` (l,) is 1 where they turn along."""

    node: Ints
    offset: Array
    force: Array
    moment: Array
    following: Ints


class Constraints(NamedTuple):
    """Joints and partial supports.

    Attributes
    ----------
    nodes, offset
        The two parts, the second may be the world, (j, 2) and (j, 2, 3).
    rows
        Which of six rows hold, (j, 6): three translations in world axes, three rotations about the axes `frame` of
        the second part.
    frame
        Axes (rows) fixed to each part, (j, 2, 3, 3), equal in the drawing.
    soft
        Compliance of rows that depend on each other (see `rod.redundant`), zero elsewhere, (j, 6).
    """

    nodes: Ints
    offset: Array
    rows: Ints
    frame: Array
    soft: Array


class Contacts(NamedTuple):
    """Points that the ground stops.

    Attributes
    ----------
    node, offset
        Where they are, (c,) and (c, 3) [mm].
    radius, axis
        Of a round surface, (c,) [mm], and its direction in the node's frame, (c, 3) or zero for a sphere.
    elsewhere, acting
        1 where the ground's force acts on another point of the node, (c,), and the offset of that, (c, 3) [mm].
    """

    node: Ints
    offset: Array
    radius: Array
    axis: Array
    elsewhere: Ints
    acting: Array


class Drags(NamedTuple):
    """Lumps of drag in a medium, see `rod.drag`.

    Attributes
    ----------
    node, offset, axis
        Where they act, (d,) and (d, 3) [mm], and the direction of least resistance, (d, 3) or zero for none.
    along, across
        Force by velocity along the axis and across it, (d,) [mN s/mm].
    quadratic
        Force by the square of the velocity across, (d,) [mN s^2/mm^2].
    spin, tumble
        Moment by angular velocity about the axis and across it, (d,) [mN mm s].
    velocity
        Of the medium, (d, 3) [mm/s].
    """

    node: Ints
    offset: Array
    axis: Array
    along: Array
    across: Array
    quadratic: Array
    spin: Array
    tumble: Array
    velocity: Array


class Touches(NamedTuple):
    """Round nodes that stay outside round chains of straight segments.

    Attributes
    ----------
    node, offset
        The centre of what touches, (t,) and (t, 3) [mm].
    first, last
        Its chain: segments of this number up to before that, (t,) each.
    chain_node, chain_offset
        Ends of the segments of all chains, (s, 2) and (s, 2, 3) [mm].
    distance, radius
        Between the axes where the surfaces meet, and the share of the one that touches, (t,) each [mm].
    friction
        Coulomb's coefficient between the surfaces, (t,) [1].
    endless, along
        1 where the chain goes on beyond its ends, (t,); direction of the world across which distances count, (t, 3)
        of length one, or zero for none.
    """

    node: Ints
    offset: Array
    first: Ints
    last: Ints
    chain_node: Ints
    chain_offset: Array
    distance: Array
    radius: Array
    friction: Array
    endless: Ints
    along: Array


class Assembly(NamedTuple):
    """Everything about a model that does not change while it moves.

    `damping` (m,) is the Kelvin-Voigt time of an element [s]; `gravity` (3,) [mm/s^2].
    """

    elements: Elements
    damping: Array
    inertia: Inertia
    members: Members
    loads: Loads
    constraints: Constraints
    contacts: Contacts
    touches: Touches
    gravity: Array
    drag: Drags
    activation: Activation
