"""Judges that block advisers for a bad recommendation, against a slow copy, and by hand."""

from math import ceil, log, sqrt
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings
from judged import Matrix, Published, mean, play, round_by_round
from model_cases import assert_matches

from roletrust_baselines import BadMouthing
from roletrust_env import Game, JointPolicy, Scenario, record
from roletrust_env.trust import Ratings, make_trust_model


class Judge:
    """A judge and adviser, from the lists of its services and of its delivered ratings."""

    def __init__(self) -> None:
        self.services: list[tuple[int, float]] = []
        self.phase_services: list[int] = []
        self.last_phase: list[int] = []
        self.opening = True
        self.sticky: set[int] = set()
        self.guests: set[int] = set()
        self.entrants: set[int] = set()
        self.sponsors: set[int] = set()
        self.blocked: dict[int, int] = {}
        self.delivered = 0
        self.reports: list[tuple[int, float]] = []
        self.recommended: set[int] = set()


def value(ratings: list[tuple[int, float]], j: int) -> float:
    return mean([x for k, x in ratings if k == j], 0.0)


def most(candidates: list[int], weight: dict[int, int], values: dict[int, float]) -> set[int]:
    """The candidates with the largest weight, and of these the best."""
    if not candidates:
        return set()
    first = [j for j in candidates if weight[j] == max(weight[k] for k in candidates)]
    return {j for j in first if values[j] == max(values[k] for k in first)}


class Slow:
    """Judge by judge, with loops."""

    def __init__(
        self,
        raters: int,
        providers: int,
        cover: float = 2.0,
        width: float = 0.1,
        beta: float = 1.5,
        eta: float = 2.0,
    ) -> None:
        self.width, self.beta, self.eta = width, beta, eta
        self.size = max(1, min(providers, ceil(cover * providers / raters)))
        self.judges = [Judge() for _ in range(raters)]
        self.providers = range(providers)

    def completed(self, services: int) -> int:
        phase = 0
        while ceil((phase + 1) ** self.beta - 1e-3) <= services:
            phase += 1
        return phase

    def listens(self, i: int, k: int) -> bool:
        """Whether judge i does not block k in its phase."""
        return self.judges[i].blocked.get(k, 0) < 1 + self.completed(len(self.judges[i].services))

    def votes(self, i: int, j: int) -> list[int]:
        """The advisers that recommend j to i."""
        return [
            k
            for k, adviser in enumerate(self.judges)
            if k != i and self.listens(i, k) and j in adviser.recommended
        ]

    def receive(self, i: int, services: dict[int, float]) -> None:
        judge, before = self.judges[i], len(self.judges[i].services)
        if not services:
            return
        searching = len(judge.sticky) < self.size
        voted = {j: self.votes(i, j) for j in services}
        if searching:
            judge.sticky |= set(services) - judge.guests
        if judge.opening:
            judge.entrants = {j for j in services if voted[j]}
            judge.sponsors = {k for j in judge.entrants for k in voted[j]}
            joining = judge.entrants - judge.sticky - judge.guests
            if joining:
                played = {j: judge.phase_services.count(j) for j in judge.guests}
                values = {j: value(judge.services, j) for j in judge.guests}
                judge.guests = most(sorted(judge.guests), played, values) | joining
            judge.phase_services = []
        judge.services += services.items()
        judge.phase_services += services
        phase = 1 + self.completed(before)
        judge.opening = self.completed(len(judge.services)) >= phase
        if judge.opening:
            played = {j: judge.phase_services.count(j) for j in self.providers}
            values = {j: value(judge.services, j) for j in self.providers}
            favourite = most(sorted(set(judge.phase_services)), played, values)
            if not judge.entrants & favourite:
                judge.blocked |= dict.fromkeys(judge.sponsors, ceil(phase**self.eta - 1e-3))

    def report(self, k: int, ratings: dict[int, float]) -> None:
        adviser = self.judges[k]
        before, adviser.delivered = adviser.delivered, adviser.delivered + len(ratings)
        adviser.reports += ratings.items()
        if self.completed(adviser.delivered) > self.completed(before):
            rated = [j for j, _ in adviser.reports]
            values = {j: value(adviser.reports, j) for j in rated}
            adviser.recommended = most(
                sorted(set(rated)), {j: rated.count(j) for j in rated}, values
            )
            adviser.reports = []

    def learn(self, services: list[dict[int, float]], ratings: list[dict[int, float]]) -> None:
        """One round; recommendations of the round before are those that judges have heard."""
        for i, received in enumerate(services):
            self.receive(i, received)
        for k, delivered in enumerate(ratings):
            self.report(k, delivered)

    def round(self, f: Matrix, m: Matrix) -> Published:
        rows = [
            {j: x for j, x in enumerate(row) if seen[j]} for row, seen in zip(f, m, strict=True)
        ]
        self.learn(rows, rows)
        return Published.by(self.trust(), self.credence())

    def trust(self) -> Matrix:
        return [
            [mean([x for k, x in judge.services if k == j], 0.5) for j in self.providers]
            for judge in self.judges
        ]

    def credence(self) -> Matrix:
        judges = range(len(self.judges))
        return [[float(self.listens(i, k)) for k in judges] for i in judges]

    def preference(self, i: int, j: int, u: float) -> float:
        judge, first = self.judges[i], 1 + 10 * self.width
        count = sum(k == j for k, _ in judge.services)
        if len(judge.sticky) < self.size and not count:
            return 1 + first + u
        if judge.opening and (votes := len(self.votes(i, j))):
            return float(first + u ** (1 / votes))
        if j not in judge.sticky | judge.guests:
            return u - 1
        bonus = self.width * sqrt(2 * log(len(judge.services)) / count)
        return value(judge.services, j) + bonus


