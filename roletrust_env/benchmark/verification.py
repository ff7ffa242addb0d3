"""Whether a submission is what it says it is: what it claims against itself, against this machine, and measured again.

A file comes from anybody. It is read strictly, nothing that it names is made before it is known to be installed, and
what its numbers say of each other is looked at before any game is played.
"""

import random
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from roletrust_env.benchmark.cells import HONEST, cells
from roletrust_env.benchmark.schema import CellResult
from roletrust_env.benchmark.sources import Source
from roletrust_env.benchmark.store import StoredCell
from roletrust_env.benchmark.submission import (
    STAGE,
    CellClaim,
    Score,
    Standing,
    Submission,
    as_played,
    claimed,
    fingerprint,
    scores,
    sources,
)
from roletrust_env.benchmark.suite import Suite, load_suite, read_suite, suites
from roletrust_env.evaluation.resources import processor
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.game.policy_registry import registry as attackers
from roletrust_env.storage.provenance import software
from roletrust_env.storage.untrusted import check_scenario_size, parse_json, parse_untrusted, read_limited
from roletrust_env.trust.model import registry as trust_models

MAX_BYTES = 64_000_000
"""Of a file; some hundred bytes are enough for what one attack did to one model in one cell."""

LONGEST_S = 3600.0
"""A cell may take so long, whatever the suite says."""

_ROUNDING = 1e-9
_MANY = 100
"""Scenarios, and tracks, of a suite."""


class Check(NamedTuple):
    """Something that was looked at.

    Attributes:
        what: it was.
        ok: whether it is as said.
        words: what was found.
    """

    what: str
    ok: bool
    words: str


def read_submission(path: Path) -> tuple[Submission, Suite]:
    """A submission, and its suite as far as it can be known without making or importing what it names.

    Raises:
        ValueError: there is no such file, or something in it is not allowed.
        OSError: it cannot be read.
    """
    if not path.is_file():
        raise ValueError(f"there is no file {path}; `roletrust submit` makes one")
    text = read_limited(path, MAX_BYTES)
    try:
        parse_json(text)
        found = parse_untrusted(Submission, text)
        return found, _suite(found)
    except ValueError as error:
        raise ValueError(f"submission {path}: {error}") from None


def check_names(suite: Suite) -> None:
    """See that all that a suite names is installed.

    Raises:
        ValueError: something is not.
    """
    check_installed(trust_models, suite.models)
    check_installed(attackers, suite.attacks)


def same_here(found: Submission) -> bool:
    """Whether this machine must come to the same numbers to the last bit."""
    return found.software.model_dump() == software() and found.processor == processor()


def check_claims(found: Submission, suite: Suite) -> list[Check]:
    """What can be told without playing: the suite, the software, the sources, and whether the scores follow.

    Raises:
        ValueError: a model or an attack cannot be loaded.
    """
    here = sources(suite)
    return [
        _check_suite(found, suite),
        _check_software(found),
        *_check_sources("model", found.models, here["models"]),
        *_check_sources("attack", found.attacks, here["attacks"]),
        *_check_scores("scores of", found.standings, scores(suite, [claim.means() for claim in found.cells]), _follows),
    ]


def sample(found: Submission, number: int, seed: int) -> list[CellClaim]:
    """Some cells at random; all, if there are not so many."""
    return random.Random(seed).sample(found.cells, min(number, len(found.cells)))


def check_cell(claim: CellClaim, done: CellResult, same: bool) -> Check:
    """What was measured again against what is claimed.

    Args:
        claim: of a cell.
        done: what became of it here.
        same: whether it has to be the same to the last bit; else each mean has to be within the interval.
    """
    what = f"cell {claim.cell.key}"
    if done.failed:
        return Check(what, False, f"failed here: {done.failed}")
    here = claimed(claim.cell, done)
    names, ours = ({one.attack: one for one in each.attacks} for each in (claim, here))
    if odd := sorted(names.keys() ^ ours.keys()):
        return Check(what, False, f"{odd[0]}: {'claimed only' if odd[0] in names else 'left out'}")
    if same:
        wrong = [name for name in names if names[name] != ours[name]]
        return Check(what, not wrong, f"{wrong[0]}: other numbers" if wrong else "the same to the last bit")
    for name, one in names.items():
        for measure, score in one.measured:
            mine = getattr(ours[name].measured, measure)
            if not _within(score, mine):
                return Check(what, False, f"{name}, {measure}: claimed {score.words}, here {mine.words}")
    return Check(what, True, "within the intervals")


def check_all(found: Submission, suite: Suite, kept: Sequence[StoredCell], same: bool) -> list[Check]:
    """The scores with their intervals, once all cells have been played again."""

    def fits(name: str, theirs: Score, mine: Score) -> bool:
        return theirs == mine if same else _within(theirs, mine)

    return _check_scores("measured scores of", found.standings, scores(suite, kept), fits)


