"""Checks of a client in its own environment, one after the other, each with a line in a report."""

import inspect
import json
import sys
import traceback
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from time import perf_counter


def main(name: str, report: str, packages: list[str]) -> None:
    """Run a client's checks.

    Args:
        name: Name of the client, a file beside this one.
        report: File that gets one line of JSON for the versions, and one for each check.
        packages: Packages whose versions are reported.
    """
    with Path(report).open("w", encoding="utf-8", buffering=1) as lines:
        print(json.dumps({package: version(package) for package in packages}), file=lines)
        for check in import_module(f"roletrust_experiments.clients.{name}").CHECKS:
            began, passed = perf_counter(), True
            try:
                check()
            except Exception:  # from a foreign library; the other checks still run
                traceback.print_exc()
                passed = False
            print(json.dumps([inspect.getdoc(check), passed, perf_counter() - began]), file=lines)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
