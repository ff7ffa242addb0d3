import csv

import numpy as np
import pytest

from roletrust_baselines import OnOff
from roletrust_env import JointPolicy, SparseGame, make_trust_model
from roletrust_env.game.rollout import rollout
from roletrust_env.metrics.confidence import Estimate
from roletrust_env.metrics.consumers import skill
from studies.scale import Harm, _caption, attackers, city, main, measure_harm

pytestmark = pytest.mark.slow


def test_the_page_and_the_tables(tmp_path):
    small = ["--agents", "25", "--agents", "60", "--seeds", "2", "--rounds", "4", "--model", "mean"]
    main([*small, "--out", str(tmp_path)])
    with (tmp_path / "scale-harm.csv").open() as file:
        harms = list(csv.DictReader(file))
    assert len(harms) == 2 * 7
    for row in harms:
        assert float(row["harm"]) == 0 or row["attack"] != "honest"
    assert f"| mean | on-off | 40% | {float(harms[4]['harm']):.3f} ± " in (tmp_path / "scale.md").read_text()


@pytest.mark.parametrize(("agents", "raters", "providers"), [(25, 20, 5), (104, 84, 20)])
def test_a_city_has_four_raters_to_a_provider(agents, raters, providers):
    scenario = city(agents, 7)
    of = {role: sum(group.count for group in scenario.agents if group.role == role) for role in ("SR", "SP")}
    assert of == {"SR": raters, "SP": providers}
    assert scenario.max_cycles == 7
    assert {group.noise for group in scenario.agents if group.role == "SR"} == {0.05}
    assert {group.ability for group in scenario.agents if group.role == "SP"} == {(0.3, 1.0)}


def test_who_attacks_a_city():
    game = SparseGame(city(50, 2), "mean")
    liars = attackers(game, "bad-mouthing", 0.2)
    assert list(liars) == [f"sr_{n}" for n in range(8)]
    assert attackers(game, "on-off", 0.01) == {"sp_0": OnOff(period=10)}
    ring = attackers(game, "collusion", 0.4)
    assert len(ring) == 16 + 4
    assert ring["sp_3"].accomplices == (0, 1, 2, 3)


def test_harm_is_the_skill_that_is_lost_in_the_same_luck():
    found = measure_harm([100], {"mean": make_trust_model("mean")}, [0.4], rounds=8, seeds=[3, 4])
    game = SparseGame(city(100, 8), "mean")
    by_hand = []
    for policies in ({}, attackers(game, "collusion", 0.4)):
        utilities = []
        for seed in (3, 4):
            random = game.random(seed)
            sums = np.zeros(3)
            for before, actions, after, *_ in rollout(JointPolicy(game, policies), random, random):
                for i, met in enumerate(after.met):
                    top, offer = game.published(before)[1][met], game.offered(before, actions, after)[met]
                    served = after.awaiting[i]
                    if served.any():
                        trusted = served & (top == top[served].max())
                        sums += [offer[trusted].mean(), offer[served].max(), offer[served].mean()]
            utilities.append((sums[0] / sums[1], sums[2] / sums[1]))
        by_hand.append(skill(*np.array(utilities).T))
    (ring,) = [one for one in found if one.attack == "collusion"]
    assert ring.skill.mean == pytest.approx(by_hand[1].mean(), abs=1e-12)
    assert ring.harm.mean == pytest.approx((by_hand[0] - by_hand[1]).mean(), abs=1e-12)
    assert ring.harm.mean > 0.1


def test_the_caption_says_how_harm_changes_with_size():
    def harm(agents, attack, value, half):
        return Harm(agents, "mean", attack, 0.2, Estimate(0.5, 0.1), Estimate(value, half))

    rows = [harm(25, "a", 9.0, 0.1), harm(25, "b", 9.0, 0.1), harm(100, "a", 0.3, 0.03), harm(100, "b", 0.1, 0.03)]
    assert "From" not in _caption(rows, 3, 5)
    caption = _caption([*rows, harm(1000, "a", 0.34, 0.04), harm(1000, "b", 0.16, 0.04)], 3, 5)
    assert "From 100 to 1,000 agents the harm of a condition changes by +0.050 on average" in caption
    assert "from +0.040 to +0.060; in 1 of 2 conditions" in caption
