"""The study of planted rings and clubs: what it plants, and its page on a small log."""

import json
from pathlib import Path

import numpy as np

from studies.study import run
from studies.suspects import planted, read_otc


def written(path: Path) -> Path:
    """A log of 3000 ratings among 300 members from -10 to 10, a few of whom have many."""
    random = np.random.default_rng(0)
    raters, ratees = random.integers(0, 300, 3000), (300 * random.random(3000) ** 3).astype(int)
    lines = [
        f"{one},{other},{random.integers(-10, 11)},{86_400 * day}"
        for day, (one, other) in enumerate(zip(raters, ratees, strict=True))
        if one != other
    ]
    path.write_text("\n".join(lines))
    return path


def test_accounts_rate_the_same_targets_and_a_club_as_others_do(tmp_path: Path) -> None:
    log = read_otc(written(tmp_path / "log.csv"))
    for honest in (False, True):
        found, accounts = planted(log, 6, 4, 4, 3, np.random.default_rng(1), honest=honest)
        new = np.isin(found.raters, accounts)
        assert new.sum() == 6 * (4 + 3)
        times_rated = np.bincount(found.ratees[new])
        targets = np.flatnonzero(times_rated == 6)
        assert len(targets) >= 4
        for target in targets:
            theirs, others = (
                found.values[(found.ratees == target) & chosen] for chosen in (new, ~new)
            )
            assert (
                np.isin(theirs, others).all() if honest else (theirs == 1).all() or len(targets) > 4
            )


def test_the_page_has_a_line_for_each_kind_and_size(tmp_path: Path) -> None:
    labels = tmp_path / "labels.csv"
    labels.write_text("0,1\n1,-1\n2,-1\n300,-1\n")
    options = [
        "--log",
        str(written(tmp_path / "log.csv")),
        "--labels",
        str(labels),
        "--size",
        "8",
        "--targets",
        "5",
        "--runs",
        "1",
        "--shuffles",
        "100",
    ]
    run(
        "studies.suspects",
        [*options, "--workers", "1", "--out", str(tmp_path / "out")],
    )
    page = (tmp_path / "out" / "suspects.md").read_text()
    assert "| ring | 5 of 5 | 8 | " in page
    assert "| honest club | 5 of 5 | 8 | " in page
    runs = json.loads((tmp_path / "out" / "runs.json").read_text())["runs"]
    assert runs["shuffled 0"] == {"any": 0.0, "groups": 0.0}
    assert runs["labels"] == {
        "accused": 0,
        "all_fraud": 2,
        "all_benign": 1,
        "suspect_fraud": 0,
        "suspect_benign": 0,
    }
    assert runs["ring 5 8 0"]["accused"]
    assert runs["ring 5 8 0"]["found"] == 1.0
    assert runs["ring 5 8 0"]["apart"] > 2 * (runs["honest club 5 8 0"]["apart"] or 0.0)
