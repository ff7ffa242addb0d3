"""Scenarios with every feature, drawn and made, and how games of them are played with given
luck."""

from collections.abc import Callable, Iterator
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest

from roletrust_env import Actions, Game, Noise, Random, Scenario, State
from roletrust_env.trees import map_leaves

TOLERANCE = {"rtol": 0, "atol": 1e-12}

# --- scenarios
# --------------------------------------------------------------------------------------


def busy(**fields: Any) -> Scenario:
    """Every feature at once: all roles, turns, joining, leaving, a bad channel, perturbations,
    admission, values."""
    defaults = {
        "agents": [
            {"role": "SP", "count": 2, "ability": [0.3, 0.9], "drift": 0.2, "switch": 0.3},
            {"role": "SR+SP", "count": 2, "noise": 0.1, "ability": 0.8, "scale": [0.5, 1.2]},
            {"role": "SR", "count": 3, "noise": 0.05, "bias": [-0.2, 0.1]},
            {"role": "SR+SP", "count": 3, "turns": ["SR", "SP", "SR+SP"], "turn_length": 2},
            {
                "role": "SR",
                "count": 2,
                "joins": 3,
                "join_rate": 0.4,
                "leave_rate": 0.1,
                "noise": 0.2,
            },
            {"role": "SP", "count": 2, "joins": 1, "leaves": 14, "leave_rate": 0.05},
            {"role": "SR+SP", "count": 2, "reserve": 2, "join_rate": 0.7, "noise": 0.1},
        ],
        "ratings": {"lost": 0.2, "late": 0.3, "delay": 3},
        "perturbations": [
            {"start": 4, "stop": 8, "strength": 0.6},
            {"start": 6, "stop": 9, "strength": 0.3},
        ],
        "values": [1.0, 2.0, 2.0, 5.0],
        "admission": {"threshold": 0.3, "rounds": 4},
        "rewards": {
            "rater_trust": 1.5,
            "provider_trust": 0.7,
            "agent_trust": 2.0,
            "quality_cost": 0.2,
        },
        "max_cycles": 25,
        "lam": 0.6,
        "initial_trust": 0.4,
    }
    return Scenario.model_validate(defaults | fields)


ACCESS = {
    "everyone": {"kind": "everyone"},
    "in-range": {"kind": "in-range", "radius": 4.0, "arena": 8.0, "speed": 1.5},
    "greedy": {"kind": "choice", "providers": 2},
    "softmax": {"kind": "choice", "providers": 3, "temperature": 0.3},
    "exploring": {"kind": "choice", "by": "own", "explore": 0.4},
    "encounters": {"kind": "encounters", "providers": 3},
}
OPEN = {"lost": 0.2, "late": 0.3, "delay": 3, "deadline": 2, "open": 2}
EVERY_ACCESS = pytest.mark.parametrize("access", ACCESS.values(), ids=ACCESS)

shares = st.sampled_from([0.0, 0.3, 1.0])
presences = st.fixed_dictionaries(
    {},
    optional={
        "joins": st.integers(0, 3),
        "join_rate": st.sampled_from([0.3, 1.0]),
        "leaves": st.integers(4, 6),
        "leave_rate": st.sampled_from([0.0, 0.2]),
    },
)


