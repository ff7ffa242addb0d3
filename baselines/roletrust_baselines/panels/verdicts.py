"""Verdicts of a panel: by a vote that trust weights, by the view of one who has labels, and by
methods of crowd work.

An answer to an item is a provider, and a judge is a rater that rates it by the share of its votes
for it. Who has own labels is one more rater, the owner: it rates the answers to its items 1 if true
and 0 if not.
"""

import dataclasses
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from roletrust_baselines.logs.models import LOG_MODELS, make_log_model
from roletrust_baselines.panels.votes import Votes
from roletrust_env.trust import Traits, trust_models
from roletrust_env.trust.grid_run import GridRun
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import make_run

TIE = 1e-9
"""Weights that differ by less are equal."""


class Verdict(NamedTuple):
    """What is made of the votes.

    Attributes:
        support: Support of each answer to each item, shape (I, A); the answer with most is the
            verdict, see `leaders`.
        trust: Trust in the judges, shape (J,); None without.
    """

    support: Floats
    trust: Floats | None


class Method(Protocol):
    """A way from votes to a verdict.

    Attributes:
        takes_labels: Whether labels of the owner can change it.
    """

    @property
    def takes_labels(self) -> bool:
        """Whether labels of the owner can change the verdict."""

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        """Return the verdict on all items.

        Args:
            votes: Votes and truth.
            labelled: Places of the items with the truth that is known to the owner.
        """


def log_odds(chance: Floats, answers: int = 2) -> Floats:
    """Return the logarithm of the odds of a right answer over each wrong one, which are equally
    likely.

        log(p (A - 1) / (1 - p))

    Args:
        chance: Chance p to be right; NaN is that of a guess, 1 / A, and none is nearer to 0 or 1
            than 0.001.
        answers: Number A of answers.
    """
    answers = max(answers, 2)
    chance = np.clip(np.nan_to_num(chance, nan=1 / answers), 0.001, 0.999)
    odds: Floats = np.log(chance * (answers - 1) / (1 - chance))
    return odds


def leaders(support: Floats) -> npt.NDArray[np.bool_]:
    """Return whether each answer has the most support for its item, shape (I, A); in a tie several
    have.
    """
    best: npt.NDArray[np.bool_] = support >= support.max(axis=1, keepdims=True) - TIE
    return best


def right(votes: Votes, support: Floats) -> Floats:
    """Return how right a verdict is on each item, shape (I,): 1, 0 or in a tie a share; NaN if the
    truth is unknown.
    """
    best = leaders(support)
    known = votes.truth >= 0
    hit = best[np.arange(len(best)), votes.truth] / best.sum(axis=1)
    return np.where(known, hit, np.nan)


@dataclasses.dataclass(frozen=True)
class ByTrust:
    """The verdict by a trust model, after all votes as one round.

    - With one trust for all, the vote weighted by trust in the judges, ToR. Labels would be the
      votes of one more judge among many, and are left out.
    - With a trust for each judge, the trust that the owner of the labels has in the answers, and
      its credence in the judges, where the model has one.
    """

    model: Any

    @property
    def takes_labels(self) -> bool:
        """Whether each judge has a trust of its own."""
        return Traits.of(self.model).family != "central"

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        """Return the verdict. See `Method`.

        Raises:
            MemoryError: The model does not fit, see `make_run`.
        """
        judges, items, answers = votes.shape
        raters, rated, values = votes.judges, votes.items, votes.shares
        if self.takes_labels:
            raters = np.concatenate([raters, np.full(len(labelled), judges)])
            rated = np.concatenate([rated, labelled])
            values = np.concatenate([values, np.eye(answers)[votes.truth[labelled]]])
        run = make_run(self.model, (judges + self.takes_labels, items * answers))
        run.play(np.repeat(raters, answers), votes.answers_to(rated).ravel(), values.ravel())
        trust = run.rater_trust[:judges] if self.model.rates_raters else None
        if isinstance(run, GridRun) and self.takes_labels:
            if len(labelled) and hasattr(run.state, "credence"):
                trust = run.state.credence[judges, :judges]
            return Verdict(self.model.judge_trust(run.state)[judges].reshape(items, answers), trust)
        return Verdict(votes.tally(np.ones(judges) if trust is None else trust), trust)


@dataclasses.dataclass(frozen=True)
class Majority:
    """The verdict by votes of equal weight."""

    takes_labels = False

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        """Return the verdict. See `Method`."""
        return Verdict(votes.tally(np.ones(votes.shape[0])), None)


