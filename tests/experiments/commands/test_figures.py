import csv
import json
from unittest.mock import ANY

import imageio.v2 as imageio
import numpy as np
import pytest
from command_line import printed
from refusals import assert_names, refuses
from typer.testing import CliRunner

from roletrust_env import make_scenario
from roletrust_env.evaluation.curves import Curves
from roletrust_env.world.vision.service import HogService
from roletrust_experiments.cli import app
from roletrust_experiments.paper import claims
from roletrust_experiments.paper.figures import figures
from roletrust_experiments.plots import paper

HEADER = ["time_s", "ToR_1", "ToR_2", "ToR_3", "ToP_1", "ToP_2", "ToP_3"]


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory):
    out = tmp_path_factory.mktemp("figures")
    result = printed("figures", "paper-3x3", "--out", out)
    return out, result


def rows_of(path):
    with path.open(newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


@pytest.mark.parametrize("name", ["figure3.csv", "figure4.csv"])
def test_csv_has_the_exact_header_and_a_row_for_each_half_second(synthetic, name):
    header, rows = rows_of(synthetic[0] / name)
    assert header == HEADER
    assert rows.shape == (240, 7)
    np.testing.assert_allclose(rows[:, 0], np.arange(1, 241) / 2)
    assert rows[:, 1:].min() >= 0
    assert rows[:, 1:].max() <= 1


def test_both_figures_are_one_scenario_until_somebody_attacks(synthetic):
    first, second = (rows_of(synthetic[0] / f"figure{n}.csv")[1] for n in (3, 4))
    np.testing.assert_array_equal(first[:40], second[:40])  # bad-mouthing begins in round 40
    assert (first[40] != second[40]).any()


def test_every_claim_holds_and_is_printed(synthetic):
    out, printed = synthetic
    results = json.loads((out / "results.json").read_text())
    assert len(results["claims"]) == 11
    assert all(claim["ok"] for claim in results["claims"])
    assert "not ok" not in printed
    for claim in results["claims"]:
        assert claim["what"] in printed


def test_results_tell_how_to_make_them_again(synthetic):
    results = json.loads((synthetic[0] / "results.json").read_text())
    assert results["scenario"] == make_scenario("paper-3x3").model_dump(mode="json")
    assert results["attackers"]["figure 3"]["sp_2"]["parameters"]["start"] == 100
    assert results["attackers"]["figure 4"]["sr_2"]["parameters"]["stop"] == 90
    assert results["packages"]["numpy"] == np.__version__
    assert results["service"] == "synthetic"
    for name in results["files"]:
        assert (synthetic[0] / name).stat().st_size > 0


def test_same_seed_same_bytes(synthetic, tmp_path):
    CliRunner().invoke(app, ["figures", "paper-3x3", "--out", str(tmp_path)])
    for name in ("figure3.csv", "figure4.csv", "results.json"):
        assert (tmp_path / name).read_bytes() == (synthetic[0] / name).read_bytes()


def test_failed_claim_is_said_and_is_no_error(monkeypatch, tmp_path):
    monkeypatch.setattr(claims, "_VISIBLE", 2.0)
    result = printed("figures", "paper-3x3", "--out", tmp_path)
    assert result.count("not ok") == 4


def test_attack_claims_fail_when_nobody_attacks():
    scenario, ones = make_scenario("paper-3x3"), np.ones((240, 3, 1))
    curves = Curves(np.arange(1, 241) / 2, *[ones] * 5)
    on_off = claims.check_on_off(curves, scenario, claims.Window(50, 90))
    assert [claim.ok for claim in on_off] == [True, False, False, False, True]
    bad_mouthing = claims.check_bad_mouthing(curves, scenario, claims.Window(20, 45))
    assert [claim.ok for claim in bad_mouthing] == [True, False, False, False, False, False]


@pytest.mark.parametrize("clear", [True, False])
def test_claims_that_do_not_apply_to_given_frames(clear):
    scenario, seen = make_scenario("paper-3x3"), np.full((240, 3, 1), 1.0 if clear else 0.2)
    curves = Curves(np.arange(1, 241) / 2, *[seen] * 5)
    found = claims.for_given_frames(claims.check_on_off(curves, scenario, claims.Window(50, 90)))
    # The person stays recognised in the blur. Without one in clear view no level says anything.
    assert [claim.ok for claim in found] == (
        [True, None, None, False, True] if clear else [None] * 5
    )


def test_the_function_measures_what_its_command_writes(synthetic):
    found = figures("paper-3x3")
    assert found.data() | {"files": ANY} == json.loads((synthetic[0] / "results.json").read_text())
    assert found._repr_markdown_().count("| ok |") == 11


def test_another_scenario_has_no_such_figures():
    with refuses(ValueError, "market", "paper-3x3"):
        figures("market")


def test_windows_of_the_claims():
    time_s, scenario = np.arange(1, 241) / 2, make_scenario("paper-3x3")
    calm = claims.calm_before(time_s, scenario, claims.Window(50, 90))
    assert claims.spans(time_s, calm) == "5-18 s, 25-30 s, 37-50 s"
    steady = claims.steady_under(time_s, scenario, claims.Window(20, 45))
    assert claims.spans(time_s, steady) == "25-30 s, 37-45 s"


def test_frames_that_do_not_exist(tmp_path):
    result = CliRunner().invoke(
        app, ["figures", "--set", "frames=no.mp4", "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 2
    assert_names(result.stderr, "no.mp4")
    assert "Traceback" not in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.fixture
def walk(tmp_path):
    """A folder of four images."""
    folder = tmp_path / "walk"
    folder.mkdir()
    for k in range(4):
        imageio.imwrite(folder / f"{k}.png", np.full((36, 48, 3), 20 * k, np.uint8))
    return folder


@pytest.mark.parametrize(("sure", "seen"), [(0.02, False), (0.99, True)])
def test_looped_frames_with_and_without_a_person(tmp_path, monkeypatch, walk, sure, seen):
    monkeypatch.setattr(
        HogService, "perceive", lambda self, *given: np.full(given[3].shape, sure)
    )  # as the noise
    captions = []
    draw = paper.paper_figure
    monkeypatch.setattr(
        paper, "paper_figure", lambda *given: captions.append(given[-1]) or draw(*given)
    )
    out = tmp_path / "out"
    result = printed("figures", "--set", f"frames={walk}", "--set", "playback=loop", "--out", out)
    results = json.loads((out / "results.json").read_text())
    assert results["scenario"]["playback"] == "loop"
    assert results["footage"]["loop_length_s"] == 2.0
    assert results["footage"]["in_clear_view"] is seen
    assert captions == ["the frames of walk, 2 s, are looped"] * 2
    assert captions[0] in result
    assert f"{sure:.2f}" in result
    assert results["footage"]["probability"] == pytest.approx(sure)
    assert {claim["ok"] for claim in results["claims"]} == ({None, False, True} if seen else {None})


def test_frames_that_are_too_few_say_that_they_can_be_looped(tmp_path, walk):
    result = CliRunner().invoke(
        app, ["figures", "--set", f"frames={walk}", "--out", str(tmp_path / "out")]
    )
    assert result.exit_code == 2
    assert_names(result.stderr, "images")


def test_there_is_nothing_to_loop_without_frames(tmp_path):
    result = CliRunner().invoke(app, ["figures", "--set", "playback=loop", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert_names(result.stderr, "playback", "loop", "None")


def test_frames_without_hog(tmp_path):
    result = CliRunner().invoke(
        app, ["figures", "paper-3x3", "--set", "frames=0", "--out", str(tmp_path)]
    )
    assert result.exit_code == 2
    assert_names(result.stderr, "frames", "hog")
