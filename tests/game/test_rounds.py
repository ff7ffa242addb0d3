"""A round of the game compiled, its gradients, single rounds by hand, extremes, and what is
refused."""

import numpy as np
import pytest
import torch
from game_cases import ACCESS, OPEN, assert_close, busy, each, luck, play
from refusals import refuses

from roletrust_env import Actions, Game, Random, Scenario, make_scenario
from roletrust_env.game.summary import summarise
from roletrust_env.trust import Mean
from roletrust_env.world.presence import CUT_OFF, PRESENT

PLAIN = Scenario(agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}], max_cycles=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("backend", "scenario"),
    [
        pytest.param("inductor", PLAIN, id="inductor"),
        *(
            pytest.param("aot_eager", busy(access=access, max_cycles=3), id=f"aot_eager-{name}")
            for name, access in ACCESS.items()
        ),
        pytest.param("aot_eager", busy(ratings=OPEN, max_cycles=5), id="aot_eager-open"),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_compiled_step_is_the_step(backend: str, scenario: Scenario) -> None:
    """In one graph. Inductor takes half a minute for all the features at once, so it has a plain
    game."""
    torch.compiler.reset()
    game = Game(scenario, like=torch.zeros((), dtype=torch.float64))
    start, *rounds = luck(Game(scenario), 0, (4,))
    actions, noises = ([each(torch.asarray, tree) for tree in trees] for trees in rounds)
    state = game.start(each(torch.asarray, start))
    for inputs in zip(actions[:-1], noises[:-1], strict=True):
        state, _ = game.step(state, *inputs)
    compiled = torch.compile(game.step, fullgraph=True, backend=backend)
    assert_close(
        compiled(state, actions[-1], noises[-1]), game.step(state, actions[-1], noises[-1])
    )


@pytest.mark.parametrize("trust_model", ["role-trust", "mean"])
def test_gradients_reach_the_actions(trust_model: str) -> None:
    """White-box attackers climb them; from the start on, a rating counts from the second round."""
    scenario = Scenario(
        agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}], max_cycles=3
    )
    game = Game(scenario, trust_model, like=torch.zeros((), dtype=torch.float64))
    random = Random(np.random.default_rng(0), torch.zeros((), dtype=torch.float64))
    state = game.start(game.draw(random, start=True))
    actions = Actions(
        torch.full((2,), 0.9, dtype=torch.float64), torch.tensor([[0.2, 0.4], [0.6, 0.9]]).double()
    )
    actions.ratings.requires_grad_(True)
    for _ in range(3):
        state, _ = game.step(state, actions, game.draw(random))
    game.published(state)[1].sum().backward()
    assert torch.all(torch.isfinite(actions.ratings.grad))
    assert torch.all(actions.ratings.grad != 0)


def test_ratings_are_for_the_services_of_the_step_before() -> None:
    game = Game(Scenario(agents=[{"role": "SR"}, {"role": "SP"}], max_cycles=3))
    start, _, noises = luck(game, 0)
    good = Actions(np.array([0.8]), np.array([[1.0]]))
    first, _ = game.step(game.start(start), good, noises[0])
    assert not first.rated.any()
    assert game.published(first)[1] == 0.5
    assert first.service == pytest.approx(0.8)
    second, _ = game.step(first, good._replace(quality=np.array([0.1])), noises[1])
    assert second.rated.all()
    assert game.published(second)[1] == pytest.approx(
        0.5 * 0.75 + 0.25
    )  # ToR rises to 0.75, the note is 1


