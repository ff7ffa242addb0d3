"""`python -m studies NAME` runs a study; without a name it prints the list of all."""

import sys
from importlib import import_module
from pathlib import Path

from roletrust_env.errors import suggest
from studies.study import run


def main() -> None:
    """Run a study, or print each with the first line of its documentation, and its recipes."""
    places = sorted(Path(__file__).parent.glob("*.py"))
    names = [place.stem for place in places if "\nRECIPES = " in place.read_text(encoding="utf-8")]
    for name in sys.argv[1:2]:
        if name not in names:
            print(f"Error: no study {name!r}{suggest(name, names)}", file=sys.stderr)
            raise SystemExit(2)
        run(f"studies.{name}", sys.argv[2:])
        return
    for name in names:
        try:
            module = import_module(f"studies.{name}")
        except ModuleNotFoundError as error:
            print(f"{name:12} needs {error.name}: make setup")
            continue
        print(f"{name:12} {(module.__doc__ or '').partition(chr(10))[0]}")
        if len(module.RECIPES) > 1:
            print(f"{'':12} {', '.join(module.RECIPES)}")


if __name__ == "__main__":
    main()
