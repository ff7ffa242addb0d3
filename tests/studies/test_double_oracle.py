"""The game that both sides play: its matrix, its mixtures, its numbers by iteration, and what a repeat plays."""

import numpy as np
import pytest

pytest.importorskip("cma")
pytest.importorskip("torch")
pytest.importorskip("safetensors")

from attackers_suite import SUITE

from roletrust_agents.training.defence import Climb
from roletrust_env.evaluation.attackers import read_record
from roletrust_env.evaluation.measurement import exact_task, measure
from roletrust_env.metrics.confidence import estimate
from roletrust_env.metrics.consumers import skill
from studies.defence.comparison import Comparison, leads, rows
from studies.defence.double_oracle import Game, Setup, label
from studies.defence.fronts import Front
from studies.defence.progress import best_trained, iterations, over_runs
from studies.defence.response import respond_by_attack

pytestmark = pytest.mark.slow

SETUP = Setup(
    learners=("leave-one-out",),
    fixed=("mean", "role-trust"),
    iterations=2,
    budget=8_000,
    climb=Climb(steps=2, pairs=2, games=2, attackers=2, validation=2, validate_every=1),
    games=4,
    explored=0.25,
    seed=0,
)


def fronts_in(folder):
    path = folder / "tiny.toml"
    path.write_text(SUITE.replace("shares = [0.5]", "shares = [0.25, 0.5]"))
    return [Front.of(str(path), f"small/raters/{share}") for share in (0.25, 0.5)]


def play(fronts, runs=(), setup=SETUP, stop=None):
    kept = dict(runs)
    game = Game(fronts, setup, kept, kept.__setitem__)
    for k, _ in enumerate(game.play()):
        if k == stop:
            break
    return game, kept


@pytest.fixture(scope="module")
def fronts(tmp_path_factory):
    return fronts_in(tmp_path_factory.mktemp("suite"))


@pytest.fixture(scope="module")
def game(fronts):
    return play(fronts)[0]


def test_both_sides_grow(game):
    first, last = game.known(0), game.known(2)
    assert list(first.defences) == ["mean", "role-trust"]
    assert list(last.defences) == ["mean", "role-trust", "leave-one-out, trained 1", "leave-one-out, trained 2"]
    for before, after in zip(first.attackers, last.attackers, strict=True):
        names = [one.name for one in after]
        assert names == [*(one.name for one in before), "learned in iteration 1", "learned in iteration 2"]
        assert len(set(names)) == len(names)
        assert {"bad-mouthing", "ballot-stuffing"} & set(names)


def test_a_cell_is_the_skill_in_games_of_its_own(game):
    payoffs, known = game.payoffs(2)[1], game.known(2)
    attack = known.attackers[1][-1]
    task = exact_task(game.fronts[1].arguments("role-trust"))
    seen = measure(task, read_record(attack.record), game.seed(1), (1, 4))
    for half, part in ((seen.chosen, payoffs.chosen), (seen.measured, payoffs.measured)):
        expected = skill(half["utility"][0], half["blind"][0])
        np.testing.assert_allclose(part[1, -1], expected, atol=1e-5)
    assert payoffs.chosen.shape == (4, len(payoffs.attacks), 4)


def test_the_numbers_of_an_iteration_are_those_of_the_formulas(game):
    """Every mean is a loop over the matrix of what is known after the iteration."""
    for one in iterations([game]):
        solution, after = game.solution(one.number), game.payoffs(one.number + 1)
        x = list(solution.models) + [0.0] * (len(after[0].chosen) - len(solution.models))
        value, worst, replies = [], [], np.zeros(len(x))
        for payoffs, y in zip(after, solution.attacks, strict=True):
            y = list(y / sum(y)) + [0.0] * (payoffs.chosen.shape[1] - len(y))
            pairs = [(m, a) for m in range(len(x)) for a in range(len(y))]
            value.append(sum(x[m] * y[a] * payoffs.measured[m, a].mean() for m, a in pairs))
            mixed = [sum(x[m] * payoffs.chosen[m, a].mean() for m in range(len(x))) for a in range(len(y))]
            reply = int(np.argmin(mixed))
            worst.append(sum(x[m] * payoffs.measured[m, reply].mean() for m in range(len(x))))
            replies += [sum(y[a] * payoffs.chosen[m, a].mean() for a in range(len(y))) for m in range(len(x))]
        best = int(np.argmax(replies))
        answered = np.mean(
            [
                sum((y / sum(y))[a] * payoffs.measured[best, a].mean() for a in range(len(y)))
                for payoffs, y in zip(after, solution.attacks, strict=True)
            ]
        )
        assert one.value.value == pytest.approx(np.mean(value))
        assert one.worst.value == pytest.approx(np.mean(worst))
        assert one.attack.value == pytest.approx(np.mean(value) - np.mean(worst))
        assert one.defence.value == pytest.approx(answered - np.mean(value))
        assert one.nash_conv.value == pytest.approx(one.attack.value + one.defence.value)
        assert sum(one.weights.values()) == pytest.approx(1)
        assert one.nash_conv.low < one.nash_conv.value < one.nash_conv.high


