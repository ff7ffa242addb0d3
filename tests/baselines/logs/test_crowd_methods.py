"""Methods of crowd-kit as parts of the protocol of crowd work."""

import numpy as np
import pytest

from roletrust_baselines.logs.crowd import CROWD_METHODS, CrowdMethod, CrowdTask, crowd_work, read_crowd, write_crowd
from roletrust_env.data.log import RatingLog


def test_names_and_the_library_are_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="unknown method 'dawid'; known: dawid-skene, one-coin"):
        CrowdMethod("dawid")
    monkeypatch.setattr("roletrust_baselines.logs.crowd.find_spec", lambda name: None)
    with pytest.raises(ValueError, match=r"mace needs crowd-kit: pip install 'roletrust-env\[crowd\]'"):
        CrowdMethod("mace")


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> CrowdTask:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    folder = tmp_path_factory.mktemp("crowd")
    write_crowd(folder, questions=200, workers=12)
    return read_crowd(folder / "answer.csv.gz", folder / "truth.csv.gz")


SLOW = {"mace", "glad"}  # seconds each
NAMES = [pytest.param(name, marks=pytest.mark.slow) if name in SLOW else name for name in CROWD_METHODS]


@pytest.mark.parametrize("name", NAMES)
def test_the_truth_and_the_guessers_are_found(task: CrowdTask, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    verdict = CrowdMethod(name).judge(task.answers)
    assert verdict.trust is not None
    assert verdict.trust.shape == (12,)
    assert ((verdict.trust >= 0) & (verdict.trust <= 1)).all()
    monkeypatch.setattr(CrowdMethod, "judge", lambda *_: verdict)
    found = crowd_work(CrowdMethod(name), task)
    assert found["accuracy"].value > found["majority"].value - 0.02
    assert found["spearman"].low > 0.3


def one_step(answers: RatingLog, chance: np.ndarray, one_coin: bool) -> tuple[np.ndarray, np.ndarray]:
    """The probabilities after an M and an E step, loop by loop, and the expected accuracies after the M step."""
    workers, questions = answers.shape
    both = np.stack([1 - chance, chance], 1)
    shares, counts = both.mean(0), np.zeros((workers, 2, 2))
    for worker, question, answer in zip(answers.raters, answers.ratees, answers.values.astype(int), strict=True):
        counts[worker, answer] += both[question]
    if one_coin:
        skill = (counts[:, 0, 0] + counts[:, 1, 1]) / counts.sum((1, 2))
        errors = np.array([[[s, 1 - s], [1 - s, s]] for s in skill])
    else:
        errors = counts / counts.sum(1, keepdims=True)
    chances = np.tile(shares, (questions, 1))
    for worker, question, answer in zip(answers.raters, answers.ratees, answers.values.astype(int), strict=True):
        chances[question] *= errors[worker, answer]
    expected = errors[:, 0, 0] * shares[0] + errors[:, 1, 1] * shares[1]
    return (chances / chances.sum(1, keepdims=True))[:, 1], skill if one_coin else expected


@pytest.mark.parametrize("one_coin", [False, True])
def test_dawid_and_skene_rest_where_their_equations_do(task: CrowdTask, one_coin: bool) -> None:
    name = "one-coin-dawid-skene" if one_coin else "dawid-skene"
    verdict = CrowdMethod(name).judge(task.answers)
    chance = (verdict.leaning + 1) / 2
    again, trust = one_step(task.answers, chance, one_coin)
    assert again == pytest.approx(chance, abs=0.06)  # the library stops when the likelihood hardly grows
    assert abs(again - chance).mean() < 0.002
    assert verdict.trust == pytest.approx(trust, abs=0.01)


def test_an_answer_that_nobody_gave_is_no_failure() -> None:
    pytest.importorskip("crowdkit", reason="needs crowd-kit: pip install 'roletrust-env[crowd]'")
    raters, ratees = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])
    answers = RatingLog(raters, ratees, np.ones(4), None, list("ab"), list("pq"), True)
    for name in set(CROWD_METHODS) - SLOW:
        assert (CrowdMethod(name).judge(answers).leaning > 0).all(), name
