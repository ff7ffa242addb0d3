"""A round of the game against a loop-by-loop reference, and what holds in every game."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from slow_game import Slow

from roletrust_env import Actions, Game, Noise, Random, Scenario, State, make_scenario
from roletrust_env.trust import Mean
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT, WAITING

TOLERANCE = {"rtol": 0, "atol": 1e-12}

# --- scenarios --------------------------------------------------------------------------------------


def busy(**fields: Any) -> Scenario:
    """Every feature at once: all roles, turns, joining, leaving, a bad channel, perturbations, admission, values."""
    defaults = {
        "agents": [
            {"role": "SP", "count": 2, "ability": [0.3, 0.9]},
            {"role": "SR+SP", "count": 2, "noise": 0.1, "ability": 0.8, "scale": [0.5, 1.2]},
            {"role": "SR", "count": 3, "noise": 0.05, "bias": [-0.2, 0.1]},
            {"role": "SR+SP", "count": 3, "turns": ["SR", "SP", "SR+SP"], "turn_length": 2},
            {"role": "SR", "count": 2, "joins": 3, "join_rate": 0.4, "leave_rate": 0.1, "noise": 0.2},
            {"role": "SP", "count": 2, "joins": 1, "leaves": 14, "leave_rate": 0.05},
            {"role": "SR+SP", "count": 2, "reserve": 2, "join_rate": 0.7, "noise": 0.1},
        ],
        "ratings": {"lost": 0.2, "late": 0.3, "delay": 3},
        "perturbations": [{"start": 4, "stop": 8, "strength": 0.6}, {"start": 6, "stop": 9, "strength": 0.3}],
        "values": [1.0, 2.0, 2.0, 5.0],
        "admission": {"threshold": 0.3, "rounds": 4},
        "rewards": {"rater_trust": 1.5, "provider_trust": 0.7, "agent_trust": 2.0, "quality_cost": 0.2},
        "max_cycles": 25,
        "lam": 0.6,
        "initial_trust": 0.4,
    }
    return Scenario.model_validate(defaults | fields)


ACCESS = {
    "everyone": {"kind": "everyone"},
    "in-range": {"kind": "in-range", "radius": 4.0, "arena": 8.0, "speed": 1.5},
    "greedy": {"kind": "choice", "providers": 2},
    "softmax": {"kind": "choice", "providers": 3, "temperature": 0.3},
}
EVERY_ACCESS = pytest.mark.parametrize("access", ACCESS.values(), ids=ACCESS)

shares = st.sampled_from([0.0, 0.3, 1.0])
presences = st.fixed_dictionaries(
    {},
    optional={
        "joins": st.integers(0, 3),
        "join_rate": st.sampled_from([0.3, 1.0]),
        "leaves": st.integers(4, 6),
        "leave_rate": st.sampled_from([0.0, 0.2]),
    },
)


@st.composite
def groups(draw: st.DrawFn, role: str, least: int = 1, core: bool = False) -> dict[str, Any]:
    """A group of agents; one of the core is there from the start, with all that its role does."""
    group = {"role": role, "count": draw(st.integers(least, 3)), "noise": draw(st.sampled_from([0.0, 0.2]))}
    if role == "SR+SP" and not core and draw(st.booleans()):
        group |= {"turns": draw(st.permutations(["SR", "SP", "SR+SP"])), "turn_length": draw(st.integers(1, 2))}
    if role != "SR":
        group["ability"] = draw(st.sampled_from([1.0, 1.0, 0.5, (0.2, 1.0), (0.7, 0.7)]))
    if role != "SP":
        group |= {"bias": draw(st.sampled_from([0.0, 0.0, -0.1, (-0.3, 0.3)]))}
        group |= {"scale": draw(st.sampled_from([1.0, 1.0, 0.7, (0.5, 1.5)]))}
    return group | draw(presences) | ({"joins": 0, "join_rate": 1.0} if core else {})


@st.composite
def scenarios(draw: st.DrawFn) -> Scenario:
    core = draw(st.sampled_from([[("SR", 1), ("SP", 1)], [("SR+SP", 2)], [("SR+SP", 1), ("SP", 1)]]))
    agents = [draw(groups(role, least, core=True)) for role, least in core]
    agents += draw(st.lists(st.sampled_from(["SR", "SP", "SR+SP"]).flatmap(groups), max_size=2))
    providers = sum(group["count"] for group in agents if "SP" in group["role"])
    choices = st.builds(
        lambda k, t: {"kind": "choice", "providers": k, "temperature": t},
        st.integers(1, providers),
        st.sampled_from([0.0, 0.2]),
    )
    fields = {
        "agents": agents,
        "access": draw(st.sampled_from([ACCESS["everyone"], ACCESS["in-range"]]) | choices),
        "ratings": {"lost": draw(shares), "late": draw(shares), "delay": draw(st.integers(1, 9))},
        "perturbations": draw(st.sampled_from([[], [{"start": 1, "stop": 3, "strength": 0.5}]])),
        "values": draw(st.lists(st.sampled_from([0.5, 1.0, 7.0]), min_size=1, max_size=3)),
        "admission": draw(st.none() | st.builds(lambda n: {"threshold": 0.5, "rounds": n}, st.integers(1, 3))),
        "max_cycles": draw(st.integers(1, 7)),
        "lam": draw(st.floats(0.5, 1, exclude_max=True)),
        "initial_trust": draw(st.floats(0, 1)),
    }
    return Scenario.model_validate(fields)


# --- playing ----------------------------------------------------------------------------------------


def each(function: Callable, *trees: Any) -> Any:
    """Apply a function to the arrays of states, noises or actions; None and flags stay as they are."""
    if trees[0] is None or isinstance(trees[0], bool):
        return trees[0]
    if isinstance(trees[0], tuple):
        make = getattr(trees[0], "_make", tuple)
        return make(each(function, *parts) for parts in zip(*trees, strict=True))
    return function(*trees)


def arrays(tree: Any) -> list[Any]:
    found: list[Any] = []
    each(found.append, tree)
    return found


def assert_close(actual: Any, expected: Any) -> None:
    each(lambda a, b: np.testing.assert_allclose(np.asarray(a), np.asarray(b), **TOLERANCE), actual, expected)


def luck(game: Game, seed: int, batch: tuple[int, ...] = ()) -> tuple[Noise, list[Actions], list[Noise]]:
    """The noise of the start, and actions and noise of every round; ratings often agree, or are 0 or 1."""
    rng = np.random.default_rng(seed)
    source, s, p = Random(rng), game.roster.n_raters, game.roster.n_providers

    def notes(*shape: int) -> np.ndarray:
        return np.where(rng.random((*shape, *batch)) < 0.5, rng.integers(0, 5, (*shape, *batch)) / 4, rng.random())

    def wanted() -> np.ndarray | None:
        return rng.random((game.roster.n_agents, *batch)) < 0.8 if any(game.roster.turn) else None

    def kept() -> np.ndarray | None:
        return rng.random((s, p, *batch)) < 0.2 if rng.random() < 0.5 else None

    start = game.draw(source, batch, start=True)
    rounds = range(game.scenario.max_cycles)
    actions = [Actions(notes(p), notes(s, p), wanted(), kept()) for _ in rounds]
    return start, actions, [game.draw(source, batch) for _ in rounds]


def play(game: Game, start: Noise, actions: list[Actions], noises: list[Noise]) -> Iterator[tuple[State, Any]]:
    state = game.start(start)
    yield state, None
    for action, noise in zip(actions, noises, strict=True):
        state, rewards = game.step(state, action, noise)
        yield state, rewards


def many(max_examples: int) -> Any:
    return settings(deadline=None, max_examples=max_examples)


# --- the tests --------------------------------------------------------------------------------------


def assert_matches_reference(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, actions, noises = luck(game, seed)
    slow = Slow(scenario, start)
    assert game.roster.names == tuple(slow.names)
    for t, (state, rewards) in enumerate(play(game, start, actions, noises)):
        if t:
            np.testing.assert_allclose(rewards, list(slow.step(actions[t - 1], noises[t - 1]).values()), **TOLERANCE)
        for field, value in slow.expected().items():
            np.testing.assert_allclose(getattr(state, field), value, err_msg=f"{field}, round {t}", **TOLERANCE)
        tor, top = game.published(state)
        np.testing.assert_allclose(tor, list(slow.tor.values()), **TOLERANCE)
        np.testing.assert_allclose(top, list(slow.top.values()), **TOLERANCE)
        np.testing.assert_allclose(game.agent_trust(state), [slow.trust(k) for k in slow.names], **TOLERANCE)
        if state.population is None:
            assert set(slow.phase.values()) == {PRESENT}
        else:
            assert state.population.phase.tolist() == list(slow.phase.values())
        if slow.place is not None:
            np.testing.assert_allclose(state.places.position, list(slow.place.values()), **TOLERANCE)


@EVERY_ACCESS
@pytest.mark.parametrize("seed", range(3))
def test_a_busy_game_matches_the_reference(access: dict, seed: int) -> None:
    assert_matches_reference(busy(access=access), seed)


@many(60)
@given(scenarios(), st.integers(0, 99))
def test_any_game_matches_the_reference(scenario: Scenario, seed: int) -> None:
    assert_matches_reference(scenario, seed)


@many(40)
@given(scenarios(), st.integers(0, 99))
def test_a_batch_is_its_games_one_by_one(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, *rounds = luck(game, seed, (3,))
    together = list(play(game, start, *rounds))
    for e in range(3):

        def one(array: Any, e: int = e) -> Any:
            return array[..., e]

        alone = play(game, each(one, start), *([each(one, tree) for tree in trees] for trees in rounds))
        for whole, single in zip(together, alone, strict=True):
            assert_close(single, each(one, whole))


def test_a_batch_may_have_several_axes() -> None:
    game = Game(busy(access=ACCESS["softmax"]))
    start, *rounds = luck(game, 0, (6,))

    def fold(tree: Any) -> Any:
        return each(lambda a: a.reshape(*a.shape[:-1], 2, 3), tree)

    folded = play(game, fold(start), *(map(fold, trees) for trees in rounds))
    for flat, two in zip(play(game, start, *rounds), folded, strict=True):
        assert_close(two, fold(flat))
        np.testing.assert_allclose(game.summary(two[0]), fold(game.summary(flat[0])), **TOLERANCE)


@many(40)
@given(scenarios(), st.integers(0, 99), st.sampled_from([(), (2,)]))
def test_numpy_and_torch_agree(scenario: Scenario, seed: int, batch: tuple[int, ...]) -> None:
    game, tensor_game = Game(scenario), Game(scenario, like=torch.zeros((), dtype=torch.float64))
    start, *rounds = luck(game, seed, batch)
    tensors = play(tensor_game, each(torch.asarray, start), *([each(torch.asarray, t) for t in r] for r in rounds))
    for (state, rewards), (tensor_state, tensor_rewards) in zip(play(game, start, *rounds), tensors, strict=True):
        assert all(isinstance(array, torch.Tensor) for array in arrays(tensor_state))
        assert_close((tensor_state, tensor_rewards), (state, rewards))
        assert_close(tensor_game.summary(tensor_state), game.summary(state))
        assert_close(tensor_game.views(tensor_state), game.views(state))
        assert_close(tensor_game.observations(tensor_state), game.observations(state))


@many(40)
@given(scenarios(), st.integers(0, 99), st.sampled_from([np.float32, np.float64]), st.booleans())
def test_everything_stays_in_range_and_precision(scenario: Scenario, seed: int, dtype: type, tensors: bool) -> None:
    def cast(array: Any) -> Any:
        array = np.asarray(array)
        array = array if array.dtype == bool else array.astype(dtype)
        return torch.asarray(array) if tensors else array

    game = Game(scenario, like=cast(0.0))
    start, *rounds = luck(Game(scenario), seed)
    kinds = None
    for state, rewards in play(game, each(cast, start), *([each(cast, tree) for tree in trees] for trees in rounds)):
        seen = [*game.published(state), game.agent_trust(state), game.summary(state)]
        seen += [array for array in game.observations(state) if array is not None]
        assert {array.dtype for array in seen} == {cast(0.0).dtype}
        assert all(np.all((np.asarray(a) >= 0) & (np.asarray(a) <= 1)) for a in seen)
        assert rewards is None or (rewards.dtype == cast(0.0).dtype and np.all(np.isfinite(np.asarray(rewards))))
        assert kinds in (None, [a.dtype for a in arrays(state)])
        kinds = [a.dtype for a in arrays(state)]


@many(40)
@given(scenarios(), st.integers(0, 99))
def test_a_step_leaves_its_inputs_alone(scenario: Scenario, seed: int) -> None:
    game = Game(scenario)
    start, actions, noises = luck(game, seed)
    state = game.start(start)
    for inputs in zip(actions, noises, strict=True):
        before = each(np.copy, (state, *inputs))
        after, _ = game.step(state, *inputs)
        each(np.testing.assert_array_equal, (state, *inputs), before)
        state = after


@many(40)
@given(scenarios(), st.integers(0, 99))
def test_who_serves_whom(scenario: Scenario, seed: int) -> None:
    """Never oneself; the absent neither serve nor are served; who left or was cut off never comes back."""
    game, roster = Game(scenario), Game(scenario).roster
    states = [state for state, _ in play(game, *luck(game, seed))]
    own = np.array([[i == j for j in roster.provider_names] for i in roster.rater_names])
    for before, after in pairwise(states):
        assert not (after.awaiting & own).any()
        assert not (after.rated & own).any()
        assert np.all(after.service[~after.awaiting] == 0)
        assert np.all(after.ratings[~after.rated] == 0)
        assert np.all(after.quality[~after.awaiting.any(axis=0)] == 0)
        if after.population is not None:
            here = (before.population.phase == PRESENT) & (after.population.phase == PRESENT)
            assert not after.awaiting[~roster.raters(here)].any()
            assert not after.awaiting[:, ~roster.providers(here)].any()
            gone = before.population.phase >= LEFT
            assert np.array_equal(after.population.phase[gone], before.population.phase[gone])
            assert not np.any((before.population.phase == PRESENT) & (after.population.phase == WAITING))
            fresh = (after.population.phase == WAITING) | (before.population.phase == WAITING)
            assert np.all(game.agent_trust(after)[fresh] == scenario.initial_trust)
            assert np.array_equal(game.present(after), after.population.phase == PRESENT)


@many(30)
@given(scenarios(), st.integers(0, 99), st.randoms())
def test_permuting_agents_of_a_group_permutes_results(scenario: Scenario, seed: int, random: Any) -> None:
    game = Game(scenario)
    roster, (start, actions, noises) = game.roster, luck(game, seed)
    order = list(range(roster.n_agents))
    for group in dict.fromkeys(map(id, roster.groups)):
        places = [n for n in order if id(roster.groups[n]) == group]
        for n, m in zip(places, random.sample(places, len(places)), strict=True):
            order[n] = m
    by_name = [roster.names[n] for n in order]
    i = [roster.rater_names.index(name) for name in by_name if name in roster.rater_names]
    j = [roster.provider_names.index(name) for name in by_name if name in roster.provider_names]
    cells = np.ix_(i, j)

    def shuffle(noise: Noise) -> Noise:
        axes = Noise(cells, cells, cells, cells, order, j, order, order, j, i, i)
        return Noise(*(None if a is None else a[axis] for a, axis in zip(noise, axes, strict=True)))

    permuted = play(
        game,
        shuffle(start),
        [
            Actions(a.quality[j], a.ratings[cells], withheld=None if a.withheld is None else a.withheld[cells])
            for a in actions
        ],
        list(map(shuffle, noises)),
    )
    for (state, rewards), (other, other_rewards) in zip(play(game, start, actions, noises), permuted, strict=True):
        assert_close(other.awaiting, state.awaiting[cells])
        assert_close(other.service, state.service[cells])
        assert_close(other.quality, state.quality[j])
        assert_close(game.agent_trust(other), game.agent_trust(state)[order])
        if rewards is not None:
            assert_close(other_rewards, rewards[order])


PLAIN = Scenario(agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}], max_cycles=3)


@pytest.mark.parametrize(
    ("backend", "scenario"),
    [
        pytest.param("inductor", PLAIN, id="inductor"),
        *(pytest.param("aot_eager", busy(access=access, max_cycles=3), id=name) for name, access in ACCESS.items()),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_compiled_step_is_the_step(backend: str, scenario: Scenario) -> None:
    """In one graph. Inductor takes half a minute for all the features at once, so it has a plain game."""
    torch.compiler.reset()
    game = Game(scenario, like=torch.zeros((), dtype=torch.float64))
    start, *rounds = luck(Game(scenario), 0, (4,))
    actions, noises = ([each(torch.asarray, tree) for tree in trees] for trees in rounds)
    state = game.start(each(torch.asarray, start))
    for inputs in zip(actions[:-1], noises[:-1], strict=True):
        state, _ = game.step(state, *inputs)
    compiled = torch.compile(game.step, fullgraph=True, backend=backend)
    assert_close(compiled(state, actions[-1], noises[-1]), game.step(state, actions[-1], noises[-1]))


@pytest.mark.parametrize("trust_model", ["role-trust", "mean"])
def test_gradients_reach_the_actions(trust_model: str) -> None:
    """White-box attackers climb them; from the start on, a rating counts from the second round."""
    scenario = Scenario(agents=[{"role": "SR", "count": 2}, {"role": "SP", "count": 2}], max_cycles=3)
    game = Game(scenario, trust_model, like=torch.zeros((), dtype=torch.float64))
    random = Random(np.random.default_rng(0), torch.zeros((), dtype=torch.float64))
    state = game.start(game.draw(random, start=True))
    actions = Actions(torch.full((2,), 0.9, dtype=torch.float64), torch.tensor([[0.2, 0.4], [0.6, 0.9]]).double())
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
    assert game.published(second)[1] == pytest.approx(0.5 * 0.75 + 0.25)  # ToR rises to 0.75, the note is 1


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
    # The first ratings arrive in the second round and halve a trust of 0.5, so round 2 is the first one under 0.3.
    assert phases[200] == [PRESENT] * 3
    assert phases[201] == [PRESENT, PRESENT, CUT_OFF]


@pytest.mark.parametrize(
    "scenario",
    [
        pytest.param(Scenario(agents=[{"role": "SR"}, {"role": "SP"}], max_cycles=1), id="one of each, one round"),
        pytest.param(busy(max_cycles=4, ratings={"late": 1.0, "delay": 9}), id="all later than the end"),
        pytest.param(busy(ratings={"lost": 1.0}), id="all lost"),
        pytest.param(busy(admission={"threshold": 1.0, "rounds": 1}), id="everyone cut off"),
        pytest.param(
            Scenario(agents=[{"role": "SR", "count": 2, "leaves": 2}, {"role": "SP", "leaves": 3}]), id="everyone left"
        ),
        pytest.param(busy(access={"kind": "in-range", "radius": 1e-9}), id="nobody in range"),
        pytest.param(busy(values=[float(v) for v in range(1, 1000)]), id="a thousand values"),
        pytest.param(Scenario(agents=[{"role": "SR+SP"}, {"role": "SP"}]), id="no pure rater"),
        pytest.param(
            Scenario(agents=[{"role": "SR", "count": 300}, {"role": "SP", "count": 300}], max_cycles=3), id="300x300"
        ),
    ],
)
def test_extremes(scenario: Scenario) -> None:
    game = Game(scenario)
    for state, _ in play(game, *luck(game, 0)):
        for array in (*game.published(state), game.agent_trust(state), game.summary(state)):
            assert np.all((array >= 0) & (array <= 1))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_luck_at_its_limits_is_harmless(dtype: type) -> None:
    """The largest number below 1 picks the dearest value, and 0 the first; softmax takes both."""
    scenario = busy(access=ACCESS["softmax"], max_cycles=2)
    game = Game(scenario, like=np.zeros((), dtype))
    for extreme in (dtype(0), np.nextafter(dtype(1), dtype(0))):
        start, actions, noises = luck(game, 0)
        start, *noises = (each(lambda a, x=extreme: np.full_like(a, x, dtype), n) for n in (start, *noises))
        *_, (state, _) = play(game, start, actions, noises)
        assert np.all(state.value == dtype(1.0 if extreme else 0.2))
        assert np.all(np.isfinite(game.summary(state)))


def test_whom_admission_cuts_off_is_seen_in_the_published_trust() -> None:
    """By ToA, too, whose weights are counts of services."""
    rules = make_scenario("peers").change(
        agents=[{"role": "SR+SP", "count": 4}], admission={"threshold": 0.5, "rounds": 1}, initial_trust=0.6
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
    with pytest.raises(ValueError, match=r"\(3,\) and \(3, 3\); needed are"):
        game.step(state, Actions(np.ones(3), np.ones((3, 3))), game.draw(game.random(0), (3,)))


class _Odd(Mean):
    """A model with read-outs to be spoilt."""

    spoil = staticmethod(lambda trust: trust)

    def provider_trust(self, state):
        return self.spoil(state.top)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda trust: trust + 1, r"must lie in \[0, 1\]"),
        (lambda trust: trust * np.nan, r"must lie in \[0, 1\]"),
        (lambda trust: trust[:1], r"has shape \(1, 1\); it must be \(3, 1\)"),
    ],
)
def test_a_trust_model_that_reads_nonsense_is_refused(monkeypatch, spoil, message) -> None:
    monkeypatch.setattr(_Odd, "spoil", staticmethod(spoil))
    with pytest.raises(ValueError, match=message):
        Game(make_scenario("paper-3x3"), _Odd())


def test_a_class_is_no_trust_model() -> None:
    with pytest.raises(ValueError, match="must be a trust model"):
        Game(make_scenario("paper-3x3"), Mean)
