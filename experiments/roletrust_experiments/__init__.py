"""The command line `roletrust` and the experiments behind it."""

import os
import sys

_PACKAGES = ("typer", "filelock", "rich", "jinja2", "matplotlib", "yaml")  # of the extra `cli`


def main() -> None:
    """Run `roletrust`; without the extra `cli` or a working directory, leave with 2 and one line
    that says so.
    """
    try:
        os.getcwd()  # PettingZoo asks for it
    except FileNotFoundError:
        print("roletrust needs a working directory, and this one has been deleted", file=sys.stderr)
        raise SystemExit(2) from None
    try:
        from roletrust_experiments.cli import main as run

        run()
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in _PACKAGES:
            raise
        print(f"roletrust needs {error.name}: pip install 'roletrust-env[cli]'", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None
