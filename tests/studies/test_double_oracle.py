"""The game that both sides play: its matrix, its mixtures, its numbers by iteration, and the
comparison."""

import numpy as np
import pytest
from refusals import refuses

pytest.importorskip("cma")
pytest.importorskip("torch")
pytest.importorskip("safetensors")

from attackers_suite import SUITE

from roletrust_env.evaluation.attackers import read_record
from roletrust_env.evaluation.measurement import exact_task, measure
from roletrust_env.metrics.confidence import estimate
from roletrust_env.metrics.consumers import skill
from studies.defence.fronts import Front
from studies.defence.game import Game, Options, measure_iteration, respond_by_attack
from studies.defend import compare, over_runs
from studies.equilibrium import solve

pytestmark = pytest.mark.slow

FRONTS = "small/raters/0.25", "small/raters/0.5"
BOTH = ("mean", "role-trust")


def options_in(folder):
    path = folder / "tiny.toml"
    path.write_text(SUITE.replace("shares = [0.5]", "shares = [0.25, 0.5]"))
    return Options(
        ("leave-one-out",),
        BOTH,
        ("median",),
        str(path),
        FRONTS,
        FRONTS[:1],
        1,
        8_000,
        1,
        4,
        5,
        0.25,
    )


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    """A game after an iteration, with its payoffs before it, and their equilibrium."""
    game = Game(options_in(tmp_path_factory.mktemp("suite")), 0)
    before = game.payoffs()
    solution = solve([one.chosen.mean(axis=2) for one in before])
    game.respond(0, solution)
    return game, before, solution


def test_both_sides_grow(played):
    game, before, _ = played
    assert list(game.defences) == ["mean", "role-trust", "leave-one-out, trained 1"]
    for payoffs, after in zip(before, game.attackers, strict=True):
        names = [one.name for one in after]
        assert names == [*payoffs.attacks, "learned in iteration 1"]
        assert len(set(names)) == len(names)
        assert {"bad-mouthing", "ballot-stuffing"} & set(names)


def test_a_cell_is_the_skill_in_games_of_its_own(played):
    game = played[0]
    payoffs = game.payoffs()[1]
    task = exact_task(game.fronts[1].arguments("role-trust"))
    seen = measure(task, read_record(game.attackers[1][-1].record), game.seed(1), (1, 4))
    for half, part in ((seen.chosen, payoffs.chosen), (seen.measured, payoffs.measured)):
        np.testing.assert_allclose(
            part[1, -1], skill(half["utility"][0], half["blind"][0]), atol=1e-5
        )
    assert payoffs.chosen.shape == (3, len(payoffs.attacks), 4)


def test_the_numbers_of_an_iteration_are_those_of_the_formulas(played):
    """Every mean is a loop over the matrix of what is known after the iteration."""
    game, before, solution = played
    after = game.payoffs()
    one = {
        name: values.mean() for name, values in measure_iteration(before, solution, after).items()
    }
    x = [*solution.models, 0.0]
    value, worst, replies, mixtures = [], [], np.zeros(3), []
    for payoffs, weights in zip(after, solution.attacks, strict=True):
        y = [*(weights / sum(weights)), 0.0]
        mixtures.append(y)
        value.append(
            sum(
                x[m] * y[a] * payoffs.measured[m, a].mean() for m in range(3) for a in range(len(y))
            )
        )
        mixed = [sum(x[m] * payoffs.chosen[m, a].mean() for m in range(3)) for a in range(len(y))]
        worst.append(
            sum(x[m] * payoffs.measured[m, int(np.argmin(mixed))].mean() for m in range(3))
        )
        replies += [
            sum(y[a] * payoffs.chosen[m, a].mean() for a in range(len(y))) for m in range(3)
        ]
    best = int(np.argmax(replies))
    answered = np.mean(
        [
            sum(y[a] * payoffs.measured[best, a].mean() for a in range(len(y)))
            for payoffs, y in zip(after, mixtures, strict=True)
        ]
    )
    assert one["value"] == pytest.approx(np.mean(value))
    assert one["worst"] == pytest.approx(np.mean(worst))
    assert one["attack"] == pytest.approx(np.mean(value) - np.mean(worst))
    assert one["defence"] == pytest.approx(answered - np.mean(value))
    assert one["nash_conv"] == pytest.approx(one["attack"] + one["defence"])


