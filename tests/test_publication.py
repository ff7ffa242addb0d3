"""What is needed to publish: the paper for JOSS, the citation, the container and the archive."""

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import tomllib
from pathlib import Path

import pytest
import yaml
from pages import refused
from pybtex.database import parse_file

import croissant
import model_cards
from roletrust_agents.learned.saved import load_attacker

HOUSE = Path(__file__).parent.parent
PROJECT = tomllib.loads((HOUSE / "pyproject.toml").read_text())["project"]
_, FRONT, PAPER = (HOUSE / "docs/paper.md").read_text(encoding="utf-8").split("---\n", 2)


def test_every_source_of_the_paper_is_in_the_bibliography():
    cited = set(re.findall(r"@([a-z]+\d{4})", PAPER))
    assert "su2023" in cited
    entries = parse_file(str(HOUSE / "docs" / yaml.safe_load(FRONT)["bibliography"])).entries
    assert cited <= set(entries)


def test_the_citation_is_of_this_version_and_a_doi_can_be_added():
    text = (HOUSE / "CITATION.cff").read_text(encoding="utf-8")
    citation = yaml.safe_load(text)
    assert {"cff-version", "message", "title", "authors", "version", "license", "keywords"} <= set(
        citation
    )
    assert citation["version"] == PROJECT["version"]
    added = yaml.safe_load(
        re.sub(r"^# (date-released|identifiers|  )", r"\1", text, flags=re.MULTILINE)
    )
    assert added["identifiers"][0]["type"] == "doi"
    assert re.fullmatch(r"10\.\d{4,}/\S+", added["identifiers"][0]["value"])


def test_the_container_runs_commands_that_are_there():
    lines = (HOUSE / "Dockerfile").read_text().splitlines()
    versions = {line.split()[1] for line in lines if line.startswith("FROM")}
    assert versions == {f"python:{PROJECT['requires-python'].removeprefix('>=')}-slim"}
    makefile = (HOUSE / "Makefile").read_text()
    text = "\n".join(lines)
    targets = re.findall(r"make (\w+)", text) + re.findall(r'"make", "(\w+)"', text)
    assert {"setup", "run", "test"} <= set(targets)
    for target in targets:
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    for source in re.findall(r"^COPY (\S+) ", text, flags=re.MULTILINE):
        assert (HOUSE / source).exists()
    assert {"git", "make"} <= set(re.search(r"--no-install-recommends (.+?) &&", text)[1].split())


def test_the_trust_manager_is_started_with_its_database():
    manager, database = yaml.safe_load((HOUSE / "compose.yaml").read_text())["services"].values()
    stages = re.split(r"^FROM \S+", (HOUSE / "Dockerfile").read_text(), flags=re.MULTILINE)
    (stage,) = (stage for stage in stages if stage.startswith(f" AS {manager['build']['target']}"))
    (extra,) = re.findall(r"'\.\[(\w+)\]'", stage)
    assert extra in PROJECT["optional-dependencies"]
    program = json.loads(re.search(r"^ENTRYPOINT (.+)", stage, flags=re.MULTILINE)[1])
    assert not refused(shlex.join([*program, *manager["command"]]))
    assert "POSTGRES_PASSWORD" in database["environment"]
    (port,) = manager["ports"]
    assert port.endswith(":8000")  # the command's default


@pytest.mark.slow
@pytest.mark.skipif(not (HOUSE / ".git").exists(), reason="this is no clone")
@pytest.mark.skipif(not shutil.which("make"), reason="there is no make")
def test_the_same_commit_gives_the_same_archive(tmp_path):
    settings = tmp_path / "settings"
    settings.write_text("[tar]\numask = 0077\n[core]\nautocrlf = true\n")
    sums = []
    for name, environment in ("one", {}), ("two", {"GIT_CONFIG_GLOBAL": str(settings)}):
        command = ["make", "archive", f"ARCHIVE={tmp_path / name}"]
        subprocess.run(
            command, cwd=HOUSE, check=True, capture_output=True, env=os.environ | environment
        )
        sums.append(hashlib.sha256((tmp_path / name / "roletrust.tar.gz").read_bytes()).hexdigest())
    assert sums[0] == sums[1]
    assert sums[0] in (tmp_path / "one" / "roletrust.sha256").read_text()
    listed = dict(
        reversed(line.split("  "))
        for line in (tmp_path / "one" / "SHA256SUMS").read_text().splitlines()
    )
    board = "docs/leaderboards/standard/leaderboard.csv"
    stored = subprocess.run(
        ["git", "show", f"HEAD:{board}"], cwd=HOUSE, check=True, capture_output=True
    ).stdout
    assert listed[f"roletrust/{board}"] == hashlib.sha256(stored).hexdigest()
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == [
        "SHA256SUMS",
        "roletrust-results.tar.gz",
        "roletrust.sha256",
        "roletrust.tar.gz",
    ]


def test_the_published_results_and_the_attackers_are_described():
    described = croissant.croissant()
    tables = {file["contentUrl"]: file["sha256"] for file in described["distribution"]}
    board = HOUSE / "docs/leaderboards/standard/leaderboard.csv"
    assert tables["leaderboard.csv"] == hashlib.sha256(board.read_bytes()).hexdigest()
    fields = {
        field["@id"]: field["dataType"]
        for records in described["recordSet"]
        for field in records["field"]
    }
    assert (fields["leaderboard/worst"], fields["leaderboard/model"]) == ("sc:Float", "sc:Text")
    headings = re.findall(
        r"^## ", (HOUSE / "docs/release/datasheet.md").read_text(encoding="utf-8"), re.MULTILINE
    )
    said = {key: words for key, words in described.items() if key.startswith("rai:")}
    assert len(said) == len(headings)
    assert all(said.values())
    page = model_cards.page({"rater-3x3": load_attacker("rater-3x3").card})
    assert "sr_2 in `paper-3x3`" in page


@pytest.mark.slow
def test_a_notebook_installs_the_package_and_then_is_the_tutorial():
    import notebooks  # of what makes the site

    for name, (page, extras) in notebooks.NOTEBOOKS.items():
        book = notebooks.notebook(name)
        first, *others = [cell.source for cell in book.cells if cell.cell_type == "code"]
        assert f'%pip install --quiet --find-links . "roletrust-env[{extras}]"' in first
        assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
        text = (HOUSE / f"docs/tutorials/{page}.md").read_text(encoding="utf-8")
        assert len(others) == text.count("```{code-cell}")
        assert all(cell in text for cell in others)
        words = "".join(cell.source for cell in book.cells if cell.cell_type == "markdown")
        assert not re.findall(r"\]\((?!https?://)", words)
