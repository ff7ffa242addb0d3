"""The page of `roletrust report` in a real browser, against the file of a run."""

import json
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_run import SHOWN, lines, mean

PATIENCE_MS = 240_000  # far more than a busy machine takes


@pytest.fixture(params=["light", "dark", "phone"])
def page(request: pytest.FixtureRequest, browser: Any, folder: Path) -> Iterator[Any]:
    """The page, ready; what its console complained of is an error."""
    size = {"width": 390 if request.param == "phone" else 1100, "height": 900}
    found = browser.new_page(viewport=size, color_scheme="dark" if request.param == "dark" else "light")
    found.set_default_timeout(PATIENCE_MS)
    wrong: list[str] = []
    found.on("pageerror", lambda error: wrong.append(str(error)))
    found.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
    found.on(
        "request", lambda asked: None if asked.url.startswith(("file:", "data:", "blob:")) else wrong.append(asked.url)
    )
    found.goto((folder / "out" / "report.html").as_uri())
    found.wait_for_selector("html[data-ready]")
    yield found
    if shots := os.environ.get("SCREENSHOTS"):  # a folder, to look at them
        found.screenshot(path=f"{shots}/{request.param}.png", full_page=True)
    found.close()
    assert wrong == []


def test_in_a_browser_every_figure_has_data_and_every_control_works(page: Any, folder: Path) -> None:
    def data(name: str) -> dict[str, list[Any]]:
        return page.evaluate(
            "([n, s]) => Object.fromEntries(Object.entries(source(n, s).data).map(([k, v]) => [k, [...v]]))",
            [name, SHOWN[name]],
        )

    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    for name in SHOWN:
        assert data(name)["learner" if name == "learners" else "model"], name
        assert page.locator(f"#{name} .legend li").count() or name in ("heatmap", "worst_cases")
        assert page.locator(f"#{name} canvas").count()
    # First the worst case of each condition.
    cells = data("heatmap")
    assert cells["worst"] == [True] * len(cells["model"])
    assert cells["column"] == cells["condition"]
    # Each model by itself, as it counts; and the curves open where each model is weakest.
    assert set(data("worst_cases")["model"]) == {"role-trust"}
    page.select_option("#worst_cases select", "constant")
    cells = data("worst_cases")
    expected = [line for line in lines(folder, "worst_cases") if line["model"] == "constant"]
    assert cells["score"] == pytest.approx([float(line["score"]) for line in expected], abs=1e-4)
    assert cells["row"] == [f"market, {line['track']}" for line in expected]
    assert [float(column.strip("%")) / 100 for column in cells["column"]] == [float(row["share"]) for row in expected]
    curves, board = data("curves"), lines(folder, "leaderboard")
    assert dict(zip(curves["model"], curves["condition"], strict=True)) == {
        row["model"]: row["worst_condition"] for row in board
    }
    # Intervals end inside the axes.
    start, end = page.evaluate("[plots.breakdown.y_range.start, plots.breakdown.y_range.end]")
    points = data("breakdown")
    assert start < min(points["low"]) <= max(points["high"]) < end
    # The choice of a condition, and the numbers against the run's.
    page.select_option("#heatmap select", "market, raters 25%")
    cells = data("heatmap")
    assert set(cells["condition"]) == {"market, raters 25%"}
    for model, attack, value in zip(cells["model"], cells["attack"], cells["utility"], strict=True):
        assert value == pytest.approx(mean(folder, model, attack, "raters", 0.25), abs=1e-4)
    page.select_option("#curves select >> nth=0", "market, raters 50%")
    page.select_option("#curves select >> nth=1", "bad-mouthing")
    assert set(data("curves")["attack"]) == {"bad-mouthing"}
    page.select_option("#curves select >> nth=1", "every attack")
    assert len(set(data("curves")["attack"])) > 10
    # Learners, by task, against what their trials scored: share 0 is 0.05, and 1 is 0.7.
    page.select_option("#learners select", "provider")
    points = data("learners")
    assert points["share"] == pytest.approx([(score - 0.05) / 0.65 for score in points["score"]], abs=0.05)
    file = sqlite3.connect(folder / "learners.sqlite")
    for learner, budget, score in zip(points["learner"], points["budget"], points["score"], strict=True):
        scored = file.execute("SELECT measured FROM attacks WHERE cell LIKE ?", (f"provider|{learner}|{budget}|%",))
        assert score == pytest.approx(np.mean([json.loads(found)["score"] for (found,) in scored]), abs=1e-4)
    file.close()
    page.uncheck(".chooser[data-who=learner] input[value=SAC]")
    assert "SAC" not in data("learners")["learner"]
    assert page.locator("#learners .legend li").count() == 5
    page.click("#learners-board thead button >> nth=0")
    assert page.locator("#learners-board tbody td").first.inner_text() == "6"
    # The models of the lower figures.
    page.uncheck(".chooser[data-who=model] input[value=constant]")
    for name in ("curves", "breakdown", "tradeoff"):
        assert set(data(name)["model"]) <= {"mean", "role-trust"}
    page.click(".chooser[data-who=model] [data-choose='0']")
    assert data("breakdown")["model"] == []
    # The numbers as a table, by keyboard.
    page.focus("#heatmap .numbers summary")
    page.keyboard.press("Enter")
    page.wait_for_selector("#heatmap .numbers tbody tr")
    assert page.locator("#heatmap .numbers tbody tr").count() == len(cells["model"])
    # The leaderboard is filtered, and sorted by keyboard.
    page.fill("#filter", "role")
    assert page.locator("#board tbody tr:visible").count() == 1
    page.fill("#filter", "")
    page.focus("#board thead button >> nth=1")
    page.keyboard.press("Enter")
    assert page.locator("#board tbody th").first.inner_text() == "constant"


def test_a_tooltip_has_a_point_of_the_line_and_not_the_place_of_the_mouse(browser: Any, folder: Path) -> None:
    page = browser.new_page(viewport={"width": 1100, "height": 900})
    page.set_default_timeout(PATIENCE_MS)
    page.goto((folder / "out" / "report.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    page.locator("#curves .figure").scroll_into_view_if_needed()
    place = page.locator("#curves canvas").first.bounding_box()
    values = page.evaluate("source('curves', 'lines').data.ys.flat()")
    shown = ""
    for k in range(200):
        page.mouse.move(place["x"] + 0.43 * place["width"], place["y"] + k / 200 * place["height"])
        found = page.locator(".bk-tooltip-row-value").all_inner_texts()
        if found:
            shown = " ".join(found)
            break
    page.close()
    *_, turn, utility = shown.split()
    assert float(turn) in range(2, 13)  # no round is between two others
    assert min(abs(float(utility) - value) for value in values) < 6e-4


def test_dark_is_dark(browser: Any, folder: Path) -> None:
    page = browser.new_page(color_scheme="dark")
    page.set_default_timeout(PATIENCE_MS)
    page.goto((folder / "out" / "report.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    for scheme, ink in (("dark", "#e6edf3"), ("light", "#1f2328")):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(f"plots.curves.left[0].major_label_text_color === '{ink}'")
    page.close()