def test_a_game_continues_where_it_stopped(fronts, game):
    part, kept = play(fronts, stop=5)
    assert 0 < len(kept) < len(game.runs)
    again, _ = play(fronts, kept)
    assert again.runs == game.runs
    assert len(part.runs) == len(kept)


def test_a_repeat_plays_nothing_and_more_iterations_continue(fronts, game, monkeypatch):
    monkeypatch.setattr(Front, "skills", None)  # nothing may be played
    assert play(fronts, game.runs)[0].runs == game.runs
    short = SETUP.__class__(**{**SETUP.__dict__, "iterations": 1})
    assert short.plain() == SETUP.plain()
    assert play(fronts, game.runs, short)[0].known(1).defences == game.known(1).defences


def test_models_stand_beside_each_other(game, fronts):
    comparison = Comparison(game, ("median",), fronts[:1], 5)
    assert len(list(comparison.play())) == comparison.stages
    found = {row.name: row for row in rows([comparison])}
    learned = label("leave-one-out", best_trained(game, "leave-one-out"))
    assert set(found) == {learned, "mean", "role-trust", "median"}
    for name, row in found.items():
        worst = []
        for front in fronts:
            met = game.runs[f"seen|2|{front.name}|{name}"]
            assert "trained against it alone" in met
            worst.append(min(met.values(), key=lambda halves: np.mean(halves[0]))[1])
        assert all(len(half) == 5 for half in worst)
        assert row.worst.value == pytest.approx(np.mean(worst))
        assert row.clean.value == pytest.approx(
            np.mean([game.runs[f"clean|{front.name}|{name}"]["skill"] for front in fronts])
        )
    assert list(found) == sorted(found, key=lambda name: -found[name].worst.value)
    ((ours, over),) = leads([comparison]).items()
    assert (ours, [row.name for row in over]) == (learned, ["mean", "role-trust", "median"])
    for row in over:
        assert row.worst.value == pytest.approx(found[learned].worst.value - found[row.name].worst.value)
        apart = comparison.measured(learned)["worst"] - comparison.measured(row.name)["worst"]
        assert row.worst.high - row.worst.low == pytest.approx(2 * estimate(apart).half)


def test_intervals_cover_the_spread_of_runs():
    """Runs that differ by more than their games say something about the next run, games alone do not."""
    noise = np.array([-0.01, 0.0, 0.01])
    first, second = ({"worst": level + noise} for level in (0.4, 0.6))
    alone, both = (over_runs({"model": runs})["model"]["worst"] for runs in ([first], [first, second]))
    assert alone == estimate(first["worst"]).interval
    assert both == pytest.approx(estimate(np.array([0.4, 0.6])).interval)
    assert over_runs({"model": [first, {}]}) == {"model": {}}


def test_a_comparison_after_more_iterations_is_the_one_without_a_stop(fronts, game):
    short, kept = play(fronts, setup=SETUP.__class__(**{**SETUP.__dict__, "iterations": 1}))
    assert list(Comparison(short, (), (), 5).play())
    longer, _ = play(fronts, kept)
    compared = []
    for one in (longer, play(fronts, game.runs)[0]):
        comparison = Comparison(one, (), (), 5)
        assert list(comparison.play())
        compared.append(rows([comparison]))
    assert compared[0] == compared[1]


def test_a_skill_that_is_undefined_is_refused(fronts, monkeypatch):
    monkeypatch.setattr("studies.defence.fronts.skill", lambda utility, blind: utility * np.nan)
    with pytest.raises(ValueError, match=r"the skill in small/raters/0\.25 is undefined"):
        fronts[0].clean("mean", 0, 2)


def test_a_budget_that_the_models_of_the_mixture_exceed_is_refused(fronts):
    models = ("mean", "median", "beta", "role-trust")
    arguments = {model: fronts[0].arguments(model) for model in models}
    with pytest.raises(ValueError, match=r"--budget is 3100 rounds; .* against 4 models needs"):
        respond_by_attack(arguments, dict.fromkeys(models, 0.25), (), 3_100, 0)


def test_strangers_are_attackers_that_no_training_has_met(fronts):
    begun = fronts[0].beginners(["mean"], 0, 2)
    strangers = fronts[0].strangers(begun)
    assert strangers
    assert not {one.name for one in strangers} & {one.name for one in begun}


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("small/raters", "a front is SCENARIO/TRACK/SHARE"),
        ("small/raters/half", "a front is SCENARIO/TRACK/SHARE"),
        ("large/raters/0.5", "no scenario 'large'"),
        ("small/honest/0.5", "no track 'honest'"),
        ("small/raters/2", "must lie between 0 and 1"),
    ],
)
def test_a_condition_that_is_not_there_is_refused(fronts, tmp_path, name, message):
    fronts_in(tmp_path)
    with pytest.raises(ValueError, match=message):
        Front.of(str(tmp_path / "tiny.toml"), name)
