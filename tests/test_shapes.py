"""Games, tasks and metrics have the shapes of their annotations; a wrong annotation is found."""

import inspect
import re
from collections import Counter
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
import pytest
from game_cases import busy
from refusals import refuses
from shapes import WrongShapeError, checked, checked_shapes, has_shapes, hints_of, public_functions

from roletrust_env import Game, JointPolicy, Scenario, make_attacker, make_scenario, make_task
from roletrust_env import metrics as scores
from roletrust_env.arrays import Array, namespace
from roletrust_env.game.rollout import record
from roletrust_env.game.sparse import SparseGame
from roletrust_env.game.state import State
from roletrust_env.game.summary import summarise
from roletrust_env.game.views import ProviderView, RaterView
from roletrust_env.shapes import PairFlags, PerGame, PerPair, PerProvider, PerRater, Shape
from roletrust_env.trust.models import OWN
from roletrust_env.trust.ratings import Ratings
from roletrust_env.trust.run import make_run

torch = pytest.importorskip("torch")
PRESETS = ("paper-3x3", "peers", "open-system", "robots-that-move")
CENTRAL_AND_PERSONAL = ("role-trust", "leave-one-out", "eigentrust", "travos", "first-hand")
LIBRARIES = {
    "numpy float64": np.zeros(()),
    "numpy float32": np.zeros((), np.float32),
    "torch": torch.zeros((), dtype=torch.float32),
}
ON_EVERY_LIBRARY = pytest.mark.parametrize("like", LIBRARIES.values(), ids=LIBRARIES)
SINGLE_AND_BATCH = pytest.mark.parametrize("batch", [(), (3,)], ids=["single", "batch"])


def seated(game: Game) -> JointPolicy:
    """Return a game in which two raters and two providers attack, each on another channel."""
    owners = game.roster.owner_names
    raters = [name for name in game.roster.rater_names if name in owners]
    providers = [name for name in game.roster.provider_names if name in owners]
    attacks = {
        raters[0]: make_attacker("silent", start=1),
        raters[-1]: make_attacker("bad-mouthing"),
        providers[1]: make_attacker("personal-milking"),
        providers[2]: make_attacker("on-off", period=2),
    }
    return JointPolicy(game, attacks)


def played(
    scenario: Scenario, trust_model: str, like: Array, batch: tuple[int, ...]
) -> Counter[str]:
    """Play a game, look at its states in every way, and return the functions that were called."""
    with checked_shapes() as calls:
        game = Game(scenario.change(max_cycles=5), trust_model, like)
        random = game.random(0)
        history = record(seated(game), random, batch)
        state = game.start(game.draw(random, batch, start=True))
        game.known_trust(state)
        game.observations(state)
        summarise(game, state)
    assert history.tor.shape == (5, game.roster.n_raters, *batch)
    return calls


@SINGLE_AND_BATCH
@ON_EVERY_LIBRARY
@pytest.mark.parametrize("preset", PRESETS)
def test_games_have_the_shapes_of_the_annotations(
    preset: str, like: Array, batch: tuple[int, ...]
) -> None:
    for trust_model in CENTRAL_AND_PERSONAL:
        calls = played(make_scenario(preset), trust_model, like, batch)
        assert calls["game.game.Game.step"] == 5


@SINGLE_AND_BATCH
@pytest.mark.parametrize("access", ["everyone", "choice", "encounters"])
def test_a_game_with_every_feature_has_the_shapes(access: str, batch: tuple[int, ...]) -> None:
    """In it, S, P and N are different numbers."""
    fields = {"access": {"kind": access, "providers": 2} if access != "everyone" else {}}
    scenario = busy(**(fields if access != "everyone" else {}))
    assert played(scenario, "role-trust", np.zeros(()), batch)["game.game.Payoff.rewards"] == 5


@pytest.mark.parametrize("trust_model", OWN)
def test_every_trust_model_has_the_shapes(trust_model: str) -> None:
    scenario = make_scenario("open-system").change(max_cycles=3)
    with checked_shapes() as calls:
        game = Game(scenario, trust_model)
        record(JointPolicy(game, {}), game.random(0), (2,))
        run = make_run(game.model, (3, 4))
        run.play(np.r_[0, 1, 2, 2], np.r_[3, 1, 0, 3], np.r_[0.2, 0.9, 1.0, 0.4])
        run.play(np.r_[1, 4, 1], np.r_[0, 2, 0], np.r_[0.6, 0.1, 0.2])
        assert run.rater_trust.shape == (5,)
        if hasattr(game.model, "preference"):
            chosen = Game(scenario.change(access={"kind": "choice", "by": "model"}), game.model)
            record(JointPolicy(chosen, {}), chosen.random(0), (2,))
    own = [name for name in calls if name.startswith(type(game.model).__module__[14:])]
    assert any(calls[name] for name in own), own


