"""Trust from a stream of ratings, which can be saved and continued."""

import json
import zipfile
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from roletrust_env.data.names import NameIndex
from roletrust_env.data.rounds import play_round, round_numbers, spans
from roletrust_env.data.scale import check_scale, unit_ratings
from roletrust_env.storage.files import replacing
from roletrust_env.trust.edge_state import edge_model
from roletrust_env.trust.key_index import Ints
from roletrust_env.trust.ledger import Floats, Ledger, moved, staying

_FORMAT = 1

Columns: TypeAlias = tuple[Ints, Ints, Floats, Floats]
"""Places of raters and of providers, ratings on [0, 1], and times."""


class TrustStream:
    """Trust of raters and providers, from ratings that arrive in batches. Agents join when they first occur.

    Without `every`, each call of `update` is a round. With it, rounds have that length, and the ratings of a round
    count once a later rating shows that it has ended, or when `finish` is called. A round without ratings is a round.
    Several ratings of a pair in a round count as one, their mean.

    Example:
        >>> from roletrust_env import make_trust_model
        >>> stream = TrustStream(make_trust_model("mean"), scale=(1, 5))
        >>> stream.update(["ann", "bob"], ["shop", "shop"], [5, 3])
        >>> stream.provider_trust()
        {'shop': 0.625}

    Attributes:
        model: Central trust model.
        scale: Worst and best rating.
        every: Length of a round, in the unit of the times; None if each batch is a round.
        same_agents: Whether a rater and a provider of the same name are one agent, as where members rate members.
    """

    def __init__(
        self,
        model: Any,
        *,
        scale: tuple[float, float] = (0.0, 1.0),
        every: float | None = None,
        same_agents: bool = False,
        fused: bool = False,
    ) -> None:
        """Start without agents. With `fused`, sums are compiled by numba, see `Ledger`.

        Raises:
            ValueError: The model does not run on edges, the scale is empty, a round has no length, or numba is missing.
        """
        check_scale(scale)
        round_numbers(np.zeros(0), 1.0 if every is None else every, 0.0)
        self.model, self.scale, self.every, self.same_agents = edge_model(model), scale, every, same_agents
        self._ledger = Ledger(self.model, one_role=not same_agents, fused=fused)
        self._raters = NameIndex("raters")
        self._providers = self._raters if same_agents else NameIndex("providers")
        self._start: float | None = None
        self._waiting: list[Columns] = []  # the ratings of the round that has begun
        self._begun: int | None = None  # its number

    @property
    def rounds(self) -> int:
        """The number of rounds that count so far."""
        return self._ledger.rounds

    def update(self, raters: Any, providers: Any, ratings: Any, times: Any = None) -> None:
        """Take a batch of ratings: lists, arrays, or columns of a table of pandas or Arrow.

        Args:
            raters: Name or number of the rater of each rating, shape (n,).
            providers: Name or number of the provider of each rating, shape (n,).
            ratings: Ratings, shape (n,), on the scale of the stream.
            times: Time of each rating, shape (n,), in any order within the batch, none in a round that has ended;
                needed with `every`, not allowed without it.

        Raises:
            ValueError: The columns do not fit together, or a value is not allowed. Nothing is changed then.
        """
        who, whom = self._raters.check(raters), self._providers.check(providers)
        if self.same_agents and len(who) and len(whom) and (who.dtype.kind in "iu") != (whom.dtype.kind in "iu"):
            raise ValueError("raters and providers are the same agents, so both must be whole numbers, or both texts")
        values = unit_ratings(_numbers("ratings", ratings, len(who)), self.scale)
        if len(whom) != len(who):
            raise ValueError(f"there are {len(who)} raters and {len(whom)} providers")
        if (times is None) != (self.every is None):
            raise ValueError("times are given" if self.every is None else "times are missing; rounds go by time here")
        if self.same_agents and (own := np.flatnonzero(who == whom)).size:
            raise ValueError(f"rating {own[0] + 1} is of {who[own[0]]!s} by itself")
        when = np.zeros(len(who)) if times is None else _numbers("times", times, len(who))
        start = self._start = self._start_with(when)
        places = self._raters.places(who), self._providers.places(whom)
        if self.every is None:
            self._play(self._ledger.rounds, *places, values)
        elif start is not None:
            self._wait((*places, values, when), round_numbers(when, self.every, start))

    def _wait(self, columns: Columns, numbers: Ints) -> None:
        """Keep ratings until their rounds have ended, and play the rounds that have."""
        if not len(numbers):
            return
        if self._begun is None or np.any(numbers != self._begun):
            before = sum(len(part[0]) for part in self._waiting)
            numbers = np.concatenate([np.full(before, self._begun or 0), numbers])
            columns, self._waiting = _joined([*self._waiting, columns]), []
            order = np.argsort(numbers, kind="stable")
            for self._begun, some in spans(numbers[order]):
                chosen: Columns = tuple(column[order[some]] for column in columns)  # type: ignore[assignment]
                if some.stop == len(numbers):
                    columns = chosen
                else:
                    self._play(self._begun, *chosen[:3])
        self._waiting.append(columns)

    def finish(self) -> None:
        """End the round that has begun, so that its ratings count. Later ratings of its time are refused."""
        if self._begun is not None:
            number, columns = self._begun, _joined(self._waiting)
            self._begun, self._waiting = None, []
            self._play(number, *columns[:3])

    def remove(self, raters: Any = (), providers: Any = ()) -> None:
        """Let agents leave, with all that is known of them and of their pairs.

        A name that comes again is that of a newcomer. Ratings by them and of them in a round that has not ended do not
        count. What they did in earlier rounds stays in the trust of others where the model keeps that trust; a model
        that computes all trust anew from the memory of pairs, such as EigenTrust, is from the next round on what it
        would be if it had never seen them.

        It takes time in proportion to all agents and pairs, so many are better removed by one call.

        Args:
            raters: Names or numbers of raters.
            providers: Names or numbers of providers. With `same_agents`, agents may be in either list.

        Raises:
            ValueError: A name is not known. Nothing is changed then.

        Example:
            >>> from roletrust_env import make_trust_model
            >>> stream = TrustStream(make_trust_model("mean"))
            >>> stream.update(["ann", "bob"], ["shop", "stall"], [1.0, 1.0])
            >>> stream.remove(providers=["stall"])
            >>> stream.provider_trust()
            {'shop': 0.75}
        """
        one, other = self._raters.leaving(raters), self._providers.leaving(providers)
        if self.same_agents:
            one = other = np.union1d(one, other)
        self._ledger.remove(one, other)
        stay = staying(len(self._raters), one), staying(len(self._providers), other)
        if self._waiting:
            who, whom, values, when = _joined(self._waiting)
            there = stay[0][who] & stay[1][whom]
            who, whom = moved(stay[0])[who[there]], moved(stay[1])[whom[there]]
            self._waiting = [(who, whom, values[there], when[there])] if len(who) else []
            self._begun = self._begun if len(who) else None
        self._raters.keep(stay[0])
        if not self.same_agents:
            self._providers.keep(stay[1])

    def rater_trust(self) -> dict[Any, float]:
        """Return the trust of each rater by name, in [0, 1]. Raters whose first round has not ended are missing."""
        return dict(zip(self._raters.names, self._ledger.rater_trust.tolist(), strict=False))

    def provider_trust(self) -> dict[Any, float]:
        """Return the trust of each provider by name, in [0, 1]."""
        return dict(zip(self._providers.names, self._ledger.provider_trust.tolist(), strict=False))

    def save(self, path: Path) -> None:
        """Write the state to a file of NumPy arrays, complete or not at all."""
        texts = [None if len(index.numbers) else index.names for index in (self._raters, self._providers)]
        header = {"format": _FORMAT, "texts": texts, "start": self._start, **self._settings()}
        arrays: dict[str, npt.NDArray[Any]] = {
            "header": np.frombuffer(json.dumps(header).encode(), np.uint8),
            "raters": self._raters.numbers,
            "providers": self._providers.numbers,
            **{f"waiting_{n}": column for n, column in enumerate(_joined(self._waiting))},
            **self._ledger.arrays(),
        }
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: Path, model: Any, **settings: Any) -> "TrustStream":
        """Return the stream that was saved, with the same model and settings.

        Args:
            path: File that `save` has written. It holds plain numbers and texts, and no code is run.
            model: Trust model, with the same parameters.
            **settings: Arguments of the constructor, the same as before.

        Raises:
            ValueError: The file is damaged, or is of another model or of other settings.
            OSError: The file cannot be read.
        """
        stream = cls(model, **settings)
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = dict(stored)
            header = json.loads(arrays["header"].tobytes())
            same = {name: header[name] for name in stream._settings()} == stream._settings()
        except (zipfile.BadZipFile, KeyError, ValueError, EOFError, TypeError) as error:
            raise ValueError(f"{path} is no saved stream, or is damaged: {error}") from None
        if header["format"] != _FORMAT or not same:
            raise ValueError(f"{path} is of {header['model']} with other settings than {stream._settings()}")
        try:
            stream._restore(arrays, header)
        except (KeyError, ValueError, TypeError) as error:
            raise ValueError(f"{path} is damaged: {error}") from None
        return stream

    def _restore(self, arrays: dict[str, npt.NDArray[Any]], header: dict[str, Any]) -> None:
        self._ledger.restore(arrays)
        self._start = header["start"]
        raters, providers = header["texts"]
        self._raters.restore(arrays["raters"], raters)
        if not self.same_agents:
            self._providers.restore(arrays["providers"], providers)
        waiting: Columns = tuple(arrays[f"waiting_{n}"] for n in range(4))  # type: ignore[assignment]
        if self.every is not None and self._start is not None:
            self._wait(waiting, round_numbers(waiting[3], self.every, self._start))

    def _settings(self) -> dict[str, Any]:
        return {
            "model": repr(self.model),
            "scale": [float(end) for end in self.scale],
            "every": self.every,
            "same_agents": self.same_agents,
        }

    def _start_with(self, when: Floats) -> float | None:
        """Return the start of the first round, once the times of a batch are checked."""
        if self.every is None or not len(when):
            return self._start
        start = float(when.min()) if self._start is None else self._start
        ended = start + self._ledger.rounds * self.every
        if (late := np.flatnonzero(when < ended)).size:
            raise ValueError(
                f"rating {late[0] + 1} is of time {when[late[0]]:g}, in a round that has ended; "
                f"the earliest time that counts is {ended:g}"
            )
        round_numbers(when, self.every, start)
        return start

    def _play(self, number: int, raters: Ints, providers: Ints, values: Floats) -> None:
        play_round(self._ledger, number, raters, providers, values)


def _numbers(column: str, values: Any, length: int) -> Floats:
    """Return a column as finite numbers."""
    try:
        array = np.asarray(values, np.float64)
    except (ValueError, TypeError):
        raise ValueError(f"{column} must be numbers") from None
    if array.shape != (length,):
        raise ValueError(f"{column} have shape {array.shape}; there are {length} raters")
    if (wrong := np.flatnonzero(~np.isfinite(array))).size:
        raise ValueError(f"{column} hold {array[wrong[0]]} at position {wrong[0] + 1}; all must be numbers")
    return array


def _joined(parts: list[Columns]) -> Columns:
    """Return columns one after the other; columns without ratings if there are none."""
    none = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), np.zeros(0)
    return tuple(np.concatenate(columns) for columns in zip(none, *parts, strict=True))  # type: ignore[return-value]
