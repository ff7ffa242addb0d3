"""`roletrust report`: its files against the file of a run."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from refusals import assert_names
from report_run import SHOWN, SUITE, lines, random_cells, small_suite, write_run

from roletrust_env.benchmarking.leaderboard import COLUMNS, Leaderboard
from roletrust_env.evaluation.specs import is_own_model
from roletrust_experiments.report.files import report


def test_files_hold_the_numbers_of_the_run(folder: Path) -> None:
    for name in SHOWN:
        assert lines(folder, name)
        assert (folder / "out" / f"{name}.png").stat().st_size > 5000
        document = (folder / "out" / f"{name}.pdf").read_bytes()
        assert b"/Type3" not in document
        assert b"/FontFile2" in document  # the font itself, as TrueType
    board = Leaderboard.read(folder / "results.sqlite")
    for line, row in zip(lines(folder, "leaderboard"), board.rows, strict=True):
        assert (line["model"], line["rule"], int(line["rank"])) == (row.model, row.rule, row.rank)
        for name in ("worst", "gain", "clean"):
            assert float(line[name]) == pytest.approx(row.estimates[name].mean, abs=1e-6)
    cases = lines(folder, "worst_cases")
    assert len(cases) == len(board.worst_cases) == len(SUITE.entrants) * len(SUITE.settings)
    for line in cases:
        case = board.worst_cases[line["model"], line["rule"], line["setting"]]
        assert (line["attack"], line["method"]) == (case.attack, case.method)
        assert float(line["skill"]) == pytest.approx(case.skill, abs=1e-6)


def test_regimes_compare_settings_with_both_kinds_of_reports(folder: Path) -> None:
    rows = lines(folder, "regimes")
    board = Leaderboard.read(folder / "results.sqlite")
    assert [(row["model"], row["rule"]) for row in rows] == [
        (row.model, row.rule) for row in board.rows
    ]
    for row in rows:
        verified, open_ = (
            board.worst_cases[row["model"], row["rule"], name].scores["skill"]
            for name in ("raters", "raters-open")
        )
        gap = open_ - verified
        # Student's distribution with 2 degrees of freedom
        half = 4.302653 * gap.std(ddof=1) / np.sqrt(3)
        for name, value in (
            ("verified", verified.mean()),
            ("open", open_.mean()),
            ("difference", gap.mean()),
            ("difference_half_95", half),
        ):
            assert float(row[name]) == pytest.approx(value, abs=2e-6)


def test_a_run_without_pairs_of_settings_has_no_regimes(tmp_path: Path) -> None:
    suite = small_suite(settings={"liars": {"roles": ["SR"], "share": 0.3}})
    file = write_run(tmp_path / "results.sqlite", suite, random_cells(suite))
    printed("report", file, "--out", tmp_path / "out")
    assert lines(tmp_path, "regimes") == []
    assert 'id="regimes"' not in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_curve_is_the_regret_of_the_rounds_of_the_worst_case(folder: Path) -> None:
    board, rows = Leaderboard.read(folder / "results.sqlite"), lines(folder, "curves")
    longest = max(world.max_cycles for world in SUITE.worlds.worlds("measured"))
    assert len(rows) == 3 * len(SUITE.entrants)
    for row in rows:
        case = board.worst_cases[row["model"], row["rule"], row["setting"]]
        values = [float(x) for x in row["regret"].split()]
        assert row["attack"] == case.attack
        assert len(values) == longest
        assert values == pytest.approx(list(case.by_round))


def test_the_page_needs_nothing_from_outside_and_escapes_text(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "<script src" not in page
    assert "<script>alert" not in page
    both = f"{folder / 'results.sqlite'} {folder / 'learners.sqlite'}"
    assert page.count(f"<code>roletrust report {both} --out {folder / 'out'}</code>") == 5
    command = f"roletrust benchmark mean block --suite small.toml --out {folder}"
    assert page.count(f"<code>{command}</code>") == 3
    assert page.count(f"<code>roletrust benchmark --suite large.toml --out {folder}</code>") == 2


def test_the_page_has_the_settings_and_the_distribution_of_the_worlds(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    worlds = page.partition('id="worlds"')[2].partition("</section>")[0]
    for name in (*SUITE.settings, *SUITE.worlds.set):
        assert name in worlds
    assert "8, &#34;high&#34;: 12" in worlds


def test_rows_lead_to_the_pages_of_the_models(folder: Path, tmp_path: Path) -> None:
    suite = small_suite(models=["mean", "block", "roletrust_env.trust.models:Mean"])
    file = write_run(tmp_path / "results.sqlite", suite, random_cells(suite))
    report(file, tmp_path / "out", pages="../models/")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for name in suite.model_names:
        link = f'<a href="../models/{name.partition(":")[0]}.html">{name}</a>'
        assert (link in page) == is_own_model(name)
    assert "../models" not in (folder / "out" / "report.html").read_text(encoding="utf-8")


def test_a_failed_cell_is_a_warning_and_the_others_count(folder: Path, tmp_path: Path) -> None:
    suite = small_suite()
    stored = random_cells(suite)
    failed = stored[1]
    stored[1] = failed._replace(result=failed.result._replace(rows=(), failed="division by <b>"))
    file = write_run(tmp_path / "results.sqlite", suite, stored)
    printed("report", file, "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    warnings = page.partition('id="warnings"')[2]
    assert f"{failed.cell.key}: division by &lt;b&gt;" in warnings
    assert len(lines(tmp_path, "worst_cases")) == len(stored) - 1
    (row,) = [row for row in lines(tmp_path, "leaderboard") if row["missing"] == "1"]
    assert (row["model"], row["rule"]) == failed.cell[:2]


def test_every_file_that_the_page_links_to_is_there(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    links = set(re.findall(r'href="([^#"]+\.\w+)"', page))
    assert {"worst_cases.csv", "curves.pdf", "regimes.csv", "learners.csv"} <= links
    assert [link for link in links if not (folder / "out" / link).is_file()] == []


def test_learners_alone_have_a_page(folder: Path, tmp_path: Path) -> None:
    printed("report", folder / "learners.sqlite", "--out", tmp_path / "out")
    files = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.*")}
    assert files == {"report.html", "learners.csv", "learners.png", "learners.pdf"}
    assert (tmp_path / "out" / "learners.csv").read_bytes() == (
        folder / "out" / "learners.csv"
    ).read_bytes()


def test_the_leaderboard_in_markdown_has_the_numbers_of_the_other(folder: Path) -> None:
    text = (folder / "out" / "leaderboard.md").read_text(encoding="utf-8")
    assert f"`roletrust benchmark mean block --suite small.toml --out {folder}`" in text
    found = list(csv.reader(re.findall(r"^\| +\d.*\|$", text, re.M), delimiter="|"))
    for line, row in zip(found, lines(folder, "leaderboard"), strict=True):
        _, tier, rank, model, *numbers, _ = (cell.strip() for cell in line)
        assert (tier, rank, model) == (row["tier"], row["rank"], f"`{row['model']}`")
        shown = [column.name for column in COLUMNS if column.shown]
        for number, name in zip(numbers[: len(shown)], shown, strict=True):
            assert number.split()[0] == f"{float(row[name]):.3f}"


def test_a_file_without_results_is_refused(folder: Path, tmp_path: Path) -> None:
    write_run(tmp_path / "empty.sqlite", small_suite(), [])
    for name in ("none.sqlite", "empty.sqlite"):
        result = printed("report", tmp_path / name, "--out", tmp_path / "out", code=2)
        assert_names(result, tmp_path / name)
    result = printed("report", *2 * [folder / "results.sqlite"], "--out", tmp_path / "out", code=2)
    assert_names(result)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_no_table_is_cut_on_a_desktop(folder: Path, browser: Any) -> None:
    window = browser.new_page(viewport={"width": 1440, "height": 900})
    window.goto((folder / "out" / "report.html").as_uri())
    cut = (
        "() => [...document.querySelectorAll('.wide')].filter((e) => e.scrollWidth > "
        "e.clientWidth + 1).length"
    )
    assert window.evaluate(cut) == 0
    window.close()
