"""The attacker's side of a game against slow formulas: outcomes, actions, exact optima, bad
input."""

from statistics import fmean
from typing import Any

import numpy as np
import pytest
from attack_cases import (
    CASES,
    EVERY_ACCESS,
    EVERY_CASE,
    STEALTH,
    assert_close,
    busy,
    deeds,
    each,
    make,
    play,
    rng,
)
from refusals import refuses

from roletrust_agents.planning.exact import optimal_provider, optimal_rater
from roletrust_baselines import BadMouthing, OnOff
from roletrust_env import Actions, Game, Scenario, make_scenario, make_task
from roletrust_env.evaluation.attackers import Scripted
from roletrust_env.evaluation.measurement import SEARCHED, mean_rewards
from roletrust_env.game.attack_task import AttackTask, Stealth
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT, WAITING

# --- objectives, cost, termination
# -------------------------------------------------------------------


def slow_outcome(task: AttackTask, case: dict[str, Any], state: Any) -> dict[str, float]:
    """The outcome as the documentation tells it, agent by agent."""
    game, roster, mine = task.game, task.game.roster, case["compromised"]
    tor, top = game.published(state)
    tor, top = (
        dict(zip(roster.rater_names, tor, strict=True)),
        dict(zip(roster.provider_names, top, strict=True)),
    )
    phase = dict.fromkeys(roster.names, PRESENT)
    if state.population is not None:
        phase = dict(zip(roster.names, state.population.phase, strict=True))
    attackers = [k for k, policy in case.get("others", {}).items() if policy.attacks]
    honest = [
        k for k in roster.names if k not in mine and k not in attackers and phase[k] == PRESENT
    ]

    def mean(numbers: list[float]) -> float:
        return fmean(numbers) if numbers else 0.0

    if case.get("objective", "damage") == "damage":
        objective = mean([1 - top[k] for k in honest if k in top])
    else:
        sellers = (
            case["accomplices"] if case["objective"] == "promote" else [k for k in mine if k in top]
        )
        gains = []
        for k in sellers:
            j = roster.provider_names.index(k)
            gains.append(top[k] * (1 - state.quality[j]) if state.awaiting[:, j].any() else 0.0)
        objective = mean(gains)
    stealth, costs = case.get("stealth", Stealth()), []
    for k in mine:  # there or not
        costs.append(0.0)
        for trust in (tor, top):
            others = [trust[j] for j in honest if j in trust]
            if others and k in trust:
                costs[-1] = max(costs[-1], mean(others) - trust[k] - stealth.tolerance)
    cost = fmean(costs)
    return {
        "reward": objective - stealth.weight * cost,
        "objective": objective,
        "cost": cost,
        "caught": all(phase[k] in (LEFT, CUT_OFF) for k in mine),
    }


@EVERY_CASE
@EVERY_ACCESS
def test_an_outcome_is_what_the_formulas_say(case: dict, access: str) -> None:
    task = make(busy(access), case)
    for seed in range(3):
        for _, after, outcome in play(task, seed):
            assert outcome._asdict() == pytest.approx(
                slow_outcome(task, case, after.game), abs=1e-12
            )


def test_the_cases_meet_what_they_are_for() -> None:
    """Costs and none, absent sellers, honest agents that are away, caught and not: else the test
    above is idle."""
    met = set()
    for case in CASES.values():
        task = make(busy(), case)
        for seed in range(3):
            for _, after, outcome in play(task, seed):
                state, roster = after.game, task.game.roster
                away = roster.providers(state.population.phase) != PRESENT
                met.add("cost" if outcome.cost > 0 else "no cost")
                met.add("caught" if outcome.caught else "free")
                met.add("somebody away" if away.any() else "all there")
                met.add(
                    "some sell" if 0 < state.awaiting.any(axis=0).mean() < 1 else "all or none sell"
                )
                met |= {"objective"} if 0 < outcome.objective < 1 else set()
    assert len(met) == 9


def test_the_paper_world_by_hand() -> None:
    """Honest 1, one of three raters at 0 for ever: the steady state."""
    scenario = make_scenario("paper-3x3").change(noise=0.0, perturbations=(), max_cycles=60)
    task = make(scenario, {"compromised": ("sr_2",), "stealth": Stealth(2.0, 0.1)})
    *_, (_, _, outcome) = play(task, actions=[np.zeros(3)] * 60)
    honest, liar = 1 - (1 / 3) ** 0.5, 1 - (2 / 3) ** 0.5
    assert outcome.objective == pytest.approx(1 - 2 / 3 * honest, abs=1e-9)
    assert outcome.objective == pytest.approx(1 - 0.282, abs=1e-3)
    assert outcome.cost == pytest.approx(honest - liar - 0.1, abs=1e-9)
    assert outcome.reward == pytest.approx(outcome.objective - 2 * outcome.cost)


