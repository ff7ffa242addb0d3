"""Which agents to trust, from ratings: `rate` and what it returns."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_args

import numpy as np

from roletrust_env.logs.calibration import Calibration, Past, calibrated, cuts, replayed
from roletrust_env.logs.evidence import Evidence, Role, as_dates, window
from roletrust_env.logs.explain import Explanation, find_agent
from roletrust_env.logs.explain import explain as explained
from roletrust_env.logs.log import Log, read
from roletrust_env.logs.log_rounds import numbers_of
from roletrust_env.logs.models import make_log_model
from roletrust_env.logs.names import NameList
from roletrust_env.logs.sources import Reading
from roletrust_env.logs.stream import TrustStream
from roletrust_env.storage.files import prepare_folder
from roletrust_env.storage.tables import write_table
from roletrust_env.trust.trust_run import TrustRun

MODEL = "leave-one-out"
"""Trust model unless another is given: the nearest to later ratings of the log of docs/real.md."""

ROLES: tuple[Role, ...] = get_args(Role)

Advance = Callable[[str, float], None]
"""Function that is called with what is done, and the share of it that is done."""


class Rated:
    """Trust in the agents of ratings, with its evidence.

    Attributes:
        stream: Stream that has taken the ratings, and takes further ones.
        model: Name of the trust model.
        log: The ratings, for what plays them again; None if there were earlier or later ones.
        notes: How the source was read, and what was left out, one line each.
    """

    def __init__(
        self,
        stream: TrustStream,
        model: str,
        columns: Mapping[str, Any],
        *,
        log: Log | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        """Take a stream that `rate` has made.

        Args:
            stream: Stream with evidence.
            model: Name of its trust model.
            columns: Arguments of `read` for further ratings.
            log: See the attributes.
            notes: See the attributes.
        """
        self.stream, self.model, self.log, self.notes = stream, model, log, tuple(notes)
        self._columns = dict(columns)
        self._finished: TrustStream | None = None
        self._tables = dict[Role, Any]()
        self._left_out = _left_out(stream)

    @property
    def calibration(self) -> Calibration | None:
        """What the log's past says about its trust; None if it has too few later ratings."""
        return self.stream.calibration

    @property
    def ratees(self) -> Any:
        """The rated agents as a data frame of pandas, the best first, see `table`."""
        return self.table("ratee").to_pandas()

    @property
    def raters(self) -> Any:
        """The raters as a data frame of pandas, the most trusted first, see `table`."""
        return self.table("rater").to_pandas()

    @property
    def n_ratings(self) -> int:
        """The number of ratings that count."""
        return int(self.evidence("ratee").ratings.sum())

    @property
    def rounds(self) -> int:
        """The number of rounds that count, with the running one."""
        return self._counted().rounds

    def evidence(self, role: Role) -> Evidence:
        """Return trust in the agents of a role that have ratings, with its evidence."""
        return self._counted().evidence(role)

    def table(self, role: Role) -> Any:
        """Return the agents of a role that have ratings as a table of pyarrow, the best first.

        Columns are `name`, `trust`, `ratings`, `raters` or `ratees` (their number), `independent`
        (their effective number), `last` (the time of the last rating), `role`, `since` and `until`
        (the first and the last rating of all), `model` and `version`. Ratees have `estimate`, too,
        by which they are ranked, and `low` and `high`, the interval of the mean of their later
        ratings, see `Calibration`; these are missing if nothing is calibrated.
        """
        if role not in self._tables:
            self._tables[role] = self._table(role)
        return self._tables[role]

    def _table(self, role: Role) -> Any:
        import pyarrow as arrow

        found = self.evidence(role)
        scores = {"trust": found.trust}
        if role == "ratee":
            scores["estimate"] = found.trust
            if calibration := self.calibration:
                scores["estimate"] = calibration.shrinkage.of(found.trust, found.agents)
                ends = calibration.interval(scores["estimate"], found.agents)
                scores |= dict(zip(("low", "high"), ends, strict=True))
            else:
                scores |= dict.fromkeys(("low", "high"), np.full(len(found.names), np.nan))
        counts = {
            "ratings": found.ratings,
            "raters" if role == "ratee" else "ratees": found.agents,
            "independent": found.independent,
            "last": as_dates(found.last),
        }
        columns: dict[str, Any] = {"name": found.names}
        columns |= {
            name: arrow.array(values, from_pandas=True)
            for name, values in (scores | counts).items()
        }
        same = np.zeros(len(found.names), np.int32)
        origin = {"role": role, **window(self.stream.window), "model": self.model}
        for name, text in {**origin, "version": version("roletrust-env")}.items():
            texts = arrow.array([text], arrow.string())
            columns[name] = arrow.DictionaryArray.from_arrays(same, texts)
        return arrow.table(columns).take(found.ranked(scores.get("estimate")))

    def write(self, out: Path, advance: Callable[[int], None] = lambda rows: None) -> list[Path]:
        """Write the tables of both roles: `ratees.csv` and `raters.csv` in a folder, or a single
        Parquet file.

        Args:
            out: Folder, or a file that ends in `.parquet`.
            advance: Function that is called with a number of rows that were written.

        Returns:
            The files.

        Raises:
            OSError: A file cannot be written.
        """
        import pyarrow as arrow

        single = out.suffix == ".parquet"
        prepare_folder(out.parent if single else out)
        with ThreadPoolExecutor() as pool:
            tables = dict(zip(ROLES, pool.map(self.table, ROLES), strict=True))
            if single:
                whole = arrow.concat_tables(tables.values(), promote_options="default")
                write_table(out, whole.unify_dictionaries(), advance=advance)
                return [out]
            paths = [out / f"{role}s.csv" for role in tables]
            list(pool.map(partial(write_table, advance=advance), paths, tables.values()))
            return paths

    def explain(
        self, agent: str, role: Role = "ratee", advance: Advance = lambda what, share: None
    ) -> Explanation:
        """Return what makes the trust in an agent, see `roletrust_env.logs.explain.explain`.

        Raises:
            ValueError: The agent has no ratings in this role, or not all ratings are at hand.
        """
        if self.log is None:
            raise ValueError("an explanation needs all ratings: rate the whole log without a state")
        place = find_agent(self.log, agent, (role,))[role]
        numbers = numbers_of(self.log, self.stream.every)
        what = f"Explaining trust in the {role} {agent}"
        return explained(
            self.stream.model,
            self.log,
            numbers,
            role,
            place,
            advance=lambda done, total: advance(what, done / total),
        )

    def update(self, source: Any) -> None:
        """Take further ratings, which are read as the first ones were.

        Without rounds by time each call is a round. Ratings of rounds that have ended are left out;
        `notes` say how many.

        Raises:
            ValueError: They cannot be read, or do not fit. Nothing is changed then.
            OSError: The file cannot be read.
        """
        log = source if isinstance(source, Log) else read(source, **self._columns)
        raters, ratees = (
            np.array(list(NameList.of(names).at(places)), object)
            for names, places in ((log.rater_names, log.raters), (log.ratee_names, log.ratees))
        )
        times = None
        if self.stream.every is not None and log.times is not None:
            times = log.times.view("datetime64[ns]")
        self.stream.update(raters, ratees, log.values, times)
        self.log, self._finished, self._tables, self.notes = None, None, {}, log.notes
        before, self._left_out = self._left_out, _left_out(self._counted())
        if self._left_out != before:
            late, repeated = np.subtract(self._left_out, before).tolist()
            words = f"Left out: {late:,} ratings of rounds that had ended, {repeated:,} repeated."
            self.notes = (*log.notes, words)

    def save(self, path: Path | str) -> None:
        """Write a state, with which `rate` continues, see `TrustStream.save`."""
        self.stream.save(path)

    def _counted(self) -> TrustStream:
        """Return the stream with the ratings of the running round."""
        if self._finished is None:
            self._finished = self.stream.finished()
        return self._finished


