"""Crowd work: workers answer questions, some of which have a known truth; and the methods that are made for it.

The methods are those of the library crowd-kit, the extra `crowd`.
"""

import csv
import dataclasses
import gzip
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from roletrust_baselines.logs.resampling import correlation, interval, mean, ranks
from roletrust_env.data.columns import Columns
from roletrust_env.data.log import RatingLog, read_ratings
from roletrust_env.metrics.confidence import Interval
from roletrust_env.trust.key_index import Floats
from roletrust_env.trust.run import make_run


class Verdict(NamedTuple):
    """What a model or a method makes of the answers.

    Attributes:
        leaning: Above 0 for each question that is judged true, below 0 for the others, shape (questions,).
        trust: Trust in the workers, shape (workers,); None without.
    """

    leaning: Floats
    trust: Floats | None


class CrowdTask(NamedTuple):
    """Answers, 0 or 1, and the truth.

    Attributes:
        answers: Answers as ratings: workers are raters, questions are ratees.
        truth: Truth of each question, 0 or 1, shape (questions,); NaN where it is unknown.
    """

    answers: RatingLog
    truth: Floats


def read_crowd(answers: Path, truth: Path) -> CrowdTask:
    """Read answers (question, worker, answer) and truth (question, truth): CSV files with a header, or Parquet files.

    Raises:
        ValueError: A file is no such table, an answer is neither 0 nor 1, or no question has a truth.
        OSError: A file cannot be read.
    """
    tables = (answers, Columns("worker", "question", "answer")), (truth, Columns("question", "question", "truth"))
    log, gold = (read_ratings(*table, labels={"0": 0.0, "1": 1.0}) for table in tables)
    known = dict(zip((gold.rater_names[at] for at in gold.raters.tolist()), gold.values.tolist(), strict=True))
    values = np.array([known.get(name, np.nan) for name in log.ratee_names])
    if np.isnan(values).all():
        raise ValueError(f"{truth} has the truth of no question in {answers}")
    return CrowdTask(log, values)


def crowd_work(model: Any, task: CrowdTask, seed: int = 0) -> dict[str, Interval]:
    """Return how well a trust model, or a method made for crowd work, finds the truth and the good workers.

    - `accuracy`: share of questions with a known truth in which the verdict is right; a tie is half. The verdict of a
      trust model is the vote weighted by trust, after all answers as one round.
    - `majority`: the same for the vote with equal weights.
    - `spearman`: rank correlation of trust in the workers and their true accuracy; undefined without rater trust.

    Intervals resample questions; that of `spearman` resamples workers.

    Args:
        model: Trust model or `CrowdMethod`.
        task: Answers and truth.
        seed: Random seed of the resamples, and of a method that needs one.

    Raises:
        MemoryError: The model does not fit, see `make_run`.
    """
    log, truth = task
    verdict = model.judge(log, seed) if isinstance(model, CrowdMethod) else _vote(model, log)
    equal = _weighted(log, np.ones(log.shape[0]))
    known, found = ~np.isnan(truth), dict[str, Interval]()
    for name, leaning in (("accuracy", verdict.leaning), ("majority", equal)):
        right = np.where(abs(leaning) < 1e-12, 0.5, (leaning > 0) == (truth > 0.5))[known]
        found[name] = interval(mean(right), np.arange(len(right)), seed)
    graded = known[log.ratees]
    right = (log.values == truth[log.ratees])[graded]
    count = np.bincount(log.raters[graded], minlength=log.shape[0])
    accuracy = np.bincount(log.raters[graded], right, log.shape[0])[count > 0] / count[count > 0]
    if verdict.trust is not None:
        pair = ranks(verdict.trust[count > 0]), ranks(accuracy)
        found["spearman"] = interval(correlation(*pair), np.arange(len(accuracy)), seed)
    return found


def _vote(model: Any, log: RatingLog) -> Verdict:
    """Return the vote weighted by a trust model's trust after all answers."""
    run = make_run(model, log.shape)
    run.play(log.raters, log.ratees, log.values)
    trust = run.rater_trust
    return Verdict(_weighted(log, trust), trust if model.rates_raters else None)


def _weighted(log: RatingLog, weights: Floats) -> Floats:
    """Return the balance of a vote on each question, above 0 for yes, from a weight for each worker."""
    return np.bincount(log.ratees, weights[log.raters] * (2 * log.values - 1), log.shape[1]).astype(np.float64)


