"""Compaction of tissue between its pillars: how wide it is in the end, and the section that follows from its volume.

Laws of numbers alone, after Pagan-Diaz et al. 2018 (Adv. Funct. Mater.): section 2.5 and Fig. 6 for widths.
"""

from __future__ import annotations

import math

from fem_biobot.errors import DesignError

# seeding widths that the paper tried [mm]; the law is not used outside them
NARROWEST, WIDEST = 3.5, 14.0
# W0 / WF at the narrowest, and its rise with each doubling of the width [1]
RATIO, PER_DOUBLING = 1.58, 0.75
# depth of the trench that the tissue is seeded in [mm]: trench_depth of the paper's section 2.3
TRENCH_DEPTH = 0.4


def compaction_ratio(seeded_width: float) -> float:
    """Seeded over final width ``W0 / WF = 1.58 + 0.75 log2(W0 / 3.5 mm)`` [1].

    Notes
    -----
    Meets both ratios that the paper prints, 1.58 at 3.5 mm and 3.08 at 14 mm, with the slope of its Fig. 6c; at 7 mm
    it gives 2.33. The figure's caption prints the ratio upside down.

    Raises
    ------
    DesignError
        A width outside those tried.
    """
    if not NARROWEST <= seeded_width <= WIDEST:
        raise DesignError(
            f"seeded_width: found {seeded_width:g} mm, expected between {NARROWEST:g} and {WIDEST:g} mm, "
            "where compaction was measured"
        )
    return RATIO + PER_DOUBLING * math.log2(seeded_width / NARROWEST)


def compacted_section(
    seeded_width: float, seeded_depth: float = TRENCH_DEPTH, volume_kept: float | None = None
) -> tuple[float, float]:
    """Width and thickness of tissue after compaction [mm].

    Parameters
    ----------
    seeded_width, seeded_depth
        Of the trench that it was seeded in [mm].
    volume_kept
        Share of the seeded volume that is left; the pillars keep its length, so the thickness is what this share of
        the seeded section has over the final width. None: the thickness stays the trench's.

    Notes
    -----
    How much volume tissue loses is not printed. The two readings bound the section: at 3.5 mm both are 0.886 mm^2 for
    a share of 1 / 1.58; at 14 mm the thickness that stays gives 1.82 mm^2, the same share 3.54 mm^2.
    """
    if not seeded_depth > 0.0:
        raise DesignError(f"seeded_depth: found {seeded_depth:g} mm, expected above 0 mm")
    width = seeded_width / compaction_ratio(seeded_width)
    if volume_kept is None:
        return width, seeded_depth
    if not 0.0 < volume_kept <= 1.0:
        raise DesignError(f"volume_kept: found {volume_kept:g}, expected above 0 and at most 1")
    return width, volume_kept * seeded_width * seeded_depth / width
