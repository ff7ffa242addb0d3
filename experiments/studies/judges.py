"""How often methods find the true answer from the votes of judges, by the number of own labels.

Judges are language models on LLMBar and workers on product. The models of LLMBar saw both orders of
the two answers, so each judge has two votes on an item; `one order` has the first of them. The
owner of the labels knows the truth of some items, which are drawn. All methods are scored on the
same items: those without a label. A tie between answers counts as half.

- `most right labels`, the trivial rule: follow the judge with the most right votes on labelled
  items, of those that voted on the item. Judges that are equal vote; if that is a tie, all judges
  vote.
- `labels alone`: votes weighted by log(p / (1 - p)), where p = (right + 1) / (votes + 2) is a
  judge's share of right votes on labelled items.
- Trust models: judges rate the answer that they chose 1 and the other 0, in one round. With
  `leave-one-out` votes are weighted by trust in the judges, which labels cannot change. With the
  personal models `first-hand` and `yu-singh` the owner is one more rater, which rates by its
  labels. Its trust in the answers is the verdict: votes weighted by its trust in the judges.
- `dawid-skene` and `mace` of crowd-kit, the first with the labels as known truths.

Intervals resample items and draws of labels together. Takes twenty minutes of a core.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from crowdkit.aggregation import MACE, DawidSkene

from roletrust_env.logs.compare import interval_text
from roletrust_env.metrics.confidence import Interval
from roletrust_env.storage.markdown import markdown_table
from roletrust_env.trust import make_trust_model
from roletrust_env.trust.key_index import Floats, Ints
from roletrust_env.trust.run import make_run
from studies.study import Recipe, Study, with_ends

ONE_ORDER, BOTH_ORDERS, PRODUCT = DATA = ("LLMBar, one order", "LLMBar, both orders", "product")
TRIVIAL = "most right labels"
LABELS = (0, 5, 10, 20)
RESAMPLES = 1000
_FAINT = 1e-6  # weight of a vote that only settles ties
_TIE = 1e-9  # least difference of support that is not a tie


class Options(NamedTuple):
    """Where the votes are, and how often labels are drawn.

    Attributes:
        logs: Folder of the files, which are not in the repository.
        draws: Number of sets of labels of each size.
    """

    logs: Path = Path("logs")
    draws: int = 20


FILES = ("judges.md", "judges.csv")
RECIPES = {"judges": Recipe(Options(), {name: f"judges/{name}" for name in FILES})}


class Votes(NamedTuple):
    """Votes of judges on items with the answers 0 and 1.

    Attributes:
        judges: Index of the judge of each vote, shape (V,).
        items: Index of the item of each vote, shape (V,).
        answers: Answer of each vote, shape (V,).
        truth: True answer of each item, shape (I,).
    """

    judges: Ints
    items: Ints
    answers: Ints
    truth: Ints

    def support(self, weights: Floats) -> Floats:
        """Return the sum of the weights of the votes for each answer, shape (I, 2)."""
        pairs = 2 * self.items + self.answers
        sums: Floats = np.bincount(pairs, weights, 2 * len(self.truth)).astype(np.float64)
        return sums.reshape(-1, 2)

    def graded(self, labelled: Ints) -> tuple[Floats, Floats]:
        """Return how many labelled items' votes of each vote's judge are right, and their number,
        shape (V,) each.
        """
        known = np.isin(self.items, labelled)
        right = known & (self.answers == self.truth[self.items])
        counts = (np.bincount(self.judges, flags).astype(np.float64) for flags in (right, known))
        right_count, count = (each[self.judges] for each in counts)
        return right_count, count


Key = tuple[str, int]
"""Method and number of labels."""


def main(study: Study[Options]) -> None:
    """Measure all methods on all data, and write the tables."""
    rows, tables = [], list[str]()
    for data in DATA:
        votes, rng = read(study.options.logs, data), np.random.default_rng(study.seed)
        many, items = study.options.draws, len(votes.truth)
        draws = {n: [rng.choice(items, n, replace=False) for _ in range(many)] for n in LABELS}
        found = intervals(hits(votes, draws), rng)
        rows += [(data, *key, *(end for one in both for end in one)) for key, both in found.items()]
        tables += [f"**{data}**", table(found)]
    header = ["data", "method", "labels", *with_ends(("accuracy", "difference"))]
    study.csv("judges.csv", header, rows)
    note = (
        "Share of items without a label that are right, by the number of own labels, with 95% "
        f"intervals over items and {study.options.draws} draws of labels. The last column is the "
        f"paired difference to the trivial rule, `{TRIVIAL}`. Made by `{study.command}`."
    )
    study.page("judges.md", *tables, note)


def read(logs: Path, data: str) -> Votes:
    """Return the votes of a data set. A judge on LLMBar is a language model and a prompt."""
    if data == PRODUCT:
        table = pd.read_csv(logs / "crowd-product" / "answer.csv.gz")
        table.columns = pd.Index(["item", "judge", "vote"])
        truth = pd.read_csv(logs / "crowd-product" / "truth.csv.gz", index_col="question")["truth"]
    else:
        table = pd.read_csv(logs / "llm-judges" / "llmbar-votes.csv.gz")
        truth = table.drop_duplicates("item").set_index("item")["truth"] - 1
        table = table[(table["order"] == "swap = False") | (data == BOTH_ORDERS)].dropna()
        table = table.assign(judge=table["model"] + "/" + table["prompt"], vote=table["vote"] - 1)
    judges, items = pd.factorize(table["judge"])[0], truth.index.get_indexer(table["item"])
    return Votes(judges, items, table["vote"].to_numpy(np.int64), truth.to_numpy(np.int64))


def majority(votes: Votes, labelled: Ints) -> Floats:
    """Return the support of each answer by votes of equal weight."""
    return votes.support(np.ones(len(votes.items)))


def most_right_labels(votes: Votes, labelled: Ints) -> Floats:
    """Return the support of each answer by the trivial rule."""
    right, most = votes.graded(labelled)[0], np.zeros(len(votes.truth))
    np.maximum.at(most, votes.items, right)
    return votes.support(np.where(right == most[votes.items], 1.0, _FAINT))


def labels_alone(votes: Votes, labelled: Ints) -> Floats:
    """Return the support of each answer by votes with the log-odds of their judges' labels."""
    right, count = votes.graded(labelled)
    return votes.support(np.log((right + 1) / (count - right + 1)))


