"""Write the technical report: `python -m roletrust_experiments.article docs build/report`."""

import sys
from pathlib import Path

from roletrust_env.storage.files import write_text
from roletrust_experiments.article.page import page
from roletrust_experiments.article.printing import browser, print_page


def main(results: Path, out: Path) -> None:
    """Write report.html, and report.pdf where there is a browser of the Chromium family.

    Args:
        results: Folder `docs` of the repository.
        out: Folder for the report.
    """
    html = out / "report.html"
    write_text(html, page(results))
    program = browser()
    if program is None:
        print(f"Written: {html}. There is no Chromium, which prints report.pdf (Debian: apt-get install chromium).")
        return
    print_page(html, out / "report.pdf", program)
    print(f"Written: {html}, {out / 'report.pdf'}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python -m roletrust_experiments.article RESULTS OUT, such as docs build/report")
    try:
        main(*map(Path, sys.argv[1:]))
    except (ValueError, OSError) as error:
        sys.exit(f"Error: {error}")
