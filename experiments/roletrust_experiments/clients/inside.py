"""What runs in a client's own environment: its checks, one after the other, each said in a line of a report."""

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
        name: of the client, a file beside this one.
        report: a file that gets one line of JSON for the versions, and one for each check.
        packages: whose versions are told.
    """
    with Path(report).open("w", encoding="utf-8", buffering=1) as lines:
        print(json.dumps({package: version(package) for package in packages}), file=lines)
        for check in import_module(f"roletrust_experiments.clients.{name}").CHECKS:
            began, passed = perf_counter(), True
            try:
                check()
            except Exception:  # whatever a foreign library raises; the others are tried all the same
                traceback.print_exc()
                passed = False
            print(json.dumps([inspect.getdoc(check), passed, perf_counter() - began]), file=lines)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], sys.argv[3:])
