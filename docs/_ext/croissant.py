"""The published tables and their Croissant description: `python docs/_ext/croissant.py FOLDER`, or
`make cards`.
"""

import csv
import hashlib
import json
import re
import shutil
import sys
import tomllib
from pathlib import Path
from typing import Any

import yaml

_HOUSE = Path(__file__).parents[2]
_TABLES = "docs/leaderboards/standard"
_LICENSE = "https://opensource.org/license/mit"
_LISTS = (
    "dataCollectionType",
    "dataPreprocessingProtocol",
    "dataLimitations",
    "dataBiases",
    "dataUseCases",
)
_LISTS += ("personalSensitiveInformation",)
_FORMS = {"sc:Integer": r"-?\d+", "sc:Float": r"(-?\d+(\.\d+)?(e-?\d+)?|nan|-?inf)?"}
_TERMS = (
    "citeAs column equivalentProperty extract field fileObject fileProperty fileSet format "
    "includes isLiveDataset"
)
_TERMS += (
    " jsonPath key md5 parentField path recordSet references regex repeated replace "
    "samplingRate separator source"
)
_TERMS += " subField transform"
_CONTEXT = {  # that of the standard, also for what is not used here: readers compare it
    "@language": "en",
    "@vocab": "https://schema.org/",
    "sc": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "dct": "http://purl.org/dc/terms/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{term: f"cr:{term}" for term in _TERMS.split()},
}


def croissant(house: Path = _HOUSE) -> dict[str, Any]:
    """Return the description: each table with its checksum and columns, and the sections of the
    datasheet.

    Tables are named as files beside the description, as they are among the assets of a release.

    Args:
        house: Root folder of the source.
    """
    project = tomllib.loads((house / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((house / "CITATION.cff").read_text(encoding="utf-8"))
    names = ", ".join(
        one.get("name") or f"{one['given-names']} {one['family-names']}"
        for one in citation["authors"]
    )
    day = citation.get("date-released")
    tables = tables_of(house)
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": [
            "http://mlcommons.org/croissant/1.0",
            "http://mlcommons.org/croissant/RAI/1.0",
        ],
        "name": "RoleTrust-standard",
        "description": "Robustness of trust models against searched and learned attackers, suite standard.",  # noqa: E501
        "license": _LICENSE,
        "version": project["version"],
        "url": project["urls"].get("Repository", project["urls"]["Paper"]),
        "citeAs": f"{names}: {citation['title']}, version {project['version']}",
        **({"datePublished": day.isoformat()} if day else {}),
        **_responsible(house),
        "distribution": [_file(path) for path in tables],
        "recordSet": [_records(path) for path in tables],
    }


def tables_of(house: Path = _HOUSE) -> list[Path]:
    """Return the paths of the published tables."""
    return sorted((house / _TABLES).glob("*.csv"))


def _responsible(house: Path) -> dict[str, Any]:
    """Return the fields on responsible use, which are sections of the datasheet."""
    text = (house / "docs/release/datasheet.md").read_text(encoding="utf-8")
    sections = re.findall(
        r"^`(rai:\w+)`\n\n(.*?)(?=\n+## |\Z)", text, flags=re.MULTILINE | re.DOTALL
    )
    words = {key: " ".join(said.split()) for key, said in sections}
    return {
        key: [said] if key.removeprefix("rai:") in _LISTS else said for key, said in words.items()
    }


def _file(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return {
        "@type": "cr:FileObject",
        "@id": path.name,
        "name": path.name,
        "contentUrl": path.name,
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
            "dataType": _data_type([row[column] for row in rows]),
            "source": {"fileObject": {"@id": path.name}, "extract": {"column": column}},
        }
        for column in rows[0]
    ]
    return {"@type": "cr:RecordSet", "@id": path.stem, "name": path.stem, "field": fields}


def _data_type(texts: list[str]) -> str:
    return next(
        (name for name, form in _FORMS.items() if all(re.fullmatch(form, text) for text in texts)),
        "sc:Text",
    )


if __name__ == "__main__":
    written = json.dumps(croissant(), indent=1, ensure_ascii=False) + "\n"
    (Path(sys.argv[1]) / "croissant.json").write_text(written, encoding="utf-8")
    for table in tables_of():
        shutil.copy(table, sys.argv[1])
