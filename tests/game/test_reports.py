"""Ratings that a rater may report: of older services, and without a service."""

from itertools import pairwise
from typing import Any

import gymnasium
import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from game_cases import luck, play, scenarios
from hypothesis import given
from refusals import refuses

from roletrust_baselines import (
    BadMouthing,
    BallotStuffing,
    CamouflageRating,
    CheatingRing,
    Collusion,
    Complementary,
    Promotion,
    RepTrap,
    SelfPromotion,
    Silent,
    Sleeper,
)
from roletrust_env import (
    Actions,
    Game,
    JointPolicy,
    Noise,
    Player,
    Policy,
    Random,
    Scenario,
    State,
    make_task,
    parallel_env,
    record,
)
from roletrust_env.evaluation.attackers import Both, SideBySide
from roletrust_env.game.policy import ByChannel
from roletrust_env.game.rollout import History, rollout
from roletrust_env.game.views import RaterView
from roletrust_env.world import RatingDelivery
from roletrust_env.world.presence import PRESENT


def market(raters: int = 4, providers: int = 5, **ratings: Any) -> Scenario:
    """Each rater receives one service in a round."""
    agents = [
        {"role": "SR", "count": raters, "noise": 0.1},
        {"role": "SP", "count": providers, "ability": (0.2, 1.0)},
    ]
    access = {"kind": "choice", "providers": 1, "by": "own", "explore": 0.2}
    return Scenario(agents=agents, access=access, ratings=ratings, max_cycles=15)


def parted(providers: int, **ratings: Any) -> tuple[Game, State]:
    """One rater that has received a service of 0.7 from each provider, and receives no others."""
    agents = [{"role": "SR"}, {"role": "SP", "count": providers}]
    access = {"kind": "in-range", "radius": 1e-6, "arena": 1.0, "speed": 0.0}
    game = Game(Scenario(agents=agents, access=access, ratings=ratings, max_cycles=9))
    state = game.start(game.draw(game.random(0), start=True))
    return game, state._replace(service=state.service + 0.7, awaiting=~state.awaiting)