@SINGLE_AND_BATCH
@ON_EVERY_LIBRARY
@pytest.mark.parametrize("observation", ["agents", "coalition", "accounts"])
def test_attack_tasks_have_the_shapes(
    observation: Any, like: Array, batch: tuple[int, ...]
) -> None:
    for objective in ("damage", "exploit", "promote", "mislead"):
        with checked_shapes() as calls:
            task = make_task(
                busy(max_cycles=3),
                ["sr_0", "sp_0", "srsp_0"],
                objective=objective,
                accomplices=["sp_1"],
                consumers="raters",
                observation=observation,
                like=like,
            )
            random = task.game.random(0)
            state = task.start(task.game.draw(random, batch, start=True), random)
            for _ in range(3):
                assert task.observe(state).shape[1:] == batch
                size = (task.action_size, *batch)
                action = namespace(like).full(size, 0.75, dtype=like.dtype)
                state, _ = task.step(state, action, task.game.draw(random, batch), random)
        assert calls["game.attack_task.AttackTask.step"] == 3


@SINGLE_AND_BATCH
def test_metrics_have_the_shapes(batch: tuple[int, ...]) -> None:
    with checked_shapes() as calls:
        game = Game(make_scenario("open-system").change(max_cycles=8))
        history = record(seated(game), game.random(0), batch)
        honest = record(JointPolicy(game, {}), game.random(0), batch)
        trust, paired = scores.present_trust(history), scores.present_trust(honest)
        weights = game.scenario.round_weights
        best = history.quality.max(axis=0).astype(np.float64)
        scores.damage(trust, paired, [2, 3], weights)
        scores.recovery(trust, paired, [2, 3], 4)
        scores.auc(trust[-1], [0, 1])
        scores.classify(trust[-1], [0, 1])
        scores.rounds_to_detection(trust, [0, 1])
        scores.false_alarms(trust, [2, 3], weights=weights)
        for measure in (scores.kendall_tau, scores.spearman, scores.absolute_error):
            measure(history.top[-1], best)
        scores.coverage(history.rated)
        scores.robustness(history.served, [0, 1], [1, 2])
        got = scores.utility(history.top, history.offered, weights)
        blind = scores.blind_utility(history.top, history.offered, weights)
        scores.return_on_attack(scores.damage(trust, paired, [2, 3]), got)
        scores.exploitability({"mixed": scores.damage(trust, paired, [2, 3])})
        if batch:
            scores.skill(got.value, blind.value)
        scores.received(history, np.ones((history.top.shape[1], *batch)), [0, 1], [1, 2])
    functions = {name for name in calls if name.startswith("metrics.")}
    left = {name for name in functions if not calls[name] and "confidence" not in name}
    of_batches = {"metrics.consumers.skill", "metrics.consumers.skill_score"}
    assert left == (set() if batch else of_batches)


def test_a_sparse_game_has_cells_in_place_of_pairs() -> None:
    fields = {"access": {"kind": "encounters", "providers": 3}, "max_cycles": 4}
    agents = [{"role": "SR", "count": 6}, {"role": "SP", "count": 5}]
    with checked_shapes(sparse=True) as calls:
        game = SparseGame(Scenario.model_validate({"agents": agents, **fields}))
        record(JointPolicy(game, {}), game.random(0))
    assert calls["game.cells.MetCells.update"] == 4


# --- wrong annotations and wrong arrays


class Pair(NamedTuple):
    """Two arrays of one game."""

    tor: PerRater
    top: PerProvider


def right(tor: PerRater, pairs: PerPair) -> PerProvider:
    return pairs.sum(axis=0) + 0 * tor.sum(axis=0)


def wrong(tor: PerRater, pairs: PerPair) -> PerProvider:
    return pairs.sum(axis=1)


def wrong_dtype(tor: PerRater, pairs: PerPair) -> PairFlags:
    return pairs


def wrong_batch(tor: PerRater, pairs: PerPair) -> PerGame:
    return tor


def wrong_field(tor: PerRater, pairs: PerPair) -> Pair:
    return Pair(tor, tor)


TOR, PAIRS = np.zeros((2, 4)), np.zeros((2, 3, 4))


def test_arrays_that_fit_pass() -> None:
    assert checked(right, "right")(TOR, PAIRS).shape == (3, 4)
    assert checked(right, "right")(TOR[:, 0], PAIRS[..., 0]).shape == (3,)


@pytest.mark.parametrize("function", [wrong, wrong_dtype, wrong_batch, wrong_field])
def test_a_wrong_annotation_of_a_result_is_found(function: Any) -> None:
    with refuses(WrongShapeError, function.__name__, "the result"):
        checked(function, function.__name__)(TOR, PAIRS)


