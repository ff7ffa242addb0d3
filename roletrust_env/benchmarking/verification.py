"""Verification of submissions: their consistency, their sources, and their scores in a repeated
run.

Submissions are untrusted files. They are parsed strictly, and nothing that they name is created
before it is known to be installed. The consistency of their numbers is checked before any game is
played. Claimed numbers may differ from those of a run on this machine by the noise of sampling.
"""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np

from roletrust_env.benchmarking.schema import CellResult
from roletrust_env.benchmarking.sources import Source
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.submission import (
    BASE_PRESET,
    CellClaim,
    Claim,
    ClaimedScore,
    ModelScores,
    Submission,
    make_claim,
    model_scores,
    self_contained,
    suite_hash,
    suite_sources,
)
from roletrust_env.benchmarking.suite import HONEST, Suite
from roletrust_env.benchmarking.suite_files import load_suite, read_suite, suites
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.game.policy import registry as attackers
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import check_scenario_size, read_untrusted
from roletrust_env.trust.model import registry as trust_models

ROUNDING = 1e-9

CHOSEN = "chosen utility"
"""Name of the utility in the games that choose the worst case."""

_CHOSEN_BLIND = "chosen blind"

_SEARCH_ERROR = 0.03  # standard deviation of the worst case between searches with other seeds
_LEAST_ERROR = 1e-4  # where all games are alike, another processor rounds otherwise
_EVERY = "all models"
_LEVEL = 0.001  # of each test
_NEGLIGIBLE = 0.1  # half intervals, on average over cells
_NORMAL_95, _NORMAL_999 = (
    1.96,
    3.09,
)  # quantiles of the normal distribution, for both sides and for one


class Check(NamedTuple):
    """Result of a check.

    Attributes:
        subject: Part of the submission.
        ok: Whether the part is correct.
        message: Explanation of the result.
    """

    subject: str
    ok: bool
    message: str


def check_cell(claim: CellClaim, result: CellResult, same: bool) -> Check:
    """Compare the claim for a cell with its result on this machine.

    Args:
        claim: Claim for the cell.
        result: Result of the cell on this machine.
        same: Require equal numbers to the last bit. Otherwise each mean must be within the
            interval.
    """
    subject = f"cell {claim.cell.key}"
    if result.failed:
        return Check(subject, False, f"failed here: {result.failed}")
    own_claim = make_claim(claim.cell, result)
    claimed, own = ({row.attack: row for row in each.attacks} for each in (claim, own_claim))
    if different := sorted(claimed.keys() ^ own.keys()):
        name = different[0]
        return Check(
            subject,
            False,
            f"{name}: {'only in the claim' if name in claimed else 'missing in the claim'}",
        )
    if same:
        wrong = [name for name in claimed if claimed[name] != own[name]]
        return Check(
            subject,
            not wrong,
            f"{wrong[0]}: other numbers" if wrong else "the same to the last bit",
        )
    for name, attack in claimed.items():
        if attack.treats != own[name].treats:
            return Check(
                subject,
                False,
                f"{name}: treats raters alike only {'here' if attack.treats else 'in the claim'}",
            )
        pairs = [
            (metric, score, getattr(own[name].measured, metric))
            for metric, score in attack.measured
        ]
        for metric, score, own_score in [*pairs, *_chosen(attack, result)]:
            if not within_noise(score, own_score):
                return Check(
                    subject, False, f"{name}, {metric}: claimed {score.text}, here {own_score.text}"
                )
    return Check(subject, True, "within the intervals")


