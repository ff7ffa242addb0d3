"""Benchmark runs as one call each: of trust models, and of learners."""

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, TypeVar

from roletrust_env.benchmarking.cells import check_attacks
from roletrust_env.benchmarking.entrants import Entrant, name_entrants, pack, temporary_registration
from roletrust_env.benchmarking.entries import published_cells
from roletrust_env.benchmarking.leaderboard import Leaderboard
from roletrust_env.benchmarking.learner_board import LearnerBoard
from roletrust_env.benchmarking.learners.learner import make_search_method, registry
from roletrust_env.benchmarking.learners.suite import LearnersSuite
from roletrust_env.benchmarking.pool import LocalPool, Pool, play_safely
from roletrust_env.benchmarking.schema import CellResult, SuiteSchema
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.suite import (
    Suite,
    with_attackers,
    with_models,
    with_search,
    without_models,
)
from roletrust_env.benchmarking.suite_files import AnySuite, load_suite
from roletrust_env.evaluation.agreed import check_recorded
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import check_installed, parse_kinds
from roletrust_env.game.policy import registry as attackers_registry
from roletrust_env.parameters import truth_value, whole_number
from roletrust_env.storage.files import prepare_folder
from roletrust_env.trust.model import registry as trust_models

SuiteT = TypeVar("SuiteT", Suite, LearnersSuite)
_QUIET_S = 10  # seconds between two lines of a progress bar where no bar can move

OnStart = Callable[[Sequence[Any], int], None]
"""Callback for the start of a run. It receives the cells to play and the number of all cells."""

OnCell = Callable[[Any, CellResult], None]
"""Callback for each cell that has been played. It receives the cell and its result."""


def benchmark(
    models: Entrant | Sequence[Entrant] | None = None,
    suite: str | Path | Suite = "standard",
    *,
    attacks: str | Sequence[str] | None = None,
    attackers: Mapping[str, Attacker] | None = None,
    search: bool = False,
    workers: int | Pool | None = None,
    out: str | Path | None = None,
    progress: bool = True,
) -> Leaderboard:
    """Attack trust models in the worlds of a suite, and rank them by the worst case next to the
    published models.

    Args:
        models: Trust models: a spec such as `"role-trust:lam=0.7"`, a class, an instance, or a list
            of these. `"all"` means the models of the suite. None plays nothing: the leaderboard
            then has the published models.
        suite: Name of a suite, path of a TOML file, or a `Suite`.
        attacks: Specs of scripted attacks, or one spec. They and the attackers replace all attacks
            of the suite, so that published models, which did not face them, are left out.
        attackers: Trained attackers by name that play in every setting, such as a
            `CoalitionAttacker`.
        search: Also search for attacks, which takes hours instead of minutes.
        workers: Number of processes, or a pool such as `cluster.Cluster`. None means one process
            for each core. With 0 the cells are played in this process.
        out: Folder of the results. A stopped run continues from there. None writes no files.
        progress: Show a progress bar.

    Returns:
        The leaderboard. It displays as a table in a terminal and in a notebook.

    Raises:
        ValueError: A name is unknown, a model or an attack cannot be created, there are attacks
            without a model, the suite is one for learners or has no published models, or `out`
            contains another run.
        OSError: `out` cannot be written.

    Example:
        >>> from roletrust_env.benchmarking import benchmark, load_suite
        >>> suite = load_suite("quick")
        >>> small = suite.worlds.model_copy(update={"selection": 1, "measured": 2})
        >>> suite = suite.model_copy(update={"worlds": small, "games": 1, "selection_games": 1})
        >>> attacks = ["bad-mouthing", "on-off", "sybil"]
        >>> board = benchmark("mean", suite, attacks=attacks, workers=0, progress=False)
        >>> sorted({row.model for row in board.rows})
        ['mean', 'own-experience', 'solo-threshold']
    """
    attacks = [attacks] if isinstance(attacks, str) else attacks
    for name, chosen in (("models", models), ("attacks", attacks)):
        if isinstance(chosen, list | tuple) and not chosen:
            raise ValueError(f"{name} is empty; None means those of the suite")
    progress = truth_value("progress", progress)
    chosen_suite = _loaded(suite, Suite, "benchmark_learners")
    if truth_value("search", search):
        chosen_suite = with_search(chosen_suite)
    if models is None:
        if attacks or attackers:
            raise ValueError(f"models is None; attacks {attacks or [*(attackers or ())]} need one")
        board = _placed(without_models(chosen_suite), [])
        if all(row.missing for row in board.rows):
            raise ValueError(
                f"suite {chosen_suite.name} does not have models that are published with "
                f"{', '.join(chosen_suite.methods)}; name those to play"
            )
        return board
    everything = isinstance(models, str) and models == "all"
    given: list[Any] = list(models) if isinstance(models, list | tuple) else [models]
    names, instances = name_entrants(chosen_suite.models if everything else given)
    with temporary_registration(instances):
        selected = selected_suite(chosen_suite, names, attacks or (), attackers)
        board = _placed(selected, _play(selected, workers, out, progress, pack(instances)))
    if out is not None:
        board.write(out)
    return board


