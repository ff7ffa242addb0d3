"""The page of `roletrust report` in a real browser."""

from pathlib import Path
from typing import Any

import pytest
from report_run import lines

PATIENCE_MS = 240_000  # far more than a busy machine takes


@pytest.mark.parametrize("width", [390, 1100])
def test_the_page_is_complete_and_its_leaderboard_is_filtered_and_sorted(
    browser: Any, folder: Path, width: int
) -> None:
    page, wrong = browser.new_page(viewport={"width": width, "height": 900}), list[str]()
    page.set_default_timeout(PATIENCE_MS)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console",
        lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None,
    )
    page.on(
        "request",
        lambda asked: None if asked.url.startswith(("file:", "data:")) else wrong.append(asked.url),
    )
    page.goto((folder / "out" / "report.html").as_uri())
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    assert page.evaluate("[...document.images].every((image) => image.naturalWidth > 300)")
    assert page.locator("img").count() == 4
    page.fill("#filter", "mean")
    assert page.locator(".models tbody tr:visible").count() == 1
    page.fill("#filter", "")
    page.focus(".models thead button >> nth=1")
    page.keyboard.press("Enter")
    ranks = [row["rank"] for row in lines(folder, "leaderboard") if row["rule"] == "common"]
    assert page.locator(".models tbody td").nth(1).inner_text() == max(ranks)
    page.click("#learners-board thead button >> nth=0")
    assert page.locator("#learners-board tbody td").first.inner_text() == "6"
    page.close()
    assert wrong == []
