"""Files of figures: names are plain text, and equal figures give equal bytes."""

from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib import rc_context
from matplotlib.figure import Figure
from PIL import Image

from roletrust_experiments.plots.figure_files import write_figure

NAME = "exec:a$_b$ [x]"  # as a formula it is an error


def drawn() -> Figure:
    figure = Figure(figsize=(3, 2))
    axes = figure.subplots()
    axes.plot([1, 1000], [1, 2], label=NAME)
    axes.set_xscale("log")
    axes.set_title(NAME)
    axes.set_yticks([1], [NAME])
    axes.legend()
    figure.suptitle(NAME)
    return figure


def texts(path: Path) -> list[str]:
    """The texts of an SVG file; a text that is drawn as a formula is none of them."""
    return [
        node.text or "" for node in ElementTree.parse(path).iter("{http://www.w3.org/2000/svg}text")
    ]


def test_names_are_no_formulas_and_numbers_of_logarithmic_axes_are(tmp_path: Path) -> None:
    with rc_context({"svg.fonttype": "none"}):
        write_figure(tmp_path / "it.svg", drawn())
    found = texts(tmp_path / "it.svg")
    assert found.count(NAME) == 4
    assert not any("mathdefault" in text for text in found)


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_equal_figures_give_equal_bytes(
    tmp_path: Path, suffix: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with rc_context({"svg.hashsalt": "it"}):
        for name, time in (("one", "0"), ("other", "1000000000")):
            monkeypatch.setenv("SOURCE_DATE_EPOCH", time)
            write_figure(tmp_path / f"{name}.{suffix}", drawn())
    assert (tmp_path / f"one.{suffix}").read_bytes() == (tmp_path / f"other.{suffix}").read_bytes()


def test_fewer_colours_make_a_smaller_file_that_looks_alike(tmp_path: Path) -> None:
    write_figure(tmp_path / "all.png", drawn())
    write_figure(tmp_path / "few.png", drawn(), colours=64)
    whole, few = (Image.open(tmp_path / f"{name}.png") for name in ("all", "few"))
    assert len(few.convert("RGB").getcolors()) <= 64
    assert whole.convert("RGB").getcolors(64) is None  # more than these
    assert (tmp_path / "few.png").stat().st_size < (tmp_path / "all.png").stat().st_size
    difference = np.abs(np.asarray(whole.convert("RGB"), int) - np.asarray(few.convert("RGB"), int))
    assert difference.mean() < 1
