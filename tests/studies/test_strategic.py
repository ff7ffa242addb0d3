"""Strategic agents, in few rounds."""

import numpy as np
import pytest
from csv_files import csv_rows

from studies.strategic import STARTS, price_of_anarchy
from studies.study import run

pytestmark = pytest.mark.slow

FEW = (
    "--scenario",
    "crowd",
    "--cost",
    "0.1",
    "--runs",
    "2",
    "--steps",
    "2",
    "--games",
    "2",
    "--workers",
    "1",
)


def test_every_population_has_a_row(tmp_path, capsys):
    run(
        "studies.strategic",
        ["--model", "beta", "--model", "constant", *FEW, "--out", str(tmp_path)],
    )
    found = csv_rows(tmp_path / "strategic.csv")
    assert [(row["model"], row["start"]) for row in found] == [
        (m, s) for m in ("beta", "constant") for s in STARTS
    ]
    assert {"welfare_half_95", "provider_gain_half_95", "moved_half_95"} < set(found[0])
    calm = found[0]
    assert float(calm["honest_providers"]) == float(calm["honest_raters"]) == 1
    assert float(calm["rater_gain"]) == 0  # beta has no trust in raters
    assert 0.9 < float(calm["anarchy"]) < 1.2
    assert (
        float(found[4]["provider_gain"]) > 0.05
    )  # under a constant trust no service is the best one
    assert "level 0" in found[4]["provider_deviation"]
    page = (tmp_path / "strategic.md").read_text()
    assert page.startswith("| world | model | start | gain, provider |")
    assert page in capsys.readouterr().out
    assert (tmp_path / "strategic.png").stat().st_size > 1000


def test_the_price_of_anarchy_has_an_interval_that_covers_the_quotient_and_is_infinite_without_welfare():  # noqa: E501
    rng = np.random.default_rng(0)
    best, welfare = (
        0.9 + 0.01 * rng.standard_normal((400, 5)),
        0.45 + 0.02 * rng.standard_normal((400, 5)),
    )
    found = [price_of_anarchy(*pair) for pair in zip(best, welfare, strict=True)]
    assert np.mean([one.low <= 2 <= one.high for one in found]) > 0.9
    assert price_of_anarchy(np.array([0.9, 0.9]), np.array([0.001, 0.001])).high == np.inf
