"""What a person runs: the command line `roletrust` and the experiments behind it."""

from importlib.util import find_spec

if find_spec("typer") is None:
    raise ModuleNotFoundError("the command line needs more than the library: pip install 'roletrust-env[cli]'")
