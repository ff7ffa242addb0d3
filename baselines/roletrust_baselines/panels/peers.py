"""Agents that judge one another's answers: raters and providers at once, with ToR, ToP and ToA."""

import dataclasses
import itertools
import warnings
from collections.abc import Callable, Iterator, Sequence
from fnmatch import fnmatchcase
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np

from roletrust_baselines.logs.models import LOG_MODELS, make_log_model
from roletrust_baselines.logs.resampling import correlation, interval, mean, ranks
from roletrust_baselines.panels.verdicts import TIE
from roletrust_baselines.panels.votes import read_codes
from roletrust_env.data.dialect import Dialect
from roletrust_env.metrics.confidence import Interval
from roletrust_env.metrics.score import ratio
from roletrust_env.randomness import generator
from roletrust_env.trust import Traits, trust_models
from roletrust_env.trust.algorithms import agent_trust
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import make_run

_FIRST, _SECOND, _TIE = (
    ("first", "1", "a", "model_a", "left"),
    ("second", "2", "b", "model_b", "right"),
    ("tie", "0.5"),
)
PEOPLE = "human"
"""Name of the judge whose votes are the truth."""


class Comparisons(NamedTuple):
    """Votes of judges on pairs of answers, each by an agent.

    Attributes:
        judges: Place of the judge of each vote among the agents, shape (n,).
        items: Place of the item in the order in which they first occur, shape (n,), ascending.
        first: Place of the author of the first answer, shape (n,).
        second: Place of the author of the second answer, shape (n,).
        values: 1 if the first answer won, 0 if the second, 0.5 for a tie, shape (n,).
        agents: Names of the agents: judges and authors.
        item_names: Names of the items.
    """

    judges: Ints
    items: Ints
    first: Ints
    second: Ints
    values: Floats
    agents: list[str]
    item_names: list[str]

    def at(self, rows: Any) -> "Comparisons":
        """Return some of the votes, by a mask or their places."""
        return self._replace(**{name: getattr(self, name)[rows] for name in self._fields[:5]})

    @property
    def authors(self) -> Ints:
        """The places of the agents that have answers."""
        return np.union1d(self.first, self.second)

    @property
    def win_rate(self) -> Floats:
        """The mean value of each agent's answers, shape (agents,); NaN without."""
        both, many = np.concatenate([self.first, self.second]), len(self.agents)
        total = np.bincount(both, np.concatenate([self.values, 1 - self.values]), many)
        count = np.bincount(both, minlength=many)
        return ratio(total, count)


def read_comparisons(
    path: Path,
    judge: str = "judge",
    item: str = "item",
    first: str = "first",
    second: str = "second",
    vote: str = "vote",
    *,
    people: str = PEOPLE,
    dialect: Dialect = Dialect(),  # noqa: B008 - immutable
    tell: Callable[[str], None] = lambda line: None,
) -> tuple[Comparisons, Comparisons | None]:
    """Read comparisons: a table with a row for each vote. See `read_votes` for the forms.

    A vote is `first`, `second` or `tie`, also `1` and `2`, `A` and `B`, `model_a` and `model_b`, or
    the name of an author of the pair.

    Args:
        path: Path of the file.
        judge: Column of the judge.
        item: Column of the item, such as the question.
        first: Column of the author of the first answer.
        second: Column of the author of the second answer.
        vote: Column of the vote.
        people: Name of the judge with the truth, or a pattern such as `expert_*` for several.
        dialect: Parts of the dialect that are known.
        tell: Function that is called with a line for the user.

    Returns:
        Votes of agents, and votes of people on pairs of these agents; None without.

    Raises:
        ValueError: The file is no such table, a vote is not allowed, an agent is compared with
            itself, or all votes are by people.
        OSError: The file cannot be read.
    """
    wanted = {"judge": judge, "item": item, "first": first, "second": second, "vote": vote}
    table = read_codes(path, wanted, dialect, tell)
    names = list(
        dict.fromkeys(
            itertools.chain(*(table[role].names for role in ("judge", "first", "second")))
        )
    )
    place = {name: at for at, name in enumerate(names)}
    who, one, other = (
        np.array([place[name] for name in table[role].names])[table[role].places]
        for role in ("judge", "first", "second")
    )
    if (same := np.flatnonzero(one == other)).size:
        raise ValueError(
            f"{path}, vote {same[0] + 1}: {names[one[same[0]]]!r} is compared with itself"
        )
    voted = table["vote"].places >= 0
    values = np.full(len(voted), np.nan)
    for at, name in enumerate(table["vote"].names):
        rows = table["vote"].places == at
        word = name.casefold()
        if word in _FIRST or word in _SECOND or word.startswith(_TIE):
            values[rows] = 1.0 if word in _FIRST else 0.0 if word in _SECOND else 0.5
        elif name in place:
            values[rows] = np.where(
                one == place[name], 1.0, np.where(other == place[name], 0.0, np.nan)
            )[rows]
    if (wrong := np.flatnonzero(voted & np.isnan(values))).size:
        shown = table["vote"].names[table["vote"].places[wrong[0]]]
        raise ValueError(
            f"{path}, vote {wrong[0] + 1} is {shown!r}; it must be first, second, tie, or one of "
            "the two names"
        )
    by_people = voted & np.array([fnmatchcase(name, people) for name in names])[who]
    ours = voted & ~by_people
    if not ours.any():
        raise ValueError(f"{path} has no votes but those of {people!r}")
    order = np.argsort(table["item"].places[ours], kind="stable")
    agents, here = (
        np.unique(np.concatenate([who[ours], one[ours], other[ours]])),
        np.full(len(names), -1),
    )
    here[agents] = np.arange(len(agents))
    by_people &= np.isin(one, agents) & np.isin(other, agents)  # people may have seen others, too

    def votes(rows: Any) -> Comparisons:
        columns = (
            here[who[rows]],
            table["item"].places[rows],
            here[one[rows]],
            here[other[rows]],
            values[rows],
        )
        return Comparisons(*columns, [names[at] for at in agents.tolist()], table["item"].names)

    return votes(np.flatnonzero(ours)[order]), votes(by_people) if by_people.any() else None


