"""Two worlds that swap roles: their ratings are the same, and so is the trust of every model."""

import re

import numpy as np
import pytest

from roletrust_env.metrics.confidence import Estimate
from roletrust_env.trust import Traits, make_trust_model, trust_models
from studies import mirrored
from studies.mirrored import over_both, played, sentence, trust_in, worlds
from studies.study import run

pytestmark = pytest.mark.slow

GAMES = 6
EVERY = pytest.mark.parametrize("name", trust_models())


@pytest.fixture(scope="module")
def half():
    return worlds(10, 10, 8, GAMES, np.random.default_rng(0))


@pytest.mark.parametrize(("honest", "liars"), [(10, 10), (4, 4), (3, 7), (5, 16)])
def test_the_ratings_of_both_worlds_are_the_same_but_for_the_raters(honest, liars):
    here, there = worlds(honest, liars, 5, GAMES, np.random.default_rng(1))
    assert there.quality == pytest.approx(1 - here.quality)
    said = [np.where(world.mask, world.ratings, -1) for world in (here, there)]
    swapped = np.r_[honest : 2 * honest, :honest, 2 * honest : honest + liars]
    np.testing.assert_array_equal(said[0][:, swapped], said[1])


def test_the_honest_say_what_is_and_liars_its_complement(half):
    for world in half:
        truth = np.broadcast_to(world.quality, world.ratings[0, 0].shape)
        for camp, wanted in ((slice(10), truth), (slice(10, None), 1 - truth)):
            apart = (world.ratings[:, camp] - wanted)[world.mask[:, camp]]
            assert abs(apart.mean()) < 0.01
            assert apart.std() < 0.06


@EVERY
def test_trust_is_the_same_in_both_worlds(half, name):
    here, there = (trust_in(name, world)[0] for world in half)
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-9)


@EVERY
@pytest.mark.parametrize(("honest", "liars"), [(10, 10), (8, 12), (16, 16)])
def test_no_model_has_skill_over_both_worlds_by_published_trust(name, honest, liars):
    pair = worlds(honest, liars, 6, GAMES, np.random.default_rng(2))
    assert played(name, pair)[0].mean == pytest.approx(0, abs=1e-6)


@EVERY
def test_only_judges_with_a_trust_of_their_own_escape(half, name):
    own = played(name, half)[1].mean
    personal = Traits.of(make_trust_model(name)).family == "personal"
    assert own > 0.5 if personal else abs(own) < 1e-6


def test_below_the_bound_a_model_may_have_all_skill():
    rng = np.random.default_rng(3)
    assert played("leave-one-out", worlds(12, 8, 10, 12, rng))[0].mean > 0.9
    assert (
        played("leave-one-out", worlds(17, 3 * 4, 10, 12, rng))[0].mean > 0.9
    )  # 3 of 20 with 3 more identities


def test_what_one_world_gives_the_other_takes(half):
    rng = np.random.default_rng(4)
    trust = rng.random((8, GAMES))
    assert over_both([trust, trust], half).mean() == pytest.approx(0, abs=1e-12)
    best = [world.quality for world in half]
    assert over_both(best, half).mean() == pytest.approx(1)
    assert over_both([np.ones((8, GAMES))] * 2, half).mean() == pytest.approx(0)
    assert (
        over_both([np.stack([one, 1 - one]) for one in best], half).mean() < 0.6
    )  # two consumers, one of them misled


def test_the_sentence_counts_the_models_that_are_at_0():
    none, some = Estimate(0.0, 0.0), Estimate(0.25, 0.01)
    text = sentence({"a": (none, none), "b": (none, some), "c": (some, none)})
    assert re.findall(r"\d+ of \d+", text) == ["2 of 3"]
    assert re.findall(r"[\d.]+ ± [\d.]+\d", text) == ["0.250 ± 0.010"] * 2


def test_the_study_draws_every_share(tmp_path, monkeypatch):
    monkeypatch.setattr(mirrored, "trust_models", lambda: ["mean", "own-experience"])
    run("studies.mirrored", ["--games", "2", "--rounds", "4", "--out", str(tmp_path)])
    assert "2 of 2 models" in (tmp_path / "mirrored.md").read_text()
    assert (tmp_path / "mirrored.png").stat().st_size > 10_000
