"""`roletrust submit` and `roletrust verify`: what is true is found so, and what is not is told."""

import copy
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from benchmark_cases import tiny
from command_line import printed, run
from refusals import assert_names, refuses

from roletrust_env.benchmarking import verification
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.store import ResultStore, StoredCell
from roletrust_env.benchmarking.submission import (
    CellClaim,
    ClaimedMetrics,
    model_scores,
    suite_hash,
)
from roletrust_env.benchmarking.suite_files import load_suite, read_suite
from roletrust_env.benchmarking.verification import read_submission
from roletrust_env.evaluation.measurement import MEASURED
from roletrust_experiments.commands import submit

SUITE = tiny(methods=["scripted"])


def played(folder: Path, suite: Any = SUITE) -> Path:
    """The file of a run that is over."""
    with ResultStore(folder / "results.sqlite", suite) as store:
        for cell in suite.cells():
            store.add(cell, play_cell(suite, cell))
    return folder / "results.sqlite"


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A true submission."""
    folder = tmp_path_factory.mktemp("true")
    printed("submit", played(folder), "--out", folder / "true.json")
    return (folder / "true.json").read_text()


@pytest.fixture
def verified(tmp_path: Path, text: str) -> Callable[..., tuple[int, str]]:
    """Verifies the submission as somebody changed it; exit code and what was printed."""

    def verify(change: Callable[[Any], Any] = lambda said: None, *options: str) -> tuple[int, str]:
        said = json.loads(text)
        change(said)
        path = tmp_path / "theirs.json"
        path.write_text(json.dumps(said))
        result = run(
            "verify", str(path), "--own-suite", "--seed", "7", *(options or ("--cells", "0"))
        )
        return result.exit_code, " ".join(result.output.split())

    return verify


def test_what_is_true_is_found_so(verified: Callable) -> None:
    code, told = verified(lambda said: None, "--cells", "100", "--workers", "1")
    assert code == 0, told
    assert told.count("the same to the last bit") == len(SUITE.cells()) + 1
    assert "measured scores of role-trust" in told
    assert f"{len(SUITE.cells())} of {len(SUITE.cells())} cells played again" in told


def test_games_with_a_new_seed_are_played_unless_left_out(
    in_process: None, verified: Callable
) -> None:
    code, told = verified(lambda said: None, "--cells", "4", "--workers", "1")
    assert code == 0, told
    assert "in games with a new seed" in told
    code, told = verified(lambda said: None, "--cells", "4", "--workers", "1", "--no-fresh")
    assert code == 0, told
    assert "An entry is ranked only once all its cells have been played" in told
    assert "new seed" not in told


def test_cells_in_any_order_come_to_the_same_scores(tmp_path: Path, text: str) -> None:
    """Sums of floats depend on the order in their last bits."""
    (tmp_path / "true.json").write_text(text)
    found, suite = read_submission(tmp_path / "true.json")
    kept = [StoredCell(cell, play_cell(suite, cell)) for cell in reversed(suite.cells())]
    assert all(check.ok for check in verification.check_scores(found, suite, kept, same=True))


def test_a_seed_draws_the_same_cells(tmp_path: Path, text: str) -> None:
    (tmp_path / "true.json").write_text(text)
    found, _ = read_submission(tmp_path / "true.json")
    assert verification.sample_claims(found, 2, 7) == verification.sample_claims(found, 2, 7)
    assert (
        len(
            {
                tuple(claim.cell for claim in verification.sample_claims(found, 2, seed))
                for seed in range(20)
            }
        )
        > 5
    )


def test_all_that_is_measured_is_claimed() -> None:
    assert list(ClaimedMetrics.model_fields) == list(MEASURED)


def cell(said: Any, track: str = "raters") -> Any:
    return next(one for one in said["cells"] if one["track"] == track and one["model"] == "mean")


def better(said: Any) -> None:
    """A model that nobody harmed, and all that follows from it."""
    for one in said["cells"]:
        for attack in one["attacks"] if one["model"] == "mean" else ():
            attack["chosen"] = attack["measured"]["utility"]["mean"] = attack["measured"][
                "published"
            ]["mean"] = 1.0
    for name in ("clean", "worst", "alike", "published", "ensemble", "open_worst"):
        said["standings"]["mean"][name]["mean"] = 1.0


def follow(said: Any) -> None:
    """Let the standings follow from the cells, as in a file that was made up with care."""
    suite = read_suite(said["suite"], "suite")
    claims = [CellClaim.model_validate_json(json.dumps(one)) for one in said["cells"]]
    for name, scores in model_scores(suite, [claim.as_single_game() for claim in claims]).items():
        for score, value in scores:
            said["standings"][name][score]["mean"] = value.mean


def other_versions(said: Any) -> None:
    said["software"]["packages"]["numpy"] = "1.0.0"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (
            lambda said: said["standings"]["mean"]["worst"].update(mean=0.99),
            "scores of mean worst: claimed 0.9900",
        ),
        (lambda said: said.update(suite_sha256="0" * 64), "its hash is not the stated one"),
        (lambda said: said["suite"].update(games=4), "its hash is not the stated one"),
        (
            lambda said: said["models"]["mean"].update(sha256="0" * 64),
            "model mean another source than here",
        ),
        (
            lambda said: said["attacks"]["on-off"].update(version="9"),
            "other source, from roletrust-env 9",
        ),
    ],
)
def test_what_is_not_as_said_is_told_without_playing(
    verified: Callable, change: Callable, words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if "from roletrust-env 9" in words:
        code, told = verified(change)
        assert code == 0
    else:
        monkeypatch.setattr(submit, "LocalPool", None)
        code, told = verified(change, "--cells", "1")
        assert code == 1
        assert "No cell was played again: what is not ok above needs no game." in told
    assert words in told


@pytest.mark.parametrize("forgotten", [False, True])
def test_numbers_that_were_made_up_are_found(
    in_process: None, verified: Callable, forgotten: bool
) -> None:
    def change(said: Any) -> None:
        better(said)
        if forgotten:
            for one in said["cells"]:
                del one["attacks"][1:]
        follow(said)

    code, told = verified(change, "--cells", "100", "--workers", "1")
    assert code == 1
    assert ("missing in the claim" if forgotten else "other numbers") in told
    assert "scores of mean worst case 1.0000" in told  # which goes with the rest of the file


def test_on_other_software_means_have_to_be_within_the_intervals(
    in_process: None, verified: Callable
) -> None:
    def near(said: Any) -> None:
        other_versions(said)
        cell(said)["attacks"][0]["measured"]["blind"]["mean"] += 1e-6

    code, told = verified(near, "--cells", "100", "--workers", "1")
    assert code == 0, told
    assert "not the same (numpy): numbers must be within the intervals" in told

    def far(said: Any) -> None:
        near(said)
        cell(said)["attacks"][0]["measured"]["false_alarms"]["mean"] = 7.0
        follow(said)

    code, told = verified(far, "--cells", "100", "--workers", "1")
    assert code == 1
    assert "7.0000" in told


def test_an_edited_choice_of_the_worst_case_is_found(in_process: None, verified: Callable) -> None:
    def change(said: Any) -> None:
        other_versions(said)
        rows = [row for one in said["cells"] if one["track"] == "raters" for row in one["attacks"]]
        min(rows, key=lambda row: row["chosen"])["chosen"] += 2
        follow(said)

    code, told = verified(change, "--cells", "100", "--workers", "1")
    assert code == 1
    assert "claimed 2." in told  # the best possible is 1


def test_utilities_that_are_a_little_too_high_everywhere_are_found(
    in_process: None, verified: Callable
) -> None:
    def change(said: Any) -> None:
        other_versions(said)
        for one in said["cells"]:
            for row in one["attacks"]:
                row["measured"]["utility"]["mean"] += 1.3 * row["measured"]["utility"]["half_95"]
        follow(said)

    code, told = verified(change, "--cells", "100", "--workers", "1")
    assert code == 1
    assert (
        "claimed" not in told.partition("cell mean")[2].partition("bias of")[0]
    )  # each is within its interval
    assert "not ok bias of utility" in told
    assert "ok bias of chosen utility" in told


@pytest.mark.slow
def test_utilities_that_are_hardly_too_high_are_found_over_all_cells(tmp_path: Path) -> None:
    suite = tiny(methods=["scripted"], models=["mean"], seeds=list(range(8)))
    path = tmp_path / "theirs.json"
    assert run("submit", str(played(tmp_path, suite)), "--out", str(path)).exit_code == 0
    true = json.loads(path.read_text())
    for raised, code in ((0.0, 0), (0.4, 1)):
        said = copy.deepcopy(true)
        other_versions(said)
        for row in (row for one in said["cells"] for row in one["attacks"]):
            for name in ("utility", "published"):
                row["measured"][name]["mean"] += raised * row["measured"][name]["half_95"]
        follow(said)
        path.write_text(json.dumps(said))
        result = run("verify", str(path), "--own-suite", "--seed", "7", "--workers", "2")
        told = " ".join(result.output.split())
        assert result.exit_code == code, told
        assert ("not ok bias of the worst skill" in told) == (raised > 0)
        assert "not ok cell" not in told
        assert "all its cells" not in told


def test_an_easier_suite_is_no_entry(tmp_path: Path, text: str) -> None:
    (tmp_path / "theirs.json").write_text(text)
    result = printed("verify", tmp_path / "theirs.json", "--cells", "0", code=1)
    assert "not a suite of this package; --own-suite accepts it" in result


def test_a_suite_that_only_bears_a_known_name_is_told(verified: Callable, tmp_path: Path) -> None:
    def change(said: Any) -> None:
        said["suite"]["name"] = "quick"
        said["suite_sha256"] = suite_hash(load_suite("quick").model_validate(said["suite"]))

    code, told = verified(change)
    assert code == 1
    assert "its name is quick, but it differs" in told


def test_a_run_that_is_not_whole_is_not_submitted(tmp_path: Path) -> None:
    path = played(tmp_path)
    with ResultStore(path, SUITE) as store:
        first = store.all()[0]
        store.add(first.cell, first.result._replace(failed="attack on-off: it broke"))
    refused = printed("submit", path, "--out", tmp_path / "mine.json", code=2)
    assert_names(refused, "1", "6")
    wanted = run("submit", str(path), "--model", "median", "--out", str(tmp_path / "mine.json"))
    assert_names(" ".join(wanted.output.split()), "median")
    printed("submit", path, "--model", "role-trust", "--out", tmp_path / "mine.json")
    assert read_submission(tmp_path / "mine.json")[1].models == ("role-trust",)


@pytest.fixture
def mine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A module of a model that leaves a file behind when it is imported."""
    (tmp_path / "model_of_mine.py").write_text(
        "from pathlib import Path\n"
        "from roletrust_env.trust.models.central.means import Mean\n"
        "Path('imported').touch()\n"
        "class Mine(Mean): pass\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    yield "model_of_mine:Mine"
    sys.modules.pop("model_of_mine", None)


def test_a_file_imports_only_what_the_user_allows(tmp_path: Path, mine: str) -> None:
    suite = tiny(methods=["scripted"], models=[mine], tracks={"honest": {}})
    path, out = str(played(tmp_path, suite)), str(tmp_path / "mine.json")
    del sys.modules["model_of_mine"]
    (tmp_path / "imported").unlink()
    for command in (
        ["submit", path, "--out", out],
        ["report", path, "--out", str(tmp_path / "report")],
    ):
        assert_names(" ".join(run(*command).output.split()), "--allow-code")
    assert not (tmp_path / "imported").exists()
    assert run("submit", path, "--model", mine, "--out", out).exit_code == 0  # named by the user
    del sys.modules["model_of_mine"]
    (tmp_path / "imported").unlink()
    refused = run("verify", out)
    assert (refused.exit_code, "which is not installed" in " ".join(refused.output.split())) == (
        2,
        True,
    )
    assert not (tmp_path / "imported").exists()
    printed("verify", out, "--allow-code", "--own-suite", "--cells", "0")
    assert not (tmp_path / "imported").exists()  # only processes that play it import it


def renamed(name: str) -> Callable[[Any], None]:
    """A submission whose model `mean` is called otherwise everywhere."""

    def change(said: Any) -> None:
        said["suite"]["models"] = [
            name if one == "mean" else one for one in said["suite"]["models"]
        ]
        for part in ("models", "standings"):
            said[part][name] = said[part].pop("mean")
        for one in said["cells"]:
            one["model"] = name if one["model"] == "mean" else one["model"]

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (renamed("os:system"), ("os:system",)),
        (renamed("os:system:command=touch hacked"), ("--allow-code",)),
        (renamed("../../etc/passwd"), ("[key]",)),
        (renamed("mean\x1b[2J"), ("[key]",)),
        (
            lambda said: said["suite"]["attacks"].__setitem__(0, "os:system"),
            ("attacks", "bad-mouthing"),
        ),
        (
            lambda said: said["suite"]["scenarios"]["market"].update(preset="/etc/passwd.toml"),
            ("preset", "/etc/passwd"),
        ),
        (
            lambda said: said["suite"]["scenarios"]["market"]["set"].update(frames="/dev/video0"),
            ("frames",),
        ),
        (
            lambda said: said["suite"]["tracks"]["honest"].update(set={"frames": 0}),
            ("frames",),
        ),
        (
            lambda said: said["suite"]["scenarios"]["market"]["set"].update(max_cycles=10**9),
            ("1000000000",),
        ),
        (
            lambda said: said["suite"].update(seeds=list(range(1000))),
            ("6", "6000"),
        ),
        (lambda said: said["suite"].update(models="all"), ("suite",)),
        (lambda said: said["suite"].update(kind="learners"), ("suite", "models")),
        (
            lambda said: said["suite"].update(tracks=[]),
            ("1", "100"),
        ),
        (lambda said: said["suite"].update(tracks={"a": 1}), ("1",)),
        (lambda said: said["suite"].update(ghost=1), ("ghost",)),
        (lambda said: said.update(ghost=1), ("ghost", "1")),
        (lambda said: said.update(format=1), ("format", "1")),
        (lambda said: said.update(cells={}), ("cells", "{}")),
        (lambda said: said["cells"].pop(), ("5", "6")),
        (
            lambda said: said["cells"].__setitem__(0, said["cells"][1]),
            ("cells", "mean|market|honest|0.0|nobody|0"),
        ),
        (lambda said: cell(said)["attacks"][0].update(chosen="0.5"), ("chosen", "0.5")),
        (lambda said: cell(said)["attacks"][0].update(chosen=True), ("chosen", "True")),
        (lambda said: cell(said)["attacks"][0].update(chosen=float("nan")), ("JSON", "NaN")),
        (
            lambda said: said["standings"]["mean"]["worst"].update(mean=float("inf")),
            ("JSON", "Infinity"),
        ),
        (
            lambda said: cell(said)["attacks"][0]["measured"]["utility"].update(mean=None),
            ("utility", "bad-mouthing"),
        ),
        (
            lambda said: cell(said, "honest").update(attacks=[]),
            ("mean|market|honest|0.0|nobody|0", "0"),
        ),
        (lambda said: said["software"].update(python=["3"] * 10**6), ("python", "3")),
    ],
)
def test_a_hostile_file_is_one_line(
    verified: Callable,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    change: Callable,
    words: tuple[str, ...],
) -> None:
    def never(*_: object) -> None:
        raise AssertionError("something was run for the sake of a file")

    monkeypatch.setattr(os, "system", never)
    code, told = verified(change, "--cells", "1")
    assert code == 2, told
    assert_names(told, *words)
    assert told.startswith("Error: ")
    assert len(told) < 4000


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda text: text[: len(text) // 2], ("JSON",)),
        (lambda text: "[" * 200_000, ("JSON",)),
        (lambda text: '{"cells": ' * 200_000, ("JSON",)),
        (
            lambda text: text.replace('"format": 4', '"format": 4, "format": 4'),
            ("JSON",),
        ),
        (
            lambda text: text.replace('"chosen": 0', '"chosen": 1e999, "x": 0', 1),
            ("cells.0.attacks.0.chosen", "inf"),
        ),
        (lambda text: "", ("JSON",)),
        (lambda text: "\udcff", ("JSON", "utf-8")),
        (lambda text: "1" * 10_000, ("4300",)),
        (
            lambda text: text.replace("market", "\\ud800"),
            ("JSON", "\\ud800"),
        ),
        (lambda text: f"[{'{},' * 1_500_000}{{}}]", ("3,000,000",)),
        (
            lambda text: json.dumps({f"{k}": 0 for k in range(10_001)}),
            ("10,000",),
        ),
        (
            lambda text: '{"cells": [' + "{}," * 1_000 + "{}]}",
            ("cells.0.model",),
        ),
    ],
)
def test_a_file_that_is_no_json_is_one_line(
    tmp_path: Path, text: str, spoil: Callable, words: tuple[str, ...]
) -> None:
    path = tmp_path / "theirs.json"
    path.write_bytes(spoil(text).encode("utf-8", "surrogateescape"))
    with refuses(ValueError, *words):
        read_submission(path)


def test_a_file_that_is_too_large_or_none_is_not_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(verification, "MAX_BYTES", 1000)
    (tmp_path / "large.json").write_text(" " * 1001)
    with refuses(ValueError, "large.json", "1000"):
        read_submission(tmp_path / "large.json")
    os.mkfifo(tmp_path / "pipe.json")
    for name in ("pipe.json", "none.json", "."):
        with refuses(ValueError, tmp_path / name):
            read_submission(tmp_path / name)
