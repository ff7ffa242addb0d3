"""Providers that differ in ability, and raters that see on scales of their own."""

from typing import Any

import numpy as np
import pytest
from refusals import refuses

from roletrust_env import Game, JointPolicy, Scenario, load_scenario, make_scenario, record
from roletrust_env.world.scenario import read_scenario
from roletrust_env.world.vision.service import HogService


def crowd(
    raters: dict[str, Any] | None = None, providers: dict[str, Any] | None = None, **fields: Any
) -> Scenario:
    agents = [
        {"role": "SR", "count": 3} | (raters or {}),
        {"role": "SP", "count": 4} | (providers or {}),
    ]
    return read_scenario({"agents": agents, "max_cycles": 5} | fields, "crowd")


def start(scenario: Scenario, seed: int = 0, batch: tuple[int, ...] = ()) -> Any:
    game = Game(scenario)
    return game.start(game.draw(game.random(seed), batch, start=True))


def test_honest_providers_deliver_their_ability_and_pay_for_no_more() -> None:
    game = Game(crowd(providers={"ability": 0.4}, values=(2.0,)))
    history = record(JointPolicy(game, {}), game.random(0))
    np.testing.assert_array_equal(history.quality, 0.4)
    np.testing.assert_array_equal(history.ratings[1:], 0.4)
    np.testing.assert_allclose(history.rewards[:, 3:], history.top - 0.1 * 2.0 * 0.4)
    np.testing.assert_allclose(game.views(start(game.scenario))[0].trust, 0.5)


def test_in_the_market_who_chooses_by_trust_is_served_better_than_the_mean() -> None:
    game = Game(make_scenario("market").change(max_cycles=60))
    history = record(JointPolicy(game, {}), game.random(0), (30,))
    bought = (history.quality[:, None] * history.served)[30:].sum() / history.served[30:].sum()
    ability = history.quality.max(axis=0)
    assert ability.min() >= 0.3
    assert bought > ability.mean() + 0.15


def test_raters_perceive_scale_times_quality_plus_bias() -> None:
    game = Game(crowd({"bias": 0.1, "scale": 0.5}, {"ability": 0.6}))
    history = record(JointPolicy(game, {}), game.random(0))
    np.testing.assert_allclose(history.ratings[1:], 0.5 * 0.6 + 0.1)
    struck = Game(
        crowd(
            {"bias": -0.4, "scale": 2.0}, perturbations=[{"start": 1, "stop": 2, "strength": 0.75}]
        )
    )
    notes = record(JointPolicy(struck, {}), struck.random(0)).ratings
    np.testing.assert_allclose(
        notes[1:4, 0, 0], [1.0, 2.0 * 0.25 - 0.4, 1.0]
    )  # clipped, dimmed, clipped


def test_a_range_is_drawn_for_each_agent_and_each_game_and_lasts() -> None:
    game = Game(crowd({"bias": (-0.1, 0.0)}, {"ability": (0.2, 0.7)}, max_cycles=4))
    history = record(JointPolicy(game, {}), game.random(3), (2000,))
    ability = history.quality[0]
    assert np.array_equal(history.quality, np.broadcast_to(ability, history.quality.shape))
    assert len(np.unique(ability)) > 7000
    assert ability.min() == pytest.approx(0.2, abs=1e-3)
    assert ability.max() == pytest.approx(0.7, abs=1e-3)
    assert ability.mean() == pytest.approx(0.45, abs=5e-3)
    alone = record(JointPolicy(game, {}), game.random(3))
    np.testing.assert_allclose(alone.quality, history.quality[..., 0], atol=1e-12)
    other = record(JointPolicy(game, {}), game.random(4))
    assert not np.isclose(alone.quality[0], other.quality[0]).any()


def test_luck_of_bias_scale_and_ability_is_independent() -> None:
    properties = start(
        crowd({"bias": (0, 1), "scale": (0, 1)}, {"ability": (0, 1), "count": 3}), 0, (5000,)
    ).properties
    draws = [
        properties.ability.ravel(),
        properties.perception.bias.ravel(),
        properties.perception.scale.ravel(),
    ]
    assert np.abs(np.corrcoef(draws) - np.eye(3)).max() < 5 / np.sqrt(15_000)


