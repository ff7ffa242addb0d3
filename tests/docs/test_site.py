"""The site as `make docs` has built it: all that is registered has its page, links land, pictures
are described."""

import importlib
import runpy
from fnmatch import fnmatch

import gymnasium
import pytest
import typer
from built import HOUSE, WHOLE, broken, fetched, pages, parsed, text
from sphinx.util.inventory import InventoryFile

import roletrust_env
from roletrust_experiments.cli import app

pytestmark = pytest.mark.site


@pytest.fixture(scope="module")
def site():
    assert (WHOLE / "index.html").is_file(), "there is no site; make docs builds it"
    return WHOLE


@pytest.mark.parametrize(
    ("folder", "names"),
    [("models", roletrust_env.trust_models()), ("attacks", roletrust_env.attackers())],
)
def test_the_catalogue_has_all_that_is_registered(site, folder, names):
    index = text(site / "reference" / folder / "index.html")
    for name, described in names.items():
        said = text(site / "reference" / folder / f"{name}.html")
        assert name in index
        if not described.startswith("from "):  # of a plug-in only that
            assert described.partition("`")[0].strip()[:40] in said, name


def test_a_model_has_formula_source_parameters_and_a_picture(site):
    page = site / "reference" / "models" / "travos.html"
    said = text(page)
    for part in ("Teacy et al. (2006)", "S^2 P", "threshold 0.95 0 to 1", "bins 5 whole"):
        assert part in said
    assert parsed(page).find("math", display="block").find("mfrac")
    assert "../../references.html#" in str(parsed(page).find("article"))
    picture = parsed(page).find("article").find("img")
    assert (page.parent / picture["src"]).is_file()
    assert "ToP of honest providers" in picture["alt"]


def test_an_attack_says_who_plays_it_and_where_it_is_searched(site):
    said = text(site / "reference" / "attacks" / "bad-mouthing.html")
    for part in (
        "--attack 'sr_[0-3]=bad-mouthing:start=30,stop=90'",
        "constant or relative",
        "some honest providers",
    ):
        assert part in said


def test_every_model_and_attack_has_a_formula_and_a_command(site):
    for folder in ("models", "attacks"):
        for page in (site / "reference" / folder).glob("*.html"):
            if page.name != "index.html":
                assert parsed(page).find("math", display="block"), page
                command = parsed(page).find("pre").get_text()
                assert command.startswith(("roletrust ", "python -m studies ")), page


def test_no_description_of_a_picture_has_a_number_that_is_none(site):
    for page in pages(site):
        assert not [
            tag for tag in parsed(page).find_all("img") if "nan" in tag.get("alt", "").split()
        ], page


def test_every_source_has_its_page(site):
    said = text(site / "references.html")
    for part in (
        "The Sybil attack",
        "10.1145/775152.775242",
        "Iterative filtering in reputation systems",
    ):
        assert part in said


def test_every_scenario_is_told_with_its_file(site):
    said = text(site / "reference" / "scenarios.html")
    for name, description in roletrust_env.scenarios().items():
        assert f'name = "{name}"' in said
        assert description in said


def test_every_environment_has_a_page_with_a_film(site):
    ids = ["RoleTrust-v0", *(name for name in gymnasium.registry if name.startswith("RoleTrust/"))]
    found = {
        parsed(page).find("h1").get_text().rstrip("¶#"): page
        for page in (site / "reference/environments").iterdir()
    }
    assert set(ids) <= set(found)
    for identity in ids:
        film = parsed(found[identity]).find("video")
        assert (found[identity].parent / film.find("source")["src"]).stat().st_size > 1000
        assert identity in film["aria-label"]
        for heading in (
            "Description",
            "Action Space",
            "Observation Space",
            "Rewards",
            "Episode End",
        ):
            assert heading in text(found[identity])


def test_every_command_and_option_is_told(site):
    def told(command, words, page):
        said = text(page)
        assert " ".join(words) in said
        for parameter in command.params:
            assert all(word in said for word in parameter.opts), (words, parameter.opts)
        for name, one in getattr(command, "commands", {}).items():
            told(one.loaded, [*words, name], page)

    for name, command in typer.main.get_command(app).commands.items():
        told(command.loaded, ["roletrust", name], site / "reference" / "commands" / f"{name}.html")
        assert f"roletrust {name}" in text(site / "reference" / "commands" / "index.html")


@pytest.mark.parametrize(
    "module",
    [
        "roletrust_env",
        "roletrust_env.trust",
        "roletrust_env.metrics",
        "roletrust_env.world",
        "roletrust_env.evaluation",
        "roletrust_env.benchmarking",
        "roletrust_env.testing",
        "roletrust_agents.learned",
    ],
)
def test_the_api_has_all_that_is_public(site, module):
    inventory = InventoryFile.loads((site / "objects.inv").read_bytes(), uri="").data
    told = {name for kind, names in inventory.items() if kind.startswith("py:") for name in names}
    last = {name.rpartition(".")[2] for name in told}
    assert set(importlib.import_module(module).__all__) <= last


def test_what_stands_in_docs_is_on_the_site(site):
    """A page is missing only where the settings say that another page includes it."""
    docs = HOUSE / "docs"
    included = runpy.run_path(str(docs / "conf.py"))["exclude_patterns"]
    for page in (path.relative_to(docs) for path in docs.glob("**/*.md")):
        if "reference" not in page.parts and not any(
            fnmatch(page.as_posix(), pattern) for pattern in included
        ):
            assert (site / page.with_suffix(".html")).is_file(), page


def test_every_page_has_a_title(site):
    """One without would be found by the search as such; it may be a table that another page
    includes."""
    written = [page for page in pages(site) if page.name not in ("search.html", "report.html")]
    assert [page for page in written if not parsed(page).select_one("article h1")] == []


def test_home_has_three_doors_and_four_groups_of_results(site):
    home = parsed(site / "index.html")
    doors = home.select(".doors .sd-card")
    assert len(doors) == 3
    assert all(door.find("img") and door.find("pre") and door.find("a") for door in doors)
    (results,) = (
        one for one in home.select(".sidebar-tree .caption") if one.get_text() == "Results"
    )
    names = [one.get_text() for one in results.find_next_sibling("ul").select(".toctree-l1 > a")]
    assert names == ["Leaderboard", "Attackers", "Theory", "Real data"]


def test_long_tables_of_results_are_folded(site):
    for name, folded in (("robustness", True), ("guide/install", False)):
        for table in parsed(site / f"{name}.html").select("article table"):
            assert (table.find_parent("details") is not None) == (
                folded and len(table.select("tbody tr")) > 8
            ), name


def test_links_land_and_nothing_is_fetched(site):
    assert {page.name: wrong for page in pages(site) if (wrong := broken(page))} == {}
    assert {page.name: asked for page in pages(site) if (asked := fetched(page))} == {}


def test_pictures_are_described(site):
    bare = {
        page.name: tag
        for page in pages(site)
        for tag in parsed(page).find_all("img")
        if not tag.get("alt")
    }
    assert bare == {}


def test_no_docstring_is_left_as_it_was_typed(site):
    """Headings and literals of another markup would be read as text."""
    for page in pages(site):
        for part in parsed(page).select("article p, article dd"):
            assert not part.get_text().lstrip().startswith(("## ", "| ---", ".. ")), page
