"""The trust model with a network: against its formulas loop by loop, its rules, and its files."""

import json
import math

import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("safetensors")

from hypothesis import given, settings
from hypothesis import strategies as st

from roletrust_agents.learned.rater_network import (
    SHAPES,
    SIZE,
    UNITS,
    RaterNetworkTrust,
    split,
    start_weights,
)
from roletrust_agents.learned.saved import digest
from roletrust_agents.learned.saved_defence import (
    DefenceCard,
    SavedTrust,
    load_defence,
    save_defence,
    weights_bytes,
)
from roletrust_env.testing import check_trust_model
from roletrust_env.trust import Ratings
from roletrust_env.trust.edge_run import EdgeRun
from roletrust_env.trust.models.central.leave_one_out import LeaveOneOut


def some_weights(seed=0):
    return np.random.default_rng(seed).normal(0, 0.7, SIZE)


def model_of(vector, **parameters):
    return RaterNetworkTrust(weights=tuple(vector.tolist()), **parameters)


def one_round(ratings, mask, vector):
    """ToR of one round of a model with the defaults, loop by loop."""
    w, initial, prior, power, doubt = split(vector), 0.5, 0.2, 6.0, 0.8
    raters, providers = range(len(ratings)), range(len(ratings[0]))
    met = [(i, j) for i in raters for j in providers if mask[i][j]]
    voice, trust = 0.5, doubt**power  # one rating of each pair, and nobody is known
    means = [np.mean([ratings[i][k] for i, k in met if k == j]) for j in {j for _, j in met}]
    middle = sorted(means)[len(means) // 2] if len(means) > 1 else initial
    base = initial - max(initial - middle, 0)
    view, evidence = {}, {}
    for i, j in met:
        others = [ratings[k][j] for k, h in met if h == j and k != i]
        heard = voice * trust * len(others)
        view[i, j] = (prior * base + voice * trust * sum(others)) / (prior + heard)
        evidence[i, j] = voice * heard / (heard + prior)
    distance = {(i, j): 4 * abs(ratings[i][j] - view[i, j]) for i, j in met}
    pair = {}
    for i, j in met:
        of = [distance[k, h] for k, h in met if h == j]
        y = np.array(
            [
                4 * (ratings[i][j] - view[i, j]),
                distance[i, j],
                ratings[i][j] - initial,
                voice,
                sum(of) / len(of),
            ]
        )
        pair[i, j] = np.tanh(w["pair.weight"] @ y + w["pair.bias"])
    mass = [sum(evidence[i, j] for j in providers if (i, j) in pair) for i in raters]
    own = [
        sum((evidence[i, j] * pair[i, j] for j in providers if (i, j) in pair), np.zeros(UNITS))
        / (mass[i] + 1e-30)
        for i in raters
    ]
    mean = sum(m * u for m, u in zip(mass, own, strict=True)) / (sum(mass) + 1e-30)
    found = []
    for i in raters:
        if not any(mask[i]):
            found.append(trust)
            continue
        near = sum(evidence[i, j] * (1 - distance[i, j] / 4) for j in providers if (i, j) in pair)
        agreement = (doubt + near) / (1 + mass[i])
        hidden = np.tanh(w["rater.weight"] @ own[i] + w["rater.mean"] @ mean + w["rater.bias"])
        said = (
            w["trust.weight"] @ hidden
            + w["trust.agreement"][0] * (agreement - 1)
            + w["trust.bias"][0]
        )
        found.append(agreement**power / (1 + math.exp(-3 - 4 * said)))
    return found


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 4), st.integers(1, 4))
def test_a_round_is_that_of_the_formulas(seed, raters, providers):
    rng = np.random.default_rng(seed)
    ratings, mask = rng.random((raters, providers)), rng.random((raters, providers)) < 0.7
    vector = some_weights(seed)
    model = model_of(vector)
    state = model.update(model.start(ratings), Ratings(ratings, mask))
    np.testing.assert_allclose(
        model.rater_trust(state), one_round(ratings, mask, vector), rtol=1e-9
    )


def test_it_keeps_the_rules_of_trust_models():
    check_trust_model(model_of(some_weights()))


def test_it_plays_a_list_of_ratings_as_a_grid():
    rng, model = np.random.default_rng(3), model_of(some_weights(3))
    shape, run = (9, 5), EdgeRun(model)
    run.join(*shape)
    state = model.start(np.zeros(shape))
    for _ in range(4):
        ratings, mask = rng.random(shape), rng.random(shape) < 0.4
        state = model.update(state, Ratings(ratings, mask))
        run.play(*np.nonzero(mask), ratings[mask])
        np.testing.assert_allclose(run.rater_trust, model.rater_trust(state), rtol=1e-9)
        np.testing.assert_allclose(run.provider_trust, model.provider_trust(state), rtol=1e-9)


def test_it_begins_as_leave_one_out():
    rng = np.random.default_rng(0)
    ratings = rng.random((6, 4, 3))
    network, plain = model_of(start_weights()), LeaveOneOut()
    pairs = [
        (model, model.update(model.start(ratings), Ratings(ratings, ratings >= 0)))
        for model in (network, plain)
    ]
    seen, expected = (model.rater_trust(state) for model, state in pairs)
    np.testing.assert_allclose(seen, expected / (1 + math.exp(-3)))
    np.testing.assert_allclose(*(model.provider_trust(state) for model, state in pairs), atol=0.01)