@pytest.mark.parametrize("name", ["paper-3x3", "robots-that-move", "open-system", "peers"])
def test_luck_moves_for_nobody_else(name: str) -> None:
    """A range for one group leaves all other luck as it was, that of positions and policies too."""
    plain = make_scenario(name)
    first = next(i for i, group in enumerate(plain.agents) if group.role != "SR")
    groups = [group.model_dump() for group in plain.agents]
    groups[first] |= {"ability": (0.1, 0.9), "drift": 0.1, "switch": 0.1}
    game, other = Game(plain), Game(plain.change(agents=groups))
    random, twin = game.random(1), other.random(1)
    for round in range(70):
        luck, same = (
            game.draw(random, (2,), start=round == 0),
            other.draw(twin, (2,), start=round == 0),
        )
        assert (same.ability is not None) == (round == 0)
        others = same._replace(ability=None, drift=None, switch=None)
        for a, b in zip(luck, others, strict=True):
            assert (a is None) == (b is None)
            assert a is None or np.array_equal(a, b)
        assert np.array_equal(random.uniform((3,)), twin.uniform((3,)))


@pytest.mark.parametrize("name", ["paper-3x3", "robots-that-move", "open-system", "peers"])
def test_the_usual_nature_told_changes_no_bit(name: str) -> None:
    plain = make_scenario(name).change(max_cycles=30)
    told = [g.model_dump() | ({} if g.role == "SR" else {"ability": (1, 1)}) for g in plain.agents]
    told = [g | ({} if g["role"] == "SP" else {"bias": (0, 0), "scale": (1, 1)}) for g in told]
    game, same = Game(plain), Game(plain.change(agents=told))
    assert start(game.scenario).properties == (None, None)
    assert start(same.scenario).properties.ability is not None
    histories = (record(JointPolicy(one, {}), one.random(0), (3,)) for one in (game, same))
    for a, b in zip(*histories, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("raters", "providers", "fields", "words"),
    [
        ({}, {"ability": 1.1}, {}, ["ability", "1.1", "[0, 1]", "range"]),
        ({}, {"ability": (0.9, 0.3)}, {}, ["ability", "[0.9, 0.3]", "(low, high)"]),
        ({}, {"ability": (0.1, 0.2, 0.3)}, {}, ["ability", "(low, high)"]),
        ({}, {"ability": float("nan")}, {}, ["ability", "nan", "[0, 1]"]),
        ({}, {"ability": "much"}, {}, ["ability", "much", "[0, 1]"]),
        ({}, {"ability": [True, 1]}, {}, ["ability", "True", "[0, 1]"]),
        ({}, {"ability": True}, {}, ["ability", "True"]),
        ({"ability": 0.5}, {}, {}, ["ability", "0.5", "provide", "SR"]),
        ({"bias": -1.5}, {}, {}, ["bias", "-1.5", "[-1, 1]"]),
        ({"scale": (-0.1, 1)}, {}, {}, ["scale", "-0.1", "[0, 1e6]"]),
        ({"scale": float("inf")}, {}, {}, ["scale", "inf", "[0, 1e6]"]),
        ({"noise": 1e308}, {}, {}, ["noise", "1e+308", "[0, 1e6]"]),
        (
            {},
            {},
            {"access": {"kind": "in-range", "arena": 1e308}},
            ["access.in-range.arena", "[1e-6, 1e6]"],
        ),
        (
            {},
            {},
            {"access": {"kind": "choice", "temperature": 1e-9}},
            ["temperature", "0", "1e-6", "1e6"],
        ),
        ({}, {"bias": 0.1}, {}, ["bias", "0.1", "raters", "SP"]),
        ({"bias": 0.1}, {}, {"service": "hog"}, ["synthetic", "hog"]),
    ],
    ids=str,
)
def test_what_is_out_of_range_is_refused(
    raters: dict[str, Any], providers: dict[str, Any], fields: dict[str, Any], words: list[str]
) -> None:
    with refuses(ValueError, "crowd", *words):
        crowd(raters, providers, **fields)


def test_a_detector_has_no_taste() -> None:
    perception = start(crowd({"bias": 0.1})).properties.perception
    with refuses(ValueError, "perception"):
        HogService(3, 4, period_s=0.5, max_cycles=5).perceive(
            np.ones(4), 0.0, 0, np.zeros((3, 4)), perception
        )


def test_ranges_from_a_file(tmp_path: Any) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'agents = [{role = "SR", count = 3, bias = [-0.1, 0.1], scale = 0.9},'
        ' {role = "SP", count = 4, ability = [0.5, 1]}]\nmax_cycles = 5'
    )
    expected = crowd({"bias": (-0.1, 0.1), "scale": 0.9}, {"ability": (0.5, 1.0)}, name="mine")
    assert load_scenario(path) == expected
    assert Scenario.model_validate_json(expected.model_dump_json()) == expected
    assert len({expected, load_scenario(path)}) == 1
