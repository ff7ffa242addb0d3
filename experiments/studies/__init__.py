"""Studies: what made the pages of results in `docs/`. Each runs from a checkout, as `python -m
studies NAME`.
"""

from pathlib import Path

SUITES = Path(__file__).parent / "suites"
"""Folder of the suites that only studies play."""
