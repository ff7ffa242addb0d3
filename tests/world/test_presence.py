"""Joining, leaving, and being cut off."""

from typing import Any

import numpy as np
import pytest

from roletrust_env.world import Scenario
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT, WAITING, Population, Presence
from roletrust_env.world.roster import Roster


def presence(group: dict[str, Any], **fields: Any) -> tuple[Presence, int]:
    """The rules for a rater of a group among two providers that always stay; and the number of
    agents."""
    scenario = Scenario(agents=[{"role": "SR"} | group, {"role": "SP", "count": 2}], **fields)
    roster = Roster.of(scenario)
    return Presence(scenario, roster, np.zeros(())), roster.n_agents


def life(group: dict[str, Any], luck: list[float], trust: float = 0.5, **fields: Any) -> list[int]:
    """The phases of the first agent, round by round."""
    rules, n = presence(group, **fields)
    population = rules.start(np.full(n, luck[0]))
    phases = [int(population.phase[0])]
    for round, chance in enumerate(luck[1:], start=1):
        population = rules.step(
            population, np.asarray(round), np.full(n, trust), np.full(n, chance)
        )
        phases.append(int(population.phase[0]))
    return phases


@pytest.mark.parametrize(
    ("group", "luck", "expected"),
    [
        ({}, [0.9] * 3, [PRESENT] * 3),
        ({"joins": 2}, [0.5] * 4, [WAITING, WAITING, PRESENT, PRESENT]),
        (
            {"joins": 1, "join_rate": 0.3},
            [0.1, 0.3, 0.29, 0.9],
            [WAITING, WAITING, PRESENT, PRESENT],
        ),
        ({"leaves": 2}, [0.5] * 4, [PRESENT, PRESENT, LEFT, LEFT]),
        ({"leave_rate": 0.3}, [0.1, 0.3, 0.29, 0.9], [PRESENT, PRESENT, LEFT, LEFT]),
        ({"joins": 1, "leaves": 3}, [0.5] * 5, [WAITING, PRESENT, PRESENT, LEFT, LEFT]),
        ({"joins": 1, "join_rate": 0.1, "leaves": 2}, [0.5] * 4, [WAITING, WAITING, LEFT, LEFT]),
        ({"leave_rate": 1.0}, [0.0, 0.0, 0.0], [PRESENT, LEFT, LEFT]),
    ],
)
def test_joining_and_leaving(group: dict[str, Any], luck: list[float], expected: list[int]) -> None:
    assert life(group, luck) == expected


def test_admission_cuts_off_after_rounds_in_succession() -> None:
    rules, n = presence({"joins": 1}, admission={"threshold": 0.4, "rounds": 2})
    population, phases = rules.start(np.zeros(n)), []
    for round, trust in enumerate([0.3, 0.3, 0.4, 0.39, 0.39, 0.9, 0.9], start=1):
        population = rules.step(population, np.asarray(round), np.full(n, trust), np.zeros(n))
        phases.append(population.phase.tolist())
    waiting_first = [row[0] for row in phases]
    # The rater was not there in the first round, so its second bad round is not yet the end.
    assert waiting_first == [PRESENT] * 4 + [CUT_OFF] * 3
    assert [row[1] for row in phases] == [PRESENT] + [CUT_OFF] * 6


def test_the_gone_stay_gone_whatever_happens() -> None:
    rules, n = presence({"leave_rate": 0.5}, admission={"threshold": 0.5, "rounds": 1})
    for phase in (LEFT, CUT_OFF):
        population = Population(np.full(n, phase, np.int8), np.zeros(n, np.int8))
        for luck in (0.0, 0.9):
            after = rules.step(population, np.asarray(5), np.zeros(n), np.full(n, luck))
            assert np.array_equal(after.phase, population.phase)


@pytest.mark.parametrize("rounds", [1, 127, 128, 129, 300])
def test_admission_of_any_length(rounds: int) -> None:
    phases = life({}, [0.5] * 310, trust=0.1, admission={"threshold": 0.5, "rounds": rounds})
    assert phases.index(CUT_OFF) == rounds


GROUPS = [{}, {"joins": 1}, {"join_rate": 0.9}, {"leaves": 1}, {"leave_rate": 0.1}, {"reserve": 1}]


@pytest.mark.parametrize("group", GROUPS, ids=str)
def test_whether_anybody_ever_comes_or_goes(group: dict[str, Any]) -> None:
    assert presence(group)[0].changes is (group != {})
    assert presence(group, admission={"threshold": 0.1})[0].changes


def test_shares_are_as_told() -> None:
    scenario = Scenario(
        agents=[{"role": "SR", "count": 2000, "join_rate": 0.1, "leave_rate": 0.05}, {"role": "SP"}]
    )
    rules, rng = Presence(scenario, Roster.of(scenario), np.zeros(())), np.random.default_rng(0)
    first = rules.start(rng.random((2001, 3)))
    second = rules.step(first, np.asarray([1, 1, 1]), np.ones((2001, 3)), rng.random((2001, 3)))
    assert (first.phase == PRESENT).mean() == pytest.approx(0.1, abs=0.02)
    assert (second.phase[first.phase == PRESENT] == LEFT).mean() == pytest.approx(0.05, abs=0.03)
    assert second.phase.dtype == first.phase.dtype


def test_an_identity_in_reserve_comes_when_it_is_wanted_and_who_is_not_wanted_leaves_for_good() -> (
    None
):
    rules, n = presence(
        {"reserve": 1, "joins": 1}
    )  # sr_0, sr_1 in reserve of it, sp_0 and sp_1 without
    assert n == 4
    population, phases = rules.start(np.zeros(n)), []
    plan = [[1, 1, 0, 0], [1, 1, 0, 0], [0, 1, 0, 0], [1, 0, 0, 0], [1, 1, 0, 0]]
    for round, wanted in enumerate(plan):
        population = rules.step(
            population, np.asarray(round), np.ones(n), np.zeros(n), np.asarray(wanted, bool)
        )
        phases.append(population.phase[:2].tolist())
        assert population.phase[2:].tolist() == [PRESENT, PRESENT]
    here, gone = [PRESENT, PRESENT], [LEFT, PRESENT]
    assert phases == [
        [WAITING, WAITING],
        here,
        gone,
        [LEFT, LEFT],
        [LEFT, LEFT],
    ]  # nobody before the group joins


def test_nobody_is_called_where_nobody_says_what_is_wanted() -> None:
    rules, n = presence({"reserve": 1})
    population = rules.start(np.zeros(n))
    for round in range(1, 4):
        population = rules.step(population, np.asarray(round), np.ones(n), np.zeros(n))
        assert population.phase.tolist() == [PRESENT, WAITING, PRESENT, PRESENT]