@dataclasses.dataclass(frozen=True)
class LabelsOnly:
    """The verdict by votes that count as their judges are right on the labels.

        weight = log(p (A - 1) / (1 - p)),   p = (right + 1) / (labelled + A)

    With A answers it is the best vote of independent judges if p is the chance to be right and
    wrong answers are equally likely (Nitzan and Paroush, 1982, for two). A judge that is right less
    often than a guess counts against its vote. Without labels nothing is said.
    """

    takes_labels = True

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        """Return the verdict. See `Method`."""
        total, count = votes.graded(np.isin(np.arange(votes.shape[1]), labelled))
        answers = max(votes.shape[2], 2)
        chance = (total + 1) / (count + answers)
        return Verdict(votes.tally(log_odds(chance, answers)), chance)


# --- methods of crowd-kit
# -----------------------------------------------------------------------------


def _expected_accuracy(method: Any) -> Any:
    """Return the probability that a judge is right, by its confusion matrix and the shares of the
    truths.
    """
    by_label = {
        truth: method.errors_[truth].unstack("label", fill_value=0.0)
        for truth in method.priors_.index
    }
    return sum(answers[truth] * method.priors_[truth] for truth, answers in by_label.items())


_TRUST: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "dawid-skene": ("DawidSkene", _expected_accuracy),
    "one-coin-dawid-skene": ("OneCoinDawidSkene", lambda method: method.skills_),
    "glad": ("GLAD", lambda method: 1 / (1 + np.exp(-method.alphas_))),
    "mace": ("MACE", lambda method: method.spamming_[:, 1] / method.spamming_.sum(1)),
}

CROWD_METHODS = tuple(_TRUST)
"""Names of the methods of crowd-kit."""


@dataclasses.dataclass(frozen=True)
class ByCrowdMethod:
    """The verdict by a method of crowd-kit (Ustalov et al., 2024), with the settings of the
    library.

    - `dawid-skene`: a confusion matrix for each judge (Dawid and Skene, 1979). Trust is the
      expected accuracy. Labels are known truths.
    - `one-coin-dawid-skene`: an accuracy for each judge (Zhang et al., 2016), which is the trust.
    - `glad`: an ability of each judge and a difficulty of each item (Whitehill et al., 2009). Trust
      is the accuracy at an item of difficulty 1.
    - `mace`: a probability of each judge not to guess (Hovy et al., 2013), which is the trust.

    An opinion counts as the answer with the largest share in it; of equal ones, the first.

    Attributes:
        name: Name of the method, see `CROWD_METHODS`.

    Raises:
        ValueError: There is no such method, or crowd-kit is not installed.
    """

    name: str

    @property
    def takes_labels(self) -> bool:
        """Whether the method is told known truths."""
        return self.name == "dawid-skene"

    def __post_init__(self) -> None:
        """Check the name, and that the library is installed."""
        if self.name not in _TRUST:
            raise ValueError(f"unknown method {self.name!r}; known: {', '.join(_TRUST)}")
        if find_spec("crowdkit") is None:
            raise ValueError(f"{self.name} needs crowd-kit: pip install 'roletrust-env[crowd]'")

    def __call__(self, votes: Votes, labelled: Ints) -> Verdict:
        """Return the verdict. See `Method`."""
        import pandas as pd
        from crowdkit import aggregation

        kind, trust = _TRUST[self.name]
        judges, items, answers = votes.shape
        method = getattr(aggregation, kind)()
        said = {"task": votes.items, "worker": votes.judges, "label": votes.shares.argmax(axis=1)}
        known = {}
        if self.takes_labels and len(labelled):
            known = {"true_labels": pd.Series(votes.truth[labelled], index=labelled)}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it uses parts of pandas that will go
            method.fit(pd.DataFrame(said), **known)
        chance = method.probas_.reindex(index=range(items), columns=range(answers)).fillna(0.0)
        each = trust(method)
        if self.name != "mace":  # MACE has an array in the order of the judges
            each = each.reindex(range(judges))
        return Verdict(chance.to_numpy(), np.nan_to_num(np.asarray(each, np.float64)))


# --- by name
# ------------------------------------------------------------------------------------------

SIMPLE: dict[str, Method] = {"majority": Majority(), "labels-only": LabelsOnly()}
"""Methods without a model."""


def make_method(name: str) -> Method:
    """Return a method by its name: one of `SIMPLE` or `CROWD_METHODS`, or a trust model, see
    `make_log_model`.

    Raises:
        ValueError: There is no such method, or a library is missing.
    """
    if name in SIMPLE:
        return SIMPLE[name]
    return ByCrowdMethod(name) if name in CROWD_METHODS else ByTrust(make_log_model(name))


def all_methods() -> list[str]:
    """Return the names of all methods that are installed. GLAD and MACE take most of the time."""
    return [
        *SIMPLE,
        *(CROWD_METHODS if find_spec("crowdkit") else ()),
        *trust_models(),
        *LOG_MODELS,
    ]
