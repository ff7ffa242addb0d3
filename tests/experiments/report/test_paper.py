"""Figures of a report as files, and names that Matplotlib or a page could take for commands."""

import re
from pathlib import Path
from xml.etree import ElementTree

import large_run
import pytest
from small_suites import MARKET

from roletrust_experiments.report.content import Content, Learners
from roletrust_experiments.report.figures import write_figures
from roletrust_experiments.report.robustness import Robustness

MODELS = ["exec:a$_b$ [x]_%&#", "$$\\frac{x}{y}$$ <b>mean</b>", "@score {safe} ~^"]
ATTACK = "x:Y$_$[red]"
NAMES = ["breakdown", "curves", "heatmap", "leaderboard", "learners", "tradeoff"]


@pytest.fixture(scope="module")
def content() -> Content:
    suite = large_run.large(
        models=MODELS,
        attacks=[ATTACK],
        methods=["scripted"],
        name="odd\n\\input{x}",
        scenarios={"market": MARKET},
    )
    learners = large_run.learners()
    return Content(
        Robustness.of(suite, large_run.stored_cells(suite), {}, Path("results.sqlite")),
        Learners.of(learners, large_run.stored_trials(learners), {}, Path("results.sqlite")),
    )


@pytest.fixture(scope="module")
def folder(content: Content, tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("paper")
    write_figures(here, content, ".svg")
    return here


def svg(path: Path) -> list[str]:
    """The texts of a file."""
    return [
        node.text or "" for node in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")
    ]


def test_every_figure_has_its_text_as_text(folder: Path) -> None:
    assert sorted(path.stem for path in folder.glob("*.svg")) == NAMES
    assert all(len(svg(folder / f"{name}.svg")) > 5 for name in NAMES)


def test_names_stand_in_figures_as_they_are(folder: Path) -> None:
    for name in ("heatmap", "curves", "breakdown", "tradeoff"):
        assert set(MODELS) <= set(svg(folder / f"{name}.svg")), name


def test_a_heat_map_has_the_worst_cases_in_hundredths(folder: Path, content: Content) -> None:
    assert content.robustness is not None
    columns = content.robustness.tables["worst_cases"].columns()
    found = [text for text in svg(folder / "heatmap.svg") if re.fullmatch(r"\d+", text)]
    attacked = [
        score for score, share in zip(columns["score"], columns["share"], strict=True) if share
    ]
    assert sorted(found) == sorted(f"{100 * score:.0f}" for score in attacked)