def by_trust(name: str, votes: Votes, labelled: Ints) -> Floats:
    """Return the support of each answer by a trust model."""
    model: Any = make_trust_model(name)
    personal, owner = hasattr(model, "judge_trust"), int(votes.judges.max()) + 1
    own = labelled if personal else labelled[:0]
    run: Any = make_run(model, (owner + 1, 2 * len(votes.truth)))
    raters = np.append(votes.judges, np.full(len(own), owner))
    items, answers = np.append(votes.items, own), np.append(votes.answers, votes.truth[own])
    chosen, other = 2 * items + answers, 2 * items + 1 - answers
    run.play(np.tile(raters, 2), np.append(chosen, other), np.repeat([1.0, 0.0], len(raters)))
    if not personal:
        return votes.support(run.rater_trust[votes.judges])
    trust: Floats = model.judge_trust(run.state)[owner].reshape(-1, 2)
    return trust


def by_crowd_kit(kind: Any, votes: Votes, labelled: Ints) -> Floats:
    """Return the probability of each answer by a class of crowd-kit with its default settings."""
    columns = {"task": votes.items, "worker": votes.judges, "label": votes.answers}
    told = kind is DawidSkene and len(labelled) > 0
    known = {"true_labels": pd.Series(votes.truth[labelled], labelled)} if told else {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # crowd-kit uses deprecated parts of pandas
        found = kind().fit_predict_proba(pd.DataFrame(columns), **known)
    chances: Floats = found.reindex(range(len(votes.truth)), columns=range(2)).fillna(0).to_numpy()
    return chances


METHODS: dict[str, Callable[[Votes, Ints], Floats]] = {
    TRIVIAL: most_right_labels,
    "labels alone": labels_alone,
    "first-hand": partial(by_trust, "first-hand"),
    "yu-singh": partial(by_trust, "yu-singh"),
    "dawid-skene": partial(by_crowd_kit, DawidSkene),
    "majority": majority,
    "leave-one-out": partial(by_trust, "leave-one-out"),
    "mace": partial(by_crowd_kit, MACE),
}
UNLABELLED = ("majority", "leave-one-out", "mace")
"""Methods that labels cannot change."""


def right_shares(votes: Votes, support: Floats) -> Floats:
    """Return how right the verdict on each item is, shape (I,): 1, 0, or 0.5 in a tie."""
    lead = (support[:, 1] - support[:, 0]) * (2 * votes.truth - 1)
    return np.where(abs(lead) < _TIE, 0.5, (lead > 0).astype(np.float64))


def hits(votes: Votes, draws: Mapping[int, Sequence[Ints]]) -> dict[Key, Floats]:
    """Return how right each method is by draw and item, shape (D, I); NaN where it has a label."""
    found = dict[Key, Floats]()
    for name, method in METHODS.items():
        print(f"{name} on {len(votes.truth):,} items", flush=True)
        without = right_shares(votes, method(votes, np.zeros(0, np.int64)))
        for size, drawn in draws.items():
            same = size == 0 or name in UNLABELLED
            each = [without if same else right_shares(votes, method(votes, one)) for one in drawn]
            found[name, size] = np.array(each)
            np.put_along_axis(found[name, size], np.array(drawn), np.nan, axis=1)
    return found


def intervals(
    found: Mapping[Key, Floats], rng: np.random.Generator
) -> dict[Key, tuple[Interval, Interval]]:
    """Return each accuracy, and its difference to that of the trivial rule with as many labels."""
    counts = [
        np.vstack([np.ones(size), rng.multinomial(size, np.full(size, 1 / size), RESAMPLES)])
        for size in next(iter(found.values())).shape
    ]  # of draws and of items in each resample; the first has all once
    accuracy = {key: weighted_mean(values, *counts) for key, values in found.items()}
    return {
        key: (with_interval(values), with_interval(values - accuracy[TRIVIAL, key[1]]))
        for key, values in accuracy.items()
    }


def weighted_mean(values: Floats, draws: Floats, items: Floats) -> Floats:
    """Return the mean of the values (D, I) that are not NaN, by weights (R, D) and (R, I)."""
    parts = np.nan_to_num(values), (~np.isnan(values)).astype(np.float64)
    total, weight = (((draws @ part) * items).sum(axis=1) for part in parts)
    mean: Floats = total / weight
    return mean


def with_interval(values: Floats) -> Interval:
    """Return the first value and the 95% interval of the others."""
    return Interval(*map(float, (values[0], *np.quantile(values[1:], (0.025, 0.975)))))


def table(found: Mapping[Key, tuple[Interval, Interval]]) -> str:
    """Return the accuracy of each method by the number of labels, and the difference with most."""
    headings = ["method", *(f"{n} labels" for n in LABELS), f"difference, {LABELS[-1]} labels"]
    cells = {
        name: [*(found[name, n][0] for n in LABELS), found[name, LABELS[-1]][1]] for name in METHODS
    }
    lines = [[name, *map(interval_text, values)] for name, values in cells.items()]
    return markdown_table(headings, lines, 1)
