"""Verification of submissions: their consistency, their sources, and their scores in a repeated run.

Submissions are untrusted files. They are parsed strictly, and nothing that they name is created before it is known to
be installed. The consistency of their numbers is checked before any game is played.
"""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from roletrust_env.benchmarking.agreement import ROUNDING, Check, within
from roletrust_env.benchmarking.cells import cells
from roletrust_env.benchmarking.sources import Source
from roletrust_env.benchmarking.store import StoredCell
from roletrust_env.benchmarking.submission import (
    BASE_PRESET,
    CellClaim,
    ClaimedScore,
    ModelScores,
    Submission,
    fingerprint,
    model_scores,
    self_contained,
    suite_sources,
)
from roletrust_env.benchmarking.suite import HONEST, Suite
from roletrust_env.benchmarking.suite_files import load_suite, read_suite, suites
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.search import search_methods
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import check_scenario_size, read_untrusted
from roletrust_env.trust.model import registry as trust_models

MAX_BYTES = 64_000_000
"""Maximum size of a file. A result of one attack takes some hundred bytes."""

LONGEST_S = 3600.0
"""Maximum time limit of a cell in seconds, whatever limit the suite has."""

_MAX_PARTS = 100
"""Maximum number of scenarios, and of tracks, in a suite."""


def read_submission(path: Path) -> tuple[Submission, Suite]:
    """Read a submission and its suite, without importing or creating anything that they name.

    Args:
        path: Path of the file.

    Raises:
        ValueError: The file does not exist, or its content is not allowed.
        OSError: The file cannot be read.
    """
    submission = read_untrusted(Submission, path, MAX_BYTES, what="submission", command="roletrust submit")
    try:
        return submission, _suite(submission)
    except ValueError as error:
        raise ValueError(f"submission {path}: {error}") from None


def check_names(suite: Suite) -> None:
    """Check that the models, attacks and search methods of a suite are installed.

    Args:
        suite: Suite of a submission.

    Raises:
        ValueError: A model, an attack or a search method is not installed.
    """
    check_installed(trust_models, suite.models)
    check_installed(attackers, suite.attacks)
    check_installed(search_methods, suite.searches)


def is_same_platform(submission: Submission) -> bool:
    """Return whether this machine has the same software and processor, and so must reproduce the numbers exactly.

    Args:
        submission: Submission to compare with.
    """
    return submission.software.model_dump() == software() and submission.processor == processor()


