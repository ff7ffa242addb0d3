"""The technical report: each of its numbers is found in the file that it names, and no number is
typed."""

import csv
import math
import re
import shutil
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
from refusals import refuses

from article import FILES, Results, Sources, browser, page, print_page

pytestmark = pytest.mark.slow

HOUSE = Path(__file__).parents[2]
DOCS = HOUSE / "docs"
MINUS = "\N{MINUS SIGN}"
FREE = {"style", "title", "code"}  # names, such as `standard`
FREE_CLASSES = {"cite", "references", "version"}


class Read(HTMLParser):
    """Marked numbers, quotes, and the text outside of both."""

    def __init__(self):
        super().__init__()
        self.stack, self.numbers, self.quotes, self.typed, self.links, self.ids = (
            [],
            [],
            [],
            [],
            [],
            set(),
        )

    def handle_starttag(self, tag, attributes):
        named = dict(attributes)
        self.ids.add(named.get("id"))
        if tag == "a":
            self.links.append(named["href"])
        if tag not in ("meta", "img", "br"):
            self.stack.append((tag, named))

    def handle_endtag(self, tag):
        while self.stack.pop()[0] != tag:
            pass

    def handle_data(self, data):
        for tag, named in self.stack:
            if tag in FREE or named.get("class") in FREE_CLASSES:
                return None
            if tag == "data":
                return self.numbers.append((named["data-from"], named["value"], data))
            if tag == "q":
                return self.quotes.append((named["data-from"], data))
        return self.typed.append(data)


@pytest.fixture(scope="module")
def report():
    reader = Read()
    reader.feed(page(DOCS))
    return reader


def cells(path):
    with (DOCS / path).open(encoding="utf-8", newline="") as file:
        return {cell for row in csv.reader(file) for cell in row}


def test_every_number_is_found_in_its_file(report):
    assert len(report.numbers) > 300
    files = {path: cells(path) for path, _, _ in report.numbers}
    for path, value, shown in report.numbers:
        assert value in files[path], (path, value)
        digits = len(shown.partition(".")[2])
        assert math.isclose(
            float(shown.replace(MINUS, "-")), float(value), abs_tol=0.5001 * 10**-digits
        ), (
            value,
            shown,
        )


def test_every_copied_sentence_is_found_in_its_file(report):
    assert {path for path, _ in report.quotes} == {"findings.md"}
    for path, text in report.quotes:
        assert text.replace(MINUS, "-") in (DOCS / path).read_text(encoding="utf-8")


def test_no_number_has_a_hyphen_for_its_sign(report):
    shown = [text for _, _, text in report.numbers] + [text for _, text in report.quotes]
    assert any(MINUS in text for text in shown)
    assert [text for text in shown if re.search(r"(?<![\w-])-\d", text)] == []


def test_no_number_is_typed(report):
    text = " ".join(report.typed).replace("(95%)", "").replace("95% interval", "")
    assert re.findall(r"[^\s]*\d[^\s]*", text.replace(f"mean (1 {MINUS} b)", "")) == []


def test_links_lead_to_what_is_there(report):
    assert {link.removeprefix("#") for link in report.links if link.startswith("#")} <= report.ids


def test_every_claim_has_a_file_and_a_command():
    text = page(DOCS)
    claims = re.findall(
        r"<code>docs/([^<]+)</code></td><td class=\"text\"><code>make ([^<]+)</code>", text
    )
    makefile = (HOUSE / "Makefile").read_text()
    assert len(claims) >= 9
    for path, target in claims:
        assert (DOCS / path).is_file()
        assert re.search(rf"^{target.split()[0]}:", makefile, re.MULTILINE), target
    used = {path for path in FILES.values() if f'data-from="{path}"' in text}
    assert used == set(FILES.values())
    assert used <= {file for file, _ in claims}


@pytest.mark.parametrize(
    ("name", "where", "words"),
    [
        ("leaderboards", {}, ("leaderboards",)),
        ("leaderboard", {"modell": "beta"}, ("modell",)),
        ("leaderboard", {"model": "betta"}, ("leaderboard", "0")),
        ("leaderboard", {}, ("leaderboard",)),
    ],
)
def test_a_number_that_is_not_there_is_refused(name, where, words):
    with refuses(ValueError, *words):
        Results(DOCS).number(name, "worst", **where)


def test_a_source_or_a_sentence_that_is_not_there_is_refused():
    with refuses(ValueError, "references.bib", "nobody1999"):
        Sources(DOCS / "references.bib").cite("nobody1999")
    with refuses(ValueError, "dilutions"):
        Results(DOCS).answer("dilutions")


def test_numbers_are_rounded_and_signed():
    results = Results(DOCS)
    assert results.mark("leaderboard", "-0.4004") == (
        '<data value="-0.4004" '
        f'data-from="leaderboards/standard/leaderboard.csv">{MINUS}0.400</data>'
    )
    assert ">0.000<" in results.mark("leaderboard", "-0.0001")
    assert results.mark("leaderboard", "") == "\N{EN DASH}"


def test_the_command_writes_the_page_and_prints_it(tmp_path):
    command = [sys.executable, "docs/_ext/article.py", "docs", str(tmp_path)]
    done = subprocess.run(command, cwd=HOUSE, capture_output=True, text=True, check=True)
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == page(DOCS)
    assert (tmp_path / "report.pdf").exists() == (browser() is not None), done.stdout
    wrong = subprocess.run(
        [*command[:2], str(tmp_path), str(tmp_path)], cwd=HOUSE, capture_output=True, text=True
    )
    assert wrong.returncode == 1
    assert wrong.stderr.startswith("Error: ")


def test_a_browser_that_prints_nothing_is_an_error(tmp_path):
    with refuses(ValueError, "PDF"):
        print_page(tmp_path / "page.html", tmp_path / "page.pdf", shutil.which("true"))