class Standing(NamedTuple):
    """What a method makes of comparisons.

    Attributes:
        score: Score of each agent by its answers, ToP where a trust model says so, shape (agents,).
        tor: Trust in each agent as a judge, shape (agents,); None without.
        toa: ToA of each agent, shape (agents,); None without.
    """

    score: Floats
    tor: Floats | None = None
    toa: Floats | None = None


class PeerMethod(Protocol):
    """A way from comparisons to the standing of agents.

    Attributes:
        takes_own: Whether own votes of the owner can change it.
    """

    @property
    def takes_own(self) -> bool:
        """Whether own votes of the owner can change the standing."""

    def __call__(self, votes: Comparisons, own: Comparisons | None = None) -> Standing:
        """Return the standing, from votes of agents and own votes of the owner."""


@dataclasses.dataclass(frozen=True)
class PeersByTrust:
    """The standing by a trust model: the winner of a pair is rated 1, the other 0; a round for each
    item, in turn.

    Judges do not rate themselves. The owner is one more agent with its own votes in the first
    round: models with a trust for each judge say what it trusts. With one trust for all it would be
    one agent among many, and is left out.
    """

    model: Any

    @property
    def takes_own(self) -> bool:
        """Whether each judge has a trust of its own."""
        return Traits.of(self.model).family != "central"

    def __call__(self, votes: Comparisons, own: Comparisons | None = None) -> Standing:
        """Return the standing. See `PeerMethod`."""
        many = len(votes.agents)
        owner = own is not None and len(own.judges) > 0 and self.takes_own
        run = make_run(self.model, (many + owner,) * 2, one_role=False)
        if owner and own is not None:
            run.play(*_ratings(own._replace(judges=np.full(len(own.judges), many))))
        for rows in _rounds(votes.items):
            run.play(*_ratings(votes.at(rows)))
        raters, rated, _ = _ratings(votes)
        score, tor = (
            run.provider_trust[:many],
            run.rater_trust[:many] if self.model.rates_raters else None,
        )
        if owner and isinstance(run, GridRun):
            score = self.model.judge_trust(run.state)[many][:many]
        if tor is None:
            return Standing(score)
        counts = {
            "rated": np.bincount(raters, minlength=many),
            "provided": np.bincount(rated, minlength=many),
        }
        return Standing(score, tor, agent_trust(tor, score, initial=0.5, **counts))


@dataclasses.dataclass(frozen=True)
class WinRate:
    """The standing by the share of comparisons that an agent's answers win, whoever votes."""

    takes_own = False

    def __call__(self, votes: Comparisons, own: Comparisons | None = None) -> Standing:
        """Return the standing. See `PeerMethod`."""
        return Standing(np.nan_to_num(votes.win_rate, nan=0.5))


@dataclasses.dataclass(frozen=True)
class BradleyTerry:
    """The standing by strengths of Bradley and Terry (1952), with crowd-kit; a tie is left out.

    Attributes:
        reliable: Whether judges have reliabilities, which are their trust (Bugakova et al., 2019).
    """

    reliable: bool = False

    takes_own = False

    def __call__(self, votes: Comparisons, own: Comparisons | None = None) -> Standing:
        """Return the standing. See `PeerMethod`."""
        import pandas as pd
        from crowdkit import aggregation

        rows = votes.at(votes.values != 0.5)
        winner = np.where(rows.values == 1, rows.first, rows.second)
        table = {"worker": rows.judges, "left": rows.first, "right": rows.second, "label": winner}
        many = len(votes.agents)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            method = (
                aggregation.NoisyBradleyTerry()
                if self.reliable
                else aggregation.BradleyTerry(n_iter=100)
            )
            score = method.fit_predict(pd.DataFrame(table)).reindex(range(many)).to_numpy()
        tor = (
            method.skills_.reindex(range(many)).to_numpy()
            if isinstance(method, aggregation.NoisyBradleyTerry)
            else None
        )
        return Standing(np.nan_to_num(score, nan=-1.0), tor)