@pytest.mark.parametrize("wrong", [(), (0.0,) * (SIZE - 1), (math.nan,) * SIZE])
def test_other_weights_are_refused(wrong):
    with refuses(ValueError, "weights"):
        RaterNetworkTrust(weights=wrong)


# --- files ----------------------------------------------------------------------------------------


def card_of(vector, **changes):
    fields = {
        "package_version": "0",
        "conditions": ("crowd",),
        "iteration": 1,
        "seed": 0,
        "settings": {"steps": 2},
    }
    fields["parameters"] = {"power": 3.0}
    return DefenceCard(**{**fields, "weights_sha256": digest(weights_bytes(vector)), **changes})


@pytest.fixture
def saved(tmp_path):
    vector = some_weights()
    save_defence(
        vector, card_of(vector), tmp_path / "network", lambda path, data: path.write_bytes(data)
    )
    return tmp_path / "network", vector


def test_what_is_saved_plays_again(saved):
    path, vector = saved
    card, again = load_defence(path)
    assert card == card_of(vector)
    assert np.array_equal(again, vector)
    for written in (path, path.with_suffix(".json"), path.with_suffix(".safetensors")):
        model = SavedTrust(path=str(written), initial=0.3)
        assert (model.weights, model.initial, model.power) == (tuple(vector.tolist()), 0.3, 3.0)


def test_a_parameter_outside_its_range_is_refused(saved):
    path, _ = saved
    rewrite(path, parameters={"power": 99.0})
    with refuses(ValueError, "power", "99.0"):
        SavedTrust(path=str(path))


@pytest.mark.parametrize("weight", [1e39, -1.1e6, math.inf, math.nan])
def test_a_weight_that_would_overflow_is_refused(weight):
    with refuses(ValueError, "weights", weight):
        RaterNetworkTrust(weights=(weight, *[0.0] * (SIZE - 1)))


def test_the_largest_weights_give_a_trust():
    check_trust_model(RaterNetworkTrust(weights=(1e6,) * SIZE))


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("", ("path",)),
        ("/", ("path", "/")),
        ("none", ("none.json",)),
        ("a\0b", ("a\\x00b.json",)),
        ("x" * 5000, ("path",)),
    ],
)
def test_a_path_without_files_is_said_in_one_line(path, words):
    with refuses(ValueError, *words):
        load_defence(path)


def test_other_weights_than_those_of_the_card_are_not_written(tmp_path):
    with refuses(ValueError, "digest"):
        save_defence(
            some_weights(1), card_of(some_weights(2)), tmp_path / "network", lambda path, data: None
        )


def rewrite(path, **changes):
    file = path.with_suffix(".json")
    file.write_text(json.dumps({**json.loads(file.read_text()), **changes}))


def replace_weights(path, **changes):
    from safetensors.numpy import save

    parts = {
        name: part
        for name, part in {**split(some_weights()), **changes}.items()
        if part is not None
    }
    path.with_suffix(".safetensors").write_bytes(save(parts))
    rewrite(path, weights_sha256=digest(path.with_suffix(".safetensors").read_bytes()))


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.with_suffix(".json").unlink(), ("--defence",)),
        (lambda path: path.with_suffix(".safetensors").unlink(), ("--defence",)),
        (lambda path: path.with_suffix(".json").write_text("{"), ("JSON",)),
        (lambda path: path.with_suffix(".json").write_bytes(b" " * 200_000), ("100000",)),
        (lambda path: path.with_suffix(".safetensors").write_bytes(b"0" * 200_000), ("11552",)),
        (lambda path: path.with_suffix(".safetensors").write_bytes(b"none"), ("digest",)),
        (
            lambda path: rewrite(path, format="roletrust-attacker"),
            ("format", "roletrust-attacker", "roletrust-defence"),
        ),
        (lambda path: rewrite(path, extra=1), ("extra", "1")),
        (lambda path: rewrite(path, units=9), ("units",)),
        (lambda path: rewrite(path, features=["level"]), ("features",)),
        (lambda path: rewrite(path, parameters={"pwer": 1.0}), ("pwer",)),
        (lambda path: replace_weights(path, more=np.zeros(1)), ("weights", "pair.bias")),
        (lambda path: replace_weights(path, **{"pair.bias": None}), ("weights", "pair.bias")),
        (
            lambda path: replace_weights(path, **{"pair.bias": np.zeros(3)}),
            ("pair.bias", "(3,)", "(8,)"),
        ),
        (
            lambda path: replace_weights(path, **{"pair.bias": np.zeros(UNITS, np.float32)}),
            ("pair.bias", "float32", "float64"),
        ),
        (
            lambda path: replace_weights(path, **{"pair.bias": np.full(UNITS, np.nan)}),
            ("-1e+06",),
        ),
        (
            lambda path: replace_weights(path, **{"pair.bias": np.full(UNITS, 1e39)}),
            ("pair.bias",),
        ),
        (lambda path: rewrite(path, iteration=0), ("iteration", "0")),
    ],
)
def test_a_hostile_file_is_refused(saved, spoil, words):
    path, _ = saved
    spoil(path)
    with refuses(ValueError, *words):
        load_defence(path)


def test_every_weight_has_a_place():
    parts = split(np.arange(float(SIZE)))
    assert {name: part.shape for name, part in parts.items()} == dict(SHAPES)
    assert np.array_equal(
        np.concatenate([part.reshape(-1) for part in parts.values()]), np.arange(SIZE)
    )
