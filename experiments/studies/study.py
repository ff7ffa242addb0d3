"""The runner of all studies: their options, the runs that they keep, and the files that they write
and publish.
"""

import json
import math
import shlex
import shutil
import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Generic, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from matplotlib.figure import Figure

from roletrust_env.benchmarking.pool import ONE_THREAD, TRIES, WorkerPool, cores
from roletrust_env.benchmarking.schema import reason
from roletrust_env.metrics.confidence import Estimate, estimate
from roletrust_env.storage.files import prepare_folder, write_csv, write_json, write_text
from roletrust_env.storage.provenance import software
from roletrust_experiments.commands.console import progress_bar
from roletrust_experiments.plots.figure_files import write_figure

DOCS = Path(__file__).parents[2] / "docs"

Options = TypeVar("Options", bound=tuple[Any, ...])
Run = dict[str, Any]
"""Result of a run as plain data; `failed` has the reason of a run that raised an error."""


def plus_minus(value: Estimate) -> str:
    """Return a mean and half its interval.

    Example:
        >>> plus_minus(Estimate(0.25, 0.0121))
        '0.250 ± 0.012'
    """
    return f"{value.mean + 0.0:.3f} ± {value.half:.3f}"


class Recipe(NamedTuple, Generic[Options]):
    """What makes some published files.

    Attributes:
        options: Options of the study, a `NamedTuple`: a tuple is an option that may be repeated,
            False is a flag.
        files: Path below `docs/` of each published file, by its name in the folder of the study.
    """

    options: Options
    files: Mapping[str, str] = {}