def benchmark_learners(
    learners: str | Sequence[str] | None = None,
    suite: str | Path | LearnersSuite = "learners",
    *,
    workers: int | Pool | None = None,
    out: str | Path | None = None,
    progress: bool = True,
) -> LearnerBoard:
    """Let learners and search methods find attacks under the budgets of a suite, and rank them.

    Args:
        learners: Names of search methods or learners, or `package.module:Class[:key=value,...]`;
            `"all"` among them means those of the suite, as None does.
        suite: Name of a suite for learners, path of a TOML file, or a `LearnersSuite`.
        workers: See `benchmark`.
        out: Folder of the results. A stopped run continues from there. None writes no files.
        progress: Show a progress bar.

    Raises:
        ValueError: A name is unknown, a learner cannot be created, the suite is one for trust
            models, or `out` contains another run.
        OSError: `out` cannot be written.

    Example:
        >>> from roletrust_env.benchmarking import benchmark_learners, load_suite
        >>> changes = {"budgets": (4_000,), "seeds": (0,), "games": 2}
        >>> suite = load_suite("learners-quick").model_copy(update=changes)
        >>> board = benchmark_learners("random search", suite, workers=0, progress=False)
        >>> board.ranking
        ['random search']
    """
    loaded = _loaded(suite, LearnersSuite, "benchmark")
    if isinstance(learners, list | tuple) and not learners:
        raise ValueError("learners is empty; None means those of the suite")
    named = [learners] if isinstance(learners, str) else [*(learners or ["all"])]
    asked = [part for name in named for part in (loaded.learners if name == "all" else [name])]
    selected = loaded.model_copy(update={"learners": tuple(dict.fromkeys(asked))})
    for name in selected.learners:
        make_search_method(name, next(iter(selected.tasks.values())).id)
    cells = _play(selected, workers, out, truth_value("progress", progress))
    board = LearnerBoard.of(selected, cells)
    if out is not None:
        board.write(out)
    return board


def check_suite_installed(suite: AnySuite) -> None:
    """Refuse a suite that names models, attacks or learners that are not installed, so that its
    file cannot make Python import a module.

    Raises:
        ValueError: It names one.
    """
    if isinstance(suite, LearnersSuite):
        known = search_methods.names()
        names = [name for name in suite.learners if name.partition(":")[0] not in known]
        check_installed(registry, names)
        return
    check_installed(trust_models, suite.models)
    check_installed(attackers_registry, (*suite.attacks, *suite.usual.values()))
    check_recorded(replayed.record for replayed in suite.replayed)


def _placed(suite: Suite, cells: Sequence[StoredCell]) -> Leaderboard:
    """Return the leaderboard of a run with the published models that were measured as its own."""
    with_published, more = published_cells(suite)
    return Leaderboard.of(with_published, [*cells, *more])


