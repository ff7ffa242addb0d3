"""Figures and tables of a report for papers, and names that LaTeX, Matplotlib or a page could take for commands."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import large_run
import pytest

from roletrust_experiments.report.content import Content, Learners
from roletrust_experiments.report.figures import COLUMN, write_figures
from roletrust_experiments.report.latex import escape, latex_table
from roletrust_experiments.report.robustness import Robustness

MODELS = ["exec:a$_b$ [x]_%&#", "$$\\frac{x}{y}$$ <b>mean</b>", "@score {safe} ~^"]
ATTACK = "x:Y$_$[red]"
NAMES = ["breakdown", "curves", "heatmap", "leaderboard", "learners", "tradeoff"]


@pytest.fixture(scope="module")
def content() -> Content:
    suite = large_run.large(models=MODELS, attacks=[ATTACK], methods=["scripted"], name="odd\n\\input{x}")
    learners = large_run.learners()
    return Content(
        Robustness.of(suite, large_run.stored_cells(suite), {}, Path("results.sqlite")),
        Learners.of(learners, large_run.stored_trials(learners), {}, Path("results.sqlite")),
    )


@pytest.fixture(scope="module")
def folder(content: Content, tmp_path_factory: pytest.TempPathFactory) -> Path:
    here = tmp_path_factory.mktemp("paper")
    write_figures(here, content, COLUMN, ".pdf", ".svg")
    return here


def svg(path: Path) -> tuple[list[str], dict[str, Any]]:
    """The texts of a file, and the attributes of its root."""
    root = ElementTree.parse(path).getroot()
    return [node.text or "" for node in root.iter("{http://www.w3.org/2000/svg}text")], root.attrib


def test_every_figure_is_a_column_wide_and_its_text_is_text(folder: Path) -> None:
    assert sorted(path.stem for path in folder.glob("*.pdf")) == sorted(path.stem for path in folder.glob("*.svg"))
    assert sorted(path.stem for path in folder.glob("*.pdf")) == NAMES
    for name in NAMES:
        texts, root = svg(folder / f"{name}.svg")
        assert float(root["width"].removesuffix("pt")) == pytest.approx(72 * COLUMN.width)
        assert len(texts) > 5
        document = (folder / f"{name}.pdf").read_bytes()
        box = re.search(rb"/MediaBox \[ ?0 0 ([\d.]+) ", document)
        assert box is not None
        assert float(box[1]) == pytest.approx(72 * COLUMN.width)
        assert b"/Type3" not in document
        assert b"/FontFile2" in document  # the font itself, as TrueType


def test_names_stand_in_figures_as_they_are(folder: Path) -> None:
    for name in ("heatmap", "curves", "breakdown", "tradeoff"):
        assert set(MODELS) <= set(svg(folder / f"{name}.svg")[0]), name


def test_a_heat_map_has_the_worst_cases_in_hundredths(folder: Path, content: Content) -> None:
    assert content.robustness is not None
    columns = content.robustness.tables["worst_cases"].columns()
    found = [text for text in svg(folder / "heatmap.svg")[0] if re.fullmatch(r"\d+", text)]
    attacked = [score for score, share in zip(columns["score"], columns["share"], strict=True) if share]
    assert sorted(found) == sorted(f"{100 * score:.0f}" for score in attacked)


def test_the_table_has_the_leaderboard_and_no_command_of_a_name(content: Content) -> None:
    assert content.robustness is not None
    board = content.robustness.leaderboard
    text = latex_table(board, "roletrust report")
    lines = [line for line in text.splitlines() if not line.startswith("%")]
    assert not any("input" in line for line in lines)
    start, end = lines.index(r"\midrule"), lines.index(r"\bottomrule")
    for line, row in zip(lines[start + 1 : end], board.rows, strict=True):
        tier, rank, model, clean, worst, attack, *rest = re.split(r"(?<!\\) & ", line.removesuffix(r" \\"))
        assert (tier, rank, model) == (str(row.tier), str(row.rank), escape(row.model))
        assert clean == rf"{row.clean.mean:.3f} $\pm$ {row.clean.half:.3f}"
        assert worst == rf"{row.worst.mean:.3f} $\pm$ {row.worst.half:.3f}"
        assert attack == escape(f"{row.worst_attack} ({row.worst_condition})")
        assert len(rest) == 4
    assert lines[0] == r"\begin{tabular}{@{}rrlrrlrrrr@{}}"


def test_latex_prints_special_letters() -> None:
    assert escape("a_b%c&d#e$f{g}") == r"a\_b\%c\&d\#e\$f\{g\}"
    assert escape("\\x^~") == r"\textbackslash{}x\textasciicircum{}\textasciitilde{}"
    assert escape("<|>") == r"\textless{}\textbar{}\textgreater{}"
