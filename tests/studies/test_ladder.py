"""Ladders of attacks on small tasks."""

from dataclasses import replace

import pytest
from csv_files import csv_rows
from refusals import refuses

from roletrust_agents.learned.saved import ZOO, load_attacker, save_attacker
from roletrust_agents.training.runs import write_bytes
from roletrust_env import make_scenario
from roletrust_env.evaluation.search import UnsuitableError, find
from roletrust_env.trust import Traits, make_trust_model
from studies.study import run
from studies.trained import Learned

pytestmark = pytest.mark.slow

CERTAIN = ["--set", "noise=0", "--set", "perturbations=[]", "--set", "max_cycles=15"]


def climb(out, task, *arguments, budget=6000):
    """The scores of each rung by run, and the page."""
    run(
        "studies.ladder",
        [
            "task",
            "--task",
            task,
            *arguments,
            "--budget",
            str(budget),
            "--games",
            "4",
            "--out",
            str(out),
        ],
    )
    rows = csv_rows(out / "ladder.csv")
    rungs = {}
    for row in rows:
        rungs.setdefault(row["rung"], []).append(float(row["score"]))
    return rungs, (out / "ladder.md").read_text(), rows


@pytest.mark.parametrize(
    ("task", "options", "top", "other"),
    [("ProviderAttack", [], "exact", "best known"), ("RaterAttack", [], "best known", "exact")],
)
def test_where_the_optimum_is_known(tmp_path, task, options, top, other):
    rungs, page, rows = climb(tmp_path, task, *CERTAIN, *options)
    (honest,), (best,), (planned,) = rungs["honest play"], rungs[top], rungs["white-box planner"]
    assert max(score for scores in rungs.values() for score in scores) <= best + 1e-9
    assert (planned - honest) / (best - honest) > 0.85
    assert all(float(row["half_95"]) == pytest.approx(0, abs=1e-6) for row in rows)
    assert all(int(row["rounds"]) <= 6000 for row in rows)
    assert f"- Left out: {other}: " in page
    assert "the exact optimum" in page or "a bound that is proven" in page
    assert (tmp_path / "ladder.png").stat().st_size > 10_000


def test_runs_are_the_ladders_of_their_seeds_side_by_side(tmp_path):
    task = ["RaterAttack", "--set", "max_cycles=8"]
    together = climb(tmp_path / "both", *task, "--runs", "2", "--seed", "7")[0]
    alone = [climb(tmp_path / str(k), *task, "--seed", str(k))[0] for k in (7, 8)]
    for rung, scores in together.items():
        assert scores == pytest.approx([one[rung][0] for one in alone], abs=1e-6)


def test_attacks_may_be_given_with_some_parameters_fixed(tmp_path):
    attack = ["--attack", "bad-mouthing:lie=relative,targets=sp_1"]
    _, page, _ = climb(tmp_path, "RaterAttack", *CERTAIN, *attack)
    assert "- scripted, default: sr_2: bad-mouthing:lie=relative," in page


def test_the_runs_of_a_training_are_one_rung(tmp_path):
    zoo = load_attacker(ZOO / "provider-3x3")
    for seed in (3, 4):
        card = zoo.card.model_copy(
            update={"training": zoo.card.training.model_copy(update={"seed": seed})}
        )
        save_attacker(
            replace(zoo, card=card), tmp_path / "mine" / f"seed-{seed}" / "attacker", write_bytes
        )
    options = ["--runs", "2", "--seed", "3", "--learned", str(tmp_path / "mine")]
    rungs, _, _ = climb(tmp_path / "out", "ProviderAttack", *CERTAIN, *options, budget=2000)
    assert len(rungs["learned"]) == 2


def test_a_trained_attacker():
    zoo = Learned(ZOO / "provider-3x3")
    arguments = {
        "scenario": "paper-3x3",
        "noise": 0.0,
        "perturbations": (),
        "max_cycles": 200,
        "objective": "exploit",
    }
    measured = {"budget": 0, "seed": 0, "games": 2}
    trained = find(zoo, {**arguments, "compromised": ("sp_2",)}, **measured)
    assert trained.scores.mean() > 0.23  # the best regular script has 0.230
    assert trained.rounds > 100_000
    assert trained.seconds > 10
    four = make_scenario("paper-3x3").change(
        agents=[{"role": "SR", "count": 4}, {"role": "SP", "count": 3}]
    )
    with refuses(UnsuitableError, "12", "1"):
        find(zoo, {**arguments, "compromised": ("sp_2",), "scenario": four}, **measured)


@pytest.mark.parametrize("name", ["eigentrust", "huber-mean", "peer-trust"])
def test_a_ladder_plans_where_trust_has_no_jumps(tmp_path, name):
    rungs = climb(tmp_path, "RaterAttack", "--set", "max_cycles=4", "--model", name, budget=2000)[0]
    assert {"honest play", "scripted, default", "random search", "CMA-ES"} <= set(rungs)
    assert ("white-box planner" in rungs) == Traits.of(make_trust_model(name)).differentiable