def test_nobody_hides_behind_another() -> None:
    """Of four raters one rates 0 for ever and its accomplice is honest: the cost is the liar's own,
    shared by two."""
    scenario = Scenario(agents=[{"role": "SR", "count": 4}, {"role": "SP"}], max_cycles=60)
    task = make(scenario, {"compromised": ("sr_2", "sr_3"), "stealth": Stealth(2.0, 0.1)})
    *_, (_, _, outcome) = play(task, actions=[np.array([1.0, 0.0])] * 60)
    honest, liar = 1 - 0.25**0.5, 1 - 0.75**0.5
    assert outcome.cost == pytest.approx((honest - liar - 0.1) / 2, abs=1e-9)


def test_who_is_gone_stays_as_far_apart_as_it_went() -> None:
    """A rater that lied until it left goes on costing what it cost; the honest one beside it costs
    nothing."""
    agents = [
        {"role": "SR", "count": 2},
        {"role": "SP"},
        {"role": "SR"},
        {"role": "SR", "leaves": 5},
    ]
    scenario = Scenario(agents=agents, max_cycles=40)
    task = make(scenario, {"compromised": ("sr_2", "sr_3"), "stealth": Stealth(2.0, 0.1)})
    rounds = list(play(task, actions=[np.array([1.0, 0.0])] * 40))
    left = task.game.published(rounds[-1][1].game)[0][3]
    assert [task.game.published(after.game)[0][3] for _, after, _ in rounds[6:]] == [left] * 34
    assert rounds[-1][2].cost == pytest.approx(
        (1 - left - 0.1) / 2, abs=1e-9
    )  # the honest are trusted again


def test_exploit_pays_for_the_trust_at_which_the_service_is_sold() -> None:
    scenario = Scenario(
        agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}], max_cycles=3
    )
    task = make(scenario, {"compromised": ("sp_1",), "objective": "exploit"})
    outcomes = [
        outcome for *_, outcome in play(task, actions=[np.array([q]) for q in (1.0, 0.25, 0.0)])
    ]
    second = 0.5 * 0.75 + 0.25  # after the good service of round 0; ToR rises to 0.75
    bad = np.sinc(0.75) * np.sinc(0.75) * 0.875 * 0.25  # the note 0.25 that follows the note 1
    gains = [0.0, second * 0.75, 0.5 * bad + 0.5 * second]
    assert [o.objective for o in outcomes] == pytest.approx(gains, abs=1e-12)
    assert not any(o.caught for o in outcomes)


def test_who_is_absent_sells_nothing() -> None:
    agents = [{"role": "SR"}, {"role": "SP"}, {"role": "SP", "joins": 4}]
    task = make(
        Scenario(agents=agents, max_cycles=9), {"compromised": ("sp_1",), "objective": "exploit"}
    )
    gains = [outcome.objective for *_, outcome in play(task, actions=[np.zeros(1)] * 9)]
    # It is there from round 4 on, and serves from its first full round on; then nothing but 0 is
    # ever noted.
    assert gains[:4] == [0.0] * 4
    assert gains[4:] == [0.5 * 0.5**n for n in range(5)]


@pytest.mark.parametrize("role", ["SR", "SP"])
def test_only_the_last_one_gone_ends_it(role: str) -> None:
    """They leave in rounds 2 and 5; one that has yet to come is not gone; the exit of somebody else
    is nothing."""
    names = [f"{role.lower()}_{n}" for n in (1, 2)]
    agents = [
        {"role": "SR"},
        {"role": "SP"},
        {"role": role, "leaves": 2},
        {"role": role, "joins": 3, "leaves": 5},
    ]
    task = make(
        Scenario(agents=[*agents, {"role": "SP", "leaves": 1}], max_cycles=7),
        {"compromised": names},
    )
    outcomes = [outcome for *_, outcome in play(task)]
    assert [bool(o.caught) for o in outcomes] == [False] * 4 + [True] * 3


