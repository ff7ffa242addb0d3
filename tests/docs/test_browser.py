"""The whole site in a real browser, as `make docs` has built it: `make test-site`."""

import os
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

import pytest
from built import WHOLE, pages

pytestmark = pytest.mark.site

PATIENCE_MS = 240_000  # far more than a busy machine takes
VIEWS = {"light": (1440, "light"), "dark": (1200, "dark"), "phone": (390, "light")}

_FAINT = """() => {
  const lightness = (rgb) => {
    const linear = rgb.map((c) => c / 255).map((c) => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4);
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
  };
  const colour = (text) => text.match(/[\\d.]+/g).map(Number);
  const behind = (one) => {
    for (let at = one; at; at = at.parentElement) {
      const [r, g, b, a = 1] = colour(getComputedStyle(at).backgroundColor);
      if (a > 0.5) return [r, g, b];
    }
    return [255, 255, 255];
  };
  const faint = [];
  for (const one of document.querySelectorAll("article :is(p, li, td, th, dt, h1, h2, h3, a, code, pre span)")) {
    if (!one.innerText || !one.innerText.trim() || one.matches(".headerlink, .sd-stretched-link")) continue;
    const both = [colour(getComputedStyle(one).color).slice(0, 3), behind(one)];
    const [high, low] = both.map(lightness).sort((a, b) => b - a);
    if ((high + 0.05) / (low + 0.05) < 3.5) faint.push(one.tagName + " " + one.innerText.slice(0, 30));
  }
  return faint;
}"""  # noqa: E501
"""Texts whose contrast with what is behind them is low, after WCAG 2."""

_SCROLLING = """() => [...document.querySelectorAll("article .highlight pre")]
  .filter((one) => one.scrollWidth > one.clientWidth + 1)
  .map((one) => one.innerText.split("\\n").sort((a, b) => b.length - a.length)[0])"""
"""Longest line of each block of code that scrolls sideways."""


@pytest.fixture(scope="module")
def home() -> Iterator[str]:
    """Where the site is served. From disk a search has no excerpts, for browsers read no files."""
    assert (WHOLE / "index.html").is_file(), "there is no site; make docs builds it"
    with ThreadingHTTPServer(("localhost", 0), partial(_Quiet, directory=str(WHOLE))) as server:
        thread = Thread(target=server.serve_forever, daemon=True)
        thread.start()
        yield f"http://localhost:{server.server_port}/"
        server.shutdown()


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Say nothing."""


def opened(browser: Any, home: str, view: str, wrong: list[str]) -> Any:
    """A window; what its console complains of, and what is asked of others, is added to what is
    wrong."""
    width, colours = VIEWS[view]
    window = browser.new_page(viewport={"width": width, "height": 900}, color_scheme=colours)
    window.set_default_timeout(PATIENCE_MS)
    window.on("pageerror", lambda error: wrong.append(f"{window.url}: {error}"))
    window.on(
        "console",
        lambda said: wrong.append(f"{window.url}: {said.text}") if said.type == "error" else None,
    )
    window.on(
        "request",
        lambda asked: (
            None if asked.url.startswith((home, "data:", "blob:")) else wrong.append(asked.url)
        ),
    )
    return window


@pytest.mark.parametrize("view", VIEWS)
def test_every_page_is_readable_without_errors(browser: Any, home: str, view: str) -> None:
    wrong: list[str] = []
    window, shots = opened(browser, home, view, wrong), os.environ.get("SCREENSHOTS")
    for page in pages(WHOLE):
        window.goto(home + str(page.relative_to(WHOLE)))
        if window.evaluate("document.documentElement.scrollWidth > innerWidth"):
            wrong.append(f"{page}: wider than {VIEWS[view][0]} px")
        if view == "light":
            wrong += [f"{page}: code scrolls: {line}" for line in window.evaluate(_SCROLLING)]
        wrong += [f"{page}: faint: {text}" for text in window.evaluate(_FAINT)[:3]]
        broken_pictures = (
            "() => [...document.images].filter((i) => i.complete && "
            "!i.naturalWidth).map((i) => i.src)"
        )
        wrong += [f"{page}: no picture {source}" for source in window.evaluate(broken_pictures)]
        if shots:  # a folder, to look at them
            name = str(page.relative_to(WHOLE)).replace("/", "_")
            window.screenshot(path=f"{shots}/{view}_{name}.png", full_page=True)
    window.close()
    assert wrong == []


@pytest.mark.parametrize(
    ("word", "page"), [("EigenTrust", "models/eigentrust"), ("RaterAttack", "rater-attack-v0")]
)
def test_search_finds(browser: Any, home: str, word: str, page: str) -> None:
    wrong: list[str] = []
    window = opened(browser, home, "light", wrong)
    window.goto(home)
    window.fill("input[name=q]", word)
    window.press("input[name=q]", "Enter")
    window.wait_for_selector(".search-summary >> text=/found|matching/")
    found = [
        link.get_attribute("href") for link in window.query_selector_all("#search-results li a")
    ]
    window.close()
    assert any(page in link for link in found), found
    assert wrong == []
