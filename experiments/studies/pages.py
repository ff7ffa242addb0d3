"""Pages, pictures and attackers that commands of `roletrust` make alone.

Each recipe is a list of commands and of the files that they publish. Recipes on logs of real
ratings take a folder of them, `--logs`, since they are not in the repository. A training whose
folder is there is not repeated without `--force`. Minutes each; `universal` takes half an hour to
an hour on two cores.
"""

import json
import shlex
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from roletrust_env.logs import write_log
from studies.study import Recipe, Study


class Options(NamedTuple):
    """Folder of logs of real ratings."""

    logs: Path = Path("logs")


ZOO = "../agents/roletrust_agents/zoo"
"""Folder of the attackers that come with the project, from `docs/`."""

_CERTAIN = "--set max_cycles=200 --set noise=0 --set perturbations=[]"
_STEALTH = "--set stealth={{weight=2.0}}"
_OTC = "--set rater=1 --set ratee=2 --set rating=3 --set time=4 --set header=false"

_EVOLVE = (
    "train CollusionAttack --learner evolution:start=random --steps 6000000 "
    "--set objective=mislead --set max_cycles=50 --model wary-role-trust --model beta "
    "--model role-trust --model qor --model median"
)
_ABLE = 'role="SP",ability=[0.3,1.0]'
_RATERS = '{role="SR",count=10,noise=0.05}'
_SPARE = '{role="SR",count=7,noise=0.05},{role="SR",count=3,noise=0.05,reserve=3}'
_LIARS, _CHEATS, _OF_6 = ["sr_7", "sr_8", "sr_9"], ["sp_7", "sp_8", "sp_9"], ["sp_4", "sp_5"]
UNIVERSAL = {
    "raters": ("crowd-10x10", f"{_RATERS},{{{_ABLE},count=10}}", ["sr_5", "sr_6", *_LIARS]),
    "providers": ("crowd-10x10", f"{_RATERS},{{{_ABLE},count=10}}", _CHEATS),
    "coalition": ("crowd-10x10", f"{_RATERS},{{{_ABLE},count=10}}", [*_LIARS, *_CHEATS]),
    "identities": (
        "crowd-10x10",
        f"{_SPARE},{{{_ABLE},count=7}},{{{_ABLE},count=3,reserve=3}}",
        [*_LIARS, *_CHEATS],
    ),
    "raters-market": ("market", f"{_RATERS},{{{_ABLE},count=6}}", _LIARS),
    "coalition-market": ("market", f"{_RATERS},{{{_ABLE},count=6}}", [*_LIARS, *_OF_6]),
    "identities-market": (
        "market",
        f"{_SPARE},{{{_ABLE},count=4}},{{{_ABLE},count=2,reserve=3}}",
        [*_LIARS, *_OF_6],
    ),
}
"""Universal coalitions: one network each for liars, cheats, both, and both with identities in
reserve.

They are trained in a crowd and in a market, against five trust models in turn. Each has its
scenario, its agents and the compromised ones.
"""

_TREAT = (
    "train CollusionAttack --learner evolution-strategy:wide=true,start=alike,games=8,pairs=16 "
    "--steps 3000000 "
    "--set objective=mislead --set consumers=raters --set scenario=market --set max_cycles=60 "
    "--set continuation=0.97 "
    "--set ratings={{lost=0.8}} --model own-experience --model first-hand --model subjective-logic "
    "--model fire "
    "--model yu-singh"
)
_OF_12 = f'{{role="SR",count=9,noise=0.05}},{{role="SR",count=3,noise=0.05}},{{{_ABLE},count=5}},{{{_ABLE},count=2}}'  # noqa: E501
_SPARE_12 = _OF_12.replace("count=3,noise=0.05", "count=3,noise=0.05,reserve=2").replace(
    "count=2", "count=2,reserve=2"
)
_TWO, _THREE = ["sp_5", "sp_6"], ["sr_9", "sr_10", "sr_11"]
TREATMENT = {
    "providers": (_OF_12, _TWO),
    "coalition": (_OF_12, [*_THREE, *_TWO]),
    "identities": (_SPARE_12, [*_THREE, *_TWO]),
}
"""Universal coalitions that treat each rater by its account, against five personal models: agents,
compromised ones."""


