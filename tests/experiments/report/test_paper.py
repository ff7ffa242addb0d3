"""Figures and page of a report, and names that Matplotlib or a page could take for commands."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import large_run
import numpy as np
import pytest
from report_run import random_cells, small_suite

from roletrust_env.benchmarking.suite import Suite
from roletrust_env.benchmarking.suite_files import load_suite
from roletrust_experiments.report.board import TrustModels, label
from roletrust_experiments.report.content import Content, Learners
from roletrust_experiments.report.figures import leaderboard_figure, write_figures
from roletrust_experiments.report.page import page

MODELS = ["exec:a$_b$ [x]_%&#", "$$\\frac{x}{y}$$ <b>mean</b>", "@score {safe} ~^"]
NAMES = ["curves", "leaderboard", "learners", "worst_cases"]
MEGABYTE = 1_000_000
SOFTWARE: dict[str, Any] = {
    "package": {"name": "it", "version": "0"},
    "python": "3",
    "packages": {},
}


def content_of(suite: Suite) -> Content:
    """Return a report on random numbers, with learners."""
    learners, path = large_run.learners(), Path("results.sqlite")
    return Content(
        TrustModels.of(suite, random_cells(suite), SOFTWARE, path),
        Learners.of(learners, large_run.stored_trials(learners), SOFTWARE, path),
    )


@pytest.fixture(scope="module")
def content() -> Content:
    return content_of(
        small_suite(models=MODELS, own=[MODELS[0], "solo-threshold"], name="odd\n\\input{x}")
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


def test_names_stand_in_figures_as_they_are(folder: Path, content: Content) -> None:
    assert content.models is not None
    assert set(MODELS) <= set(svg(folder / "worst_cases.svg"))
    assert label(MODELS[0], "own") in svg(folder / "worst_cases.svg")
    assert set(content.models.first) <= set(svg(folder / "curves.svg"))


def test_a_heat_map_has_the_worst_cases_in_hundredths(folder: Path, content: Content) -> None:
    assert content.models is not None
    found = [text for text in svg(folder / "worst_cases.svg") if re.fullmatch(r"\d+", text)]
    skills = [case.skill for case in content.models.board.worst_cases.values()]
    assert sorted(found) == sorted(f"{100 * skill:.0f}" for skill in skills)


def test_a_picture_has_worst_clean_and_solo_of_each_choice_rule(content: Content) -> None:
    assert content.models is not None
    rows = content.models.board.rows
    axes = leaderboard_figure(rows).axes
    assert len(axes) == 2
    for panel, rule in zip(axes, ("common", "own"), strict=True):
        own = [row for row in rows if row.rule == rule]
        names = [text.get_text() for text in panel.get_yticklabels()]
        assert names == [f"{row.rank}  {row.model}" for row in own]
        solo = next(row for row in own if row.model == content.models.suite.solo[row.rule])
        drawn = {str(line.get_label()): np.asarray(line.get_xdata()) for line in panel.lines}
        assert drawn["worst case of solo"] == pytest.approx(solo.estimates["worst"].mean)
        for part, name in zip(panel.containers, ("clean", "worst"), strict=True):
            points, _, (bars,) = part.lines
            ends = np.array([segment[:, 0] for segment in bars.get_segments()])
            for row, x, (low, high) in zip(own, points.get_xdata(), ends, strict=True):
                mean, half, _ = row.estimates[name]
                assert (x, low, high) == pytest.approx((mean, mean - half, mean + half))


def test_the_page_of_the_largest_suite_is_light_and_has_every_worst_case() -> None:
    suite = load_suite("standard")
    assert isinstance(suite, Suite)
    content = content_of(suite)
    html = page(content, dict.fromkeys(NAMES, b""), "roletrust report")
    assert len(html) < MEGABYTE
    found = re.search(r'<details class="numbers">(.*?)</details>', html, re.DOTALL)
    assert found is not None
    assert found[1].count('<th scope="row">') == len(suite.entrants) * len(suite.settings)
