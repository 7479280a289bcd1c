"""What tests of several folders are given by name."""

from __future__ import annotations

from typing import Any

import pytest

from fem_biobot.mesh.geometry import GmshMissing, import_gmsh


@pytest.fixture(scope="session")
def gmsh() -> Any:
    """The gmsh module, or a skip with the reason."""
    try:
        return import_gmsh()
    except GmshMissing as missing:
        pytest.skip(str(missing))
