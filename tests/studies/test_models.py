import numpy as np
import pytest
from csv_files import csv_rows

from roletrust_env import make_scenario, trust_models
from roletrust_env.evaluation.curves import Curves
from roletrust_env.world.roster import Roster
from studies.models import Panel, mean_lines, models_figure
from studies.study import run

pytestmark = pytest.mark.slow


def drawn(folder):
    """The mean trust of each line over the time of the attack, by model, attack, trust and
    whose."""
    found = {}
    for row in csv_rows(folder / "models.csv"):
        key = row["trust_model"], row["attack"].split()[0], row["trust"], row["whose"]
        found.setdefault(key, []).append(float(row["mean"]))
    return {key: np.mean(values[35:90]) for key, values in found.items()}


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    out = tmp_path_factory.mktemp("models")
    models = [
        word for name in ("role-trust", "mean", "median", "constant") for word in ("--model", name)
    ]
    run("studies.models", [*models, "--games", "1", "--out", str(out)])
    return out


def test_the_page_tells_models_apart(page):
    trust = drawn(page)
    assert trust["mean", "4", "ToP", "honest"] == pytest.approx(0.6, abs=0.02)  # four of ten rate 0
    assert trust["median", "4", "ToP", "honest"] > 0.98
    assert (
        trust["median", "a", "ToP", "attackers"]
        < 0.1
        < 0.3
        < trust["mean", "a", "ToP", "attackers"]
    )
    assert trust["role-trust", "4", "ToR", "attackers"] < trust["role-trust", "4", "ToR", "honest"]
    assert {value for key, value in trust.items() if key[0] == "constant"} == {0.5}
    assert ("mean", "4", "ToR", "honest") not in trust  # it rates no raters
    assert ("role-trust", "one", "ToR", "attackers") not in trust


def test_there_is_a_row_for_every_model():
    time_s, lines = (
        np.arange(1.0, 5.0),
        {("ToP", "honest"): np.ones(4), ("ToR", "attackers"): np.zeros(4)},
    )
    panels = {
        name: {attack: Panel(time_s, lines, (2, 3)) for attack in "abc"} for name in trust_models()
    }
    figure = models_figure(panels, dict.fromkeys(panels, "central"), "a note")
    assert [axes.get_ylabel() for axes in figure.axes[::3]] == list(trust_models())
    assert [axes.get_title() for axes in figure.axes[:3]] == ["a", "b", "c"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "honest providers, ToP",
        "attacking raters, ToR",
    ]


def test_lines_are_means_over_agents_and_games_that_are_there():
    roster = Roster.of(make_scenario("paper-3x3"))
    top = np.array([[[0.2, 0.4], [0.6, np.nan], [0.9, 0.9]]])
    curves = Curves(*[np.ones((1, 3, 2))] * 2, top, *[np.ones((1, 6, 2))] * 2, top)
    lines = mean_lines(roster, curves, ["sp_2"], rates_raters=False)
    assert lines == {
        ("ToP", "honest"): pytest.approx([0.4]),
        ("ToP", "attackers"): pytest.approx([0.9]),
    }