def check_bias(claims: Sequence[CellClaim], results: Sequence[CellResult]) -> list[Check]:
    """Compare claimed utilities with those here over all cells of each model, and of all models.

    Each one may exceed the own one by noise, but not all of them. Each test is on one side, at a
    level of 0.001. The first two take the games here for others than those of the claim, which
    bounds what single cells may exceed. The utility of a cell is that of its worst attack here. By
    the games that choose, it is the mean over the attacks, of which the lowest would be biased.

    The games are those of the claim, though, and only rounding tells the two runs apart. So the
    other tests need no interval: they compare the worst cases of two runs, either of which might
    have been the claim. Then each difference is as likely to be negative, and their sum hardly ever
    exceeds some times the root of the sum of their squares: the probability is at most 3.22 times
    that of a normal variable (Pinelis 1994). A mean below `_NEGLIGIBLE` may come from a choice that
    rounding turned in all cells.

    Args:
        claims: Claims for cells.
        results: Results of the same cells on this machine, with the same seeds.
    """
    differences: dict[str, dict[str, list[float]]] = {}

    def add(name: str, model: str, value: float) -> None:
        for group in {model, everybody}:
            differences.setdefault(name, {}).setdefault(group, []).append(value)

    everybody = _EVERY if len({claim.model for claim in claims}) > 1 else claims[0].model
    for claim, result in zip(claims, results, strict=True):
        here = make_claim(claim.cell, result)
        own = {attack.attack: attack for attack in here.attacks}
        pairs = sorted(
            ((claimed, own[claimed.attack]) for claimed in claim.attacks if claimed.attack in own),
            key=lambda p: p[1].chosen,
        )
        add(
            "utility",
            claim.model,
            _excess(
                [(claimed.measured.utility, other.measured.utility) for claimed, other in pairs[:1]]
            ),
        )
        add(CHOSEN, claim.model, _excess([_chosen(claimed, result)[0][1:] for claimed, _ in pairs]))
        for name in _WORST if pairs else ():
            add(f"the worst {name}", claim.model, _lead(name, claim, here))
    return [
        _check_lead(name, groups) if name.startswith("the worst") else _check_excess(name, groups)
        for name, groups in differences.items()
    ]


def _check_excess(name: str, groups: Mapping[str, Sequence[float]]) -> Check:
    """Test the mean of differences in standard errors, for the group in which it is largest."""
    most, limit = -np.inf, NormalDist().inv_cdf(1 - _LEVEL / len(groups))
    message = "nothing to compare"
    for group, values in groups.items():
        known = np.array([value for value in values if value == value])
        z = float(known.sum() / max(1.0, np.sqrt(known.size)))
        if known.size and z > most:
            lead = f"{z:.1f} standard errors over {known.size} cells"
            most, message = z, f"claims for {group} exceed those here by {lead}; {limit:.1f} may be"
    return Check(f"bias of {name}", most <= limit, message)


def _check_lead(name: str, groups: Mapping[str, Sequence[float]]) -> Check:
    """Test the sum of differences by their own scatter, for the group in which it is largest."""
    most, limit = -np.inf, NormalDist().inv_cdf(1 - _LEVEL / len(groups) / 3.22)
    message = ""
    for group, values in groups.items():
        lead, scatter = float(np.mean(values)), float(np.linalg.norm(values))
        t = sum(values) / scatter if lead > _NEGLIGIBLE else 0.0
        if t > most:
            size = f"{lead:.2f} half intervals on average over {len(values)} cells"
            most, message = (
                t,
                f"claims for {group} exceed those here by {size}, {t:.1f} of their scatter; "
                f"{limit:.1f} may be",
            )
    return Check(f"bias of {name}", most <= limit, message)


def _lead(name: str, claim: CellClaim, here: CellClaim) -> float:
    """Return how far a score of the worst attack in the claim is above that of the worst attack
    here.

    Args:
        name: One of `_WORST`.
        claim: Claim for a cell, with attacks.
        here: What would be claimed here, with attacks.

    Returns:
        Difference in half intervals of the utility here.
    """
    claimed, own = (min(map(_WORST[name], each.attacks)) for each in (claim, here))
    return (claimed[1] - own[1]) / max(own[2], _LEAST_ERROR)


def _utility(claim: Claim) -> tuple[float, float, float]:
    utility = claim.measured.utility
    return claim.chosen, utility.mean or 0.0, utility.half_95 or 0.0


def _published(claim: Claim) -> tuple[float, float, float]:
    return claim.chosen, claim.measured.published.mean or 0.0, claim.measured.utility.half_95 or 0.0


def _skill(claim: Claim) -> tuple[float, float, float]:
    blind, utility = claim.measured.blind.mean or 0.0, claim.measured.utility
    chosen, measured = (
        (mean - lowest) / max(1 - lowest, _LEAST_ERROR)
        for mean, lowest in ((claim.chosen, claim.chosen_blind), (utility.mean or 0.0, blind))
    )
    return chosen, measured, (utility.half_95 or 0.0) / max(1 - blind, _LEAST_ERROR)


_WORST: dict[str, Callable[[Claim], tuple[float, float, float]]] = {
    "utility": _utility,
    "skill": _skill,
    "published utility": _published,
}
"""Scores that have a worst case: their mean in the games that choose it, and the mean and half
interval of others."""


