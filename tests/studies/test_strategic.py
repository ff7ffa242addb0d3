"""`python -m studies.strategic`: its table, its files, its continuation, and what it refuses."""

import csv
import json
import shlex
import shutil

import numpy as np
import pytest

pytest.importorskip("cma")

from study_line import app
from typer.testing import CliRunner

from studies.strategic.points import MEASURES, STARTS, Point, price_of_anarchy

pytestmark = pytest.mark.slow

FEW = ("--scenario", "crowd", "--cost", 0.1, "--runs", 2, "--steps", 2, "--games", 2, "--workers", 1)


def strategic(*arguments):
    result = CliRunner().invoke(app, ["strategic", *map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("strategic")
    code, printed = strategic("--model", "beta", "--model", "constant", *FEW, "--out", out)
    assert code == 0, printed
    return out


def rows(out):
    with (out / "strategic.csv").open() as file:
        return list(csv.DictReader(file))


def test_every_population_has_a_row(written):
    found = rows(written)
    assert [(row["model"], row["start"]) for row in found] == [(m, s) for m in ("beta", "constant") for s in STARTS]
    assert {f"{name}_half_95" for name in MEASURES} < set(found[0])
    calm = found[0]
    assert float(calm["honest_providers"]) == float(calm["honest_raters"]) == 1
    assert float(calm["rater_gain"]) == 0  # beta has no trust in raters
    assert 0.9 < float(calm["anarchy"]) < 1.2
    assert float(found[4]["provider_gain"]) > 0.05  # under a constant trust no service is the best one
    assert "level 0" in found[4]["provider_deviation"]


def test_the_page_has_the_numbers_and_the_command(written):
    page = (written / "strategic.md").read_text()
    assert page.startswith("| world | model | start | gain, provider |")
    command = "python -m studies.strategic --model beta --model constant --scenario crowd --cost 0.1 --runs 2 --steps 2"
    assert f"Made by `{command} --games 2 --seed 0`." in page
    assert (written / "strategic.png").stat().st_size > 1000


def test_what_is_next_overwrites_nothing_and_keeps_the_effort(written, tmp_path):
    out = tmp_path / "here"
    shutil.copytree(written, out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    code, printed = strategic("--model", "beta", *FEW, "--out", out)
    assert code == 0, printed
    words = shlex.split(printed.partition("Next: python -m studies.strategic ")[2])
    given = dict(zip(words[::2], words[1::2], strict=True))
    assert given == {
        **{"--model": "beta", "--scenario": "crowd", "--cost": "0.1", "--runs": "4", "--steps": "2", "--games": "2"},
        **{"--seed": "0", "--workers": "1", "--out": str(tmp_path / "here-4-runs")},
    }
    code, printed = strategic(*words)
    assert code == 0, printed
    assert (out / "strategic.json").read_bytes() == before["strategic.json"]


def test_the_order_of_the_runs_does_not_depend_on_when_they_end(written, tmp_path):
    (tmp_path / "strategic.json").write_text((written / "strategic.json").read_text())
    data = json.loads((tmp_path / "strategic.json").read_text())
    data["runs"] = dict(list(data["runs"].items())[:0:-1])  # the first one is played again, after the others
    (tmp_path / "strategic.json").write_text(json.dumps(data))
    assert strategic("--model", "beta", "--model", "constant", *FEW, "--out", tmp_path)[0] == 0
    assert (tmp_path / "strategic.json").read_bytes() == (written / "strategic.json").read_bytes()


def test_a_narrow_terminal_shows_welfare(written, tmp_path):
    shutil.copy(written / "strategic.json", tmp_path)
    result = CliRunner().invoke(
        app, ["strategic", "--model", "beta", *map(str, FEW), "--out", str(tmp_path)], env={"COLUMNS": "80"}
    )
    header = next(line for line in result.output.splitlines() if line.startswith("population"))
    assert "welfare" in header
    assert "price of anarchy" in header


def test_it_continues_where_it_was_stopped(written):
    path = written / "strategic.json"
    data = json.loads(path.read_text())
    before = rows(written)
    marked = data["runs"]["crowd|beta|0.1|honest"]
    marked["welfare"] = [7.0, 7.0]
    del data["runs"]["crowd|constant|0.1|random"]
    path.write_text(json.dumps(data))
    code, printed = strategic("--model", "beta", "--model", "constant", *FEW, "--out", written)
    assert code == 0, printed
    after = rows(written)
    assert float(after[1]["welfare"]) == 7
    assert after[7] == before[7]


def test_other_settings_do_not_mix(written):
    code, printed = strategic("--model", "beta", *FEW[:-2], "--seed", 3, "--out", written)
    assert (code, "another effort" in printed) == (2, True)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scenario", "crowds"), "no scenario 'crowds'; did you mean 'crowd'"),
        (("--model", "betta"), "betta"),
        (("--games", 3), "--games is 3; it must be even"),
    ],
)
def test_bad_input_is_refused_before_anything_is_written(arguments, message, tmp_path):
    code, printed = strategic(*arguments, "--out", tmp_path / "none")
    assert (code, message in printed) == (2, True), printed
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda run: run.clear(), "numbers.welfare is None"),
        (lambda run: run.update(welfare=[0.5]), "welfare has 1 runs; the settings have 2"),
        (lambda run: run.update(welfare=[0.5, "high"]), "numbers.welfare.1 is 'high'"),
        (lambda run: run.update(quality=[0.5, float("nan")]), "NaN, which is not a number"),
        (lambda run: run.pop("rater_deviation"), "deviations.rater_deviation is None"),
    ],
)
def test_a_damaged_population_is_one_line_that_names_it(written, tmp_path, damage, message):
    data = json.loads((written / "strategic.json").read_text())
    damage(data["runs"]["crowd|beta|0.1|honest"])
    (tmp_path / "strategic.json").write_text(json.dumps(data))
    code, printed = strategic("--model", "beta", *FEW, "--out", tmp_path)
    assert (code, "strategic.json holds no runs of this command: " in printed) == (2, True), printed
    assert message in printed
    assert printed.endswith("; give --force to begin again, or another --out")


def test_the_price_of_anarchy_has_the_interval_of_a_quotient():
    rng = np.random.default_rng(0)
    best, welfare = rng.normal(0.9, 0.01, 40), rng.normal(0.6, 0.05, 40)
    found = price_of_anarchy(best, welfare)
    draws = [rng.integers(0, 40, 40) for _ in range(4000)]
    quotients = [best[d].mean() / welfare[d].mean() for d in draws]
    assert found.value == best.mean() / welfare.mean()
    np.testing.assert_allclose(found[1:], np.quantile(quotients, [0.025, 0.975]), atol=0.01)


def test_the_cost_is_that_of_the_scenario():
    assert Point("market", "beta", 0.3, "honest").game().scenario.rewards.quality_cost == 0.3
