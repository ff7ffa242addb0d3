"""Methods that are made for crowd work, from the library crowd-kit (the extra `crowd`)."""

import dataclasses
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.data.log import RatingLog
from roletrust_env.trust.ledger import Floats


class Verdict(NamedTuple):
    """What a model or a method makes of the answers.

    Attributes:
        leaning: Above 0 for each question that is judged true, below 0 for the others, shape (questions,).
        trust: Trust in the workers, shape (workers,); None without.
    """

    leaning: Floats
    trust: Floats | None


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
