"""Which agents to trust, from ratings: `rate` and what it returns."""

from collections.abc import Callable, Mapping, Sequence
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
from roletrust_env.logs.shrinkage import Shrinkage
from roletrust_env.logs.sources import Reading
from roletrust_env.logs.stream import TrustStream
from roletrust_env.logs.units import check_scale
from roletrust_env.storage.files import prepare_folder
from roletrust_env.storage.tables import write_table
from roletrust_env.trust.edges import runs_on_edges
from roletrust_env.trust.trust_run import TrustRun

MODEL = "leave-one-out"
"""Trust model unless another is given: that with the highest correlation with the next ratings of
the log of docs/real.md."""

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
        columns: Mapping[str, Any] | None,
        *,
        log: Log | None = None,
        notes: Sequence[str] = (),
    ) -> None:
        """Take a stream that `rate` has made.

        Args:
            stream: Stream with evidence.
            model: Name of its trust model.
            columns: Arguments of `read` for further ratings; None if they must be a `Log`.
            log: See the attributes.
            notes: See the attributes.
        """
        self.stream, self.model, self.log, self.notes = stream, model, log, tuple(notes)
        self._columns = columns
        self._finished: TrustStream | None = None
        self._tables = dict[Role, Any]()
        self._left_out = _left_out(stream)

    def __repr__(self) -> str:
        """Return the numbers of ratings and agents."""
        many = (len(self.evidence(role).names) for role in ROLES)
        agents = ", ".join(f"{n:,} {role}s" for n, role in zip(many, ROLES, strict=True))
        return f"Rated({self.model}: {self.n_ratings:,} ratings, {agents})"

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
        """Return trust in the agents of a role that have ratings, with its evidence.

        Raises:
            ValueError: The role is unknown.
        """
        if role not in ROLES:
            raise ValueError(f"unknown role {role!r}; roles are {' and '.join(ROLES)}")
        return self._counted().evidence(role)

    def table(self, role: Role) -> Any:
        """Return the agents of a role that have ratings as a table of pyarrow, the best first.

        Trust and ends of intervals are from 0, the worst, to 1. Columns are `name`, `trust`,
        `ratings`, `raters` or `ratees` (their number), `independent` (their effective number),
        `last` (the time of the last rating), `role`, `since` and `until` (the first and the last
        rating of all), `model` and `version`. Ratees have `estimate`, too,
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

    def write(self, out: Path | str) -> list[Path]:
        """Write the tables of both roles: `ratees.csv` and `raters.csv` in a folder, or a single
        Parquet file.

        Args:
            out: Folder, or a file that ends in `.parquet`.

        Returns:
            The files.

        Raises:
            OSError: A file cannot be written.
        """
        import pyarrow as arrow

        out = Path(out)
        single = out.suffix.lower() == ".parquet"
        tables = {out / f"{role}s.csv": self.table(role) for role in ROLES}
        if single:
            whole = arrow.concat_tables(tables.values(), promote_options="default")
            tables = {out: whole.unify_dictionaries()}
        prepare_folder(out.parent if single else out)
        for path, table in tables.items():
            write_table(path, table)
        return list(tables)

    def whole_log(self) -> Log:
        """Return the ratings.

        Raises:
            ValueError: There were earlier or later ones.
        """
        if self.log is None:
            raise ValueError("all ratings are needed: rate the whole log without a state")
        return self.log

    def explain(
        self, agent: str, role: Role = "ratee", advance: Advance = lambda what, share: None
    ) -> Explanation:
        """Return what makes the trust in an agent, see `roletrust_env.logs.explain.explain`.

        Raises:
            ValueError: The agent has no ratings in this role, or not all ratings are at hand.
        """
        log = self.whole_log()
        self.evidence(role)  # refuses an unknown role
        places = find_agent(log, str(agent))
        if role not in places:
            raise ValueError(f"{agent} is not a {role}, but a {next(iter(places))}")
        place = places[role]
        numbers = numbers_of(log, self.stream.every)
        what = f"Explaining trust in the {role} {agent}"
        return explained(
            self.stream.model,
            log,
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
        if not isinstance(source, Log) and self._columns is None:
            raise ValueError("the first ratings were a Log, so further ones must be one, too")
        log = source if isinstance(source, Log) else read(source, **(self._columns or {}))
        raters, ratees = (
            NameList.of(names).texts(places)
            for names, places in ((log.rater_names, log.raters), (log.ratee_names, log.ratees))
        )
        times = None if log.times is None else log.times.view("datetime64[ns]")
        self.stream.update(raters, ratees, log.values, times)
        self.log, self._finished, self._tables, self.notes = None, None, {}, log.notes
        before, self._left_out = self._left_out, _left_out(self._counted())
        late, repeated = np.subtract(self._left_out, before).tolist()
        new = f"Took {len(log.values) - late - repeated:,} new ratings"
        words = f"left out {late:,} of rounds that had ended, {repeated:,} repeated."
        self.notes = (*log.notes, f"{new}; {words}")

    def save(self, path: Path | str) -> None:
        """Write a state, with which `rate` continues, see `TrustStream.save`.

        Raises:
            ValueError: There are no rounds by time, the model keeps numbers for all pairs, or
                raters are trusted beforehand.
            OSError: The file cannot be written.
        """
        model = self.stream.model
        seeds = getattr(model, "seeds", None)
        if self.stream.every is None or not runs_on_edges(model) or seeds:
            raise ValueError(
                "a state needs rounds by time (every), and a model that keeps no numbers for all "
                "pairs, without trusted raters"
            )
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
        source: Path, data frame, mapping of columns, or `Log`, see `read`. Of a `Log`, names of
            columns, scale and reading have no effect, since it is read already.
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
        seed: Random seed of what is drawn to calibrate a log in a single round: its order if it has
            no times, and raters if it has more than a million ratings.
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
    check_scale(scale)
    columns: dict[str, Any] | None = None
    if not isinstance(source, Log):
        columns = {**named, "scale": scale, "same_agents": same_agents, "reading": reading}
    elif same_agents and not source.same_agents:
        raise ValueError("same_agents is True, and the log was read without it")
    name, made = (model, make_log_model(model)) if isinstance(model, str) else (repr(model), model)
    if isinstance(trusted, str):
        raise ValueError(f"trusted is {trusted!r}; it must be a list of names")
    if state is not None and (trusted or every is None):
        raise ValueError("a state needs rounds by time (every), and takes no trusted raters")
    if state is not None and not runs_on_edges(made):
        raise ValueError(f"{name} keeps numbers for all pairs, so it cannot have a state")
    if trusted and not hasattr(made, "seeds"):
        raise ValueError(
            f"{name} does not take trusted raters; merit-rank and personalized-pagerank do"
        )
    advance("Reading", 0.0)
    log = source if columns is None else read(source, **columns)
    advance("Playing rounds", 0.0)
    settings: dict[str, Any] = {"keep_evidence": True}
    if columns is not None:
        kept = asdict(replace(reading, repeats=False)) | {"missing": list(reading.missing)}
        given = {column: text for column, text in named.items() if text is not None}
        ends = [float(end) for end in scale]
        settings["source"] = {**kept, "columns": given, "scale": ends}
    if state is None:
        settings["repeats"] = reading.repeats or columns is None
        if trusted:
            seeds = tuple(find_agent(log, str(one), ("rater",))["rater"] for one in trusted)
            made = replace(made, seeds=seeds)
        return _whole(made, name, log, columns, every, seed, advance, settings)
    settings["repeats"] = reading.repeats
    begun = partial(TrustStream.opened, every=every, same_agents=log.same_agents)
    with begun(state, made, **settings) as stream:
        if stream.window is None:  # there are no earlier ratings
            first = _whole(made, name, log, columns, every, seed, advance, settings)
            stream.calibration = first.calibration
        rated = Rated(stream, name, columns)
        rated.update(log)
    return rated


def _whole(
    model: Any,
    name: str,
    log: Log,
    columns: Mapping[str, Any] | None,
    every: float | None,
    seed: int,
    advance: Advance,
    settings: Mapping[str, Any],
) -> Rated:
    """Return trust after a whole log, calibrated on its past."""
    many, wanted, pasts = len(log.values), set[int](), list[Past]()
    if every is not None:
        wanted = set(cuts(numbers_of(log, every)).tolist())

    def before(taken: int, run: TrustRun) -> None:
        advance("Playing rounds", taken / many)
        if taken in wanted:
            pasts.append(Past(taken, run.provider_trust.copy()))

    stream = TrustStream.of_log(model, log, every=every, before=before, **settings)
    advance("Calibrating", 0.0)
    part = log
    if every is None:
        part, pasts = replayed(model, log, seed)
    rated = Rated(stream, name, columns, log=log, notes=log.notes)
    final = Shrinkage.fitted(log, rated.evidence("ratee").trust)
    stream.calibration = calibrated(part, pasts, final)
    return rated