def write_crowd(folder: Path, seed: int = 0, questions: int = 300, workers: int = 30) -> None:
    """Write a small synthetic task, `answer.csv.gz` and `truth.csv.gz`: three answers a question, some workers guess.

    Args:
        folder: Folder of the files, which must exist.
        seed: Random seed.
        questions: Number of questions.
        workers: Number of workers.
    """
    rng = np.random.default_rng(seed)
    truth, skill = rng.random(questions) < 0.3, rng.choice([0.5, 0.8, 0.95], workers)
    rows = []
    for question in range(questions):
        for worker in rng.choice(workers, 3, replace=False):
            right = rng.random() < skill[worker]
            rows.append((f"q{question}", f"w{worker}", int(truth[question] == right)))
    tables: dict[str, tuple[tuple[str, ...], list[Any]]] = {
        "answer.csv.gz": (("question", "worker", "answer"), rows),
        "truth.csv.gz": (("question", "truth"), [(f"q{n}", int(value)) for n, value in enumerate(truth)]),
    }
    for name, (header, lines) in tables.items():
        with gzip.open(folder / name, "wt", encoding="utf-8", newline="") as file:
            csv.writer(file, lineterminator="\n").writerows([header, *lines])


# --- methods of crowd-kit ----------------------------------------------------------------------------


def _expected_accuracy(method: Any) -> Floats:
    """Return the probability that a worker is right, by its confusion matrix and the shares of the truths."""
    by_label = {truth: method.errors_[truth].unstack("label", fill_value=0.0) for truth in method.priors_.index}
    right: Any = sum(answers[truth] * method.priors_[truth] for truth, answers in by_label.items())
    return np.asarray(right.sort_index(), np.float64)


_WORKERS: dict[str, tuple[str, Callable[[Any], Floats]]] = {
    "dawid-skene": ("DawidSkene", _expected_accuracy),
    "one-coin-dawid-skene": ("OneCoinDawidSkene", lambda method: method.skills_.sort_index().to_numpy()),
    "glad": ("GLAD", lambda method: 1 / (1 + np.exp(-method.alphas_.sort_index().to_numpy()))),
    "mace": ("MACE", lambda method: method.spamming_[:, 1] / method.spamming_.sum(1)),
}


@dataclasses.dataclass(frozen=True)
class CrowdMethod:
    """A method of crowd-kit (Ustalov et al., 2024), with the settings of the library.

    - `dawid-skene`: a confusion matrix for each worker (Dawid and Skene, 1979). Trust is the expected accuracy.
    - `one-coin-dawid-skene`: an accuracy for each worker (Zhang et al., 2016), which is the trust.
    - `glad`: an ability of each worker and a difficulty of each question (Whitehill et al., 2009). Trust is the
      accuracy at a question of difficulty 1.
    - `mace`: a probability of each worker not to guess (Hovy et al., 2013), which is the trust.

    Attributes:
        name: Name of the method, see `CROWD_METHODS`.

    Raises:
        ValueError: There is no such method, or crowd-kit is not installed.
    """

    name: str

    rates_raters = True

    def __post_init__(self) -> None:
        """Check the name, and that the library is installed."""
        if self.name not in _WORKERS:
            raise ValueError(f"unknown method {self.name!r}; known: {', '.join(_WORKERS)}")
        if find_spec("crowdkit") is None:
            raise ValueError(f"{self.name} needs crowd-kit: pip install 'roletrust-env[crowd]'")

    def judge(self, answers: RatingLog, seed: int = 0) -> Verdict:
        """Return the verdict on the answers.

        Args:
            answers: Answers, 0 or 1, of workers to questions; every worker and every question has one.
            seed: Random seed, which `mace` needs.
        """
        import pandas as pd
        from crowdkit import aggregation

        kind, trust = _WORKERS[self.name]
        method = getattr(aggregation, kind)(**({"random_state": seed} if self.name == "mace" else {}))
        columns = {"task": answers.ratees, "worker": answers.raters, "label": answers.values.astype(np.int64)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it uses parts of pandas that will go
            method.fit(pd.DataFrame(columns))
        chance = method.probas_.sort_index().reindex(columns=[0, 1], fill_value=0.0)
        return Verdict((chance[1] - chance[0]).to_numpy(), trust(method))


CROWD_METHODS = tuple(_WORKERS)
"""Names of the methods."""