def _suite(found: Submission) -> Suite:
    """The suite. Its fields are looked at before it is made: a name could be a path, a game too long to think of."""
    stages, tracks = (_parts(found.suite.get(name)) for name in ("scenarios", "tracks"))
    for stage in stages:
        if stage.get("preset") != STAGE:
            raise ValueError(f"suite: preset is {str(stage.get('preset'))[:100]!r}; in a submission all are {STAGE!r}")
        for track in tracks:
            whole = {**stage.get("set", {}), **track.get("set", {})}
            if whole.get("frames") is not None:
                raise ValueError(f"suite: frames is {str(whole['frames'])[:100]!r}; a submission comes without files")
            check_scenario_size(whole)
    suite = read_suite(found.suite, "suite")
    if not isinstance(suite, Suite) or suite.models == "all" or suite.attacks == "all":
        raise ValueError("suite: it must be one for robustness, with its models and attacks by name")
    _check_same("models", suite.models, found.models)
    _check_same("attacks", suite.attacks, found.attacks)
    _check_same("standings", suite.models, found.standings)
    ways = sum(len(track.shares) * len(suite.rungs) or 1 for track in suite.tracks.values())
    number = len(suite.models) * len(suite.scenarios) * ways * len(suite.seeds)
    if number != len(found.cells):  # before so many are made
        raise ValueError(f"cells: there are {len(found.cells)}; the suite has {number}")
    _check_same("cells", [cell.key for cell in cells(suite)], [claim.cell.key for claim in found.cells])
    for claim in found.cells:
        if claim.rung == HONEST and len(claim.attacks) != 1:
            raise ValueError(f"cells: {claim.cell.key} has {len(claim.attacks)} attacks; all are honest there")
    return suite


def _parts(given: Any) -> list[dict[str, Any]]:
    """The scenarios or the tracks of a suite, as far as they have the form of some."""
    parts = list(given.values()) if isinstance(given, dict) else []
    for part in parts:
        if not isinstance(part, dict) or not isinstance(part.get("set", {}), dict):
            raise ValueError(f"suite: {str(part)[:100]!r} is neither a scenario nor a track")
    if not 0 < len(parts) <= _MANY:
        raise ValueError(f"suite: scenarios and tracks must each have one to {_MANY}")
    return parts


def _check_same(what: str, expected: Iterable[str], given: Iterable[str]) -> None:
    """See that the same things are there, each once."""
    wanted, found = sorted(expected), sorted(given)
    if wanted != found:
        odd = sorted(set(wanted) ^ set(found)) or found
        raise ValueError(f"{what}: not those of the suite, such as {odd[0][:300]!r}")


def _check_suite(found: Submission, suite: Suite) -> Check:
    if fingerprint(suite) != found.suite_sha256:
        return Check("suite", False, "it has another hash than is said")
    if suite.name not in suites():
        return Check("suite", True, "one that does not come with this package")
    ours = load_suite(suite.name)
    if isinstance(ours, Suite) and fingerprint(as_played(ours, suite.models)) == found.suite_sha256:
        return Check("suite", True, f"{suite.name}, as it comes with this package")
    return Check("suite", False, f"it is called {suite.name}, and is not the one that comes with this package")


def _check_software(found: Submission) -> Check:
    if same_here(found):
        return Check("software", True, "the same, and the same processor: numbers must be the same to the last bit")
    theirs, mine = found.software.model_dump(), software()
    packages = sorted({**theirs["packages"], **mine["packages"]})
    other = [name for name in ("package", "python") if theirs[name] != mine[name]]
    other += [name for name in packages if theirs["packages"].get(name) != mine["packages"].get(name)]
    other += ["processor"] if found.processor != processor() else []
    return Check("software", True, f"not the same ({', '.join(other)}): numbers must be within the intervals")


def _check_sources(what: str, theirs: Mapping[str, Source], mine: Mapping[str, Source]) -> list[Check]:
    """Sources that differ; those of another version of their package may."""
    checks = []
    for name, said in theirs.items():
        here = mine[name]
        if said == here:
            continue
        excused = said.package == here.package != "" and said.version != here.version
        words = f"other source, of {said.package} {said.version}; here is {here.version}"
        checks.append(Check(f"{what} {name}", excused, words if excused else "another source than here"))
    same, ok = len(theirs) - len(checks), all(check.ok for check in checks)
    return [Check(f"{what}s", ok, f"{same} of {len(theirs)} have the same source as here"), *checks]


def _check_scores(
    what: str,
    theirs: Mapping[str, Standing],
    mine: Mapping[str, Standing],
    fits: Callable[[str, Score, Score], bool],
) -> list[Check]:
    """The scores of each model; `fits` says of one, by its name, whether what is claimed goes with what was found."""
    checks = []
    for model, standing in theirs.items():
        wrong = ""
        for name, score in standing:
            other = getattr(mine[model], name)
            if not fits(name, score, other):
                wrong = wrong or f"{name}: claimed {score.words}, found {other.words}"
        checks.append(Check(f"{what} {model}", not wrong, wrong or f"worst case {standing.worst.words}"))
    return checks


def _follows(name: str, theirs: Score, mine: Score) -> bool:
    """Whether a score is what the means of the cells come to.

    Where damage or AUC is undefined in some games only, the mean of means is not quite the mean.
    """
    if name in ("damage", "detection"):
        return _within(theirs, mine)
    return theirs.mean == mine.mean or (
        theirs.mean is not None and mine.mean is not None and abs(theirs.mean - mine.mean) <= _ROUNDING
    )


def _within(theirs: Score, mine: Score) -> bool:
    """Whether two means differ by no more than luck allows; by the interval found here, or else the claimed one."""
    if theirs.mean is None or mine.mean is None:
        return theirs.mean == mine.mean
    half = mine.half_95 if mine.half_95 is not None else theirs.half_95 or 0.0
    return abs(theirs.mean - mine.mean) <= half * 2**0.5 + _ROUNDING