def test_admission_counts_beyond_a_byte() -> None:
    scenario = Scenario(
        agents=[{"role": "SR", "count": 2}, {"role": "SP"}],
        admission={"threshold": 0.3, "rounds": 200},
        max_cycles=210,
    )
    game = Game(scenario)
    start, _, noises = luck(game, 0)
    bad = [Actions(np.zeros(1), np.zeros((2, 1)))] * 210
    phases = [state.population.phase.tolist() for state, _ in play(game, start, bad, noises)]
    # The first ratings arrive in the second round and halve a trust of 0.5, so round 2 is the first
    # one under 0.3.
    assert phases[200] == [PRESENT] * 3
    assert phases[201] == [PRESENT, PRESENT, CUT_OFF]


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(
            Scenario(agents=[{"role": "SR"}, {"role": "SP"}], max_cycles=1),
            id="one of each, one round",
        ),
        pytest.param(
            busy(max_cycles=4, ratings={"late": 1.0, "delay": 9}), id="all later than the end"
        ),
        pytest.param(busy(ratings={"lost": 1.0}), id="all lost"),
        pytest.param(busy(admission={"threshold": 1.0, "rounds": 1}), id="everyone cut off"),
        pytest.param(
            Scenario(agents=[{"role": "SR", "count": 2, "leaves": 2}, {"role": "SP", "leaves": 3}]),
            id="everyone left",
        ),
        pytest.param(busy(access={"kind": "in-range", "radius": 1e-6}), id="nobody in range"),
        pytest.param(busy(values=[float(v) for v in range(1, 1000)]), id="a thousand values"),
        pytest.param(Scenario(agents=[{"role": "SR+SP"}, {"role": "SP"}]), id="no pure rater"),
        pytest.param(
            Scenario(
                agents=[{"role": "SR", "count": 300}, {"role": "SP", "count": 300}], max_cycles=3
            ),
            id="300x300",
        ),
    ],
)
def test_extremes(scenario: Scenario) -> None:
    game = Game(scenario)
    for state, _ in play(game, *luck(game, 0)):
        for array in (*game.published(state), game.agent_trust(state), summarise(game, state)):
            assert np.all((array >= 0) & (array <= 1))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_luck_at_its_limits_is_harmless(dtype: type) -> None:
    """The largest number below 1 picks the dearest value, and 0 the first; softmax takes both."""
    scenario = busy(access=ACCESS["softmax"], max_cycles=2)
    game = Game(scenario, like=np.zeros((), dtype))
    for extreme in (dtype(0), np.nextafter(dtype(1), dtype(0))):
        start, actions, noises = luck(game, 0)
        start, *noises = (
            each(lambda a, x=extreme: np.full_like(a, x, dtype), n) for n in (start, *noises)
        )
        *_, (state, _) = play(game, start, actions, noises)
        assert np.all(state.value == dtype(1.0 if extreme else 0.2))
        assert np.all(np.isfinite(summarise(game, state)))


def test_whom_admission_cuts_off_is_seen_in_the_published_trust() -> None:
    """By ToA, too, whose weights are counts of services."""
    rules = make_scenario("peers").change(
        agents=[{"role": "SR+SP", "count": 4}],
        admission={"threshold": 0.5, "rounds": 1},
        initial_trust=0.6,
    )
    game, random = Game(rules), np.random.default_rng(0)
    luck = game.random(0)
    state = game.start(game.draw(luck, (50,), start=True))
    for _ in range(20):
        before = game.present(state)
        actions = Actions(random.random((4, 50)), random.random((4, 4, 50)))
        state, _ = game.step(state, actions, game.draw(luck, (50,)))
        assert np.array_equal(game.present(state), before & (game.agent_trust(state) >= 0.5))


def test_actions_of_another_batch_are_refused() -> None:
    game = Game(make_scenario("paper-3x3"))
    state = game.start(game.draw(game.random(0), (3,), start=True))
    with refuses(ValueError, "(3,)", "(3, 3)"):
        game.step(state, Actions(np.ones(3), np.ones((3, 3))), game.draw(game.random(0), (3,)))


class _Odd(Mean):
    """A model with read-outs to be spoilt."""

    spoil = staticmethod(lambda trust: trust)

    def provider_trust(self, state):
        return self.spoil(state.top)


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda trust: trust + 1, ("[0, 1]",)),
        (lambda trust: trust * np.nan, ("[0, 1]",)),
        (lambda trust: trust[:1], ("(1, 1)", "(3, 1)")),
    ],
)
def test_a_trust_model_that_reads_nonsense_is_refused(monkeypatch, spoil, words) -> None:
    monkeypatch.setattr(_Odd, "spoil", staticmethod(spoil))
    with refuses(ValueError, *words):
        Game(make_scenario("paper-3x3"), _Odd())


def test_a_class_is_no_trust_model() -> None:
    with refuses(ValueError, "trust_model"):
        Game(make_scenario("paper-3x3"), Mean)
