"""Traced rounds are those of the rules to the last bit, however a game goes on; what is not traced
says so."""

import copy
import pickle
import re
from typing import Any

import numpy as np
import pytest
from pages import HOUSE, blocks

import roletrust_env
from roletrust_env import Policy, RoleTrustParallelEnv, Scenario, parallel_env
from roletrust_env.envs.attack_env import ProviderAttackEnv, RaterAttackEnv
from roletrust_env.game.traced import compiler, rounds
from roletrust_env.trees import leaves
from roletrust_env.trust.model import registry
from roletrust_env.trust.models import Mean

needs_compiler = pytest.mark.skipif(compiler.compiler() is None, reason="there is no C compiler")

UNTRACED = {"beta-filtered", "iterative-filtering", "travos"}
"""Models that branch on values."""

BOTH = {"role": "SR+SP", "count": 2, "noise": 0.1, "ability": (0.5, 1.0), "scale": (0.8, 1.0)}
RATERS, PROVIDERS = (
    {"role": "SR", "count": 2, "noise": 0.1, "bias": 0.05},
    {"role": "SP", "count": 2},
)
FEATURES: dict[str, dict[str, Any]] = {
    "two roles, differences": {"agents": [RATERS, PROVIDERS, BOTH]},
    "roles in turn": {
        "agents": [RATERS, PROVIDERS, BOTH | {"turns": ["SR", "SP"], "turn_length": 3}]
    },
    "joins and leaves": {
        "agents": [
            RATERS,
            PROVIDERS,
            RATERS | {"joins": 4, "leaves": 9},
            PROVIDERS | {"join_rate": 0.3},
        ],
        "admission": {"threshold": 0.45, "rounds": 3},
    },
    "losses and delays": {
        "agents": [RATERS, PROVIDERS],
        "ratings": {"lost": 0.2, "late": 0.3, "delay": 2},
    },
    "in range": {
        "agents": [RATERS, PROVIDERS, BOTH],
        "access": {"kind": "in-range", "radius": 4.0, "arena": 9.0},
    },
    "choice": {
        "agents": [RATERS, PROVIDERS],
        "access": {"kind": "choice", "providers": 1, "temperature": 0.1},
    },
    "encounters": {
        "agents": [RATERS, PROVIDERS, BOTH],
        "access": {"kind": "encounters", "providers": 2},
    },
    "values": {"agents": [RATERS, PROVIDERS], "values": [1.0, 3.0]},
}


def bits(seen: Any) -> list[bytes]:
    """What an environment returned, to the bit."""
    if isinstance(seen, dict):
        return [
            part for key, value in sorted(seen.items()) for part in (key.encode(), *bits(value))
        ]
    if isinstance(seen, tuple | list):
        return [part for value in seen for part in bits(value)]
    return [np.asarray(seen).tobytes(), str(np.asarray(seen).dtype).encode()]


def played(env: RoleTrustParallelEnv, seed: int = 3, n: int = 99) -> list[Any]:
    """What n rounds of an environment return, with the state after each, and its arrays after every
    fifth."""
    rng, seen = np.random.default_rng(seed), [env.reset(seed=seed)]
    while env.agents and n:
        n -= 1
        actions = {a: rng.random(env.action_space(a).shape, dtype=np.float32) for a in env.agents}
        seen.append((env.step(actions), env.state()))
        if n % 5 == 0:
            seen.append([leaf for leaf in leaves(env._state) if leaf is not None])
    return seen


def both_ways(patch: pytest.MonkeyPatch, make: Any) -> tuple[Any, Any]:
    """The same environment traced and not."""
    with patch.context() as off:
        off.setenv(rounds.SWITCH, "0")
        plain = make()
    return make(), plain


