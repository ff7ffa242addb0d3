"""Verdicts against loops and closed forms, and what must not change them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from panel_cases import votes_of
from refusals import refuses

from roletrust_baselines.panels.report import judged
from roletrust_baselines.panels.trials import draws, judge, scopes
from roletrust_baselines.panels.verdicts import (
    CROWD_METHODS,
    ByCrowdMethod,
    ByTrust,
    LabelsOnly,
    Majority,
    Verdict,
    make_method,
    right,
)
from roletrust_baselines.panels.votes import Votes, read_votes, write_votes
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.key_index import Ints

NOBODY = np.zeros(0, np.int64)


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> Votes:
    path = tmp_path_factory.mktemp("votes") / "votes.csv"
    write_votes(path, items=60, judges=12)
    return read_votes(path, truth="truth", kind="kind")


def test_right_counts_a_tie_as_a_share() -> None:
    votes = votes_of([[0, 0, 1, 0], [1, 0, 2, 0], [2, 1, 2, 0]], [1, 0, 1, -1])
    found = right(votes, Majority()(votes, NOBODY).support)
    np.testing.assert_allclose(found, [1 / 3, 1, 0, np.nan])


def test_labels_alone_weigh_by_log_odds() -> None:
    votes = votes_of([[0, 0, 1], [1, 1, 0]], [0, 0, -1])
    support, trust = LabelsOnly()(votes, np.array([0, 1]))
    assert trust == pytest.approx([3 / 4, 1 / 4])
    assert support[2] == pytest.approx(
        [-np.log(3), np.log(3)]
    )  # the first says 1, the second, mostly wrong, says 0
    assert LabelsOnly()(votes, NOBODY).support.tolist() == [[0, 0]] * 3


def test_labels_alone_are_the_most_likely_answer_of_several() -> None:
    """Support is a log-likelihood but for a constant: p if right, (1 - p) / (A - 1) for each wrong
    one."""
    rng = np.random.default_rng(0)
    truth = np.arange(60) % 5
    votes = votes_of(
        np.where(rng.random((4, 60)) < [[0.9], [0.6], [0.4], [0.1]], truth, rng.integers(0, 5, 60)),
        truth,
    )
    support, trust = LabelsOnly()(votes, np.arange(40))
    assert trust is not None
    for item in range(60):
        said = votes.shares[votes.items == item].argmax(axis=1)  # in the order of the judges
        expected = [
            np.log(np.where(said == answer, trust, (1 - trust) / 4)).sum() for answer in range(5)
        ]
        assert support[item] - support[item, 0] == pytest.approx(np.array(expected) - expected[0])
    assert LabelsOnly()(votes, NOBODY).support.tolist() == [[0] * 5] * 60


def test_a_tie_and_an_item_without_votes_have_no_verdict() -> None:
    votes = votes_of([[0, 1, 1], [1, 1, 0]], [-1, -1, -1])
    votes = votes._replace(
        **{name: getattr(votes, name)[votes.items < 2] for name in ("judges", "items", "shares")}
    )
    for name in ("majority", "first-hand", "leave-one-out"):
        assert [line[1] for line in judged(votes, make_method(name))[1]] == ["", "a1", ""], name


def test_one_trust_for_all_weighs_the_vote(synthetic: Votes) -> None:
    support, trust = ByTrust(make_trust_model("role-trust"))(synthetic, NOBODY)
    assert trust is not None
    np.testing.assert_allclose(support, synthetic.tally(trust))
    again, _ = ByTrust(make_trust_model("role-trust"))(synthetic, np.arange(9))
    assert np.array_equal(support, again)  # labels would be one more judge
    equal = ByTrust(make_trust_model("mean"))(synthetic, NOBODY)  # it does not rate raters
    assert equal.trust is None
    np.testing.assert_allclose(equal.support, synthetic.tally(np.ones(12)))


def test_few_labels_tell_who_is_right_where_most_are_not() -> None:
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 2, 40)
    answers = np.array([truth if n < 3 else 1 - truth for n in range(11)])
    votes, labelled = votes_of(answers, truth), np.array([0, 1, 2, 3, 4])
    for name in ("first-hand", "yu-singh", "fire", "labels-only"):
        found = right(votes, make_method(name)(votes, labelled).support)
        assert found[5:].mean() == 1, name
    for name in ("majority", "leave-one-out", "role-trust"):
        assert right(votes, make_method(name)(votes, labelled).support)[5:].mean() == 0, name
    trust = make_method("first-hand")(votes, labelled).trust
    assert trust is not None
    assert trust[:3].min() > trust[3:].max()


@given(
    st.permutations(range(6)),
    st.sampled_from(["first-hand", "leave-one-out", "labels-only", "majority", "qor"]),
)
def test_names_of_answers_and_order_of_judges_do_not_matter(order: list[int], name: str) -> None:
    rng = np.random.default_rng(1)
    answers, truth, labelled = rng.integers(0, 2, (6, 10)), rng.integers(0, 2, 10), np.array([2, 5])
    plain = make_method(name)(votes_of(answers, truth), labelled)
    other = make_method(name)(votes_of(1 - answers[order], 1 - truth), labelled)
    np.testing.assert_allclose(other.support[:, ::-1], plain.support, atol=1e-9)
    if plain.trust is not None and other.trust is not None:
        np.testing.assert_allclose(other.trust, plain.trust[order], atol=1e-9)


# --- trials
# -------------------------------------------------------------------------------------------


class Parrot:
    """Knows the labels, and nothing else."""

    takes_labels = True

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        support = np.zeros(votes.shape[1:])
        support[labelled, votes.truth[labelled]] = 1
        return Verdict(support, None)


def test_labelled_items_are_not_judged(synthetic: Votes) -> None:
    for scope in scopes(synthetic):
        for labels in (0, 5, 10):
            assert judge(scope, Parrot(), draws(scope, labels, 4, 0))["accuracy"].value == 0.5


def test_scopes_are_all_items_and_each_kind_with_labels_of_its_own_and_of_others(
    synthetic: Votes,
) -> None:
    found = scopes(synthetic)
    assert [one[:2] for one in found] == [
        ("all", "all"),
        *((k, k if own else "other") for k in synthetic.kind_names for own in (True, False)),
    ]
    for one in found[1:]:
        assert {one.votes.kind_names[kind] for kind in one.votes.kinds[one.judged]} == {one.scored}
        of_labels = {one.votes.kind_names[kind] for kind in one.votes.kinds[one.pool]}
        assert of_labels == (
            {one.scored} if one.labelled == one.scored else set(synthetic.kind_names) - {one.scored}
        )
    assert draws(found[1], 10_000, 4, 0) == []
    assert [len(one) for one in draws(found[0], 7, 3, 0)] == [7, 7, 7]


def test_spearman_is_one_for_the_true_order() -> None:
    rng = np.random.default_rng(0)
    truth = rng.integers(0, 2, 200)
    answers = np.array(
        [np.where(rng.random(200) < p, truth, 1 - truth) for p in (0.55, 0.7, 0.8, 0.9)]
    )
    scope = scopes(votes_of(answers, truth))[0]
    assert judge(scope, LabelsOnly(), draws(scope, 100, 3, 0))["spearman"].value == pytest.approx(1)
    assert "spearman" not in judge(scope, Majority(), draws(scope, 0, 1, 0))


def test_spearman_of_guessers_is_none_however_many_labels_are_drawn() -> None:
    truth, answers = np.zeros(40, np.int64), np.random.default_rng(0).integers(0, 2, (300, 40))
    scope = scopes(votes_of(answers, truth))[0]
    assert abs(judge(scope, LabelsOnly(), draws(scope, 20, 10, 0))["spearman"].value) < 0.15
    lone = scopes(votes_of(np.ones((1, 3), np.int64), np.ones(3, np.int64)))[0]
    assert np.isnan(judge(lone, LabelsOnly(), draws(lone, 2, 2, 0))["spearman"].value)


# --- crowd-kit
# ----------------------------------------------------------------------------------------

SLOW = {"mace", "glad"}  # seconds each
HEAVY = {*SLOW, "dawid-skene"}
NAMES = [
    pytest.param(name, marks=pytest.mark.slow) if name in HEAVY else name for name in CROWD_METHODS
]


def test_names_and_the_library_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    with refuses(ValueError, "dawid", "dawid-skene"):
        ByCrowdMethod("dawid")
    with refuses(ValueError, "dawid"):
        make_method("dawid")
    monkeypatch.setattr("roletrust_baselines.panels.verdicts.find_spec", lambda name: None)
    with refuses(ValueError, "mace", "crowd-kit", "roletrust-env[crowd]"):
        make_method("mace")


@pytest.fixture(scope="module")
def guessers() -> Votes:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    rng = np.random.default_rng(0)
    truth = (rng.random(200) < 0.3).astype(int)
    skill = rng.choice([0.5, 0.8, 0.95], 12)
    return votes_of(np.where(rng.random((12, 200)) < skill[:, None], truth, 1 - truth), truth)


@pytest.mark.parametrize("name", NAMES)
def test_the_truth_and_the_guessers_are_found(guessers: Votes, name: str) -> None:
    support, trust = ByCrowdMethod(name)(guessers, NOBODY)
    assert support.shape == (200, 2)
    assert trust is not None
    assert trust.shape == (12,)
    assert ((trust >= 0) & (trust <= 1)).all()
    assert (
        right(guessers, support).mean()
        > right(guessers, Majority()(guessers, NOBODY).support).mean() - 0.02
    )
    assert np.corrcoef(trust, guessers.accuracy)[0, 1] > 0.5


def one_step(votes: Votes, chance: np.ndarray, one_coin: bool) -> tuple[np.ndarray, np.ndarray]:
    """The probabilities after an M and an E step, loop by loop, and the expected accuracies after
    the M step."""
    shares, counts = chance.mean(0), np.zeros((len(votes.judge_names), 2, 2))
    said = list(zip(votes.judges, votes.items, votes.shares.argmax(1), strict=True))
    for judge_, item, answer in said:
        counts[judge_, answer] += chance[item]
    if one_coin:
        skill = (counts[:, 0, 0] + counts[:, 1, 1]) / counts.sum((1, 2))
        errors = np.array([[[s, 1 - s], [1 - s, s]] for s in skill])
    else:
        errors = counts / counts.sum(1, keepdims=True)
    chances = np.tile(shares, (len(chance), 1))
    for judge_, item, answer in said:
        chances[item] *= errors[judge_, answer]
    expected = errors[:, 0, 0] * shares[0] + errors[:, 1, 1] * shares[1]
    return chances / chances.sum(1, keepdims=True), skill if one_coin else expected


@pytest.mark.parametrize("one_coin", [False, True])
def test_dawid_and_skene_rest_where_their_equations_do(guessers: Votes, one_coin: bool) -> None:
    support, trust = ByCrowdMethod("one-coin-dawid-skene" if one_coin else "dawid-skene")(
        guessers, NOBODY
    )
    again, expected = one_step(guessers, support, one_coin)
    assert again == pytest.approx(
        support, abs=0.06
    )  # the library stops when the likelihood hardly grows
    assert abs(again - support).mean() < 0.002
    assert trust == pytest.approx(expected, abs=0.01)


def test_labels_are_known_truths_of_dawid_and_skene() -> None:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    truth = np.random.default_rng(0).integers(0, 2, 30)
    votes = votes_of([truth, truth, 1 - truth, 1 - truth, 1 - truth], truth)
    method = ByCrowdMethod("dawid-skene")
    assert right(votes, method(votes, NOBODY).support).mean() == 0
    assert right(votes, method(votes, np.arange(20)).support)[20:].mean() == 1


def test_an_answer_that_nobody_gave_is_no_failure() -> None:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    votes = votes_of([[1, 1], [1, 1]], [1, 1])
    for name in set(CROWD_METHODS) - SLOW:
        assert right(votes, ByCrowdMethod(name)(votes, NOBODY).support).tolist() == [1, 1], name
