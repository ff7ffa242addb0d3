"""What people wrote: Python blocks run, commands are there, links lead somewhere."""

import re
import tomllib

import pytest
from pages import HOUSE, TUTORIALS, WRITTEN, anchors, blocks, cells, commands, prose, refused, run

pytestmark = pytest.mark.slow

named = pytest.mark.parametrize("page", WRITTEN, ids=lambda page: str(page.relative_to(HOUSE)))
tutorials = pytest.mark.parametrize("page", [page for page in TUTORIALS if cells(page)], ids=lambda page: page.stem)
_LINK = re.compile(r"\]\(([^)\s]+)\)")


@pytest.mark.parametrize("page", [page for page in WRITTEN if blocks(page, "python")], ids=lambda page: page.stem)
def test_its_python_runs(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run(page)


@named
def test_its_commands_are_there(page):
    assert {line: wrong for line in commands(page) if (wrong := refused(line))} == {}


@named
def test_its_toml_is_toml(page):
    for block in blocks(page, "toml"):
        tomllib.loads(block)


@named
def test_its_links_lead_somewhere(page):
    for target in _LINK.findall(prose(page)):
        path, _, anchor = target.partition("#")
        if "://" in target or path.startswith("reference/"):
            continue
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), target
        assert not anchor or anchor in anchors(file), target


@tutorials
def test_a_tutorial_writes_what_can_be_read(page):
    """The build runs it; this finds a slip at once."""
    for cell in cells(page):
        kind, _, text = cell.partition("\n")
        if kind.startswith("%%writefile") and kind.endswith(".toml"):
            tomllib.loads(text)
        elif kind != "%%bash":
            compile(text if kind.startswith("%%") else cell, page.name, "exec")


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("roletrust play --attck sr_2=bad-mouthing", "--attck"),
        ("roletrust play --attack sr_2=bad-mouting", "attack sr_2=bad-mouting"),
        ("roletrust benchmark --suite standrd", "suite standrd"),
        ("roletrust live demonstrate", "demonstrate"),
        ("roletrust train RaterAttack --steps few", "valid integer"),
        ("make tests", "no targets"),
        ("pip install -e '.[everything]'", "no extras"),
        ("rm -rf results", "unknown program"),
    ],
)
def test_a_command_that_is_not_there_is_found(line, reason):
    assert reason in refused(line)
