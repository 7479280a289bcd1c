"""Block elimination along a plan: solutions of symmetric patterns, singular blocks, fill-in."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import numpy as np
import pytest

from fem_biobot.rod.blocks import kernels
from fem_biobot.rod.blocks.plan import plan
from tests.helpers import generator, plain_python

NAMES = tuple(name for name, value in vars(kernels).items() if hasattr(value, "py_func"))
CHAIN = [(i, i + 1) for i in range(6)]
LOOP = [*CHAIN, (6, 0), (2, 5)]


@pytest.fixture(params=["compiled", "plain"])
def mode(request: pytest.FixtureRequest) -> Iterator[str]:
    """Run the kernels compiled, and as the Python they were compiled from."""
    with ExitStack() as stack:
        if request.param == "plain":
            stack.enter_context(plain_python(kernels, *NAMES))
        yield request.param


def _system(n: int, pairs: list[tuple[int, int]], last: list[int]) -> tuple:
    made, place, count = plan(n, pairs, last)
    draw = generator(12)
    blocks, full = np.zeros((count, 6, 6)), np.zeros((6 * n, 6 * n))
    for i, j in [(i, i) for i in range(n)] + pairs + [(j, i) for i, j in pairs]:
        value = draw.normal(size=(6, 6)) + (9.0 * np.eye(6) if i == j else 0.0)
        if i == j and i in last:
            value[:] = 0.0
        blocks[place[i, j]] = value
        full[6 * i : 6 * i + 6, 6 * j : 6 * j + 6] = value
    return made, blocks, full, count


@pytest.mark.parametrize(
    ("n", "pairs", "last"), [(7, CHAIN, []), (7, LOOP, []), (9, [*LOOP, (7, 3), (7, 4), (8, 1)], [7, 8])]
)
def test_solutions_are_those_of_the_full_matrix(
    mode: str, n: int, pairs: list[tuple[int, int]], last: list[int]
) -> None:
    """Chains, loops, and multipliers whose own block is zero until their neighbours are eliminated.

    Catches: fill-in left out, an update of the wrong block, a multiplier eliminated first.
    """
    made, blocks, full, _ = _system(n, pairs, last)
    b = generator(2).normal(size=(n, 6))
    expected = np.linalg.solve(full, b.ravel()).reshape(n, 6)
    assert kernels.factor(made, blocks)
    kernels.solve(made, blocks, b)
    # two directions of elimination of a matrix of condition below 1e4
    np.testing.assert_allclose(b, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max(initial=0.0))


def test_chains_and_trees_fill_nothing_in() -> None:
    """As many blocks as are given.

    Catches: an order by number, which fills trees in.
    """
    tree = [(0, 3), (1, 3), (2, 3), (3, 4), (4, 5), (4, 6)]
    for pairs in (CHAIN, tree):
        assert plan(7, pairs)[2] == 7 + 2 * len(pairs)


def test_a_singular_block_is_reported(mode: str) -> None:
    """False, and no exception or infinite number on the way.

    Catches: a division by a zero pivot.
    """
    made, blocks, _, _ = _system(7, CHAIN, [])
    blocks[made.order[0], :, 2] = 0.0
    assert not kernels.factor(made, blocks)


def test_inversion_pivots(mode: str) -> None:
    """A matrix with a zero first pivot.

    Catches: elimination without exchange of rows, columns left exchanged.
    """
    A = generator(6).normal(size=(6, 6))
    A[0, 0] = 0.0
    B = A.copy()
    assert kernels.invert(B)
    np.testing.assert_allclose(A @ B, np.eye(6), rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("nodes", [[], [3], [6, 0, 2, 5, 1, 4]])
def test_the_compliance_is_the_inverse_at_its_nodes(mode: str, nodes: list[int]) -> None:
    """For none, for one node, and for more than are solved together, in any order; a row for each unit.

    Catches: columns of the wrong node, a last batch that is shorter, right sides left from the batch before.
    """
    made, blocks, full, _ = _system(7, LOOP, [])
    assert kernels.factor(made, blocks)
    found = np.zeros((6 * len(nodes), 6 * len(nodes)))
    kernels.compliance(made, blocks, np.array(nodes, dtype=np.int64), found)
    rows = np.array([6 * n + k for n in nodes for k in range(6)], dtype=np.int64)
    expected = np.linalg.inv(full)[np.ix_(rows, rows)].T
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max(initial=0.0))