def test_being_cut_off_is_being_caught() -> None:
    scenario = Scenario(
        agents=[{"role": "SR", "count": 3}, {"role": "SP"}],
        admission={"threshold": 0.3, "rounds": 2},
        max_cycles=8,
    )
    task = make(scenario, {"compromised": ("sr_0",)})
    rounds = list(play(task, actions=[np.zeros(1)] * 8))
    tor = [task.game.published(after.game)[0][0] for _, after, _ in rounds]
    low = np.convolve(np.array(tor) < 0.3, [1, 1])[:8] == 2
    assert [bool(outcome.caught) for *_, outcome in rounds] == np.logical_or.accumulate(
        low
    ).tolist()
    assert rounds[-1][2].caught
    assert not rounds[2][2].caught


# --- actions
# ----------------------------------------------------------------------------------------


def joint(task: AttackTask, scripted: Actions, action: np.ndarray) -> Actions:
    """The joint action, agent by agent: quality, if it provides, then ratings, if it rates."""
    roster, left = task.game.roster, list(action)
    quality, ratings = scripted.quality.copy(), scripted.ratings.copy()
    for name in task.compromised:
        if "sp" in name:
            quality[roster.provider_names.index(name)] = left.pop(0)
        if "sr" in name:
            for j in range(roster.n_providers):
                ratings[roster.rater_names.index(name), j] = left.pop(0)
    assert not left
    return Actions(quality, ratings)


@EVERY_CASE
def test_actions_overrule_exactly_the_compromised(case: dict) -> None:
    """The others rate what they perceive and serve as well as they can, but for those with a policy
    of their own."""
    task = make(
        busy(), case | {"others": {"sp_2": OnOff(bad=0.4)}} if "others" not in case else case
    )
    game, policies = task.game, task.joint_policy.policies
    random, draws = rng(3), rng(3)
    state = task.start(game.draw(random, start=True), random)
    game.draw(draws, start=True)
    task.joint_policy.begin(draws, ())
    for action in deeds(task, 3):
        noise, _ = game.draw(random), game.draw(draws)
        scripted, _ = task.joint_policy.act(state.game, state.memories, draws)
        honest = Actions(np.ones(game.roster.n_providers), state.game.service)
        for name, policy in policies.items():
            if "quality" in policy.attacks:
                j = game.roster.provider_names.index(name)
                honest.quality[j] = scripted.quality[j]
            if "ratings" in policy.attacks:
                honest = honest._replace(ratings=honest.ratings.copy())
                i = game.roster.rater_names.index(name)
                honest.ratings[i] = scripted.ratings[i]
        expected, _ = game.step(state.game, joint(task, honest, action), noise)
        state, _ = task.step(state, action, noise, random)
        assert_close(state.game, expected)


@pytest.mark.parametrize("order", [(3, 1, 0, 2), (2, 3, 1, 0)], ids=str)
def test_permuting_the_compromised_permutes_actions_and_observations(order: tuple) -> None:
    names = ("sr_2", "srsp_1", "sp_0", "sr_0")
    task = make(busy(), {"compromised": names, "stealth": STEALTH})
    other = make(busy(), {"compromised": [names[k] for k in order], "stealth": STEALTH})
    s, p = task.game.roster.n_raters, task.game.roster.n_providers
    size = {"sr": p, "sp": 1, "srsp": 1 + p}
    seen = {"sr": 2 + 5 * p, "sp": 4 + 2 * s, "srsp": 1 + 4 + 2 * s + 2 + 5 * p}

    def permute(vector: np.ndarray, sizes: dict[str, int]) -> np.ndarray:
        parts = np.split(vector, np.cumsum([sizes[name.split("_")[0]] for name in names])[:-1])
        return np.concatenate([parts[k] for k in order])

    actions = deeds(task, 1)
    permuted = play(other, 1, [permute(action, size) for action in actions])
    for (_, state, outcome), (_, twin, twin_outcome) in zip(
        play(task, 1, actions), permuted, strict=True
    ):
        assert_close(twin.game, state.game)
        assert_close(twin_outcome, outcome)
        assert_close(other.observe(twin), permute(task.observe(state), seen))


def test_a_step_leaves_its_inputs_alone() -> None:
    task, random = make(busy(), CASES["colluders among other attackers"]), rng()
    state = task.start(task.game.draw(random, start=True), random)
    for action in deeds(task, 0):
        noise = task.game.draw(random)
        before = each(np.copy, (state, action, noise))
        after, _ = task.step(state, action, noise, random)
        task.observe(state)
        each(np.testing.assert_array_equal, (state, action, noise), before)
        state = after


# --- exact optima
# -----------------------------------------------------------------------------------


