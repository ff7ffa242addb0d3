"""`roletrust report`: its files against the file of a run."""

import csv
import gzip
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from refusals import assert_names
from report_run import SHOWN, SUITE, lines, mean
from small_suites import small

from roletrust_env.benchmarking.cells import play_cell
from roletrust_env.benchmarking.store import ResultStore
from roletrust_env.evaluation.specs import is_own_model


def test_a_report_on_the_scale_of_skill_says_so(tmp_path: Path) -> None:
    suite = small(
        models=["mean", "constant"], attacks=["bad-mouthing"], methods=["scripted"], score="skill"
    )
    with ResultStore(tmp_path / "results.sqlite", suite) as store:
        for cell in suite.cells():
            store.add(cell, play_cell(suite, cell))
    printed("report", tmp_path / "results.sqlite", "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Worst-case skill" in page
    for name, column in (("breakdown", "score"), ("worst_cases", "score"), ("heatmap", "skill")):
        blind = [line for line in lines(tmp_path, name) if line["model"] == "constant"]
        assert blind
        assert all(abs(float(line[column])) < 1e-9 for line in blind)
    assert "Skill of each model in the worst case of every condition" in page
    assert "stands for a skill of 0.84" in page


def test_files_hold_the_numbers_of_the_run(folder: Path) -> None:
    for name in ("leaderboard", *SHOWN):
        assert lines(folder, name)
        assert (folder / "out" / f"{name}.png").stat().st_size > 5000
        document = (folder / "out" / f"{name}.pdf").read_bytes()
        assert b"/Type3" not in document
        assert b"/FontFile2" in document  # the font itself, as TrueType
    for line in lines(folder, "heatmap"):
        if line["condition"] == "market, raters 50%":
            expected = mean(folder, line["model"], line["attack"], "raters", 0.5)
            assert float(line["utility"]) == pytest.approx(expected, abs=1e-6)
    last = lines(folder, "leaderboard")[-1]
    assert last["model"] == "constant"
    start = [
        line
        for line in lines(folder, "breakdown")
        if line["where"] == "market, raters" and line["share"][0] == "0"
    ]
    assert {float(line["share"]) for line in start} == {0, 0.25, 0.5}


def test_worst_cases_are_the_lowest_scores_of_the_attacks_in_other_games(folder: Path) -> None:
    """One row for each model and condition, and the mean over the conditions with attackers is the
    headline."""
    rows = lines(folder, "worst_cases")
    conditions = {
        (cell.model, cell.scenario, cell.track, str(cell.share)) for cell in SUITE.cells()
    }
    found = [
        (row["model"], row["scenario"], row["track"], str(float(row["share"]))) for row in rows
    ]
    assert len(found) == len(conditions)
    assert set(found) == conditions
    assert {row["games"] for row in rows} == {str(SUITE.games)}
    for row in rows:
        where = row["model"], row["attack"], row["track"], float(row["share"])
        blind = mean(folder, *where, "blind")
        assert float(row["blind"]) == pytest.approx(blind, abs=1e-6)
        assert float(row["score"]) == pytest.approx(max(mean(folder, *where), blind), abs=1e-6)
    for line in lines(folder, "leaderboard"):
        own = [
            float(row["score"])
            for row in rows
            if row["model"] == line["model"] and float(row["share"])
        ]
        assert np.mean(own) == pytest.approx(float(line["worst"]), abs=1e-5)


def test_conditions_summarise_the_worst_cases(folder: Path) -> None:
    rows = [row for row in lines(folder, "worst_cases") if float(row["share"])]
    found = lines(folder, "conditions")
    assert len(found) == len(SUITE.conditions)
    for line, (scenario, track, share) in zip(found, SUITE.conditions, strict=True):
        scores = [
            float(row["score"])
            for row in rows
            if (row["scenario"], row["track"], float(row["share"])) == (scenario, track, share)
        ]
        assert line["condition"] == f"{scenario}, {track} {share:.0%}"
        for name, value in (
            ("mean", np.mean(scores)),
            ("least", min(scores)),
            ("spread", np.std(scores, ddof=1)),
        ):
            assert float(line[name]) == pytest.approx(value, abs=1e-5)
        assert 0 <= float(line["told_apart"]) <= 1
    assert "How well each condition tells models apart" in (
        folder / "out" / "report.html"
    ).read_text(encoding="utf-8")


def test_the_games_give_the_worst_cases_of_the_leaderboard(folder: Path) -> None:
    with gzip.open(folder / "out" / "games.csv.gz", "rt", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    lowest: dict[tuple[str, ...], tuple[float, float]] = {}
    for row in rows:
        if row["method"] not in ("nobody", "white-box planner"):
            chosen, trusted, blind = (
                float(np.mean([float(x) for x in row[name].split()]))
                for name in ("chosen_utility", "utility", "blind")
            )
            key = row["model"], row["scenario"], row["track"], row["share"]
            lowest[key] = min(lowest.get(key, (np.inf, np.inf)), (chosen, max(trusted, blind)))
    for line in lines(folder, "leaderboard"):
        own = [worst for (model, *_), (_, worst) in lowest.items() if model == line["model"]]
        assert np.mean(own) == pytest.approx(float(line["worst"]), abs=1e-4)


def test_a_curve_is_the_utility_of_the_rounds(folder: Path) -> None:
    for line in lines(folder, "curves"):
        values = [float(x) for x in line["utility"].split()]
        assert (
            len(values) == len(line["rounds"].split()) == 11
        )  # of 12 rounds; in the first nothing is known
        assert 0 <= min(values) <= max(values) <= 1


def test_the_page_needs_nothing_from_outside_and_takes_text_as_text(folder: Path) -> None:
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert "<script src" not in page
    assert "<script>alert" not in page
    both = f"{folder / 'results.sqlite'} {folder / 'learners.sqlite'}"
    assert page.count(f"<code>roletrust report {both} --out {folder / 'out'}</code>") == 7
    assert page.count(f"<code>roletrust benchmark --suite custom.toml --out {folder}</code>") == 5
    assert page.count(f"<code>roletrust benchmark --suite large.toml --out {folder}</code>") == 2


def test_rows_lead_to_the_pages_of_the_models(folder: Path, tmp_path: Path) -> None:
    printed("report", folder / "results.sqlite", "--pages", "../models/", "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "roletrust report" in page
    assert "--pages ../models/ --out" in page
    for name in SUITE.models:
        assert (
            f'<a href="../models/{name.partition(":")[0]}.html">{name}</a>' in page
        ) == is_own_model(name)
    assert "../models" not in (folder / "out" / "report.html").read_text(encoding="utf-8")


def test_replays_of_logs_have_a_column(folder: Path, tmp_path: Path) -> None:
    lines = ["log,sha256,round,protocol,model,measure,value,low,high"]
    lines += [f'otc,ab,9,attack,mean,"{goal}, 3 new",0.25,0.2,0.3' for goal in ("sink", "lift")]
    (tmp_path / "comparison.csv").write_text("\n".join(lines) + "\n")
    options = "--logs", str(tmp_path / "comparison.csv"), "--out", str(tmp_path / "out")
    printed("report", folder / "results.sqlite", *options)
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert '<td data-value="0.5">0.500<span class="half"> 0.45 to 0.55</span></td>' in page
    assert "--logs" in page
    assert "| 0.500 (0.450, 0.550) |" in (tmp_path / "out" / "leaderboard.md").read_text(
        encoding="utf-8"
    )


def test_every_file_that_the_page_links_to_is_there(folder: Path) -> None:
    links = set(
        re.findall(
            r'href="([^#"]+\.\w+)"', (folder / "out" / "report.html").read_text(encoding="utf-8")
        )
    )
    assert {"worst_cases.csv", "heatmap.pdf", "learners.csv"} <= links
    assert [link for link in links if not (folder / "out" / link).is_file()] == []


def test_learners_alone_have_a_page(folder: Path, tmp_path: Path) -> None:
    printed("report", folder / "learners.sqlite", "--out", tmp_path / "out")
    files = {str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("*.*")}
    assert files == {"report.html", "learners.csv", "learners.png", "learners.pdf"}
    assert (tmp_path / "out" / "learners.csv").read_bytes() == (
        folder / "out" / "learners.csv"
    ).read_bytes()


def test_the_leaderboard_in_markdown_has_the_numbers_of_the_other(folder: Path) -> None:
    text = (folder / "out" / "leaderboard.md").read_text(encoding="utf-8").splitlines()
    assert (
        text[0]
        == "| tier | rank | model | clean | worst | alike | worst attack | damage | alarms | AUC | holds |"  # noqa: E501
    )
    end = text.index("")
    assert f"Made by `roletrust benchmark --suite custom.toml --out {folder}`." in text[end + 1]
    assert [line.split("**")[1] for line in text[end + 3 :]][:3] == ["score", "tier", "clean"]
    for line, row in zip(text[2:end], lines(folder, "leaderboard"), strict=True):
        tier, rank, model, clean, worst, *_ = line.strip("| ").split(" | ")
        assert (tier, rank, model) == (row["tier"], row["rank"], f"`{row['model']}`")
        for found, name in ((clean, "clean"), (worst, "worst")):
            assert found == f"{float(row[name]):.3f} ± {float(row[f'{name}_half_95']):.3f}"


def test_what_treatment_costs_and_the_worlds_have_tables(folder: Path) -> None:
    moved, board = lines(folder, "moved"), lines(folder, "leaderboard")
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    for line, row in zip(moved, board, strict=True):
        assert [line[name] for name in ("model", "rank", "worst", "alike")] == [
            row[name] for name in ("model", "rank", "worst", "alike")
        ]
        assert float(line["loss"]) == pytest.approx(
            float(row["alike"]) - float(row["worst"]), abs=2e-6
        )
    assert [
        (line["scenario"], line["raters"], line["rounds"]) for line in lines(folder, "worlds")
    ] == [("market", "4", "12")]
    assert "What moves if providers treat raters differently" in page
    assert "The worlds" in page


def test_what_is_no_run_is_refused(folder: Path, tmp_path: Path) -> None:
    with ResultStore(tmp_path / "empty.sqlite", small()):
        pass
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