def check_fresh(claims: Sequence[CellClaim], results: Sequence[CellResult]) -> list[Check]:
    """Compare the claimed worst cases with those of cells with a seed that nobody could know, for
    each model.

    A model that recognises the games of a public seed is good there only. The mean of the
    differences over all cells of a model is tested on one side, at a level of 0.001. Cells of a
    scenario share their games, so their noise counts as the same. Searches with other seeds find
    other attacks, which adds an error of its own to each cell. The interval of a claim counts at
    most as much as the one here, for it proves nothing.

    Args:
        claims: Claims for cells.
        results: Results of the same cells with the other seed on this machine.
    """
    pairs: dict[str, list[tuple[CellClaim, CellResult]]] = {}
    for claim, result in zip(claims, results, strict=True):
        pairs.setdefault(claim.model, []).append((claim, result))
    return [_check_fresh(model, mine) for model, mine in pairs.items()]


def _check_fresh(model: str, pairs: Sequence[tuple[CellClaim, CellResult]]) -> Check:
    subject, differences = f"{model} in games with a new seed", list[float]()
    noises: dict[str, float] = {}
    for claim, result in pairs:
        if result.failed:
            return Check(subject, False, f"{claim.cell.key} failed here: {result.failed}")
        own_claim = make_claim(claim.cell, result)
        if not claim.attacks or not own_claim.attacks:
            continue
        claimed, own = (
            min(each.attacks, key=lambda attack: attack.chosen).measured.utility
            for each in (claim, own_claim)
        )
        differences.append((claimed.mean or 0.0) - (own.mean or 0.0))
        half = own.half_95 or 0.0
        noise = float(np.hypot(half, min(half, claimed.half_95 or 0.0))) / _NORMAL_95
        noises[claim.scenario] = noises.get(claim.scenario, 0.0) + noise
    if not differences:
        return Check(subject, True, "no attack was played there")
    number, lead = len(differences), float(np.mean(differences))
    error = float(
        np.hypot(np.linalg.norm(list(noises.values())) / number, _SEARCH_ERROR / number**0.5)
    )
    message = f"claims exceed those here by {lead:.4f} on average over {number} cells; "
    return Check(
        subject, lead <= _NORMAL_999 * error, message + f"{_NORMAL_999 * error:.4f} may be"
    )


def _excess(pairs: Sequence[tuple[ClaimedScore, ClaimedScore]]) -> float:
    """Return the mean excess of claimed scores over own ones, in standard errors of a difference;
    NaN without one.
    """
    excesses = []
    for claimed, own in pairs:
        if claimed.mean is None or own.mean is None:
            continue
        error = 2**0.5 * (own.half_95 or 0.0) / _NORMAL_95
        excesses.append((claimed.mean - own.mean) / max(error, _LEAST_ERROR))
    return float(np.mean(excesses)) if excesses else np.nan


def _chosen(claim: Claim, result: CellResult) -> list[tuple[str, ClaimedScore, ClaimedScore]]:
    """Return the utilities in the games for choosing, by trust and of a blind choice, claimed and
    here.
    """
    row = next(row for row in result.rows if row.attack == claim.attack)
    claimed = {CHOSEN: (claim.chosen, "utility"), _CHOSEN_BLIND: (claim.chosen_blind, "blind")}
    return [
        (name, ClaimedScore(mean=mean, half_95=None), ClaimedScore.of(row.chosen[kind]))
        for name, (mean, kind) in claimed.items()
    ]


def within_noise(claimed: ClaimedScore, own: ClaimedScore) -> bool:
    """Return whether two means differ by sampling noise at most, by the own interval or else the
    claimed one.
    """
    if claimed.mean is None or own.mean is None:
        return claimed.mean == own.mean
    half = own.half_95 if own.half_95 is not None else claimed.half_95 or 0.0
    return abs(claimed.mean - own.mean) <= half * 2**0.5 + ROUNDING


MAX_BYTES = 64_000_000
"""Maximum size of a file. A result of one attack takes some hundred bytes."""

LONGEST_S = 3600.0
"""Maximum time limit of a cell in seconds, whatever limit the suite has."""

_MAX_PARTS = 100
"""Maximum number of scenarios, and of tracks, in a suite."""


def read_submission(path: Path) -> tuple[Submission, Suite]:
    """Read a submission and its suite, without importing or creating anything that they name.

    Raises:
        ValueError: The file does not exist, or its content is not allowed.
        OSError: The file cannot be read.
    """
    submission = read_untrusted(
        Submission, path, MAX_BYTES, what="submission", command="roletrust submit"
    )
    try:
        return submission, _suite(submission)
    except ValueError as error:
        raise ValueError(f"submission {path}: {error}") from None