@pytest.mark.parametrize(
    ("tor", "pairs"),
    [
        (TOR[:1], PAIRS),
        (TOR, PAIRS[:, 0]),
        (TOR[:, :3], PAIRS),
        (TOR > 0, PAIRS),
        (TOR.astype(int), PAIRS),
    ],
)
def test_an_argument_of_another_shape_is_found(tor: Array, pairs: Array) -> None:
    with refuses(WrongShapeError, "right"):
        checked(right, "right")(tor, pairs)


def test_unions_lists_and_ratings_are_checked() -> None:
    def function(any_side: PerRater | PerProvider, ratings: Ratings, parts: list[PerGame]) -> None:
        """Return nothing."""

    check, ratings = checked(function, "function"), Ratings(PAIRS)
    for side in (np.zeros((2, 4)), np.zeros((3, 4))):
        check(side, ratings, [np.zeros(4)])
    with refuses(WrongShapeError, "any_side"):
        check(np.zeros((5, 4)), ratings, [np.zeros(4)])
    with refuses(WrongShapeError, "parts[1]"):
        check(np.zeros((2, 4)), ratings, [np.zeros(4), np.zeros(3)])


def test_a_wrong_annotation_of_the_library_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """The sizes are those of the game's roster, so that N is not any number."""
    game = Game(make_scenario("open-system").change(max_cycles=2))
    for hint in (PerPair, PerGame, Annotated[Array, Shape("N ...", "bool")], PerRater):
        monkeypatch.setitem(Game.agent_trust.__annotations__, "return", hint)
        hints_of.cache_clear()
        with checked_shapes(), refuses(WrongShapeError, "game.game.Game.agent_trust"):
            record(JointPolicy(game, {}), game.random(0))
    hints_of.cache_clear()


def test_outside_the_block_nothing_is_checked() -> None:
    before = {where: function for _, _, where, function, _ in public_functions()}
    with checked_shapes():
        assert record is not before["game.rollout.record"]
    after = {where: function for _, _, where, function, _ in public_functions()}
    assert after == before
    assert record is before["game.rollout.record"]


# --- what has no shape

WITHOUT_SHAPE = {
    "trust.ratings.Ratings.count: the result": "one number if the ratings are full",
    "trust.ratings.Ratings.gather: agents": "on edges of a run, those of any side",
    "trust.personal.others: the result": "a size of 1 that broadcasts, before those of the batch",
    "game.accounts.account_features: ally": "a size of 1 that broadcasts, also over the batch",
    "game.accounts.account_features: place": "a size of 1 that broadcasts, also over the batch",
    "game.accounts.Accounts.mean: the result": "without n in the policy of a single agent",
    "game.cells.Cells.of_providers: the result": "any shape that broadcasts with the cells",
    "game.cells.for_batch: the result": "the shape that it is given",
    "game.coalition.provider_features: accomplice": "with or without an axis of the batch",
}
"""Arguments and results that are documented as of shape (S, ...) or (P, ...) without one shape."""

_STATED = re.compile(r"shape \([SP]\b")


def entries(docstring: str, heading: str) -> dict[str, str]:
    """Return the entries of a section of a docstring by their names."""
    section = re.search(rf"^{heading}:\n((?:    .*\n?|\n)*)", docstring, re.MULTILINE)
    text = section.group(1) if section else ""
    return dict(re.findall(r"^    (\w+): ((?:.*\n?(?:     .*\n?)*))", text, re.MULTILINE))


def test_what_is_documented_with_a_shape_is_annotated_with_one() -> None:
    left, classes = list[str](), dict[str, type]()
    for owner, name, where, function, _ in public_functions():
        hints, docstring = hints_of(function), inspect.getdoc(function) or ""
        arguments = entries(docstring, "Args")
        if isinstance(owner, type):
            classes[where.rpartition(".")[0]] = owner
            if name == "__init__":
                arguments |= entries(inspect.getdoc(owner) or "", "Args")
        for argument, text in arguments.items():
            if _STATED.search(text) and argument in hints and not has_shapes(hints[argument]):
                left.append(f"{where}: {argument}")
        summary = docstring.partition("\n\n")[0] + docstring.partition("Returns:\n")[2]
        result = hints.get("return", Ratings)
        result = owner if result is Self else result
        if _STATED.search(summary) and not has_shapes(result):
            left.append(f"{where}: the result")
    for where, cls in classes.items():
        for field, text in entries(inspect.getdoc(cls) or "", "Attributes").items():
            hint = hints_of(cls).get(field)
            if hasattr(cls, "_fields") and _STATED.search(text) and not has_shapes(hint):
                left.append(f"{where}: {field}")
    assert sorted(set(left) - set(WITHOUT_SHAPE)) == []
    assert sorted(set(WITHOUT_SHAPE) - set(left)) == []


@pytest.mark.parametrize("cls", [State, ProviderView, RaterView])
def test_fields_of_tuples_have_shapes(cls: Any) -> None:
    assert all(has_shapes(hint) for name, hint in hints_of(cls).items() if name != "trust")