class Claiming(Policy):
    """Claims with a priority for each provider, and rates 1."""

    attacks = frozenset({"claims"})

    def __init__(self, *priority: float) -> None:
        self.priority = priority

    def ratings(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        return 0 * view.service + 1, memory

    def claims(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        rows = np.asarray(self.priority).reshape(-1, *[1] * (view.service.ndim - 1))
        return 0 * view.service + rows, memory


class Hesitant(Policy):
    """Withholds all ratings but those of some rounds."""

    def __init__(self, *rounds: int) -> None:
        self.rounds = rounds

    def withholds(self, view: Any, memory: Any, random: Random) -> tuple[Any, Any]:
        now = sum(view.round == round for round in self.rounds)
        return (now == 0) | (view.service < 0), memory


def played(game: Game, policies: dict[str, Policy], batch: tuple[int, ...] = ()) -> History:
    return record(JointPolicy(game, policies), game.random(0), batch)


# --- which ratings arrive


@given(scenarios(), st.integers(0, 99), st.integers(1, 3))
def test_who_is_delivered_in_an_open_game(scenario: Scenario, seed: int, number: int) -> None:
    """At most `number` per rater, services first, only of present pairs of two agents."""
    game = Game(scenario.change(ratings={"open": number}))
    roster, (start, actions, noises) = game.roster, luck(game, seed)
    own = ~roster.not_self
    for action, ((before, _), (after, _)) in zip(
        actions, pairwise(play(game, start, actions, noises)), strict=True
    ):
        withheld = after.rated & False if action.withheld is None else action.withheld
        claims = 0 * after.ratings if action.claims is None else action.claims
        reports = before.awaiting & ~withheld
        claimed = after.rated & ~before.awaiting
        assert not (after.rated & (own | withheld)).any()
        assert (claims[claimed] > 0).all()
        assert np.array_equal(after.ratings[after.rated], action.ratings[after.rated])
        available = ~own
        if before.population is not None:
            here = before.population.phase == PRESENT
            assert not claimed[~roster.raters(here)].any()
            assert not claimed[:, ~roster.providers(here)].any()
            available = available & roster.raters(here)[:, None] & roster.providers(here)[None, :]
        for s in range(roster.n_raters):
            real, claim = reports[s].sum(), (after.rated & claimed)[s]
            assert (after.rated & reports)[s].sum() == min(real, number)
            left = available[s] & ~withheld[s] & ~before.awaiting[s] & (claims[s] > 0)
            assert claim.sum() == min(max(number - real, 0), left.sum())
            if claim.any() and (left & ~claim).any():
                assert claims[s][claim].min() > claims[s][left & ~claim].max() - 2e-5


@pytest.mark.parametrize("deadline", [1, 2, 4])
@pytest.mark.parametrize("rounds_late", range(5))
def test_a_withheld_rating_may_be_sent_until_the_deadline(deadline: int, rounds_late: int) -> None:
    game, state = parted(1, deadline=deadline)
    random, quiet = game.random(1), np.ones((1, 1), bool)
    actions = Actions(np.ones(1), np.full((1, 1), 0.7))
    for _ in range(rounds_late):
        state, _ = game.step(state, actions._replace(withheld=quiet), game.draw(random))
        assert not state.rated.any()
        assert not state.awaiting.any()
    in_time = rounds_late < deadline
    view = game.views(state)[1]
    assert view.awaiting.any() == in_time
    assert view.service == pytest.approx(0.7 * in_time)
    for arrives in (in_time, False):
        state, _ = game.step(state, actions, game.draw(random))
        assert state.rated.any() == arrives


def test_a_newer_service_replaces_the_older_one() -> None:
    agents = [{"role": "SR"}, {"role": "SP"}]
    game = Game(Scenario(agents=agents, ratings={"deadline": 5}, max_cycles=12))
    rounds = rollout(JointPolicy(game, {"sr_0": Hesitant(4)}), *[game.random(0)] * 2)
    states = [each.state for each in rounds]
    assert [bool(state.rated) for state in states] == [n == 4 for n in range(12)]
    assert states[4].ratings == states[3].service
    assert all(not state.due.rounds.any() for state in states)


def test_a_lost_rating_is_gone() -> None:
    game = Game(market(deadline=9, lost=1.0))
    for each in rollout(JointPolicy(game, {}), *[game.random(0)] * 2):
        assert not each.state.due.rounds.any()
        assert not each.state.rated.any()


def test_services_that_are_left_over_are_sent_later() -> None:
    """Of three services two are rated in a round, and the third one in the next."""
    game, state = parted(3, open=2, deadline=2)
    random, rated = game.random(1), []
    for _ in range(3):
        state, _ = game.step(state, Actions(np.ones(3), state.service), game.draw(random))
        rated.append(state.rated[0])
    assert np.sum(rated, axis=1).tolist() == [2, 1, 0]
    assert np.sum(rated, axis=0).tolist() == [1, 1, 1]


def test_the_trust_model_gets_only_what_is_sent() -> None:
    """Also where every provider serves every rater: the trust of two providers stays in a round."""
    agents = [{"role": "SR"}, {"role": "SP", "count": 3}]
    history = played(Game(Scenario(agents=agents, ratings={"open": 1}, max_cycles=4), "mean"), {})
    assert history.rated.sum(axis=(1, 2)).tolist() == [0, 1, 1, 1]
    assert (history.top[1] == 0.5).sum() == 2


# --- what stays as it was


def test_an_open_game_with_room_for_all_plays_like_a_verified_one() -> None:
    """To the last bit, and so does a long deadline: honest raters send each rating at once."""
    plain = played(Game(market(lost=0.3, late=0.2, delay=2)), {}, (2,))
    wide = played(Game(market(lost=0.3, late=0.2, delay=2, open=5, deadline=3)), {}, (2,))
    for ours, theirs in zip(plain, wide, strict=True):
        assert np.array_equal(ours, theirs, equal_nan=ours.dtype.kind == "f")


def test_the_noise_of_claims_has_a_stream_of_its_own() -> None:
    fields = {"lost": 0.3, "late": 0.2}
    games = [Game(market(**fields, **more)) for more in ({}, {"open": 2})]
    for start in (False, True):
        plain, opened = (game.draw(game.random(3), (2,), start=start) for game in games)
        assert plain.claim is None
        assert opened.claim.shape == (4, 5, 2)
        for name, ours, theirs in zip(Noise._fields, plain, opened, strict=True):
            assert name == "claim" or np.array_equal(ours, theirs)
            assert name == "claim" or ours is None or not np.array_equal(ours, opened.claim)


def test_a_verified_game_ignores_claims() -> None:
    game = Game(market())
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    actions = Actions(np.ones(5), np.ones((4, 5)), claims=np.ones((4, 5)))
    for _ in range(3):
        before = state
        state, _ = game.step(before, actions, game.draw(random))
        assert np.array_equal(state.rated, before.awaiting)
    players = JointPolicy(game, {"sr_0": Claiming(1, 1, 1, 1, 1)})
    assert players.act(state, players.begin(random), random)[0].claims is None


# --- what claims do


@pytest.mark.parametrize("model", ["role-trust", "mean", "first-hand", "travos"])
def test_a_claim_changes_the_trust_of_a_provider_that_never_served_it(model: str) -> None:
    """In the first round, before anybody has received a service."""
    liars = {"sr_0": Claiming(0, 0, 0, 0, 0.5), "sr_1": Claiming(0, 0, 0, 0, 1)}
    history = played(Game(market(open=3), model), liars)
    assert history.rated[0].tolist() == [[False] * 4 + [True]] * 2 + [[False] * 5] * 2
    assert history.top[0, 4] > 0.5
    assert (history.top[0, :4] == 0.5).all()


@pytest.mark.parametrize("name", ["own-experience", "solo-ucb"])
def test_own_memory_knows_nothing_of_claims(name: str) -> None:
    """Models that listen to nobody have the same trust, and make the same choices."""
    game = Game(market(open=4), name)
    liars = {"sr_0": Claiming(1, 1, 1, 1, 1), "sr_1": BadMouthing(level=0.0)}
    plain, attacked = (
        list(rollout(JointPolicy(game, policies), *[game.random(0)] * 2))
        for policies in ({}, liars)
    )
    assert attacked[3].state.rated[:2].sum() > plain[3].state.rated[:2].sum()
    for ours, theirs in zip(plain, attacked, strict=True):
        assert np.array_equal(ours.state.awaiting, theirs.state.awaiting)
        assert np.array_equal(game.known_trust(ours.state), game.known_trust(theirs.state))


def test_equal_claims_and_services_are_drawn_evenly() -> None:
    agents = [{"role": "SR", "count": 300}, {"role": "SP", "count": 4}]
    access = {"kind": "choice", "providers": 1, "explore": 1.0}
    scenario = Scenario(agents=agents, access=access, ratings={"open": 1}, max_cycles=9)
    for served in (0.0, 1.0):
        game = Game(scenario)
        random = game.random(0)
        state = game.start(game.draw(random, start=True))
        state = state._replace(awaiting=state.awaiting | (served > 0))
        actions = Actions(np.ones(4), np.ones((300, 4)), claims=np.full((300, 4), 0.3))
        after, _ = game.step(state, actions, game.draw(random))
        assert (after.rated.sum(axis=1) == 1).all()
        assert after.rated.sum(axis=0).min() > 50


# --- scripted attacks


def view_of(game: Game, state: State) -> RaterView:
    view = game.views(state)[1]
    return type(view)(*(field[..., 0] for field in view))


@pytest.mark.parametrize(
    ("policy", "lied_about"),
    [
        (BadMouthing(level=0.1), range(5)),
        (BadMouthing(level=0.1, targets=(1, 2)), (1, 2)),
        (BadMouthing(level=0.5), range(5)),
        (BadMouthing(lie="relative", level=0.5), range(5)),
        (BallotStuffing(accomplices=(3,)), (3,)),
        (Complementary(), range(5)),
        (SelfPromotion(accomplices=(0, 4)), (0, 4)),
        (Collusion(accomplices=(0, 4)), range(5)),
        (CheatingRing(accomplices=(0, 4), cut=0.0), None),
        (Both(serves=Policy(), rates=BadMouthing(level=0.1)), range(5)),
        (RepTrap(), ()),
        (Silent(), ()),
        (Sleeper(start=1, wakes_at=1.0), ()),
        (BadMouthing(start=3), ()),
        (CamouflageRating(start=1, wakes_at=1.0), ()),
    ],
    ids=repr,
)
def test_a_liar_claims_by_the_distance_of_its_lie_from_published_trust(
    policy: Policy, lied_about: Any
) -> None:
    game = Game(market(open=3))
    random = game.random(1)
    state, memory = game.start(game.draw(random, start=True)), policy.begin(random, ())
    for _ in range(3):
        view = view_of(game, state)
        ratings, memory = policy.ratings(view, memory, random)
        claims, memory = policy.claims(view, memory, random)
        if lied_about is None:
            lied_about = {0, 4} | {int(view.published[1:4].argmax()) + 1}
        for p in range(5):
            if view.awaiting[p]:
                continue
            expected = max(0.01, abs(ratings[p] - view.published[p])) if p in lied_about else 0.0
            if isinstance(policy, CheatingRing) and p not in (0, 4):
                continue  # which one is the best depends on its memory
            assert (0 if claims is None else claims[p]) == pytest.approx(expected, abs=1e-12)
        honest = Actions(np.ones(5), game.views(state)[1].service.T)
        state, _ = game.step(state, honest, game.draw(random))


def test_a_ring_claims_for_its_providers_and_against_the_best() -> None:
    ring = {f"sr_{n}": CheatingRing(accomplices=(0,), cut=0.0) for n in range(2)}
    game = Game(market(open=2))
    rounds = list(rollout(JointPolicy(game, ring), *[game.random(0)] * 2))
    claims = np.array([each.actions.claims for each in rounds])
    assert (claims[:, :2, 0] >= 0.01).all()
    assert (claims[2:, :2, 1:] > 0).any()
    assert (claims[:, :2, 1:] > 0).sum(axis=2).max() == 1
    assert not claims[:, 2:].any()
    assert all((each.state.rated.sum(axis=1) <= 2).all() for each in rounds)


def test_policies_side_by_side_and_of_two_parts_claim_as_each_alone() -> None:
    game = Game(market(open=2))
    liars = BadMouthing(level=0.0), Policy(), BallotStuffing(accomplices=(2,))
    together = played(game, {"sr_1": SideBySide(liars)}, (3, 2))
    assert played(game, {"sr_1": SideBySide((Policy(), Policy()))}, (2, 2)).rated[:, 1].any()
    for k, liar in enumerate(liars):
        row = SideBySide((liar,) * 3)
        each = played(game, {"sr_1": row}, (3, 2))
        assert np.array_equal(together.rated[..., k, :], each.rated[..., k, :])
    parts = played(game, {"sr_1": Both(serves=Policy(), rates=liars[0])})
    assert np.array_equal(parts.rated, played(game, {"sr_1": liars[0]}).rated)
    assert issubclass(Both, ByChannel)


def test_an_attacker_claims_for_its_own_agents_alone() -> None:
    """Beside scripted agents that claim, and those whose actions are left out claim nothing."""
    game = Game(market(open=2))
    task = make_task(game.scenario, ["sr_0", "sr_1"], others={"sr_2": Claiming(1, 0, 0, 0, 0)})
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    own = Actions(np.ones(5), np.ones((4, 5)), claims=np.full((4, 5), 0.5))
    expected = np.zeros((4, 5))
    expected[2, 0] = 1
    for action, claims in ((own, 0.5), (own._replace(claims=None), 0.0)):
        expected[:2] = claims
        assert np.array_equal(task.joint(state, action, random)[0].claims, expected)
    quiet = make_task(game.scenario, ["sr_0"])
    state = quiet.start(quiet.game.draw(random, start=True), random)
    assert quiet.joint(state, own._replace(claims=None), random)[0].claims is None


def test_a_wide_coalition_decides_on_claims_where_reports_are_open() -> None:
    fields = {"observation": "accounts", "objective": "mislead"}
    sizes = []
    for ratings in ({}, {"open": 2}):
        task = make_task(market(**ratings), ["sr_2", "sr_3", "sp_4"], like=np.zeros(()), **fields)
        sizes.append(task.action_size)
    assert sizes[1] == sizes[0] + 5
    random = task.game.random(0)
    state = task.start(task.game.draw(random, start=True), random)
    flat = np.concatenate([np.zeros(sizes[0]), [0, 0.2, 0.4, 0.6, 0.8]])
    actions, _ = task.joint(state, flat, random)
    assert np.array_equal(actions.claims, [[0] * 5] * 2 + [[0, 0.2, 0.4, 0.6, 0.8]] * 2)
    after, _ = task.step(state, flat, task.game.draw(random), random)
    assert after.game.rated[2:].tolist() == [[False, False, False, True, True]] * 2
    assert make_task(market(open=2), ["sp_4"], **fields).coalition.claims is False


# --- other libraries and engines


SETTINGS = [{"deadline": 3, "lost": 0.2}, {"open": 2, "late": 0.3}, {"open": 2, "deadline": 3}]


@pytest.mark.parametrize("ratings", SETTINGS, ids=str)
@pytest.mark.parametrize("model", ["role-trust", "first-hand"])
def test_a_batch_is_its_games_and_torch_agrees(model: str, ratings: dict) -> None:
    scenario = market(**ratings)
    policies = {
        "sr_0": Hesitant(2, 5, 9),
        "sr_1": BadMouthing(level=0.0),
        "sr_2": CheatingRing(accomplices=(0,)),
        "sp_0": CheatingRing(accomplices=(0,)),
    }
    one, many = (played(Game(scenario, model), policies, batch) for batch in ((), (3,)))
    like = torch.zeros((), dtype=torch.float64)
    tensors = played(Game(scenario, model, like), policies, (3,))
    for single, whole, tensor in zip(one, many, tensors, strict=True):
        np.testing.assert_allclose(single, whole[..., 0], atol=1e-12)
        np.testing.assert_allclose(np.asarray(tensor), whole, atol=1e-9)


@pytest.mark.parametrize("ratings", SETTINGS, ids=str)
@pytest.mark.parametrize("observation", ["agents", "accounts"])
def test_compiled_rounds_are_those_of_the_rules(observation: str, ratings: dict) -> None:
    played = []
    for engine in ("rules", "compiled"):
        env = gymnasium.make(
            "RoleTrust/CollusionAttack-v0",
            scenario=market(**ratings),
            compromised=["sr_0", "sp_4"],
            engine=engine,
            observation=observation,
            others={"sr_1": BadMouthing(level=0.0), "sr_2": Promotion()},
        )
        rows = [env.reset(seed=0)[0]]
        random = np.random.default_rng(0)
        for _ in range(14):
            seen, reward, *_ = env.step(random.random(env.action_space.shape, np.float32))
            rows.append(np.append(seen, reward))
        played.append(np.concatenate(rows))
    np.testing.assert_allclose(*played, rtol=0, atol=1e-6)  # observations are in single precision


@pytest.mark.parametrize("ratings", SETTINGS, ids=str)
def test_parallel_environments_show_what_can_be_rated(ratings: dict) -> None:
    envs = [parallel_env(market(**ratings), engine=engine) for engine in ("rules", "compiled")]
    random = np.random.default_rng(0)
    for env in envs:
        env.reset(seed=4)
    while envs[0].agents:
        actions = {a: random.random(envs[0].action_space(a).shape) for a in envs[0].agents}
        steps = [env.step(actions)[0] for env in envs]
        for agent in envs[0].agents:
            np.testing.assert_allclose(steps[0][agent], steps[1][agent], rtol=0, atol=1e-6)


# --- bad input


@pytest.mark.parametrize(("name", "value"), [("deadline", 0), ("deadline", 1.5), ("open", 0)])
def test_a_wrong_rule_is_refused(name: str, value: Any) -> None:
    with refuses(ValueError, name, value):
        RatingDelivery(**{name: value})


def test_wrong_claims_are_refused() -> None:
    game = Game(market(open=2))
    random = game.random(0)
    state = game.start(game.draw(random, start=True))
    usual = Actions(np.ones(5), np.ones((4, 5)))
    with refuses(ValueError, "claims", "(5,)", "(4, 5)"):
        game.step(state, usual._replace(claims=np.ones(5)), game.draw(random))
    for wrong in (np.nan, -0.5, 1.5):
        with refuses(ValueError, "claims", wrong):
            game.step(state, usual._replace(claims=np.full((4, 5), wrong)), game.draw(random))
        players = JointPolicy(game, {"sr_1": Claiming(0, 0, wrong, 0, 0)})
        with refuses(ValueError, "sr_1", "claims"):
            players.checked_act(state, players.begin(random), random)


def test_an_action_of_pettingzoo_and_a_provider_have_no_claims() -> None:
    claims = Claiming(1, 1, 1, 1, 1)
    with refuses(ValueError, "sr_0", "claims"):
        Player(claims, "sr_0", parallel_env(market(open=2)).layout)
    with refuses(ValueError, "sp_0", "claims"):
        JointPolicy(Game(market(open=2)), {"sp_0": claims})
