"""What people wrote: Python blocks run, commands are there, TOML and YAML are valid, links lead
somewhere."""

import re
import subprocess
import tomllib

import pytest
import yaml
from pages import HOUSE, TUTORIALS, WRITTEN, anchors, blocks, cells, commands, prose, refused, run

pytestmark = pytest.mark.slow

_LINK = re.compile(r"\]\(([^)\s]+)\)")
_ELSEWHERE = ("manager",)  # tests/manager/http/test_delegation.py runs its Python, beside a manager
PYTHON = [page for page in WRITTEN if blocks(page, "python") and page.stem not in _ELSEWHERE]


@pytest.mark.parametrize("page", PYTHON, ids=lambda page: page.stem)
def test_its_python_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(page)


def test_commands_are_there():
    wrong = {
        (page.name, line): why
        for page in WRITTEN
        for line in commands(page)
        if (why := refused(line))
    }
    assert wrong == {}


def test_blocks_are_of_languages_that_are_tried():
    """A block in another language would be looked at by nobody."""
    known = {"", "python", "bash", "toml", "yaml", "text", "mermaid"}
    known |= {
        "{code-cell}",
        "{toctree}",
        "{include}",
        "{literalinclude}",
        "{bibliography}",
        "{eval-rst}",
    }
    known |= {"json", "javascript"}  # tests/trust/test_remote.py tries them
    for page in WRITTEN:
        text = page.read_text(encoding="utf-8")
        found = re.findall(
            r"^```(\S*)$|^```(\{literalinclude\}|\{include\}) ", text, flags=re.MULTILINE
        )
        assert {fence or directive for fence, directive in found} <= known, page
        for block in blocks(page, "toml"):
            tomllib.loads(block)
        for block in blocks(page, "yaml"):
            assert yaml.safe_load(block)


def test_links_lead_somewhere_and_pictures_are_described():
    wrong = []
    for page in WRITTEN:
        text = prose(page)
        assert "![](" not in text, page
        for target in _LINK.findall(text):
            path, _, anchor = target.partition("#")
            file = (page.parent / path).resolve() if path else page
            if "://" in target or path.startswith(("reference/", "../reference/")):
                continue  # the site's build writes these
            if not file.exists() or (anchor and anchor not in anchors(file)):
                wrong.append((page.name, target))
    assert wrong == []


@pytest.mark.skipif(not (HOUSE / ".git").exists(), reason="this is no clone")
def test_no_file_names_a_folder_of_the_machine_that_made_it():
    listed = subprocess.run(
        ["git", "ls-files", "-z"], cwd=HOUSE, check=True, capture_output=True, text=True
    ).stdout
    private = re.compile(
        rb"(?<![\w.])(?:[A-Z]:\\Users\\|/(?:home|Users|root|work|tmp(?=/pytest))/)(\w+)"
    )
    found = {
        (name, path)
        for name in listed.split("\0")[:-1]
        for path in private.findall((HOUSE / name).read_bytes())
    }
    assert found == {("docs/guide/mcp.md", b"ann")}  # an example


def test_tutorials_write_what_can_be_read():
    """The build runs them; this finds a slip at once."""
    for page in TUTORIALS:
        for cell in cells(page):
            kind, _, text = cell.partition("\n")
            if kind.startswith("%%writefile") and kind.endswith(".toml"):
                tomllib.loads(text)
            elif kind != "%%bash":
                compile(text if kind.startswith("%%") else cell, page.name, "exec")
        for block in blocks(page, "{code-cell}"):
            assert "    alt: " in block or not ("plt.subplots" in block or "Image(" in block), page


def test_a_command_that_is_not_there_is_found():
    for line, reason in (
        ("roletrust play --attck sr_2=bad-mouthing", "--attck"),
        ("roletrust play --attack sr_2=bad-mouting", "attack sr_2=bad-mouting"),
        ("roletrust benchmark --suite standrd", "suite standrd"),
        ("roletrust robots demonstrate", "demonstrate"),
        ("roletrust train RaterAttack --steps few", "valid integer"),
        ("make tests", "no targets"),
        ("pip install -e '.[everything]'", "no extras"),
        ("python -m studies nothing", "no study"),
        ("rm -rf results", "unknown program"),
    ):
        assert reason in refused(line)