def check_installed_names(suite: Suite) -> None:
    """Check that the models, attacks and search methods of a suite are installed.

    Raises:
        ValueError: A model, an attack or a search method is not installed.
    """
    check_installed(trust_models, suite.models)
    check_installed(attackers, suite.attacks)
    check_installed(search_methods, suite.searches)


def is_same_platform(submission: Submission) -> bool:
    """Return whether this machine has the same software and processor, and so must reproduce the
    numbers exactly.
    """
    return submission.software.model_dump() == software() and submission.processor == processor()


def check_claims(submission: Submission, suite: Suite, *, own_suite: bool = False) -> list[Check]:
    """Check the claims that need no game: the suite, the software, the sources, and the consistency
    of the scores.

    Args:
        submission: Submission to check.
        suite: Suite of the submission.
        own_suite: Accept a suite that is none of this package.

    Raises:
        ValueError: A model, an attack or a search method cannot be loaded.
    """
    own = suite_sources(suite)
    return [
        _check_suite(submission, suite, own_suite),
        _check_software(submission),
        *_check_sources("model", submission.models, own["models"]),
        *_check_sources("attack", submission.attacks, own["attacks"]),
        *_check_sources("method", submission.methods, own["methods"]),
        *_check_model_scores(
            "scores of",
            submission.standings,
            model_scores(suite, [claim.as_single_game() for claim in submission.cells]),
            _is_consistent,
        ),
    ]


def sample_claims(submission: Submission, number: int, seed: int) -> list[CellClaim]:
    """Return a random sample of the claims, or all claims if there are fewer."""
    return random.Random(seed).sample(submission.cells, min(number, len(submission.cells)))


def check_scores(
    submission: Submission, suite: Suite, stored: Sequence[StoredCell], same: bool
) -> list[Check]:
    """Compare the scores of the models and their intervals with those of a complete run on this
    machine.

    Args:
        submission: Submission to check.
        suite: Suite of the submission.
        stored: All cells with their results on this machine.
        same: Require equal numbers to the last bit. Otherwise each mean must be within the
            interval.
    """

    def agrees(name: str, claimed: ClaimedScore, own: ClaimedScore) -> bool:
        return claimed == own if same else within_noise(claimed, own)

    return _check_model_scores(
        "measured scores of", submission.standings, model_scores(suite, stored), agrees
    )


def _suite(submission: Submission) -> Suite:
    """Return the suite. Its fields are checked first, since a name could be a path and a game could
    be huge.
    """
    stages, tracks = (_parts(submission.suite.get(name)) for name in ("scenarios", "tracks"))
    for stage in stages:
        if stage.get("preset") != BASE_PRESET:
            raise ValueError(
                f"suite: preset is {str(stage.get('preset'))[:100]!r}; it must be {BASE_PRESET!r} "
                "in a submission"
            )
        for track in tracks:
            fields = {**stage.get("set", {}), **track.get("set", {})}
            if fields.get("frames") is not None:
                raise ValueError(
                    f"suite: frames is {str(fields['frames'])[:100]!r}; a submission must not use "
                    "files"
                )
            check_scenario_size(fields)
    suite = read_suite(submission.suite, "suite")
    if not isinstance(suite, Suite) or suite.models == "all" or suite.attacks == "all":
        raise ValueError("suite: it must be a robustness suite with its models and attacks by name")
    _check_same("models", suite.models, submission.models)
    _check_same("attacks", suite.attacks, submission.attacks)
    _check_same("methods", suite.searches, submission.methods)
    _check_same("standings", suite.models, submission.standings)
    cells_each = sum(
        len(shares) * len(suite.methods_in(scenario)) or 1
        for scenario in suite.scenarios
        for shares in suite.shares_in(scenario).values()
    )
    number = len(suite.models) * cells_each * len(suite.seeds)
    if number != len(submission.cells):  # checked before the cells are created
        raise ValueError(f"cells: there are {len(submission.cells)}; the suite has {number}")
    _check_same(
        "cells",
        [cell.key for cell in suite.cells()],
        [claim.cell.key for claim in submission.cells],
    )
    for claim in submission.cells:
        if claim.method == HONEST and len(claim.attacks) != 1:
            raise ValueError(
                f"cells: {claim.cell.key} has {len(claim.attacks)} attacks instead of one; all "
                "agents are honest there"
            )
    return suite