def check_claims(submission: Submission, suite: Suite, *, own_suite: bool = False) -> list[Check]:
    """Check the claims that need no game: the suite, the software, the sources, and the consistency of the scores.

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
    """Return a random sample of the claims, or all claims if there are fewer.

    Args:
        submission: Submission with the claims.
        number: Number of claims.
        seed: Random seed.
    """
    return random.Random(seed).sample(submission.cells, min(number, len(submission.cells)))


def check_scores(submission: Submission, suite: Suite, stored: Sequence[StoredCell], same: bool) -> list[Check]:
    """Compare the scores of the models and their intervals with those of a complete run on this machine.

    Args:
        submission: Submission to check.
        suite: Suite of the submission.
        stored: All cells with their results on this machine.
        same: Require equal numbers to the last bit. Otherwise each mean must be within the interval.
    """

    def agrees(name: str, claimed: ClaimedScore, own: ClaimedScore) -> bool:
        return claimed == own if same else within(claimed, own)

    return _check_model_scores("measured scores of", submission.standings, model_scores(suite, stored), agrees)


def _suite(submission: Submission) -> Suite:
    """Return the suite. Its fields are checked first, since a name could be a path and a game could be huge."""
    stages, tracks = (_parts(submission.suite.get(name)) for name in ("scenarios", "tracks"))
    for stage in stages:
        if stage.get("preset") != BASE_PRESET:
            raise ValueError(
                f"suite: preset is {str(stage.get('preset'))[:100]!r}; it must be {BASE_PRESET!r} in a submission"
            )
        for track in tracks:
            fields = {**stage.get("set", {}), **track.get("set", {})}
            if fields.get("frames") is not None:
                raise ValueError(f"suite: frames is {str(fields['frames'])[:100]!r}; a submission must not use files")
            check_scenario_size(fields)
    suite = read_suite(submission.suite, "suite")
    if not isinstance(suite, Suite) or suite.models == "all" or suite.attacks == "all":
        raise ValueError("suite: it must be a robustness suite with its models and attacks by name")
    _check_same("models", suite.models, submission.models)
    _check_same("attacks", suite.attacks, submission.attacks)
    _check_same("methods", suite.searches, submission.methods)
    _check_same("standings", suite.models, submission.standings)
    conditions = [shares for scenario in suite.scenarios for shares in suite.shares_in(scenario).values()]
    cells_each = sum(len(shares) * len(suite.methods) or 1 for shares in conditions)
    number = len(suite.models) * cells_each * len(suite.seeds)
    if number != len(submission.cells):  # checked before the cells are created
        raise ValueError(f"cells: there are {len(submission.cells)}; the suite has {number}")
    _check_same("cells", [cell.key for cell in cells(suite)], [claim.cell.key for claim in submission.cells])
    for claim in submission.cells:
        if claim.method == HONEST and len(claim.attacks) != 1:
            raise ValueError(
                f"cells: {claim.cell.key} has {len(claim.attacks)} attacks instead of one; all agents are honest there"
            )
    return suite


def _parts(data: Any) -> list[dict[str, Any]]:
    """Return the scenarios or the tracks of a suite after a check of their form."""
    parts = list(data.values()) if isinstance(data, dict) else []
    for part in parts:
        if not isinstance(part, dict) or not isinstance(part.get("set", {}), dict):
            raise ValueError(f"suite: {str(part)[:100]!r} is neither a scenario nor a track")
    if not 0 < len(parts) <= _MAX_PARTS:
        raise ValueError(f"suite: the number of scenarios and that of tracks must be 1 to {_MAX_PARTS}")
    return parts


def _check_same(field: str, expected: Iterable[str], actual: Iterable[str]) -> None:
    """Check that a field contains the expected names, each once."""
    required, present = sorted(expected), sorted(actual)
    if required != present:
        different = sorted(set(required) ^ set(present)) or present
        raise ValueError(f"{field}: not those of the suite, such as {different[0][:300]!r}")


def _check_suite(submission: Submission, suite: Suite, own_suite: bool) -> Check:
    if fingerprint(suite) != submission.suite_sha256:
        return Check("suite", False, "its hash is not the stated one")
    if suite.name not in suites():
        known = "not a suite of this package"
        return Check(
            "suite", own_suite, known if own_suite else f"{known}; --own-suite accepts it, a leaderboard does not"
        )
    bundled = load_suite(suite.name)
    if isinstance(bundled, Suite) and fingerprint(self_contained(bundled, suite.models)) == submission.suite_sha256:
        return Check("suite", True, f"{suite.name}, the same as in this package")
    return Check("suite", False, f"its name is {suite.name}, but it differs from that suite of this package")


def _check_software(submission: Submission) -> Check:
    if is_same_platform(submission):
        return Check("software", True, "the same, and the same processor: numbers must be the same to the last bit")
    claimed, own = submission.software.model_dump(), software()
    packages = sorted({**claimed["packages"], **own["packages"]})
    other = [name for name in ("package", "python") if claimed[name] != own[name]]
    other += [name for name in packages if claimed["packages"].get(name) != own["packages"].get(name)]
    other += ["processor"] if submission.processor != processor() else []
    return Check("software", True, f"not the same ({', '.join(other)}): numbers must be within the intervals")


def _check_sources(label: str, claimed: Mapping[str, Source], own: Mapping[str, Source]) -> list[Check]:
    """Compare the sources. They may differ only between different versions of the same package."""
    checks = []
    for name, source in claimed.items():
        own_source = own[name]
        if source == own_source:
            continue
        allowed = source.package == own_source.package != "" and source.version != own_source.version
        message = f"other source, from {source.package} {source.version}; here it is {own_source.version}"
        checks.append(Check(f"{label} {name}", allowed, message if allowed else "another source than here"))
    same, ok = len(claimed) - len(checks), all(check.ok for check in checks)
    return [Check(f"{label}s", ok, f"{same} of {len(claimed)} have the same source as here"), *checks]


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
        checks.append(Check(f"{label} {model}", not wrong, wrong or f"worst case {scores.worst.text}"))
    return checks


def _is_consistent(name: str, claimed: ClaimedScore, own: ClaimedScore) -> bool:
    """Return whether a score follows from the means of the cells.

    If damage or AUC is undefined in some games, the mean of the cell means differs slightly from the mean of all games.
    """
    if name in ("damage", "detection"):
        return within(claimed, own)
    return claimed.mean == own.mean or (
        claimed.mean is not None and own.mean is not None and abs(claimed.mean - own.mean) <= ROUNDING
    )
