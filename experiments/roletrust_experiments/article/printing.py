"""HTML pages printed to PDF by a browser."""

import shutil
import subprocess
import tempfile
from pathlib import Path

from roletrust_env.storage.files import replacing

_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_PATIENCE_S = 240


def browser() -> str | None:
    """Return the path of a browser that prints, None if there is none."""
    return next((found for name in _BROWSERS if (found := shutil.which(name))), None)


def print_page(page: Path, pdf: Path, program: str) -> None:
    """Print a page to PDF.

    Args:
        page: HTML file.
        pdf: Path of the PDF.
        program: Path of the browser, Chromium or one of its family.

    Raises:
        ValueError: The browser wrote no PDF; the message has what it printed.
    """
    with tempfile.TemporaryDirectory() as profile, replacing(pdf) as temporary:
        options = [
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={profile}",
        ]
        command = [program, *options, f"--print-to-pdf={temporary.resolve()}", page.resolve().as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=_PATIENCE_S, check=False)
        if not temporary.is_file():
            raise ValueError(f"{program} printed no PDF: {done.stderr.strip()[-300:]}")
