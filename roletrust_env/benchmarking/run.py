"""Benchmark runs from Python, with the same suites, cells and results as the command `roletrust
benchmark`.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from pathlib import Path
from typing import Any

from roletrust_env.benchmarking.cells import check_attacks
from roletrust_env.benchmarking.entrants import Entrant, name_entrants, pack, temporary_registration
from roletrust_env.benchmarking.entries import published_cells
from roletrust_env.benchmarking.leaderboard import Leaderboard
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
from roletrust_env.evaluation.attackers import Attacker
from roletrust_env.evaluation.specs import parse_kinds
from roletrust_env.parameters import truth_value, whole_number
from roletrust_env.storage.files import prepare_folder

OnStart = Callable[[Sequence[Any], int], None]
"""Callback for the start of a run. It receives the cells to play and the number of all cells."""

OnCell = Callable[[Any, CellResult], None]
"""Callback for each cell that has been played. It receives the cell and its result."""


def benchmark(
    models: Entrant | list[Entrant] | tuple[Entrant, ...] | None = None,
    suite: str | Path | Suite = "standard",
    *,
    attacks: str | Sequence[str] | None = None,
    attackers: Mapping[str, Attacker] | None = None,
    search: bool = False,
    workers: int | None = None,
    out: str | Path | None = None,
    force: bool = False,
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
        workers: Number of processes. None means one for each core. With 0 the cells are played in
            this process.
        out: Folder of the results. A stopped run continues from there. None writes no files.
        force: Start again, and delete earlier results in `out`.
        progress: Show a progress bar.

    Returns:
        The leaderboard. It displays as a table in a terminal and in a notebook.

    Raises:
        ValueError: A name is unknown, a model or an attack cannot be created, the suite is one for
            learners, or `out` contains another run.
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
    if isinstance(attacks, str):
        attacks = [attacks]
    for name, chosen in (("models", models), ("attacks", attacks)):
        if isinstance(chosen, list | tuple) and not chosen:
            raise ValueError(f"{name} is empty; None means those of the suite")
    workers = None if workers is None else whole_number("workers", workers)
    force, progress = truth_value("force", force), truth_value("progress", progress)
    chosen_suite = _of_models(suite)
    if truth_value("search", search):
        chosen_suite = with_search(chosen_suite)
    if models is None:
        return placed(without_models(chosen_suite), [])
    everything = isinstance(models, str) and models == "all"
    given: list[Any] = list(models) if isinstance(models, list | tuple) else [models]
    names, instances = name_entrants(chosen_suite.models if everything else given)
    with temporary_registration(instances):
        selected = selected_suite(chosen_suite, names, attacks or (), attackers)
        pool: Pool = InProcess() if workers == 0 else LocalPool(workers, pack(instances))
        with ExitStack() as stack:
            listeners = _bar(stack, selected.name) if progress else {}
            cells = play_suite(
                selected, pool, out=None if out is None else Path(out), force=force, **listeners
            )
        return placed(selected, cells)


def placed(suite: Suite, cells: Sequence[StoredCell]) -> Leaderboard:
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
    force: bool = False,
    on_start: OnStart = lambda remaining, total: None,
    on_cell: OnCell = lambda cell, result: None,
) -> list[StoredCell]:
    """Play the cells of a suite that are not stored yet, and return all of them.

    Args:
        suite: Suite to play.
        pool: Processes that play the cells.
        out: Folder of `results.sqlite`. None writes no file.
        force: Start again, and delete earlier results in the folder.
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
    with ResultStore(out / "results.sqlite", suite, overwrite=force) as store:
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


def _of_models(suite: str | Path | Suite) -> Suite:
    """Return a suite of trust models. Raise an error for another type of suite."""
    if not isinstance(suite, str | Path | SuiteSchema):
        raise ValueError(
            f"suite is {suite!r}; it must be a Suite, the name of one, or the path of a TOML file"
        )
    loaded = suite if isinstance(suite, SuiteSchema) else load_suite(suite)
    if not isinstance(loaded, Suite):
        raise ValueError(
            f"suite {loaded.name} is for {loaded.kind}; play it with `roletrust benchmark --suite "
            f"{loaded.name}`"
        )
    return loaded


def _bar(stack: ExitStack, name: str) -> dict[str, Any]:
    """Return callbacks of `play_suite` that update a progress bar. The bar closes with the
    stack.
    """
    from tqdm import tqdm

    bar = stack.enter_context(tqdm(desc=f"Playing {name}", unit="cell"))

    def begin(remaining: Sequence[Any], total: int) -> None:
        bar.total = total
        bar.update(total - len(remaining))

    def advance(cell: Any, result: CellResult) -> None:
        if result.failed:
            bar.write(f"{cell.key}: {result.failed}")
        bar.update()

    return {"on_start": begin, "on_cell": advance}