def _rounds(items: Ints) -> Iterator[slice]:
    """Yield the votes on each item."""
    ends = np.flatnonzero(np.diff(items)) + 1
    for start, end in itertools.pairwise([0, *ends.tolist(), len(items)]):
        yield slice(start, end)


def _ratings(votes: Comparisons) -> tuple[Ints, Ints, Floats]:
    """Return raters, ratees and ratings of comparisons, without those of oneself."""
    raters, rated = np.tile(votes.judges, 2), np.concatenate([votes.first, votes.second])
    values, others = np.concatenate([votes.values, 1 - votes.values]), raters != rated
    return raters[others], rated[others], values[others]


def against_people(
    votes: Comparisons, people: Comparisons, method: PeerMethod, own: Sequence[Ints], seed: int = 0
) -> dict[str, Interval]:
    """Return how well the standing of agents agrees with people.

    - `agreement`: share of people's votes, ties apart, that are for the agent with the higher
      score; equal scores are half. A vote counts with its mean over the sets of own votes that it
      is not in. Intervals resample items.
    - `spearman`: rank correlation of scores with people's win rates, without own votes. Intervals
      resample agents.

    Args:
        votes: Votes of agents.
        people: Votes of people.
        method: Method.
        own: Places of people's votes that are the owner's own, several sets, which may be empty.
        seed: Random seed of the resamples.
    """
    total, count = np.zeros((2, len(people.judges)))
    for places in own if method.takes_own else [np.zeros(0, np.int64)]:
        score = method(votes, people.at(places)).score
        ahead = score[people.first] - score[people.second]
        right = np.where(abs(ahead) < TIE, 0.5, (ahead > 0) == (people.values == 1))
        counted = people.values != 0.5
        counted[places] = False
        total[counted] += right[counted]
        count += counted
    known, both = count > 0, np.intersect1d(votes.authors, people.authors)
    found = {"agreement": interval(mean(total[known] / count[known]), people.items[known], seed)}
    if not len(places):
        pair = ranks(score[both]), ranks(people.win_rate[both])
        found["spearman"] = interval(correlation(*pair), np.arange(len(both)), seed)
    return found


def promoted(
    votes: Comparisons, judges: Ints, target: int, rival: int | None = None
) -> Comparisons:
    """Return the votes once judges are bought to vote for a target, and against a rival where there
    is one.
    """
    values, bought = votes.values.copy(), np.isin(votes.judges, judges)
    for agent, value in ((rival, 0.0), (target, 1.0)):
        if agent is not None:
            values[bought & (votes.first == agent)] = value
            values[bought & (votes.second == agent)] = 1 - value
    return votes._replace(values=values)


def judges_to_win(
    votes: Comparisons,
    method: PeerMethod,
    target: int,
    own: Comparisons | None = None,
    most: int = 20,
    seed: int = 0,
) -> int | None:
    """Return the least number of bought judges with which a target is first, by a search; None if
    all do not suffice.

    Bought judges vote for the target, and also against the winner of now or not. For each number
    all sets of judges are tried, but at most so many, drawn at random.
    """
    judges = np.unique(votes.judges)
    authors = votes.authors
    leader = int(authors[method(votes, own).score[authors].argmax()])
    if leader == target:
        return 0
    rng = generator(seed)
    for number in range(1, len(judges) + 1):
        for bought in _sets(judges, number, most, rng):
            for rival in (None, leader):
                score = method(promoted(votes, bought, target, rival), own).score
                if (
                    score[target]
                    > np.delete(score[authors], np.flatnonzero(authors == target)).max() + TIE
                ):
                    return number
    return None


def _sets(judges: Ints, number: int, most: int, rng: np.random.Generator) -> Iterator[Ints]:
    """Yield all sets of so many judges; random ones if there are more than `most`."""
    every = list(itertools.islice(itertools.combinations(judges.tolist(), number), most + 1))
    if len(every) <= most:
        yield from map(np.array, every)
    else:
        for _ in range(most):
            yield rng.choice(judges, number, replace=False)


def make_peer_method(name: str) -> PeerMethod:
    """Return a method by its name: `win-rate`, `bradley-terry`, `reliable-bradley-terry` or a trust
    model.

    Raises:
        ValueError: There is no such method, or a library is missing.
    """
    simple: dict[str, PeerMethod] = {
        "win-rate": WinRate(),
        "bradley-terry": BradleyTerry(),
        "reliable-bradley-terry": BradleyTerry(reliable=True),
    }
    if name.endswith("bradley-terry") and find_spec("crowdkit") is None:
        raise ValueError(f"{name} needs crowd-kit: pip install 'roletrust-env[crowd]'")
    return simple[name] if name in simple else PeersByTrust(make_log_model(name))


def all_peer_methods() -> list[str]:
    """Return the names of all methods that are installed. Bradley-Terry takes most of the time."""
    terry = ["bradley-terry", "reliable-bradley-terry"] if find_spec("crowdkit") else []
    return ["win-rate", *terry, *trust_models(), *LOG_MODELS]
