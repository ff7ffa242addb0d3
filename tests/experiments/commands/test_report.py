"""`roletrust report`: the page in a real browser, and its files, against the file of a run."""

import csv
import gzip
import json
import os
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import large_run
import numpy as np
import pytest
from command_line import run
from small_suites import small

from roletrust_env.benchmark.cells import cells
from roletrust_env.benchmark.run_cell import play_cell
from roletrust_env.benchmark.store import Store

PATIENCE_MS = 240_000  # far more than a busy machine takes
SHOWN = {"heatmap": "cells", "curves": "lines", "breakdown": "points", "tradeoff": "points", "learners": "points"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of three models, one of learners whose numbers are drawn, and the report on both."""
    here = tmp_path_factory.mktemp("report")
    suite = small(models=["mean", "role-trust", "constant"], description="<script>alert(1)</script>")
    with Store(here / "results.sqlite", suite) as store:
        for cell in cells(suite):
            store.add(cell, play_cell(suite, cell))
    with Store(here / "learners.sqlite", large_run.learners()) as store:
        for trial, done in large_run.stored_trials(large_run.learners()):
            store.add(trial, done)
    made = run(
        "report", *(str(here / f"{name}.sqlite") for name in ("results", "learners")), "--out", str(here / "out")
    )
    assert made.exit_code == 0, made.output
    return here


def mean(folder: Path, model: str, attack: str, track: str, share: float, name: str = "utility") -> float:
    """Of what was measured, read from the file of the run by itself."""
    file = sqlite3.connect(folder / "results.sqlite")
    ((found,),) = file.execute(
        "SELECT measured FROM attacks JOIN cells ON attacks.cell = key WHERE cells.cell ->> 'model' = ? "
        "AND attack = ? AND cells.cell ->> 'track' = ? AND cells.cell ->> 'share' = ?",
        (model, attack, track, share),
    )
    file.close()
    return float(np.mean([x for x in json.loads(found)[name] if x is not None]))


def lines(folder: Path, name: str) -> list[dict[str, str]]:
    return list(csv.DictReader((folder / "out" / f"{name}.csv").open(encoding="utf-8")))


def test_a_report_on_the_scale_of_skill_says_so(tmp_path: Path) -> None:
    suite = small(models=["mean", "constant"], attacks=["bad-mouthing"], rungs=["scripted"], score="skill")
    with Store(tmp_path / "results.sqlite", suite) as store:
        for cell in cells(suite):
            store.add(cell, play_cell(suite, cell))
    made = run("report", str(tmp_path / "results.sqlite"), "--out", str(tmp_path / "out"))
    assert made.exit_code == 0, made.output
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Worst-case skill" in page
    assert "never as less" not in page
    worst = [line for line in lines(tmp_path, "breakdown") if line["model"] == "constant"]
    assert worst
    assert all(abs(float(line["score"])) < 1e-9 for line in worst)


def test_files_hold_the_numbers_of_the_run(folder: Path) -> None:
    for name in ("leaderboard", *SHOWN):
        assert lines(folder, name)
        assert (folder / "out" / f"{name}.png").stat().st_size > 5000
    for line in lines(folder, "heatmap"):
        if line["condition"] == "market, raters 50%":
            expected = mean(folder, line["model"], line["attack"], "raters", 0.5)
            assert float(line["utility"]) == pytest.approx(expected, abs=1e-6)
    last = lines(folder, "leaderboard")[-1]
    assert last["model"] == "constant"
    start = [
        line for line in lines(folder, "breakdown") if line["where"] == "market, raters" and line["share"][0] == "0"
    ]
    assert {float(line["share"]) for line in start} == {0, 0.25, 0.5}


def test_the_games_give_the_worst_cases_of_the_leaderboard(folder: Path) -> None:
    with gzip.open(folder / "out" / "games.csv.gz", "rt", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lowest: dict[tuple[str, ...], tuple[float, float]] = {}
    for row in rows:
        if row["rung"] not in ("nobody", "white-box planner"):
            chosen, trusted, blind = (
                float(np.mean([float(x) for x in row[name].split()])) for name in ("chosen_utility", "utility", "blind")
            )
            key = row["model"], row["scenario"], row["track"], row["share"]
            lowest[key] = min(lowest.get(key, (np.inf, np.inf)), (chosen, max(trusted, blind)))
    for line in lines(folder, "leaderboard"):
        own = [worst for (model, *_), (_, worst) in lowest.items() if model == line["model"]]
        assert np.mean(own) == pytest.approx(float(line["worst"]), abs=1e-4)


def test_a_curve_is_the_utility_of_the_rounds(folder: Path) -> None:
    for line in lines(folder, "curves"):
        values = [float(x) for x in line["utility"].split()]
        assert len(values) == len(line["rounds"].split()) == 11  # of 12 rounds; in the first nothing is known
        assert 0 <= min(values) <= max(values) <= 1


def test_the_page_needs_nothing_from_outside_and_takes_text_as_text(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "<script src" not in page
    assert "<script>alert" not in page
    both = f"{folder / 'results.sqlite'} {folder / 'learners.sqlite'}"
    assert page.count(f"<code>roletrust report {both} --out {folder / 'out'}</code>") == 7
    assert page.count(f"<code>roletrust benchmark --suite custom.toml --out {folder}</code>") == 5
    assert page.count(f"<code>roletrust benchmark --suite large.toml --out {folder}</code>") == 2


def test_learners_alone_have_a_page(folder: Path, tmp_path: Path) -> None:
    made = run("report", str(folder / "learners.sqlite"), "--out", str(tmp_path / "out"))
    assert made.exit_code == 0, made.output
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"report.html", "learners.csv", "learners.png"}
    for name in ("learners.csv", "learners.png"):
        assert (tmp_path / "out" / name).read_bytes() == (folder / "out" / name).read_bytes()


def test_the_leaderboard_in_markdown_has_the_numbers_of_the_other(folder: Path) -> None:
    text = (folder / "out" / "leaderboard.md").read_text(encoding="utf-8").splitlines()
    assert text[0] == "| rank | model | clean | worst | worst attack | damage | alarms | AUC | holds |"
    assert f"Made by `roletrust benchmark --suite custom.toml --out {folder}`." in text[-1]
    for line, row in zip(text[2:-2], lines(folder, "leaderboard"), strict=True):
        rank, model, clean, worst, *_ = line.strip("| ").split(" | ")
        assert (rank, model) == (row["rank"], f"`{row['model']}`")
        for found, name in ((clean, "clean"), (worst, "worst")):
            assert found == f"{float(row[name]):.3f} ± {float(row[f'{name}_half_95']):.3f}"


def test_what_is_no_run_is_refused(folder: Path, tmp_path: Path) -> None:
    with Store(tmp_path / "empty.sqlite", small()):
        pass
    for name, said in (("none.sqlite", "there is no"), ("empty.sqlite", "no attack")):
        refused = run("report", str(tmp_path / name), "--out", str(tmp_path / "out"))
        assert refused.exit_code == 2
        assert said in refused.output
    refused = run("report", *2 * [str(folder / "results.sqlite")], "--out", str(tmp_path / "out"))
    assert refused.exit_code == 2
    assert "both of a suite for robustness; a report has one of each kind" in " ".join(refused.output.split())
    assert not (tmp_path / "out").exists()


@pytest.fixture(params=["light", "dark", "phone"])
def page(request: pytest.FixtureRequest, browser: Any, folder: Path) -> Iterator[Any]:
    """The page, ready; what its console complained of is an error."""
    size = {"width": 390 if request.param == "phone" else 1100, "height": 900}
    found = browser.new_page(viewport=size, color_scheme="dark" if request.param == "dark" else "light")
    found.set_default_timeout(PATIENCE_MS)
    wrong: list[str] = []
    found.on("pageerror", lambda error: wrong.append(str(error)))
    found.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
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
        assert page.locator(f"#{name} .legend li").count() or name == "heatmap"
        assert page.locator(f"#{name} canvas").count()
    # First the worst case of each condition.
    cells = data("heatmap")
    assert cells["worst"] == [True] * len(cells["model"])
    assert cells["column"] == cells["condition"]
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
    page.focus("#board thead button >> nth=0")
    page.keyboard.press("Enter")
    assert page.locator("#board tbody th").first.inner_text() == "constant"


def test_dark_is_dark(browser: Any, folder: Path) -> None:
    page = browser.new_page(color_scheme="dark")
    page.set_default_timeout(PATIENCE_MS)
    page.goto((folder / "out" / "report.html").as_uri())
    page.wait_for_selector("html[data-ready]")
    for scheme, ink in (("dark", "#e6edf3"), ("light", "#1f2328")):
        page.emulate_media(color_scheme=scheme)
        page.wait_for_function(f"plots.curves.left[0].major_label_text_color === '{ink}'")
    page.close()
