"""Trust from a stream of ratings, which can be saved and continued."""

import json
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from copy import copy, deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from roletrust_env.errors import short
from roletrust_env.logs.calibration import Calibration
from roletrust_env.logs.evidence import Evidence, PairCounts, Role
from roletrust_env.logs.log import Log
from roletrust_env.logs.log_rounds import numbers_of
from roletrust_env.logs.names import NameIndex, NameList, Names
from roletrust_env.logs.rounds import nanoseconds, round_numbers, spans
from roletrust_env.logs.stream_columns import (
    StreamColumns,
    joined_columns,
    number_column,
    time_column,
)
from roletrust_env.logs.stream_file import StreamHeader, header_array, read_header
from roletrust_env.logs.units import check_scale, unit_ratings
from roletrust_env.parameters import truth_value
from roletrust_env.storage.arrays import load_arrays, save_arrays
from roletrust_env.storage.files import clear_unfinished, locked
from roletrust_env.storage.untrusted import parse_json
from roletrust_env.trust.edges import edge_model
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.remote import RemoteModel
from roletrust_env.trust.run import make_run
from roletrust_env.trust.stored import taken
from roletrust_env.trust.trust_run import TrustRun


class TrustStream:
    """Trust of raters and providers, from ratings that arrive in batches.

    Without `every`, each call of `update` is a round. With `every`, rounds have that length, from
    the earliest time on. The ratings of a round count, and its newcomers join, once a later rating
    shows that it has ended, or when `finish` is called. A round without ratings is a round. Several
    ratings of a pair in a round count as one, their mean.

    A rating is late if an earlier batch, or `finish`, has ended its round, also where it came
    before. Where none is late, neither the cuts into batches nor the order within a round matter.
    Late ratings are left out, so that trust is that of one log of the ratings that were accepted.
    A time that is wrong by years ends all rounds before it, and later ratings are late: check the
    times before.

    Example:
        >>> from roletrust_env import make_trust_model
        >>> stream = TrustStream(make_trust_model("mean"), scale=(1, 5))
        >>> stream.update(["ann", "bob"], ["shop", "shop"], [5, 3])
        >>> stream.provider_trust()
        {'shop': 0.625}

    Attributes:
        model: Trust model: a central one, or any if its agents are given.
        scale: Worst and best rating.
        every: Length of a round in seconds; None if rounds do not go by time.
        same_agents: Whether a rater and a provider of the same name are one agent, as where members
            rate members.
        repeats: Whether a rating counts again that repeats one of its round, with the same time.
            Otherwise it is left out, so that a batch which may have been taken can be sent again.
        source: Further settings that must be the same whenever the stream is continued, such as how
            ratings are read.
        calibration: What is known of how far trust is from later ratings; None if nothing is. It is
            saved with the stream.
        n_late: Number of late ratings so far.
        n_repeated: Number of ratings so far that were left out because they repeat another one.
    """

    def __init__(
        self,
        model: Any,
        *,
        scale: tuple[float, float] = (0.0, 1.0),
        every: float | None = None,
        same_agents: bool = False,
        agents: tuple[Any, Any] | None = None,
        repeats: bool = True,
        keep_evidence: bool = False,
        source: Mapping[str, Any] | None = None,
    ) -> None:
        """Start without agents, or with those that are given.

        Args:
            model: Trust model.
            scale: Worst and best rating.
            every: Length of a round in seconds.
            same_agents: Whether a rater and a provider of the same name are one agent.
            agents: Names of raters and of providers that are present from the start. A model that
                does not run on edges needs them, since it keeps numbers for all pairs.
            repeats: Whether repeated ratings count again.
            keep_evidence: Whether the ratings of each pair are counted, for `evidence`.
            source: Further settings by name, which a state keeps: plain data.

        Raises:
            ValueError: The model does not run on edges, and agents of a role are missing; the scale
                is empty; a round has no length; a policy is none of those allowed; or a further
                setting has numbers that are not finite.
            TypeError: A further setting is no plain data.
            MemoryError: The model does not fit, see `make_run`.
        """
        check_scale(scale)
        self._every = None if every is None else nanoseconds("every", every)
        self.model, self.scale = model, scale
        self.same_agents = truth_value("same_agents", same_agents)
        self.repeats = truth_value("repeats", repeats)
        self.source: dict[str, Any] = parse_json(json.dumps(dict(source or {})).encode())
        self._pairs = PairCounts() if truth_value("keep_evidence", keep_evidence) else None
        self.calibration: Calibration | None = None
        self.n_late = self.n_repeated = 0
        self.every = None if every is None else float(every)
        self._raters = NameIndex("raters")
        self._providers = self._raters if self.same_agents else NameIndex("providers")
        shape = 0, 0
        if agents is not None:
            if len(agents) != 2:
                raise ValueError(
                    f"agents are {short(repr(agents))}; they must be the raters and the providers"
                )
            for index, names in zip((self._raters, self._providers), agents, strict=True):
                index.begin(names)
            shape = len(self._raters), len(self._providers)
        if not all(shape):
            edge_model(model)
        self._run = make_run(model, shape, one_role=not self.same_agents)
        self._start: int | None = None
        self._latest: int | None = None  # time of the latest rating that was taken
        self._waiting: list[
            StreamColumns
        ] = []  # the ratings of the round that has begun, whose newcomers have no place yet
        self._begun = False  # whether a round has begun

    @classmethod
    def of_log(
        cls,
        model: Any,
        log: Log,
        *,
        every: float | None = None,
        before: Callable[[int, TrustRun], None] = lambda taken, run: None,
        **settings: Any,
    ) -> "TrustStream":
        """Return a stream that has taken a whole log, whose agents are all present from the start.

        Args:
            model: Trust model.
            log: Log.
            every: Length of a round in seconds; None for a single round.
            before: Function that is called before each round that has ratings, with the number of
                ratings in earlier rounds, and the run.
            **settings: Further arguments of the constructor.

        Raises:
            ValueError: Rounds go by time, and the log has no times, or another argument is not
                allowed.
            MemoryError: The model does not fit, see `make_run`.
        """
        numbers, names = numbers_of(log, every), (log.rater_names, log.ratee_names)
        stream = cls(model, every=every, agents=names, same_agents=log.same_agents, **settings)
        if log.times is not None:
            stream._start, stream._latest = int(log.times[0]), int(log.times[-1])
        for number, part in spans(numbers):
            stream._run.skip(number - stream.rounds)
            before(part.start, stream._run)
            places, values = (log.raters[part], log.ratees[part]), log.values[part]
            times = None if log.times is None else log.times[part]
            if every is None or times is None or part.stop < len(numbers):
                stream._count(*places, values, times)
            else:
                raters, ratees = (
                    NameList.of(side).texts(at) for side, at in zip(names, places, strict=True)
                )
                stream._waiting, stream._begun = [(raters, ratees, values, times)], True
        return stream

    def finished(self) -> "TrustStream":
        """Return a stream in which the ratings of the running round count, too; this one stays as
        it is, unless its model runs outside, which cannot be copied.
        """
        if not self._begun:
            return self
        other = self
        if not isinstance(self.model, RemoteModel):
            other = copy(self)
            parts = deepcopy((self._run, self._pairs, self._raters, self._providers))
            other._run, other._pairs, other._raters, other._providers = parts
        other.finish()
        return other

    @property
    def rounds(self) -> int:
        """The number of rounds that count so far."""
        return self._run.rounds

    def update(self, raters: Any, providers: Any, ratings: Any, times: Any = None) -> None:
        """Take a batch of ratings: lists, arrays, or columns of a table of pandas or Arrow.

        Args:
            raters: Name or number of the rater of each rating, shape (n,). White space at its ends
                does not count.
            providers: Name or number of the provider of each rating, shape (n,).
            ratings: Ratings, shape (n,), on the scale of the stream.
            times: Time of each rating, shape (n,), in any order within the batch; needed with
                `every`. Without it they tell when agents were rated last. Numbers are seconds,
                decimals to the microsecond. Dates are those of NumPy, pandas, Arrow and
                `datetime`, and texts of ISO 8601, all with a time zone or all without one, which is
                UTC then.

        Raises:
            ValueError: The columns do not fit together, or a value is not allowed, or a time is
                more than a million rounds ahead. Nothing is changed then.
        """
        who, whom = self._raters.check(raters), self._providers.check(providers)
        if self.same_agents and len(who) and len(whom) and who.dtype != whom.dtype:
            raise ValueError(
                "raters and providers are the same agents, so both must be whole numbers, or both "
                "texts"
            )
        values = unit_ratings(number_column("ratings", ratings, len(who)), self.scale)
        if len(whom) != len(who):
            raise ValueError(f"there are {len(who)} raters and {len(whom)} providers")
        if times is None and self.every is not None:
            raise ValueError("times are missing; rounds go by time here")
        if self.same_agents and (own := np.flatnonzero(who == whom)).size:
            raise ValueError(f"rating {own[0] + 1} is of {who[own[0]]!s} by itself")
        column = None if times is None else time_column(times, len(who))
        if self.every is None:
            if column is not None and len(column):
                known = [time for time in (self._start, self._latest) if time is not None]
                self._start = min([int(column.min()), *known])
                self._latest = max([int(column.max()), *known])
            self._play(who, whom, values, column)
        elif column is not None and len(who):
            self._wait((who, whom, values, column))

    def _round_numbers(self, times: Ints, start: int) -> Ints:
        """Return the number of the round in which each rating counts: the running one, if its own
        has ended.
        """
        assert self._every is not None  # only ratings with times wait
        numbers = round_numbers(np.maximum(times, start), self._every, start, self.rounds)
        return np.maximum(numbers, self.rounds)

    def _wait(self, columns: StreamColumns) -> None:
        """Keep ratings until their round has ended, and play the rounds that have.

        Raises:
            ValueError: A time is too far away. Nothing is changed then.
        """
        assert self._every is not None  # only ratings with times wait
        times, start = columns[3], self._start
        if start is None or not self.rounds:  # round 0 begins at the earliest time until it ends
            start = min([int(times.min()), *([] if start is None else [start])])
        numbers = round_numbers(np.maximum(times, start), self._every, start, self.rounds)
        there = (numbers >= self.rounds) & (times >= start)
        own: StreamColumns = tuple(column[there] for column in columns)  # type: ignore[assignment]
        if there.any():
            parts = [*self._waiting, own]
            if start != self._start or (numbers > self.rounds).any():
                columns = self._together(parts)
                numbers = self._round_numbers(columns[3], start)
                order = np.argsort(numbers, kind="stable")
                for number, part in spans(numbers[order]):
                    parts = [tuple(column[order[part]] for column in columns)]  # type: ignore[list-item]
                    self._run.skip(number - self.rounds)
                    if part.stop < len(numbers):
                        self._play(*parts[0])
            self._latest = int(own[3].max(initial=start if self._latest is None else self._latest))
            self._start, self._waiting, self._begun = start, parts, True
            self._expect_names()
        self.n_late += int((~there).sum())

    def _together(self, parts: list[StreamColumns]) -> StreamColumns:
        """Return ratings that wait as columns, without those that repeat another one, unless they
        count again.
        """
        columns = joined_columns(parts)
        if self.repeats:
            return columns
        first = dict[Any, int]()
        for place, row in enumerate(zip(*(column.tolist() for column in columns), strict=True)):
            first.setdefault(row, place)
        self.n_repeated += len(columns[0]) - len(first)
        places = list(first.values())
        return tuple(column[places] for column in columns)  # type: ignore[return-value]

    def _expect_names(self) -> None:
        """Let later names be of the type of those that wait."""
        for who, whom, *_ in self._waiting[:1]:
            self._raters.expect(who)
            self._providers.expect(whom)

    def finish(self) -> None:
        """End the round that has begun, so that its ratings count. Further ratings of its time are
        late.
        """
        if self._begun:
            columns = self._together(self._waiting)
            self._begun, self._waiting = False, []
            self._play(*columns)

    def rater_trust(self) -> dict[Any, float]:
        """Return the trust of each rater by name, in [0, 1]. Raters whose first round has not ended
        are missing.
        """
        return dict(zip(self._raters.names, self._run.rater_trust.tolist(), strict=True))

    def provider_trust(self) -> dict[Any, float]:
        """Return the trust of each provider by name, in [0, 1]."""
        return dict(zip(self._providers.names, self._run.provider_trust.tolist(), strict=True))

    @property
    def window(self) -> Ints | None:
        """The beginning of the first round and the time of the latest rating in nanoseconds, shape
        (2,); None without times.
        """
        return None if self._start is None else np.array([self._start, self._latest])

    def evidence(self, role: Role) -> Evidence:
        """Return trust with its evidence in all rounds that have ended, for the agents of a role
        that have ratings.

        Raises:
            ValueError: The stream was made without `keep_evidence`.
        """
        if self._pairs is None:
            raise ValueError("a stream has evidence if it was made with keep_evidence=True")
        index = self._raters if role == "rater" else self._providers
        trust = self._run.rater_trust if role == "rater" else self._run.provider_trust
        return self._pairs.evidence(role, index.names, trust)

    def save(self, path: Path | str) -> None:
        """Write the state to a file of NumPy arrays, complete or not at all.

        Two processes that load, update and save lose what one of them took: see `opened`. What a
        process has left in the folder that was killed while it wrote is removed. Where the path is
        a link, its file is written.

        Raises:
            OSError: The file cannot be written. It is as it was.
        """
        path = Path(os.path.realpath(path))
        waiting = self._together(self._waiting)
        self._waiting = [waiting] if len(waiting[0]) else []
        people = [self._raters.stored(), self._providers.stored(), *waiting[:2]]
        header = StreamHeader(
            settings=self._settings(),
            _start=self._start,
            _latest=self._latest,
            _begun=self._begun,
            calibration=self.calibration,
            n_late=self.n_late,
            n_repeated=self.n_repeated,
            texts=[names.tolist() if names.dtype == object else None for names in people],
        )
        arrays = {
            "header": header_array(header),
            **{f"names_{n}": names for n, names in enumerate(people) if names.dtype != object},
            "ratings": waiting[2],
            "times": waiting[3],
            **self._run.save(),
            **({} if self._pairs is None else self._pairs.save()),
        }
        try:
            clear_unfinished(path.parent)
            save_arrays(path, arrays)
        except OSError as error:
            raise OSError(
                f"{path} cannot be written, and is as it was: {error.strerror or error}"
            ) from None

    @classmethod
    def load(cls, path: Path | str, model: Any, **settings: Any) -> "TrustStream":
        """Return the stream that was saved, with the same model and settings.

        Args:
            path: File that `save` has written. It holds plain numbers and texts, and no code is
                run.
            model: Trust model, with the same parameters.
            **settings: Arguments of the constructor, the same as before; `repeats` may differ.

        Raises:
            ValueError: The file is no saved stream, is damaged, or is of another model or of other
                settings.
            OSError: The file cannot be read.
        """
        stream = cls(model, **settings)
        try:
            arrays = load_arrays(Path(path))
            header = read_header(arrays)
            before, now = header.settings, stream._settings()
            other = [name for name in {**before, **now} if before.get(name) != now.get(name)]
            if not other:
                stream._restore(arrays, header)
        except (ValueError, MemoryError) as error:
            raise ValueError(f"{path} is no saved stream, or is damaged: {error}") from None
        if other:
            saved, given = (
                ", ".join(f"{name} {some.get(name)}" for name in other) for some in (before, now)
            )
            raise ValueError(
                f"{path} was saved with other settings: {short(saved)}; given now: {given}"
            )
        return stream

    @classmethod
    @contextmanager
    def opened(cls, path: Path | str, model: Any, **settings: Any) -> Iterator["TrustStream"]:
        """Continue the stream of a file, which is saved at the end of the context, or begin one if
        there is none.

        Whoever opens a stream in the same folder waits until then, except in the same thread, which
        would wait for itself: that is an error. After an error nothing is saved.

        Args:
            path: File of the state.
            model: Trust model, see `load`.
            **settings: Arguments of the constructor, see `load`.

        Raises:
            ValueError: See `load`.
            OSError: The file cannot be read or written, or the system has no locks.
        """
        path = Path(
            os.path.realpath(path)
        )  # a link stays one, and whoever opens its file has the same lock
        with locked(path.parent):
            if not os.access(path.parent, os.W_OK):
                raise PermissionError(f"{path} cannot be written: its folder cannot")
            clear_unfinished(path.parent, path)
            stream = cls.load(path, model, **settings) if path.exists() else cls(model, **settings)
            yield stream
            stream.save(path)

    def _restore(self, arrays: dict[str, npt.NDArray[Any]], header: StreamHeader) -> None:
        """Take what was saved.

        Raises:
            ValueError: It does not fit together, or is not what can be given.
        """
        stored = list[Names]()
        for n, texts in enumerate(header.texts):
            names = (
                taken(arrays, f"names_{n}", np.int64, (None,))
                if texts is None
                else np.array(texts, object)
            )
            stored.append(NameIndex(f"names_{n}").check(names))
        raters, providers, who, whom = stored
        values = taken(arrays, "ratings", np.float64, who.shape)
        when = taken(arrays, "times", np.int64, who.shape)
        if self._pairs is not None:
            self._pairs.load(arrays, (len(raters), len(providers)), header.latest)
        self._run.load(arrays)
        self._raters.restore(raters)
        if not self.same_agents:
            self._providers.restore(providers)
        if (len(raters), len(providers)) != self._run.shape:
            raise ValueError(
                f"{len(raters)} raters and {len(providers)} providers have names; "
                f"{self._run.shape} belong"
            )
        self._start, self._latest, self._begun = header.start, header.latest, header.begun
        self.calibration = header.calibration
        self.n_late, self.n_repeated = header.n_late, header.n_repeated
        waiting = (
            self._raters.check(who),
            self._providers.check(whom),
            unit_ratings(values, (0.0, 1.0)),
            when,
        )
        if len(whom) != len(who):
            raise ValueError(f"{len(who)} raters and {len(whom)} providers wait")
        self._check_waiting(when)
        self._waiting = [waiting] if len(who) else []
        self._expect_names()

    def _check_waiting(self, times: Ints) -> None:
        """Refuse ratings that wait, or a first and a latest rating, at times at which they cannot
        have come.

        Raises:
            ValueError: There are such.
        """
        first, last = self._start, self._latest
        if self.every is None or first is None or last is None:
            known = (first is None) != (last is None) or self._begun or len(times) > 0
            if known or (self.rounds and self.every is not None):
                raise ValueError(
                    "the time of the first or of the latest rating is missing, or there can be none"
                )
            return
        right = first <= last and (self._begun or not len(times)) and (times <= last).all()
        if not right or (self._round_numbers(np.append(times, last), first) != self.rounds).any():
            raise ValueError(
                "ratings wait, or the latest one came, in another round than the running one"
            )

    def _settings(self) -> dict[str, Any]:
        return {
            "model": repr(self.model),
            "scale": [float(end) for end in self.scale],
            "every": self.every,
            "same_agents": self.same_agents,
            "keep_evidence": self._pairs is not None,
            **self.source,
        }

    def _play(
        self,
        raters: Names,
        providers: Names,
        values: Floats,
        times: Ints | None = None,
    ) -> None:
        places = self._raters.places(raters), self._providers.places(providers)
        self._count(*places, values, times)

    def _count(self, raters: Ints, providers: Ints, values: Floats, times: Ints | None) -> None:
        """Play a round, by the places of the agents."""
        self._run.play(raters, providers, values)
        if self._pairs is not None:
            self._pairs.add(raters, providers, times)
