"""`python -m studies.ladder`."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from study_line import app
from typer.testing import CliRunner

from roletrust_agents.learned.methods import Learned, learned_methods
from roletrust_agents.learned.saved import ZOO, load_attacker, save_attacker
from roletrust_agents.training.runs import write_bytes
from roletrust_baselines.search import PaperAttacks
from roletrust_env import make_scenario
from roletrust_env.evaluation.measurement import exact_task
from roletrust_env.evaluation.search import UnsuitableError, find
from roletrust_env.trust import Traits, make_trust_model
from roletrust_experiments.commands.options import find_task
from studies.ladder.trajectory import watch

pytestmark = pytest.mark.slow

CERTAIN = ["--set", "noise=0", "--set", "perturbations=[]", "--set", "max_cycles=15"]


def run(*arguments):
    return CliRunner().invoke(app, ["ladder", *arguments])


def climb(out, *arguments, budget=1500):
    result = run(*arguments, "--budget", str(budget), "--games", "3", "--out", str(out))
    assert result.exit_code == 0, result.output
    return json.loads((out / "ladder.json").read_text()), result.output


@pytest.mark.parametrize(
    ("task", "options", "top", "other", "said"),
    [
        ("ProviderAttack", ["--learned", f"{ZOO}/provider-3x3"], "exact", "best known", "1 is the exact optimum"),
        ("RaterAttack", ["--stealth-weight", "2"], "best known", "exact", "1 is a bound that is proven"),
    ],
)
def test_where_the_optimum_is_known(tmp_path, task, options, top, other, said):
    results, printed = climb(tmp_path, task, *CERTAIN, *options, budget=6000)
    rungs = {rung["rung"]: rung for rung in results["rungs"]}
    assert next(iter(rungs)) == "honest play"
    assert list(rungs)[-1] == top
    assert rungs["honest play"]["share"] == 0
    assert (rungs[top]["share"] == 1) == (top == "exact")
    assert 0.98 < rungs[top]["share"] <= 1
    assert rungs["white-box planner"]["share"] > 0.9
    assert max(rung["share"] for rung in rungs.values()) <= 1
    learned = rungs.pop("learned", {"runs": []})
    assert all(run["rounds"] > 6000 for run in learned["runs"])
    assert ("more than the budget of 6,000 rounds" in printed) == bool(learned["runs"])
    assert all(rung["runs"][0]["rounds"] <= 6000 for rung in rungs.values())
    assert all(rung["half_95"] == 0 for rung in rungs.values())
    assert said in printed
    assert set(results["not_applicable"]) == {other}
    with (tmp_path / "ladder.csv").open() as file:
        assert [row["rung"] for row in csv.DictReader(file)] == [rung["rung"] for rung in results["rungs"]]
    with (tmp_path / "trajectories.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len({row["attack"] for row in rows}) == 2
    assert max(int(row["round"]) for row in rows) == 14
    assert (tmp_path / "ladder.png").stat().st_size > 10_000
    assert not list(tmp_path.glob(".*"))


def test_where_it_is_not_the_best_found_is_1(tmp_path):
    results, printed = climb(tmp_path, "CollusionAttack", "--set", "max_cycles=5", "--stealth-weight", "2")
    assert max(rung["share"] for rung in results["rungs"]) == 1
    assert all(rung["half_95"] > 0 for rung in results["rungs"])
    assert "raters under damage" in results["not_applicable"]["best known"]
    assert "the best that was found" in printed
    assert results["stealth"] == {"weight": 2.0, "tolerance": 0.1}


def test_runs_are_the_ladders_of_their_seeds_side_by_side(tmp_path):
    task = ["RaterAttack", "--set", "max_cycles=8"]
    together, printed = climb(tmp_path / "both", *task, "--runs", "2", "--seed", "7")
    alone = [climb(tmp_path / str(k), *task, "--seed", str(k))[0]["rungs"] for k in (7, 8)]
    for rung, *ones in zip(together["rungs"], *alone, strict=True):
        scores = [one["score"] for one in ones]
        assert [run["score"] for run in rung["runs"]] == pytest.approx(scores, abs=1e-12)
        assert [run["run"] for run in rung["runs"]] == [7, 8]
        assert rung["score"] == pytest.approx(np.mean(scores))
        # Student's 95% quantile for one degree of freedom is 12.706; of two numbers the error is half their distance.
        assert rung["half_95"] == pytest.approx(12.706 * abs(scores[0] - scores[1]) / 2, rel=1e-4, abs=1e-12)
    honest, *_, planner = together["rungs"]
    assert planner["runs_above"]["honest play"] == 2
    assert honest["runs_above"]["white-box planner"] == 0
    assert "Number of the 2 runs" in printed
    with (tmp_path / "both" / "ladder.csv").open() as file:
        assert [row["run"] for row in csv.DictReader(file)] == ["7", "8"] * len(together["rungs"])


def test_an_agent_with_both_roles(tmp_path):
    results, _ = climb(tmp_path, "DualAttack", "--set", "max_cycles=5", "--model", "mean")
    assert results["trust_model"]["class"].endswith("Mean")


def test_other_attacks_are_searched_also_your_own_and_with_some_parameters_given(tmp_path, monkeypatch):
    (tmp_path / "my_lies_for_test.py").write_text(
        "from dataclasses import dataclass\nfrom roletrust_baselines import BadMouthing\n"
        "from roletrust_env.parameters import Share\n"
        "@dataclass(frozen=True)\nclass Liar(BadMouthing):\n    zeal: Share = 0.5\n"
    )
    monkeypatch.chdir(tmp_path)
    kinds = ["my_lies_for_test:Liar", "bad-mouthing:lie=relative,targets=sp_1"]
    options = [part for kind in kinds for part in ("--attack", kind)]
    results, _ = climb(tmp_path / "out", "RaterAttack", *CERTAIN, *options)
    rungs = {rung["rung"]: rung["runs"][0]["attack"] for rung in results["rungs"]}
    assert results["attacks"] == kinds
    assert rungs["scripted, default"] == "sr_2: liar:lie=constant,level=0.5,zeal=0.5"
    assert rungs["random search"].startswith("sr_2: liar:lie=")


def test_a_trained_attacker():
    zoo = Learned(ZOO / "provider-3x3")
    arguments = {"scenario": "paper-3x3", "noise": 0.0, "perturbations": (), "max_cycles": 200, "objective": "exploit"}
    measured = {"budget": 0, "seed": 0, "games": 2}
    trained = find(zoo, {**arguments, "compromised": ("sp_2",)}, **measured)
    assert trained.scores.mean() > 0.23  # the best regular script has 0.230
    assert trained.rounds > 100_000
    assert trained.seconds > 10
    four = make_scenario("paper-3x3").change(agents=[{"role": "SR", "count": 4}, {"role": "SP", "count": 3}])
    with pytest.raises(UnsuitableError, match="this task has 12 and 1"):
        find(zoo, {**arguments, "compromised": ("sp_2",), "scenario": four}, **measured)


def trained(folder, seed, **other):
    """A saved attacker of a training with a seed, as `roletrust train --runs` leaves it."""
    zoo = load_attacker(ZOO / "provider-3x3")
    card = zoo.card.model_copy(update={"training": zoo.card.training.model_copy(update={"seed": seed, **other})})
    save_attacker(replace(zoo, card=card), folder / f"seed-{seed}" / "attacker", write_bytes)


def test_the_runs_of_a_training_are_one_rung(tmp_path):
    for seed in (4, 5):
        trained(tmp_path, seed)
    assert [rung.path.name for rung in learned_methods(tmp_path, (4, 5), "learned")] == ["seed-4", "seed-5"]
    assert learned_methods(tmp_path / "seed-5", (0,), "learned") == [Learned(tmp_path / "seed-5")]
    with pytest.raises(ValueError, match="of the seeds 4, 5; this ladder has the seeds 4, 5, 6"):
        learned_methods(tmp_path, (4, 5, 6), "learned")
    with pytest.raises(ValueError, match="the seeds none"):
        learned_methods(tmp_path / "seed-5", (4, 5), "learned")
    trained(tmp_path, 6, steps=1)
    with pytest.raises(ValueError, match="differ in more than their seed"):
        learned_methods(tmp_path, (4, 5, 6), "learned")


def test_trajectory_is_what_was_played():
    arguments = {"scenario": "paper-3x3", "max_cycles": 12, "compromised": ("sr_2", "sp_0"), "objective": "damage"}
    finding = find(PaperAttacks(), arguments, budget=0, seed=0, games=2)
    seen = watch(arguments, finding, 0)
    assert seen.quality["sp_0"].tolist() == [0, 1] * 6
    assert seen.ratings["sr_2"].shape == (12, 2)
    assert np.isnan(seen.ratings["sr_2"][0]).all()
    assert (seen.ratings["sr_2"][1:] == 0.5).all()
    assert list(seen.own) == ["ToR of sr_2", "ToP of sp_0"]
    assert seen.own["ToR of sr_2"].tolist() == seen.mine["ToR"].tolist()
    assert seen.mine["ToR"].shape == seen.honest["ToP"].shape == (12,)
    assert seen.objective == pytest.approx(1 - seen.honest["ToP"])
    assert exact_task(arguments).compromised == ("sr_2", "sp_0")


@pytest.mark.parametrize("text", ["ProviderAttack", "providerattack", "RoleTrust/ProviderAttack-v0"])
def test_names_of_tasks(text):
    assert find_task(text) == "RoleTrust/ProviderAttack-v0"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["Attack"], "unknown task 'Attack'; did you mean 'DualAttack'? Known: ProviderAttack"),
        (["RaterAttack", "--set", "colour=blue"], "there is no field 'colour'"),
        (["RaterAttack", "--compromised", "sr_9"], "there is no 'sr_9'"),
        (["RaterAttack", "--learned", "/nowhere"], "/nowhere"),
        (
            ["RaterAttack", "--attack", "on-off"],
            "attacks by quality, on which no",
        ),
        (
            ["RaterAttack", "--attack", "bad-mouthing:depth=3"],
            "has no parameter 'depth'. It takes start, stop, lie",
        ),
        (["RaterAttack", "--attack", "bad-mouthing:level=3"], "level is 3: it must lie in [0, 1]"),
    ],
)
def test_bad_input_is_one_clean_error_and_writes_nothing(tmp_path, arguments, said):
    result = run(*arguments, *CERTAIN, "--budget", "5000", "--out", str(tmp_path / "out"))
    assert result.exit_code == 2
    assert said in result.stderr
    assert "Traceback" not in result.output + result.stderr
    assert not (tmp_path / "out").exists()


def test_help_teaches():
    result = run("--help")
    assert result.exit_code == 0
    assert "Examples" in result.output
    assert "python -m studies.ladder CollusionAttack" in result.output


@pytest.mark.parametrize("name", ["eigentrust", "huber-mean", "peer-trust"])
def test_a_ladder_plans_where_trust_has_no_jumps(tmp_path, name):
    task = ["RaterAttack", "--set", "max_cycles=4", "--model", name, "--budget", "2000", "--games", "2"]
    assert CliRunner().invoke(app, ["ladder", *task, "--out", str(tmp_path)]).exit_code == 0
    results = json.loads((tmp_path / "ladder.json").read_text())
    rungs = {rung["rung"] for rung in results["rungs"]}
    assert {"honest play", "scripted, best of grid", "random search", "CMA-ES"} <= rungs
    assert ("white-box planner" in rungs) == Traits.of(make_trust_model(name)).differentiable
