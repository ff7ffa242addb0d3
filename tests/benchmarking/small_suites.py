"""Suites that take a second or two."""

from typing import Any

from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import read_suite

MARKET = {
    "preset": "market",
    "set": {
        "max_cycles": 12,
        "agents": [
            {"role": "SR", "count": 4, "noise": 0.05},
            {"role": "SP", "count": 3, "ability": [0.3, 1.0]},
        ],
    },
}
TRACKS: dict[str, Any] = {
    "honest": {},
    "raters": {"roles": ["SR"], "shares": [0.25, 0.5]},
    "providers": {"roles": ["SP"], "shares": [0.3]},
    "identities": {"roles": ["SR", "SP"], "shares": [0.3], "reserve": 2},
}


def small(**fields: Any) -> Suite:
    """Return a suite on a market of four raters and three providers."""
    defaults = {
        "models": ["mean", "constant"],
        "scenarios": {"market": MARKET},
        "tracks": TRACKS,
        "methods": ["scripted"],
        "games": 4,
    }
    return read_suite(defaults | fields, "small")