@st.composite
def groups(draw: st.DrawFn, role: str, least: int = 1, core: bool = False) -> dict[str, Any]:
    """A group of agents; one of the core is there from the start, with all that its role does."""
    group = {
        "role": role,
        "count": draw(st.integers(least, 3)),
        "noise": draw(st.sampled_from([0.0, 0.2])),
    }
    if role == "SR+SP" and not core and draw(st.booleans()):
        group |= {
            "turns": draw(st.permutations(["SR", "SP", "SR+SP"])),
            "turn_length": draw(st.integers(1, 2)),
        }
    if role != "SR":
        group["ability"] = draw(st.sampled_from([1.0, 1.0, 0.5, (0.2, 1.0), (0.7, 0.7)]))
        if isinstance(group["ability"], tuple):
            group["drift"] = draw(st.sampled_from([0.0, 0.1, 3.0]))
            group["switch"] = draw(st.sampled_from([0.0, 0.5, 1.0]))
    if role != "SP":
        group |= {"bias": draw(st.sampled_from([0.0, 0.0, -0.1, (-0.3, 0.3)]))}
        group |= {"scale": draw(st.sampled_from([1.0, 1.0, 0.7, (0.5, 1.5)]))}
    return group | draw(presences) | ({"joins": 0, "join_rate": 1.0} if core else {})


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    core = draw(
        st.sampled_from([[("SR", 1), ("SP", 1)], [("SR+SP", 2)], [("SR+SP", 1), ("SP", 1)]])
    )
    agents = [draw(groups(role, least, core=True)) for role, least in core]
    agents += draw(st.lists(st.sampled_from(["SR", "SP", "SR+SP"]).flatmap(groups), max_size=2))
    providers = sum(group["count"] for group in agents if "SP" in group["role"])
    choices = st.builds(
        lambda k, t, e: {"kind": "choice", "providers": k, "temperature": t, "explore": e},
        st.integers(1, providers),
        st.sampled_from([0.0, 0.2]),
        st.sampled_from([0.0, 0.4]),
    )
    to_meet = providers - any(group["role"] == "SR+SP" for group in agents)
    encounters = st.builds(
        lambda k: {"kind": "encounters", "providers": k}, st.integers(1, to_meet)
    )
    fields = {
        "agents": agents,
        "access": draw(
            st.sampled_from([ACCESS["everyone"], ACCESS["in-range"]]) | choices | encounters
        ),
        "ratings": {
            "lost": draw(shares),
            "late": draw(shares),
            "delay": draw(st.integers(1, 9)),
            "deadline": draw(st.sampled_from([1, 1, 2, 4])),
            "open": draw(st.sampled_from([None, None, 1, 2, 9])),
        },
        "perturbations": draw(st.sampled_from([[], [{"start": 1, "stop": 3, "strength": 0.5}]])),
        "values": draw(st.lists(st.sampled_from([0.5, 1.0, 7.0]), min_size=1, max_size=3)),
        "admission": draw(
            st.none() | st.builds(lambda n: {"threshold": 0.5, "rounds": n}, st.integers(1, 3))
        ),
        "max_cycles": draw(st.integers(1, 7)),
        "lam": draw(st.floats(0.5, 1, exclude_max=True)),
        "initial_trust": draw(st.floats(0, 1)),
    }
    return Scenario.model_validate(fields)


# --- playing
# ----------------------------------------------------------------------------------------


def each(function: Callable, *trees: Any) -> Any:
    """Apply a function to the arrays of states, noises or actions; None and flags stay as they
    are."""
    return map_leaves(function, *trees)


def assert_close(actual: Any, expected: Any) -> None:
    each(
        lambda a, b: np.testing.assert_allclose(np.asarray(a), np.asarray(b), **TOLERANCE),
        actual,
        expected,
    )


def luck(
    game: Game, seed: int, batch: tuple[int, ...] = ()
) -> tuple[Noise, list[Actions], list[Noise]]:
    """Return the noise of the start, and actions and noise of every round; ratings often agree, or
    are 0 or 1."""
    rng = np.random.default_rng(seed)
    source, s, p = Random(rng), game.roster.n_raters, game.roster.n_providers

    def notes(*shape: int) -> np.ndarray:
        return np.where(
            rng.random((*shape, *batch)) < 0.5,
            rng.integers(0, 5, (*shape, *batch)) / 4,
            rng.random(),
        )

    def wanted() -> np.ndarray | None:
        return (
            rng.random((game.roster.n_agents, *batch)) < 0.8
            if any(game.roster.identity_index)
            else None
        )

    def kept() -> np.ndarray | None:
        return rng.random((s, p, *batch)) < 0.2 if rng.random() < 0.5 else None

    def shares() -> np.ndarray | None:
        return notes(s, p) if rng.random() < 0.5 else None

    start = game.draw(source, batch, start=True)
    rounds = range(game.scenario.max_cycles)
    actions = [Actions(notes(p), notes(s, p), wanted(), kept(), shares(), shares()) for _ in rounds]
    return start, actions, [game.draw(source, batch) for _ in rounds]


def play(
    game: Game, start: Noise, actions: list[Actions], noises: list[Noise]
) -> Iterator[tuple[State, Any]]:
    state = game.start(start)
    yield state, None
    for action, noise in zip(actions, noises, strict=True):
        state, rewards = game.step(state, action, noise)
        yield state, rewards
