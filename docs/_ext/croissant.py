"""Croissant description of the published results: `python docs/_ext/croissant.py FOLDER`; `make cards` calls it."""

import csv
import hashlib
import json
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

_HOUSE = Path(__file__).parents[2]
_TABLES = "docs/leaderboards/standard"
_LICENSE = "https://opensource.org/license/mit"
_LISTS = ("dataCollectionType", "dataPreprocessingProtocol", "dataLimitations", "dataBiases", "dataUseCases")
_LISTS += ("personalSensitiveInformation",)
_CONTEXT = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileObject": "cr:fileObject",
    "recordSet": "cr:recordSet",
    "source": "cr:source",
}


def croissant(house: Path = _HOUSE) -> dict[str, Any]:
    """Return the description: each table with its checksum and columns, and the sections of the datasheet.

    Args:
        house: Root folder of the source.
    """
    project = tomllib.loads((house / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    tables = sorted((house / _TABLES).glob("*.csv"))
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": ["http://mlcommons.org/croissant/1.0", "http://mlcommons.org/croissant/RAI/1.0"],
        "name": "RoleTrust-standard",
        "description": "Robustness of trust models against searched and learned attackers, suite standard.",
        "license": _LICENSE,
        "version": project["version"],
        "url": project["urls"].get("Repository", project["urls"]["Paper"]),
        **_responsible(house),
        "distribution": [_file(path, house) for path in tables],
        "recordSet": [_records(path) for path in tables],
    }


def _responsible(house: Path) -> dict[str, Any]:
    """Return the fields on responsible use, which are sections of the datasheet."""
    text = (house / "docs/release/datasheet.md").read_text(encoding="utf-8")
    sections = re.findall(r"^`(rai:\w+)`\n\n(.*?)(?=\n+## |\Z)", text, flags=re.MULTILINE | re.DOTALL)
    words = {key: " ".join(said.split()) for key, said in sections}
    return {key: [said] if key.removeprefix("rai:") in _LISTS else said for key, said in words.items()}


def _file(path: Path, house: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return {
        "@type": "cr:FileObject",
        "@id": path.name,
        "name": path.name,
        "contentUrl": path.relative_to(house).as_posix(),
        "contentSize": f"{len(data)} B",
        "encodingFormat": "text/csv",
        "sha256": hashlib.sha256(data).hexdigest(),
    }


def _records(path: Path) -> dict[str, Any]:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    fields = [
        {
            "@type": "cr:Field",
            "@id": f"{path.stem}/{column}",
            "name": column,
            "dataType": "sc:Float" if all(_number(row[column]) for row in rows) else "sc:Text",
            "source": {"fileObject": {"@id": path.name}, "extract": {"column": column}},
        }
        for column in rows[0]
    ]
    return {"@type": "cr:RecordSet", "@id": path.stem, "name": path.stem, "field": fields}


def _number(text: str) -> bool:
    return re.fullmatch(r"(-?\d+(\.\d+)?(e-?\d+)?|nan|-?inf)?", text) is not None


if __name__ == "__main__":
    written = json.dumps(croissant(), indent=1, ensure_ascii=False) + "\n"
    (Path(sys.argv[1]) / "croissant.json").write_text(written, encoding="utf-8")
