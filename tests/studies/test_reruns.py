"""`python -m studies.reruns`: the table of promises, and files that it refuses."""

import pytest

pytest.importorskip("cma")

from small_suites import MARKET, small
from study_line import app
from typer.testing import CliRunner

from roletrust_env.benchmarking import benchmark

pytestmark = pytest.mark.slow

SUITE = small(
    scenarios={"market": MARKET}, models=["mean", "median"], attacks=["bad-mouthing", "on-off"], seeds=[4, 5, 6, 7]
)


def reruns(*arguments):
    result = CliRunner().invoke(app, ["reruns", *map(str, arguments)])
    return result.exit_code, " ".join(result.output.split())


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    out = tmp_path_factory.mktemp("seeds")
    benchmark(suite=SUITE, out=out, workers=0, progress=False)
    return out / "results.sqlite"


def test_promises_are_shown_and_written(results, tmp_path):
    code, printed = reruns(results, "--out", tmp_path)
    assert code == 0
    assert "2 runs of 2 seeds, 2 models" in printed
    written = (tmp_path / "reruns.md").read_text()
    assert written.startswith("| promise | promised | kept | cases |")
    assert "| means are within the interval of their difference | 0.95 |" in written
    assert f"Made by `python -m studies.reruns {results} --seeds 2`." in written


def test_what_cannot_be_cut_into_runs_is_refused(results, tmp_path):
    refused = reruns(results, "--seeds", 3, "--out", tmp_path)
    assert refused == (2, "Error: the suite has 4 seeds, too few for two runs of 3")
    code, printed = reruns(tmp_path / "none.sqlite")
    assert (code, "none.sqlite" in printed) == (2, True)


def test_the_effect_of_places_is_shown_and_written(results, tmp_path):
    shuffled = SUITE.model_copy(update={"seeds": (4, 5), "places": "shuffled"})
    benchmark(suite=shuffled, out=tmp_path, workers=0, progress=False)
    path = tmp_path / "results.sqlite"
    code, printed = reruns(results, "--shuffled", path, "--out", tmp_path)
    assert code == 0
    assert "suites custom and custom, 2 seeds" in printed
    assert "too narrow" not in printed  # at 80 columns
    written = (tmp_path / "places.md").read_text()
    assert written.startswith(
        "| model | clean | change | worst | change |\n| --- | ---: | ---: | ---: | ---: |\n| mean |"
    )
    assert f"Made by `python -m studies.reruns {results} --shuffled {path}`." in written
    assert not (tmp_path / "reruns.md").exists()