def _left_out(stream: TrustStream) -> tuple[int, int]:
    """Return the numbers of ratings so far that were late, and that were repeated."""
    return stream.n_late, stream.n_repeated


def rate(
    source: Any,
    *,
    rater: str | None = None,
    ratee: str | None = None,
    rating: str | None = None,
    time: str | None = None,
    scale: tuple[float, float] = (0.0, 1.0),
    every: float | None = None,
    same_agents: bool = False,
    model: Any = MODEL,
    trusted: Sequence[str] = (),
    reading: Reading = Reading(),  # noqa: B008 - immutable
    state: Path | str | None = None,
    seed: int = 0,
    advance: Advance = lambda what, share: None,
) -> Rated:
    """Return trust in the agents of ratings, with its evidence.

    Ratings count round by round, by time, or all in one round. Several ratings of one agent by
    another in a round count as one, their mean.

    Args:
        source: Path, data frame, mapping of columns, or `Log`, see `read`.
        rater: Name of the column of the rater.
        ratee: Name of the column of the rated agent.
        rating: Name of the column of the rating.
        time: Name of the column of the time.
        scale: Worst and best rating.
        every: Length of a round in seconds; None for a single round.
        same_agents: Whether a rater and a ratee of the same name are one agent.
        model: Trust model, or its name.
        trusted: Names of raters that are trusted beforehand, by models with seeds.
        reading: What is known about the source.
        state: File of earlier ratings, which takes these, too; needs `every`. Its ratings count,
            and those of a round that has ended are left out, so the source may be the whole log or
            its new part.
        seed: Random seed of what is drawn to calibrate a log without times.
        advance: See `Advance`.

    Raises:
        ValueError: An argument is not allowed, the source cannot be read, or a state is of another
            model or of other settings.
        OSError: A file cannot be read or written.
        MemoryError: The model does not fit, see `make_run`.

    Example:
        >>> rated = rate({"user": ["ann", "bob", "ann"], "item": ["shop", "shop", "bar"],
        ...               "stars": [5, 4, 1]}, scale=(1, 5), model="mean")
        >>> rated.ratees[["name", "trust", "raters"]].values.tolist()
        [['shop', 0.6875, 2], ['bar', 0.25, 1]]
    """
    named = {"rater": rater, "ratee": ratee, "rating": rating, "time": time}
    columns: dict[str, Any] = {
        **named,
        "scale": scale,
        "same_agents": same_agents,
        "reading": reading,
    }
    name, made = (model, make_log_model(model)) if isinstance(model, str) else (repr(model), model)
    if state is not None and (trusted or every is None):
        raise ValueError("a state needs rounds by time (every), and takes no trusted raters")
    if trusted and not hasattr(made, "seeds"):
        raise ValueError(
            f"{name} has no seeds for trusted raters; merit-rank and personalized-pagerank have"
        )
    advance("Reading", 0.0)
    log = source if isinstance(source, Log) else read(source, **columns)
    advance("Playing rounds", 0.0)
    kept = asdict(replace(reading, repeats=False)) | {"missing": list(reading.missing)}
    given = {column: text for column, text in named.items() if text is not None}
    settings: dict[str, Any] = {
        "repeats": reading.repeats,
        "keep_evidence": True,
        "source": {**kept, "columns": given, "scale": list(scale)},
    }
    if state is None:
        if trusted:
            seeds = tuple(find_agent(log, one, ("rater",))["rater"] for one in trusted)
            made = replace(made, seeds=seeds)
        stream = _whole(made, log, every, seed, advance, settings)
        return Rated(stream, name, columns, log=log, notes=log.notes)
    begun = partial(TrustStream.opened, every=every, same_agents=log.same_agents)
    with begun(state, made, **settings) as stream:
        if stream.window is None:  # there are no earlier ratings
            stream.calibration = _whole(made, log, every, seed, advance, settings).calibration
        rated = Rated(stream, name, columns)
        rated.update(log)
    return rated


def _whole(
    model: Any,
    log: Log,
    every: float | None,
    seed: int,
    advance: Advance,
    settings: Mapping[str, Any],
) -> TrustStream:
    """Return a stream that has taken a whole log, and is calibrated on its past."""
    many, wanted, pasts = len(log.values), set[int](), list[Past]()
    if every is not None:
        wanted = set(cuts(log, numbers_of(log, every)).tolist())

    def before(taken: int, run: TrustRun) -> None:
        advance("Playing rounds", taken / many)
        if taken in wanted:
            pasts.append(Past(taken, run.provider_trust.copy()))

    stream = TrustStream.of_log(model, log, every=every, before=before, **settings)
    advance("Calibrating", 0.0)
    part = log
    if every is None:
        part, pasts = replayed(model, log, seed)
    stream.calibration = calibrated(part, pasts)
    return stream