def selected_suite(
    suite: Suite,
    models: Sequence[str],
    attacks: Sequence[str] = (),
    attackers: Mapping[str, Attacker] | None = None,
) -> Suite:
    """Return the suite with other trust models and attacks, and check that all of them can be
    created.

    Args:
        suite: Suite to change.
        models: Specs of trust models that replace those of the suite.
        attacks: Specs of scripted attacks. They and the attackers replace all attacks of the suite,
            unless both are empty.
        attackers: Trained attackers by name, see `benchmark`.

    Raises:
        ValueError: A name is unknown, or a model or an attack cannot be created.
    """
    selected = with_models(suite, models)
    if attacks or attackers:
        replaced = {"replayed"} if attacks else {"replayed", "scripts"}
        methods = tuple(name for name in suite.methods if name not in replaced)
        named = tuple(dict.fromkeys(attacks)) or suite.attacks
        changes = {"attacks": named, "methods": methods, "replayed": ()}
        selected = selected.model_copy(update=changes)
    if attackers:
        selected = with_attackers(selected, attackers)
    parse_kinds((*selected.attacks, *selected.usual.values()), selected.worlds.world("measured", 0))
    check_attacks(selected)
    return selected


def play_suite(
    suite: AnySuite,
    pool: Pool,
    *,
    out: Path | None = None,
    on_start: OnStart = lambda remaining, total: None,
    on_cell: OnCell = lambda cell, result: None,
) -> list[StoredCell]:
    """Play the cells of a suite that are not stored yet, and return all of them.

    Args:
        suite: Suite to play.
        pool: Processes that play the cells.
        out: Folder of `results.sqlite`. None writes no file.
        on_start: See `OnStart`.
        on_cell: See `OnCell`.

    Raises:
        ValueError: The folder contains another run, or another run writes to it.
        OSError: The folder cannot be written.
    """
    every = suite.cells()
    if out is None:
        on_start(every, len(every))
        played = []
        with closing(pool.play(suite, every)) as playing:
            for cell, result in playing:
                played.append(StoredCell(cell, result))
                on_cell(cell, result)
        return sorted(played, key=lambda row: str(row.cell.key))
    prepare_folder(out)
    with ResultStore(out / "results.sqlite", suite) as store:
        finished = store.finished_keys()
        remaining = [cell for cell in every if cell.key not in finished]
        on_start(remaining, len(every))
        with closing(pool.play(suite, remaining)) as playing:
            for cell, result in playing:
                store.add(cell, result)
                on_cell(cell, result)
        return store.all()


class InProcess:
    """Pool that plays the cells one after another in this process, without a time limit."""

    def play(self, suite: SuiteSchema, cells: Sequence[Any]) -> Any:
        """See `Pool.play`."""
        for cell in cells:
            yield cell, play_safely(suite, cell)


def _loaded(suite: Any, kind: type[SuiteT], other: str) -> SuiteT:
    """Return a suite of a kind. Raise an error that names the other function for another kind."""
    if not isinstance(suite, str | Path | SuiteSchema):
        raise ValueError(
            f"suite is {suite!r}; it must be a {kind.__name__}, the name of one, or the path of a "
            "TOML file"
        )
    loaded = suite if isinstance(suite, SuiteSchema) else load_suite(suite)
    if not isinstance(loaded, kind):
        raise ValueError(f"suite {loaded.name} is for {loaded.kind}; {other} plays it")
    return loaded


def _play(
    suite: AnySuite,
    workers: int | Pool | None,
    out: str | Path | None,
    progress: bool,
    packed: bytes = b"",
) -> list[StoredCell]:
    """Play a suite with a progress bar."""
    from tqdm import tqdm

    pool: Any = workers
    if not hasattr(workers, "play"):
        number = None if workers is None else whole_number("workers", workers)
        pool = InProcess() if number == 0 else LocalPool(number, packed)
    folder, quiet_s = None if out is None else Path(out), 0 if sys.stderr.isatty() else _QUIET_S
    with tqdm(
        desc=f"Playing {suite.name}",
        unit="cell",
        disable=not progress,
        leave=False,
        mininterval=quiet_s or 0.1,
        delay=quiet_s,
    ) as bar:

        def begin(remaining: Sequence[Any], total: int) -> None:
            bar.total = total
            bar.update(total - len(remaining))

        def advance(cell: Any, result: CellResult) -> None:
            if result.failed and progress:
                bar.write(f"{cell.key}: {result.failed}", file=sys.stderr)
            bar.update()

        return play_suite(suite, pool, out=folder, on_start=begin, on_cell=advance)