def test_every_model_plays_to_the_bit_as_untraced(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = 0
    for model in registry.names():
        scenario = Scenario(agents=[RATERS, PROVIDERS], max_cycles=9)
        traced, plain = both_ways(monkeypatch, lambda: parallel_env(scenario, model))  # noqa: B023
        assert bits(played(traced)) == bits(played(plain)), model
        assert repr(traced.rounds).startswith("untraced" if model in UNTRACED else "traced"), (
            model,
            traced,
        )
        assert bool(traced.rounds.forms) == (model not in UNTRACED)
        assert "untraced: ROLETRUST_TRACED is 0" in repr(plain)
        pairs += 1
    assert pairs >= 25


@pytest.mark.parametrize("feature", FEATURES)
def test_every_feature_of_a_scenario_plays_to_the_bit_as_untraced(
    feature: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = Scenario(max_cycles=24, **FEATURES[feature])
    for model in ("role-trust", "deviation-weighted"):
        traced, plain = both_ways(monkeypatch, lambda: parallel_env(scenario, model))  # noqa: B023
        assert bits(played(traced)) == bits(played(plain))
        assert traced.rounds.forms
        assert repr(traced.rounds).startswith("traced")


def check_compiled(scenario: Scenario, model: str, patch: pytest.MonkeyPatch) -> int:
    """Compare compiled rounds with those of the rules; return the number of forms that are
    compiled."""
    env, plain = both_ways(patch, lambda: parallel_env(scenario, model))
    played(env)
    env.rounds.compile()
    for seed in (3, 4):
        assert bits(played(env, seed)) == bits(played(plain, seed)), (model, scenario)
    return sum(form.compiled is not None for form in env.rounds.forms)


@needs_compiler
def test_compiled_rounds_play_to_the_bit_as_untraced(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = Scenario(max_cycles=24, **FEATURES["two roles, differences"])
    assert check_compiled(scenario, "role-trust", monkeypatch) == 3  # it calls NumPy's power, too


@needs_compiler
def test_copies_and_refusals_in_the_middle_of_compiled_rounds_go_on_to_the_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rounds, "_KNOWN", {})
    env, plain = both_ways(monkeypatch, parallel_env)
    played(env)
    env.rounds.compile()
    for one in (env, plain):
        played(one, n=20)
    assert repr(env.rounds) == "traced, compiled"
    twins = [copy.deepcopy(env), pickle.loads(pickle.dumps(env)), env]
    actions = {a: env.action_space(a).sample() for a in env.agents}
    for k in range(12):
        if k == 6:  # a round in C that differs is given up
            form = env.rounds._form
            monkeypatch.setattr(form.compiled, "play", lambda memory: memory.state.fill(0.5))
            form.unchecked = 1
        expected = bits([plain.step(actions), plain.state()])
        assert all(bits([twin.step(actions), twin.state()]) == expected for twin in twins)
    assert form.compiled is None
    assert "untraced" not in repr(env)


@needs_compiler
@pytest.mark.slow
def test_every_model_and_feature_plays_to_the_bit_when_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    n_compiled = {
        model: check_compiled(
            Scenario(agents=[RATERS, PROVIDERS], max_cycles=24), model, monkeypatch
        )
        for model in registry.names()
    }
    assert {model for model, n in n_compiled.items() if not n} == UNTRACED
    for feature in FEATURES.values():
        for model in ("role-trust", "deviation-weighted"):
            assert check_compiled(Scenario(max_cycles=24, **feature), model, monkeypatch) > 2


def test_a_whole_episode_of_the_paper_and_the_next_one(monkeypatch: pytest.MonkeyPatch) -> None:
    traced, plain = both_ways(monkeypatch, parallel_env)
    for seed in (1, 2):
        assert bits(played(traced, seed, n=240)) == bits(played(plain, seed, n=240))
    assert len(traced.rounds.forms) <= 4


@pytest.mark.parametrize("clone", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_a_copy_in_the_middle_of_an_episode_goes_on_to_the_bit(clone: Any) -> None:
    env = parallel_env()
    played(env, n=9)
    twin, actions = clone(env), {a: env.action_space(a).sample() for a in env.agents}
    for _ in range(8):
        assert bits([env.step(actions), env.state()]) == bits([twin.step(actions), twin.state()])


def test_a_pickle_goes_by_the_switch_of_the_process_that_loads_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    traced, plain = both_ways(monkeypatch, parallel_env)
    kept = pickle.dumps([traced, plain])
    assert [repr(env.rounds) for env in pickle.loads(kept)] == ["traced"] * 2
    monkeypatch.setenv(rounds.SWITCH, "0")
    assert all("untraced" in repr(env.rounds) for env in pickle.loads(kept))


def test_zeros_keep_the_sign_that_numpy_gives_them(monkeypatch: pytest.MonkeyPatch) -> None:
    choices = np.array([-0.0, 0.0, 1.0], np.float32)
    for model in ("role-trust", "trimmed-mean", "power-trust", "own-experience"):
        seen = []
        traced, plain = both_ways(
            monkeypatch,
            lambda: parallel_env(max_cycles=20, noise=0.0, trust_model=model),  # noqa: B023
        )
        for env in (traced, plain):
            rng = np.random.default_rng(0)
            seen.append(bits(env.reset(seed=1)))
            while env.agents:
                seen[-1] += bits(
                    env.step(
                        {a: rng.choice(choices, env.action_space(a).shape) for a in env.agents}
                    )
                )
        assert seen[0] == seen[1], model
        assert repr(traced.rounds).startswith("traced")


@pytest.mark.parametrize("knowledge", ["black_box", "grey_box", "white_box"])
@pytest.mark.parametrize("objective", ["damage", "mislead"])
def test_tasks_play_to_the_bit_as_untraced(
    knowledge: str, objective: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def make() -> RaterAttackEnv:
        return RaterAttackEnv(
            knowledge=knowledge, objective=objective, stealth={"weight": 0.5}, max_cycles=20
        )

    seen = []
    for env in both_ways(monkeypatch, make):
        env.action_space.seed(0)
        seen.append([env.reset(seed=1), *(env.step(env.action_space.sample()) for _ in range(20))])
        assert bool(env.rounds.forms) == ("traced" in repr(env) and "untraced" not in repr(env))
    assert bits(seen[0]) == bits(seen[1])


class Foreign(Mean):
    """A model of another package."""


class Around:
    """A model of another package, around one of ours; all have the same text."""

    rates_raters = True

    def __init__(self, model: Any) -> None:
        self.model = model
        self.start, self.update = model.start, model.update
        self.rater_trust, self.provider_trust = model.rater_trust, model.provider_trust

    def __repr__(self) -> str:
        return "Around()"


class Moody(Policy):
    """Serves at random."""

    attacks = frozenset({"quality"})

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return random.uniform(view.trust.shape), memory


def test_a_policy_that_draws_random_numbers_is_not_traced_and_draws_them_as_before() -> None:
    env, seen = ProviderAttackEnv(others={"sp_0": Moody()}), []
    for _ in range(2):
        env.reset(seed=4)
        seen.append([env.step(np.ones(1, np.float32)) for _ in range(4)])
    assert bits(seen[0]) == bits(seen[1])
    assert "untraced: a policy draws random numbers" in repr(env)


class Later(Policy):
    """Serves badly in one round, by the entries of a plain array."""

    attacks = frozenset({"quality"})

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return np.where(np.asarray(view.round) == 10, 0.0, 1.0), memory


class Elsewhere(Later):
    """The same, by Python."""

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + (10 not in np.asarray(view.round).ravel().tolist()), memory


class Learner(Policy):
    """Serves by a weight, which a trainer may change."""

    attacks = frozenset({"quality"})

    def __init__(self) -> None:
        self.weight = 0.5

    def quality(self, view: Any, memory: Any, random: Any) -> Any:
        return 0 * view.trust + self.weight, memory


@pytest.mark.parametrize("policy", [Later(), Elsewhere()])
def test_a_policy_that_leaves_the_array_of_symbols_is_not_traced(
    policy: Policy, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []
    for env in both_ways(monkeypatch, lambda: RaterAttackEnv(others={"sp_0": policy})):
        env.reset(seed=1)
        seen.append(bits([env.step(np.ones(3, np.float32)) for _ in range(14)]))
        assert "untraced" in repr(env)
    assert seen[0] == seen[1]


def test_games_side_by_side_trace_a_round_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "_KNOWN", {})
    envs = [RaterAttackEnv() for _ in range(7)]
    for env in envs:
        env.reset(seed=1)
    for _ in range(4):
        for env in envs:
            env.step(np.ones(3, np.float32))
    assert len(envs[0].rounds.forms) == 3


def test_a_copy_knows_the_rounds_of_policies_that_are_copied_too() -> None:
    class Bad(Policy):
        attacks = frozenset({"quality"})

        def quality(self, view: Any, memory: Any, random: Any) -> Any:
            return 0 * view.trust, memory

    env = RaterAttackEnv(others={"sp_0": Bad()})
    env.reset(seed=1)
    for _ in range(9):
        env.step(np.ones(3, np.float32))
    twin = copy.deepcopy(env)
    assert twin.rounds._known is env.rounds._known
    for _ in range(3):
        assert bits(twin.step(np.ones(3, np.float32))) == bits(env.step(np.ones(3, np.float32)))


def test_a_division_by_zero_is_played_by_the_rules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "_KNOWN", {})
    env = parallel_env()
    played(env, n=20)
    form, numbers = env.rounds._form, env.rounds._numbers
    assert form is not None

    def fails(*_: Any) -> Any:
        return 1 / 0

    monkeypatch.setattr(form, "written", form.written._replace(play=fails))
    twin = copy.deepcopy(env)
    actions = {a: np.full(env.action_space(a).shape, 0.5, np.float32) for a in env.agents}
    assert bits(env.step(actions)) == bits(twin.step(actions))
    assert numbers != env.rounds._numbers


def test_a_round_that_differs_from_the_rules_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rounds, "_KNOWN", {})
    monkeypatch.setattr(
        "roletrust_env.game.traced.tape._sin", lambda: lambda angle: np.nextafter(np.sin(angle), 2)
    )
    env = parallel_env()
    seen = bits(played(env, n=9))
    assert "untraced: a written round differs" in repr(env)
    monkeypatch.undo()
    assert seen == bits(played(parallel_env(), n=9))


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (lambda: parallel_env("market"), "240 pairs are more than 100"),
        (lambda: RaterAttackEnv(like=np.zeros((), np.float32)), "float64"),
        (lambda: parallel_env(trust_model=Foreign()), "another package"),
        (lambda: parallel_env(trust_model=Around(Mean())), "another package"),
        (lambda: RaterAttackEnv(others={"sp_0": Learner()}), "learner may change"),
    ],
)
def test_what_is_not_traced_says_why(make: Any, reason: str) -> None:
    assert re.search(f"untraced: .*{reason}", repr(make()))


def test_the_page_shows_the_round_that_is_written() -> None:
    (code,), (shown,) = (
        blocks(HOUSE / "docs/how/traced.md", language) for language in ("python", "text")
    )
    names: dict[str, Any] = {}
    exec(code.replace("print(", "written = ("), names)
    assert names["written"] == shown


def test_sums_are_in_the_order_of_numpy() -> None:
    scenario = Scenario(
        agents=[{"role": "SR", "count": 11, "noise": 0.2}, {"role": "SP", "count": 9}], max_cycles=9
    )
    env = roletrust_env.parallel_env(scenario)
    played(env)
    assert repr(env.rounds).startswith("traced")
