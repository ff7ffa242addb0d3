"""The command line `roletrust` and the experiments behind it."""

import sys


def main() -> None:
    """Run `roletrust`; without the extra `cli`, leave with 2 and one line that says what is needed."""
    try:
        from roletrust_experiments.cli import main as run
    except ModuleNotFoundError as error:
        print(f"roletrust needs {error.name}: pip install 'roletrust-env[cli]'", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        raise SystemExit(130) from None
    run()
