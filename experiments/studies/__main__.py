"""The list of all studies: `python -m studies`."""

from importlib import import_module
from pkgutil import iter_modules

import studies


def main() -> None:
    """Print each study with the first line of its documentation, and its recipes."""
    for found in iter_modules(studies.__path__):
        try:
            module = import_module(f"studies.{found.name}")
        except ModuleNotFoundError as error:
            print(f"{found.name:12} needs {error.name}: make setup")
            continue
        if recipes := getattr(module, "RECIPES", None):
            print(f"{found.name:12} {(module.__doc__ or '').partition(chr(10))[0]}")
            if len(recipes) > 1:
                print(f"{'':12} {', '.join(recipes)}")


if __name__ == "__main__":
    main()
