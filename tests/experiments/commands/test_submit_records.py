"""`roletrust verify`: attackers that a search found on another machine."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmark_cases import tiny
from command_line import printed, run
from refusals import assert_names

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.evaluation.resources import processor

pytestmark = pytest.mark.usefixtures("in_process")


@pytest.fixture(scope="module")
def found_elsewhere(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A true submission of another machine, whose searches find other attackers than those here."""
    folder, suite = (
        tmp_path_factory.mktemp("elsewhere"),
        tiny(methods=["random search"], budget=2000, models=["mean"]),
    )
    with ResultStore(folder / "results.sqlite", suite) as store:
        for cell in suite.cells():
            other = play_cell(suite, cell._replace(seed=99)).rows[0].record
            store.add(cell, play_cell(suite, cell, other))
    printed("submit", folder / "results.sqlite", "--out", folder / "theirs.json")
    said = json.loads((folder / "theirs.json").read_text())
    said["processor"] = "another processor"
    return json.dumps(said)


def verified_text(path: Path, text: str) -> tuple[int, str]:
    path.write_text(text)
    made = run("verify", str(path), "--own-suite", "--cells", "100", "--workers", "1", "--no-fresh")
    return made.exit_code, " ".join(made.output.split())


def test_attackers_that_were_found_on_another_machine_are_played(
    tmp_path: Path, found_elsewhere: str
) -> None:
    code, told = verified_text(tmp_path / "theirs.json", found_elsewhere)
    assert code == 0, told
    said = json.loads(found_elsewhere)
    code, told = verified_text(
        tmp_path / "theirs.json", json.dumps(said | {"processor": processor()})
    )
    assert code == 1, told  # a claim to be of this machine is taken at its word
    for claim in said["cells"]:
        for attack in claim["attacks"]:
            attack.pop("record")
    code, told = verified_text(tmp_path / "theirs.json", json.dumps(said))
    assert code == 1, told
    assert "random search, " in told  # another attacker is found here, with other numbers


@pytest.mark.parametrize(
    ("record", "words"),
    [
        ("{}", "failed here: the record"),
        ('{"kind":"scripts","policies":{}}', "random search, utility: claimed"),
    ],
)
def test_a_record_of_another_attacker_is_found(
    tmp_path: Path, found_elsewhere: str, record: str, words: str
) -> None:
    said = json.loads(found_elsewhere)
    for claim in said["cells"]:
        for attack in claim["attacks"] if claim["track"] != "honest" else ():
            attack["record"] = record
    code, told = verified_text(tmp_path / "theirs.json", json.dumps(said))
    assert code == 1
    assert words in told


def test_a_search_has_one_attack_and_others_have_no_record(
    tmp_path: Path, found_elsewhere: str
) -> None:
    def refused(change: str) -> str:
        said = json.loads(found_elsewhere)
        for claim in said["cells"]:
            if claim["method"] != "random search":
                if change == "record":
                    claim["attacks"][0]["record"] = "{}"
            elif change == "twice":
                claim["attacks"] *= 2
            elif change == "other":
                claim["attacks"][0]["attack"] = "evolution"
        code, told = verified_text(tmp_path / "theirs.json", json.dumps(said))
        assert code == 2, told
        return told

    assert_names(refused("twice"), "attacks")
    assert_names(refused("other"), "random search")
    assert_names(refused("record"), "nobody")


PLAY = """
from pathlib import Path
from benchmark_cases import tiny
from command_line import printed, run
from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.store import ResultStore
suite = tiny(methods=["scripted", "evolution strategy"], budget=20_000, models=["role-trust", "travos"])
with ResultStore(Path("results.sqlite"), suite) as store:
    for cell in suite.cells():
        store.add(cell, play_cell(suite, cell))
made = run("submit", "results.sqlite", "--out", "theirs.json")
assert made.exit_code == 0, made.output
"""  # noqa: E501


@pytest.mark.slow
def test_an_honest_entry_of_a_machine_that_rounds_otherwise_is_accepted(tmp_path: Path) -> None:
    """The same software on a machine with fewer instructions: sums differ in their last bits, and
    searches in all."""
    build: Any = np.show_config(mode="dicts")
    if not (known := build["SIMD Extensions"].get("found")):
        pytest.skip("NumPy uses no instructions here that can be left out")
    fewer = {
        "NPY_DISABLE_CPU_FEATURES": " ".join(known),
        "OPENBLAS_CORETYPE": "PRESCOTT",
        "PYTHONPATH": os.pathsep.join(sys.path),
    }
    subprocess.run(
        [sys.executable, "-c", PLAY],
        cwd=tmp_path,
        env={**os.environ, **fewer},
        check=True,
        timeout=300,
    )
    text = (tmp_path / "theirs.json").read_text()
    code, told = verified_text(tmp_path / "theirs.json", text)
    assert code == 0, told
    assert "not the same (processor)" in told