def certain(rounds: int) -> Scenario:
    return make_scenario("paper-3x3").change(noise=0.0, perturbations=(), max_cycles=rounds)


def test_the_exact_provider_scores_the_same_in_the_task() -> None:
    best = optimal_provider(certain(50), cells=24)
    task = make(certain(50), {"compromised": ("sp_2",), "objective": "exploit"})
    rewards = [outcome.reward for *_, outcome in play(task, actions=best.actions[:, None])]
    assert np.mean(rewards) == pytest.approx(best.score, abs=1e-12)


@pytest.mark.parametrize(
    ("liars", "weight", "tolerance"), [(1, 2.0, 0.1), (2, 0.5, 0.0), (1, 0.0, 0.1)]
)
def test_the_exact_rater_scores_the_same_in_the_task(
    liars: int, weight: float, tolerance: float
) -> None:
    best = optimal_rater(
        certain(50), compromised=liars, weight=weight, tolerance=tolerance, cells=24
    )
    case = {"compromised": ("sr_2", "sr_0")[:liars], "stealth": Stealth(weight, tolerance)}
    lies = np.repeat(best.actions[:, None], 3 * liars, axis=1)
    rewards = [outcome.reward for *_, outcome in play(make(certain(50), case), actions=lies)]
    assert np.mean(rewards) == pytest.approx(best.score, abs=1e-12)


# --- bad input
# --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"compromised": ("sr_9",)}, ["compromised", "sr_9", "sr_0", "srsp_2"]),
        ({"compromised": ("sr_1", "sp_0", "sr_1")}, ["compromised", "sr_1"]),
        ({"compromised": ()}, ["compromised"]),
        ({"objective": "harm"}, ["objective", "harm", "damage", "exploit", "promote"]),
        ({"objective": None}, ["objective", "None", "damage"]),
        (
            {"knowledge": "omniscient"},
            ["knowledge", "omniscient", "black_box", "grey_box", "white_box"],
        ),
        ({"objective": "exploit"}, ["exploit", "provider"]),
        ({"objective": "promote"}, ["promote"]),
        (
            {"compromised": [f"sp_{j}" for j in range(5)] + [f"srsp_{k}" for k in range(3)]},
            ["damage"],
        ),
        ({"objective": "promote", "accomplices": ("sr_0",)}, ["accomplices", "sr_0", "sp_0"]),
        (
            {"objective": "promote", "accomplices": ("sp_0", "sp_0")},
            ["accomplices", "sp_0"],
        ),
        ({"others": {"sr_1": OnOff()}}, ["sr_1", "compromised"]),
        ({"others": {"sr_7": BadMouthing()}}, ["sr_7", "sr_0"]),
        ({"others": {"sr_0": OnOff()}}, ["sr_0", "quality"]),
    ],
    ids=str,
)
def test_bad_arguments_are_refused(arguments: dict, words: list[str]) -> None:
    with refuses(ValueError, *words):
        make(busy(), {"compromised": ("sr_1",)} | arguments)


def test_all_honest_providers_attack() -> None:
    """Whoever attacks on its own is not honest, so nobody is left to damage."""
    others = {name: OnOff() for name in ("sp_0", "sp_1", "sp_2")}
    with refuses(ValueError, "damage"):
        AttackTask(Game(make_scenario("paper-3x3")), ("sr_0",), others=others)


def test_who_has_yet_to_come_is_waiting() -> None:
    """What the tests of presence above rest on."""
    task = make(busy(), CASES["rater that joins late"])
    _, after, outcome = next(play(task))
    assert after.game.population.phase[3] == WAITING
    assert not outcome.caught


def test_a_blind_share_turns_the_score_where_the_skill_is_crossed():
    task = make_task(
        "crowd-10x10", ("sp_8", "sp_9"), objective="mislead", max_cycles=20, like=np.zeros(())
    )
    attacker = Scripted({"sp_8": OnOff(duty=1.0), "sp_9": OnOff(duty=1.0)})

    def score(share):
        return mean_rewards(task.with_blind_share(share), attacker, 0, (1, 8), SEARCHED)[0].mean()

    lost, beyond_blind = score(0.0), score(1.0)
    quotient = lost / (lost - beyond_blind)  # 1 - skill
    assert 0 < quotient < 1
    assert score(0.9 * quotient) > 0 > score(1.1 * quotient)
    assert score(0.0) == mean_rewards(task, attacker, 0, (1, 8), SEARCHED)[0].mean()
