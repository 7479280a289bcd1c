"""Renew VERIFICATION.md, the table of known answers beside ours, from the cases: python studies/make_verification.py

The same table as `fem-biobot verify` writes, without pictures.
"""

from __future__ import annotations

import sys
from pathlib import Path

from fem_biobot.files import write_text
from fem_biobot.progress import reporting
from fem_biobot.verification.registry import chosen
from fem_biobot.verification.report import failures, markdown
from fem_biobot.verification.verify import Count, verify

PAGE = Path(__file__).resolve().parent / "VERIFICATION.md"


def main() -> int:
    """Compute all cases and write the page, also where a row fails; 1 then."""
    with reporting() as reporter:
        outcomes = verify(chosen([]), reporter=reporter)
    write_text(PAGE, markdown(outcomes, figures=False))
    print(*failures(outcomes), Count.of(outcomes).words(), sep="\n")
    return 0 if Count.of(outcomes).good else 1


if __name__ == "__main__":
    sys.exit(main())