@pytest.mark.parametrize("parameters", [{}, {"beta": 2.0, "eta": 1.5}, {"beta": 1.0}])
def test_it_is_the_rule(parameters: dict[str, Any]) -> None:
    assert_matches(make_trust_model("vial", **parameters), round_by_round(Slow, **parameters))


@settings(max_examples=25)
@given(
    seed=st.integers(0, 2**32 - 1),
    sizes=st.tuples(st.integers(1, 6), st.integers(1, 7)),
    at_once=st.integers(1, 2),
    lost=st.sampled_from([0.0, 0.4]),
    parameters=st.fixed_dictionaries(
        {
            "cover": st.sampled_from([0.5, 1.0, 2.5]),
            "width": st.sampled_from([0.0, 0.5]),
            "beta": st.sampled_from([1.0, 1.3, 1.5, 2.0]),
            "eta": st.sampled_from([1.0, 1.5, 2.0]),
        }
    ),
)
def test_judges_choose_by_the_rule(
    seed: int, sizes: tuple[int, int], at_once: int, lost: float, parameters: dict[str, float]
) -> None:
    """The judges mostly receive what the rule wants most, and a third of them lie about it."""
    rng, model, slow = np.random.default_rng(seed), make_trust_model("vial", **parameters), None
    state, slow = model.start(np.zeros(sizes)), Slow(*sizes, **parameters)
    quality = rng.random(sizes[1])
    for _ in range(30):
        noise = rng.random(sizes)
        wanted = model.preference(state, noise)
        rows = range(sizes[0])
        expected = [[slow.preference(i, j, noise[i, j]) for j in slow.providers] for i in rows]
        np.testing.assert_allclose(wanted, expected, rtol=0, atol=1e-9)
        explores = rng.random((sizes[0], 1)) < 0.2
        order = np.argsort(np.where(explores, rng.random(sizes), -wanted), axis=1)
        served = np.argsort(order, axis=1) < at_once
        received = np.clip(quality + 0.3 * (rng.random(sizes) - 0.5), 0, 1)
        said = np.where(np.arange(sizes[0])[:, None] % 3 == 2, 1 - received, received)
        arrived = served & (rng.random(sizes) >= lost)
        state = model.update(state, Ratings(said, arrived, experience=Ratings(received, served)))
        slow.learn(
            [{j: received[i, j] for j in np.flatnonzero(served[i]).tolist()} for i in rows],
            [{j: said[i, j] for j in np.flatnonzero(arrived[i]).tolist()} for i in rows],
        )
        np.testing.assert_array_equal(state.credence, slow.credence())


def test_it_asks_an_adviser_and_blocks_it_for_a_bad_provider() -> None:
    """A phase is a service, then two, then three. The first judge knows provider 0, and the second
    one recommends provider 1."""
    model = make_trust_model("vial", beta=1.5, cover=0.5)
    noise = np.full((2, 2), 0.5)
    rounds = [[[0.5, None], [None, 0.9]]]
    assert model.preference(play(model, *rounds), noise)[0].argmax() == 1
    tried = [*rounds, [[None, 0.2], [None, 0.9]]]
    state = play(model, *tried)
    assert state.guests[0].tolist() == [0, 1]
    assert model.preference(state, noise)[0].argmax() == 0
    assert play(model, *tried, [[0.5, None], [None, 0.9]]).credence[0].tolist() == [1, 0]
    good = [*rounds, [[None, 0.8], [None, 0.9]]]
    assert play(model, *good, [[None, 0.8], [None, 0.9]]).credence[0].tolist() == [1, 1]


def test_advisers_are_drawn_uniformly() -> None:
    """Two advisers recommend provider 1, and one recommends provider 2."""
    model = make_trust_model("vial", cover=0.5)
    one = [[0.5, None, None], [None, 0.9, None], [None, 0.9, None], [None, None, 0.9]]
    state, rng = play(model, one), np.random.default_rng(0)
    chosen = [model.preference(state, rng.random((4, 3)))[0].argmax() for _ in range(3000)]
    assert np.bincount(chosen) / 3000 == pytest.approx([0, 2 / 3, 1 / 3], abs=0.03)


def test_what_liars_say_of_services_that_they_received_is_no_recommendation() -> None:
    """Reports count as uses of a provider, whatever they say of it: ratings decide ties only."""
    scenario = Scenario(
        agents=[
            {"role": "SR", "count": 6, "noise": 0.1},
            {"role": "SP", "count": 6, "ability": (0, 1)},
        ],
        access={"kind": "choice", "by": "model"},
        max_cycles=40,
    )
    game = Game(scenario, make_trust_model("vial"))
    scores = []
    for liars in (0, 2):
        policies = {f"sr_{n}": BadMouthing(start=0, level=0.0) for n in range(liars)}
        history = record(JointPolicy(game, policies), game.random(3), (200,))
        offered = history.offered[:, None] if history.offered.ndim == 3 else history.offered
        received = np.where(history.served, offered, 0)
        scores.append(received[:, 2:].sum() / history.served[:, 2:].sum())
    assert scores[1] == pytest.approx(scores[0], abs=0.03)