def _parts(data: Any) -> list[dict[str, Any]]:
    """Return the scenarios or the tracks of a suite after a check of their form."""
    parts = list(data.values()) if isinstance(data, dict) else []
    for part in parts:
        if not isinstance(part, dict) or not isinstance(part.get("set", {}), dict):
            raise ValueError(f"suite: {str(part)[:100]!r} is neither a scenario nor a track")
    if not 0 < len(parts) <= _MAX_PARTS:
        raise ValueError(
            f"suite: the number of scenarios and that of tracks must be 1 to {_MAX_PARTS}"
        )
    return parts


def _check_same(field: str, expected: Iterable[str], actual: Iterable[str]) -> None:
    """Check that a field contains the expected names, each once."""
    required, present = sorted(expected), sorted(actual)
    if required != present:
        different = sorted(set(required) ^ set(present)) or present
        raise ValueError(f"{field}: not those of the suite, such as {different[0][:300]!r}")


def _check_suite(submission: Submission, suite: Suite, own_suite: bool) -> Check:
    if suite_hash(suite) != submission.suite_sha256:
        return Check("suite", False, "its hash is not the stated one")
    if suite.name not in suites():
        known = "not a suite of this package"
        return Check(
            "suite",
            own_suite,
            known if own_suite else f"{known}; --own-suite accepts it, a leaderboard does not",
        )
    bundled = load_suite(suite.name)
    if (
        isinstance(bundled, Suite)
        and suite_hash(self_contained(bundled, suite.models)) == submission.suite_sha256
    ):
        return Check("suite", True, f"{suite.name}, the same as in this package")
    return Check(
        "suite", False, f"its name is {suite.name}, but it differs from that suite of this package"
    )


def _check_software(submission: Submission) -> Check:
    if is_same_platform(submission):
        return Check(
            "software",
            True,
            "the same, and the same processor: numbers must be the same to the last bit",
        )
    claimed, own = submission.software.model_dump(), software()
    packages = sorted({**claimed["packages"], **own["packages"]})
    other = [name for name in ("package", "python") if claimed[name] != own[name]]
    other += [
        name for name in packages if claimed["packages"].get(name) != own["packages"].get(name)
    ]
    other += ["processor"] if submission.processor != processor() else []
    return Check(
        "software", True, f"not the same ({', '.join(other)}): numbers must be within the intervals"
    )


def _check_sources(
    label: str, claimed: Mapping[str, Source], own: Mapping[str, Source]
) -> list[Check]:
    """Compare the sources. They may differ only between different versions of the same package."""
    checks = []
    for name, source in claimed.items():
        own_source = own[name]
        if source == own_source:
            continue
        allowed = (
            source.package == own_source.package != "" and source.version != own_source.version
        )
        message = (
            f"other source, from {source.package} {source.version}; here it is {own_source.version}"
        )
        checks.append(
            Check(f"{label} {name}", allowed, message if allowed else "another source than here")
        )
    same, ok = len(claimed) - len(checks), all(check.ok for check in checks)
    return [
        Check(f"{label}s", ok, f"{same} of {len(claimed)} have the same source as here"),
        *checks,
    ]


def _check_model_scores(
    label: str,
    claimed: Mapping[str, ModelScores],
    own: Mapping[str, ModelScores],
    agrees: Callable[[str, ClaimedScore, ClaimedScore], bool],
) -> list[Check]:
    """Compare the scores of each model.

    Args:
        label: Start of the subject of each check.
        claimed: Scores in the submission.
        own: Scores that were computed here.
        agrees: Function of the name of a score, its claimed value and its own value.
    """
    checks = []
    for model, scores in claimed.items():
        wrong = ""
        for name, score in scores:
            own_score = getattr(own[model], name)
            if not agrees(name, score, own_score):
                wrong = wrong or f"{name}: claimed {score.text}, computed {own_score.text}"
        checks.append(
            Check(f"{label} {model}", not wrong, wrong or f"worst case {scores.worst.text}")
        )
    return checks


def _is_consistent(name: str, claimed: ClaimedScore, own: ClaimedScore) -> bool:
    """Return whether a score follows from the means of the cells.

    If damage or AUC is undefined in some games, the mean of the cell means differs slightly from
    the mean of all games.
    """
    if name in ("damage", "detection"):
        return within_noise(claimed, own)
    return claimed.mean == own.mean or (
        claimed.mean is not None
        and own.mean is not None
        and abs(claimed.mean - own.mean) <= ROUNDING
    )
