"""Renew VERIFICATION.md, the table of known answers beside ours, from the cases: python studies/make_verification.py

The same table as `fem-biobot verify` writes, without pictures; and what reports say of it, `study/verified.json`.
"""

from __future__ import annotations

import sys
from pathlib import Path

from fem_biobot.files import write_json, write_text
from fem_biobot.progress import reporting
from fem_biobot.study.provenance import STATUS, status_of
from fem_biobot.verification.registry import chosen, not_covered
from fem_biobot.verification.report import failures, markdown
from fem_biobot.verification.verify import Count, summary, verify

PAGE = Path(__file__).resolve().parent / "VERIFICATION.md"


def main() -> int:
    """Compute all cases and write the page, also where a row fails; 1 then."""
    with reporting() as reporter:
        outcomes = verify(chosen([]), reporter=reporter)
    write_text(PAGE, markdown(outcomes, figures=False))
    found = summary(outcomes, not_covered(), complete=True)
    write_json(STATUS, status_of(found["cases"], found["versions"]))
    print(*failures(outcomes), Count.of(outcomes).words(), sep="\n")
    return 0 if Count.of(outcomes).good else 1


if __name__ == "__main__":
    sys.exit(main())