COMMANDS = {
    "pictures": [
        "figures --out {out}",
    ],
    "learners": ["benchmark --suite learners-coalitions --out {out}"],
    "optimum": ["benchmark --suite learners-optimum --out {out}"],
    "audit": [
        "audit {out}/log.csv.gz --set same_agents=true --scale -10 10 --out {out}/audit",
    ],
    "real": [
        f"compare {{logs}}/bitcoin-otc/otc_network.csv.gz {_OTC} --scale -10 10 "
        "--set same_agents=true --out {out}"
    ],
    "colluders": [
        f"train CollusionAttack {_STEALTH} --seed {seed} --out {{out}}/runs/{seed}"
        for seed in range(5)
    ],
    "universal": [
        f"{_EVOLVE} --set scenario={scenario} --set agents=[{agents}]"
        + f" --set compromised={json.dumps(names, separators=(',', ':'))}"
        + f" --out {{out}}/{name}"
        for name, (scenario, agents, names) in UNIVERSAL.items()
    ],
    "treatment": [
        f"{_TREAT} --set agents=[{agents}]"
        + f" --set compromised={json.dumps(names, separators=(',', ':'))}"
        + f" --out {{out}}/{name}-treatment"
        for name, (agents, names) in TREATMENT.items()
    ],
    "zoo": [
        f"train ProviderAttack {_CERTAIN} --out {{out}}/provider-3x3",
        f"train RaterAttack {_STEALTH} {_CERTAIN} --out {{out}}/rater-3x3",
        f"train CollusionAttack {_STEALTH} --out {{out}}/collusion-10x10",
    ],
}
"""Commands of each recipe. `{out}` is its folder."""


def _attackers(names: Sequence[str], prefix: str = "") -> dict[str, str]:
    kinds = ("json", "safetensors")
    return {
        f"{name}/attacker.{kind}": f"{ZOO}/{prefix}{name}.{kind}"
        for name in names
        for kind in kinds
    }


FILES = {
    "pictures": {f"{name}.png": f"{name}.png" for name in ("figure3", "figure4")},
    "learners": {f"learners.{kind}": f"attackers/learners.{kind}" for kind in ("png", "md", "csv")},
    "optimum": {f"learners.{kind}": f"attackers/optimum.{kind}" for kind in ("md", "csv")},
    "audit": {"audit/audit.png": "audit.png"},
    "real": {f"comparison.{kind}": f"real/real.{kind}" for kind in ("md", "csv")},
    "colluders": {},
    "universal": _attackers(list(UNIVERSAL), "universal-"),
    "treatment": _attackers([f"{name}-treatment" for name in TREATMENT], "universal-"),
    "zoo": _attackers(["provider-3x3", "rater-3x3", "collusion-10x10"]),
}
RECIPES = {name: Recipe(Options(), FILES[name]) for name in COMMANDS}


def main(study: Study[Options]) -> None:
    """Run the commands of a recipe."""
    if study.again:
        shutil.rmtree(study.out, ignore_errors=True)
    if study.recipe == "audit":
        study.out.mkdir(parents=True, exist_ok=True)
        write_log(study.out / "log.csv.gz")
    places: dict[str, str | Path] = {"out": study.out, "logs": study.options.logs}
    for line in COMMANDS[study.recipe]:
        words = [word.format(**places) if "{role" not in word else word for word in line.split()]
        if words[0] == "train" and Path(words[-1]).exists():
            continue
        print(f"roletrust {shlex.join(words)}", flush=True)
        if code := subprocess.run(
            [Path(sys.executable).with_name("roletrust"), *words], check=False
        ).returncode:
            raise SystemExit(code)