class Study(Generic[Options]):
    """A study that is being run.

    Args:
        module: Module of the study. Its documentation is the help, and the first of its `RECIPES`
            the default.
        arguments: Arguments of the command.

    Attributes:
        recipe: Name of the recipe, also that of the folder in `results/`.
        options: Its options, with those of the command.
        seed: Random seed.
        workers: Number of processes.
        out: Folder of the results.
        again: Begin again, and overwrite what is there.
        command: Command that repeats the study.
    """

    def __init__(self, module: ModuleType, arguments: Sequence[str]) -> None:
        self._name, recipes = module.__name__, module.RECIPES
        program, first = f"python -m {self._name.replace('.', ' ')}", next(iter(recipes))
        given = _parser(program, module.__doc__, recipes).parse_args(arguments)
        self.recipe: str = given.recipe or first
        self._published, self._publish, self.again = (
            recipes[self.recipe].files,
            given.publish,
            given.force,
        )
        options: tuple[Options, list[str]] = _given(recipes[self.recipe].options, given)
        self.options, words = options
        self.seed: int = given.seed
        self.workers: int = given.workers or cores()
        self.out: Path = given.out or Path("results") / self.recipe
        seeded = ["--seed", str(self.seed)] if self.seed else []
        chosen = [] if self.recipe == first else [self.recipe]
        self.command = " ".join([program, *map(shlex.quote, [*chosen, *words, *seeded])])
        self._written: list[str] = []
        self._failed = False

    def play(
        self,
        work: Callable[..., Run],
        jobs: Mapping[str, tuple[Any, ...]],
        settings: Mapping[str, Any],
    ) -> dict[str, Run]:
        """Play the runs that are not kept in `runs.json`, each in a process, and return all that
        did not fail.

        The file is written after each run, so that an interrupted study continues.

        Args:
            work: Function of a module that plays a run.
            jobs: Arguments of each run, by key.
            settings: Settings that runs must share to be compared; the seed and the version of the
                software are added.

        Raises:
            ValueError: All runs failed, or the file has runs with other settings.
        """
        path = self.out / "runs.json"
        made_with = json.loads(
            json.dumps({"study": self._name, "seed": self.seed, **settings, **software()})
        )
        finished = {} if self.again or not path.exists() else _kept(path, made_with)
        missing = {key: arguments for key, arguments in jobs.items() if key not in finished}
        with progress_bar() as bar:
            task = bar.add_task(self.recipe, total=len(jobs), completed=len(jobs) - len(missing))
            for key, run in _played(work, missing, self.workers):
                if "failed" in run:
                    print(f"{key}: {run['failed']}", file=sys.stderr)
                    self._failed = True
                else:
                    finished[key] = run
                    write_json(
                        path,
                        {
                            "made_with": made_with,
                            "runs": {key: finished[key] for key in sorted(finished)},
                        },
                    )
                bar.update(task, advance=1)
        if not any(key in finished for key in jobs):
            raise ValueError("no run was finished, so there is nothing to show")
        return {key: finished[key] for key in jobs if key in finished}

    def csv(self, name: str, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
        """Write a table of numbers."""
        write_csv(self.out / name, header, rows)
        self._written.append(name)

    def figure(self, name: str, figure: Figure) -> None:
        """Write a chart with 256 colours, see `write_figure`."""
        write_figure(self.out / name, figure, colours=256)
        self._written.append(name)

    def text(self, name: str, text: str) -> None:
        """Write a text."""
        write_text(self.out / name, text)
        self._written.append(name)

    def page(self, name: str, *parts: str) -> None:
        """Write a page of Markdown from its parts, without the empty ones, and print it."""
        text = "\n\n".join(part for part in parts if part) + "\n"
        self.text(name, text)
        print(text)

    def end(self) -> None:
        """Write `study.json`, say what was written, and copy the published files to `docs/` if
        `--publish` is given.
        """
        about = {"command": self.command, "options": self.options._asdict(), "seed": self.seed}  # type: ignore[attr-defined]
        write_json(
            self.out / "study.json", json.loads(json.dumps({**about, **software()}, default=str))
        )
        print(f"Written to {self.out}: {', '.join([*self._written, 'study.json'])}")
        for name, place in self._published.items() if self._publish else ():
            (DOCS / place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(self.out / name, DOCS / place)
        if self._failed:
            raise SystemExit(1)


def run(name: str, arguments: Sequence[str]) -> None:
    """Run the `main` of a module such as `studies.sybils`. An error of the user is one line, with
    exit code 2.
    """
    module = import_module(name)
    study: Study[Any] = Study(module, arguments)
    try:
        prepare_folder(study.out)
        module.main(study)
    except KeyboardInterrupt:
        print("Stopped. Finished runs are kept; repeat the command to continue.", file=sys.stderr)
        raise SystemExit(130) from None
    except (ValueError, OSError) as error:
        print(f"Error: {error}", file=sys.stderr)
        raise SystemExit(2) from error
    study.end()


def mean_of(values: Sequence[float | None]) -> Estimate:
    """Return the mean over runs with its 95% interval. None counts as undefined."""
    return estimate(np.array(values, np.float64))


def with_ends(columns: Iterable[str], ends: Sequence[str] = ("", "_low", "_high")) -> list[str]:
    """Return the headings of columns that have an interval each."""
    return [f"{name}{end}" for name in columns for end in ends]


def _parser(program: str, about: str | None, recipes: Mapping[str, Recipe[Any]]) -> ArgumentParser:
    default = next(iter(recipes.values())).options
    parser = ArgumentParser(
        program, description=about, formatter_class=RawDescriptionHelpFormatter, allow_abbrev=False
    )
    if len(recipes) > 1:
        parser.add_argument(
            "recipe",
            nargs="?",
            choices=recipes,
            help=f"what is made; {next(iter(recipes))} if left out",
        )
    else:
        parser.set_defaults(recipe=None)
    types = get_type_hints(type(default))
    for field, value in default._asdict().items():
        option = f"--{field.replace('_', '-')}"
        if isinstance(value, bool):
            parser.add_argument(option, dest=field, action="store_true", default=None)
        elif isinstance(value, tuple):
            kind, shown = get_args(types[field])[0], ", ".join(map(str, value)) or "none"
            parser.add_argument(
                option, dest=field, action="append", type=kind, help=f"repeat for more; {shown}"
            )
        else:
            parser.add_argument(option, dest=field, type=type(value), help=str(value))
    parser.add_argument("--seed", type=int, default=0, help="random seed")
    parser.add_argument(
        "--workers", type=int, help="number of processes; by default one for each core"
    )
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the results")
    parser.add_argument(
        "--force", action="store_true", help="begin again, and overwrite runs that are kept"
    )
    parser.add_argument("--publish", action="store_true", help="copy the published files to docs/")
    return parser


def _given(default: Options, given: Namespace) -> tuple[Options, list[str]]:
    """Return the options with those of a command, and the words of those that differ."""
    changed: dict[str, Any] = {}
    words: list[str] = []
    for field, usual in default._asdict().items():  # type: ignore[attr-defined]
        value = getattr(given, field)
        if value is None:
            continue
        option = f"--{field.replace('_', '-')}"
        changed[field] = tuple(dict.fromkeys(value)) if isinstance(value, list) else value
        if changed[field] != usual:
            several = changed[field] if isinstance(changed[field], tuple) else (changed[field],)
            words += (
                [option]
                if value is True
                else [word for argument in several for word in (option, str(argument))]
            )
    return default._replace(**changed), words  # type: ignore[attr-defined]


def _kept(path: Path, made_with: Run) -> dict[str, Run]:
    """Return the runs of a file, all with these settings."""
    else_ = "give --force to begin again, or another --out"
    try:
        stored = json.loads(path.read_text(encoding="utf-8"))
        before, runs = (
            {"seed": 0, **stored["made_with"]},
            {str(key): dict(run) for key, run in stored["runs"].items()},
        )
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(
            f"{path} is damaged, or no file of runs ({type(error).__name__}: {error}); {else_}"
        ) from None
    if other := [
        name for name in {**before, **made_with} if before.get(name) != made_with.get(name)
    ]:
        differences = "; ".join(
            f"{name} is {before.get(name)!r} there and {made_with.get(name)!r} here"
            for name in other
        )
        raise ValueError(f"{path} holds runs with other settings: {differences}; {else_}")
    return runs


def _played(
    work: Callable[..., Run], jobs: Mapping[str, tuple[Any, ...]], workers: int
) -> Iterator[tuple[str, Run]]:
    """Play runs and yield each with its key when it is finished; a single worker is this
    process.
    """
    if workers == 1:
        for key, arguments in jobs.items():
            yield key, _play_safely(work, *arguments)
        return
    pool: WorkerPool[str] = WorkerPool(_play_safely, workers, ONE_THREAD)
    with pool:
        for key, result in pool.run(
            {key: (work, *arguments) for key, arguments in jobs.items()}, math.inf, TRIES
        ):
            died = {
                "failed": f"its process died {TRIES} times, the last time with exit code {result.exit_code}"  # noqa: E501
            }
            yield key, died if result.exit_code is not None else result.value


def _play_safely(work: Callable[..., Run], *arguments: Any) -> Run:
    """Play a run. An exception of a trust model or an attacker becomes a failed run."""
    try:
        return work(*arguments)
    except (Exception, SystemExit) as error:  # plug-in code may raise anything
        return {"failed": reason(error)}