def test_the_worst_attacker_is_chosen_in_other_games(played):
    game = played[0]
    found = game.compare("median", "median")
    assert set(found) == {"clean", "worst", "strangers", "worlds"}
    world = game.fronts[0]
    met = world.skills("median", world.strangers(()), game.seed(4), 5).values()
    worst = min(met, key=lambda skills: np.mean(skills.chosen))
    assert found["worlds"] == pytest.approx(worst.measured)
    clean = [front.clean("median", game.seed(4), 5) for front in game.fronts]
    assert found["clean"] == pytest.approx(np.mean(clean, axis=0))


def test_models_stand_beside_each_other():
    """The learned model of each run is that of its own iteration; a lead is the difference in the
    same games."""
    noise = np.array([-0.01, 0.0, 0.01])
    runs = [
        {
            "learned": {"beta": k},
            "compared": {
                f"beta, trained {k + 1}": {"worst": 0.5 + noise + k / 10},
                "mean": {"worst": 0.7 - noise},
            },
        }
        for k in (0, 1)
    ]
    rows, leads = compare(runs, ["mean"])
    assert list(rows) == ["mean", "beta, trained"]
    assert rows["beta, trained"]["worst"].value == pytest.approx(0.55)
    assert leads["beta, trained"]["mean"]["worst"].value == pytest.approx(-0.15)
    (alone,) = compare(runs[:1], ["mean"])[1]["beta, trained 1"].values()
    assert alone["worst"].high - alone["worst"].low == pytest.approx(2 * estimate(2 * noise).half)


def test_intervals_cover_the_spread_of_runs():
    """Runs that differ by more than their games say something about the next run, games alone do
    not."""
    noise = np.array([-0.01, 0.0, 0.01])
    first, second = ({"worst": level + noise} for level in (0.4, 0.6))
    alone, both = (
        over_runs({"model": runs})["model"]["worst"] for runs in ([first], [first, second])
    )
    assert alone == estimate(first["worst"]).interval
    assert both == pytest.approx(estimate(np.array([0.4, 0.6])).interval)


def test_a_skill_that_is_undefined_is_refused(played, monkeypatch):
    monkeypatch.setattr("studies.defence.fronts.skill", lambda utility, blind: utility * np.nan)
    with refuses(ValueError, "tiny", "small", "25"):
        played[0].fronts[0].clean("mean", 0, 2)


def test_a_budget_that_the_models_of_the_mixture_exceed_is_refused(played):
    models = ("mean", "median", "beta", "role-trust")
    arguments = {model: played[0].fronts[0].arguments(model) for model in models}
    with refuses(ValueError, "--budget", "3100", "4"):
        respond_by_attack(arguments, dict.fromkeys(models, 0.25), (), 3_100, 0)


def test_strangers_are_attackers_that_no_training_has_met(played):
    front = played[0].fronts[0]
    begun = front.beginners(["mean"], 0, 2)
    strangers = front.strangers(begun)
    assert strangers
    assert not {one.name for one in strangers} & {one.name for one in begun}


def test_a_condition_that_is_not_there_is_refused(tmp_path):
    suite = options_in(tmp_path).suite
    for name, words in (
        ("small/raters", ("small/raters",)),
        ("small/raters/half", ("small/raters/half",)),
        ("large/raters/0.5", ("large",)),
        ("small/honest/0.5", ("honest",)),
        ("small/raters/2", ("0", "1")),
    ):
        with refuses(ValueError, *words):
            Front.parse(suite, name)
