"""An attack of a benchmark, played again in one of its worlds: what consumers receive, and which
agents have their trust.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from roletrust_env.benchmarking.leaderboard import Leaderboard, WorstCase
from roletrust_env.benchmarking.play import CellPlay, game_seed
from roletrust_env.benchmarking.suite import Cell, Rule
from roletrust_env.errors import suggest
from roletrust_env.evaluation.agreed import AgreedScripts, check_recorded, seat
from roletrust_env.evaluation.attackers import AttackedPlayers, Attacker, read_record
from roletrust_env.evaluation.received import world_rounds
from roletrust_env.evaluation.specs import check_installed
from roletrust_env.game.attack_task import AttackTask
from roletrust_env.game.consumer import receive
from roletrust_env.game.rollout import Round
from roletrust_env.game.state import State, one_game
from roletrust_env.metrics.score import mean_or_nan, ratio
from roletrust_env.storage.markdown import ShownAsMarkdown, markdown_table, plain
from roletrust_env.trust.model import registry as trust_models
from roletrust_env.world.scenario import Choice

Floats = npt.NDArray[np.float64]

_TOLERANCE = 1e-6  # of skill, up to which a replay agrees with the file


class Side(NamedTuple):
    """Trust in agents with the same role on one side, the mean over those that are present.

    Attributes:
        label: Label, such as `honest raters`.
        attacks: Whether the agents are compromised.
        rates: Whether it is trust in raters, otherwise in providers.
        trust: Trust in each round and game, shape (T, G); NaN where no agent is present.
    """

    label: str
    attacks: bool
    rates: bool
    trust: Floats


class Course(NamedTuple):
    """The course of G games of a world.

    Attributes:
        skill: Skill score over all games, see `roletrust_env.evaluation.received.SCORES`.
        received: Mean quality that honest consumers receive in each round, shape (T, G).
        from_attacker: Share of their services that come from compromised providers, shape (T, G).
        sides: Trust in each side: trust in raters is published, trust in providers is that of the
            honest consumers.
    """

    skill: float
    received: Floats
    from_attacker: Floats
    sides: tuple[Side, ...]


@dataclass(frozen=True, repr=False)
class Replay(ShownAsMarkdown):
    """The games that measured an attack in a world, and the same games without an attack.

    Attributes:
        cell: Trust model, choice rule, setting and way to attack.
        case: Attack, with its scores in all measured worlds.
        world: Number of the measured world.
        task: Attack task of the world.
        attacker: The attacker.
        seed: Random seed of the games.
        attacked: Course under the attack.
        honest: Course while all agents are honest.
    """

    cell: Cell
    case: WorstCase
    world: int
    task: AttackTask
    attacker: Attacker
    seed: tuple[int, ...]
    attacked: Course
    honest: Course

    @property
    def title(self) -> str:
        """The trust model, the rule, the setting, the world and the attack."""
        cell = self.cell
        where = f"{cell.model} ({cell.rule} rule), {cell.setting}, world {self.world}"
        return f"{where}: {self.case.attack}"

    @property
    def agrees(self) -> bool:
        """Whether the skill is that of the file, to 1e-6. Else the software, the processor or the
        file differs.
        """
        return bool(abs(self.attacked.skill - self.case.scores["skill"][self.world]) <= _TOLERANCE)

    def states(self, game: int) -> Iterator[State]:
        """Play one of the games again, and yield its states."""
        games = self.attacked.received.shape[1]
        for played in _rounds(self.task, self.attacker, self.seed, games):
            yield one_game(played.state, (0, game))

    def table(self) -> list[tuple[str, ...]]:
        """Return the rows of a table: a measure, under the attack, and while all are honest."""
        attacked, honest = self.attacked, self.honest
        rows: list[tuple[str, ...]] = [
            ("skill score", f"{attacked.skill:.3f}", f"{honest.skill:.3f}"),
            ("skill score, mean over all worlds", f"{self.case.skill:.3f}", ""),
        ]
        for name, field, form in (
            ("quality received", "received", ".3f"),
            ("services from compromised providers", "from_attacker", ".0%"),
        ):
            means = (mean_or_nan(getattr(one, field).ravel(), 0) for one in (attacked, honest))
            rows.append((name, *(f"{mean:{form}}" for mean in means)))
        for side, same in zip(attacked.sides, honest.sides, strict=True):
            trust = (f"{np.nanmean(one.trust):.3f}" for one in (side, same))
            rows.append((f"trust in {side.label}", *trust))
        return rows

    def _repr_markdown_(self) -> str:
        table = markdown_table(("", "attack", "all agents honest"), self.table(), 1)
        return f"{plain(self.title)}\n\n{table}"


def replay(
    results: str | Path,
    *,
    model: str | None = None,
    rule: Rule = "common",
    setting: str | None = None,
    world: int | None = None,
    allow_code: bool = False,
) -> Replay:
    """Play the worst attack on a trust model of a benchmark again in one world.

    Args:
        results: File `results.sqlite` of a benchmark.
        model: Trust model; None is the first one of the leaderboard.
        rule: Choice rule of the consumers.
        setting: Setting of the suite; None is the one with the lowest skill.
        world: Number of a measured world, from 0; None is the one with the lowest skill.
        allow_code: Import models and attacks that are not installed, which runs their code.

    Raises:
        ValueError: The file cannot be read, it has no such attack, a name is not installed, or the
            trust model or the attack fails.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from roletrust_env.benchmarking import benchmark, load_suite
        >>> from roletrust_env.benchmarking.replay import replay
        >>> suite = load_suite("quick")
        >>> small = suite.worlds.model_copy(update={"selection": 1, "measured": 2})
        >>> suite = suite.model_copy(update={"worlds": small, "games": 1, "selection_games": 1})
        >>> out = Path(mkdtemp())
        >>> _ = benchmark("mean", suite, workers=0, progress=False, out=out)
        >>> replay(out / "results.sqlite", model="mean").agrees
        True
    """
    board = Leaderboard.read(results)
    rows = {row.model: row for row in board.rows if row.rule == rule and row.worst_setting}
    if not rows:
        raise ValueError(f"{results} has no attack that was played with the {rule} rule")
    model = next(iter(rows)) if model is None else model
    if model not in rows:
        raise ValueError(
            f"{results} has no attack on {model!r} with the {rule} rule{suggest(model, rows)}"
        )
    attacked = [name for name, fields in board.suite.settings.items() if fields.roles]
    settings = [name for name in attacked if (model, rule, name) in board.worst_cases]
    setting = rows[model].worst_setting if setting is None else setting
    if setting not in settings:
        raise ValueError(
            f"{results} has no attack in the setting {setting!r}{suggest(setting, settings)}"
        )
    case = board.worst_cases[model, rule, setting]
    skills = case.scores["skill"]
    if world is None:
        world = int(np.nanargmin(skills))
    elif world not in range(len(skills)):
        raise ValueError(f"world must be in [0, {len(skills) - 1}], got {world}")
    if not allow_code:
        check_installed(trust_models, [model])
        check_recorded([case.record])
    method = next(name for name in board.suite.methods if name == case.method)
    cell = Cell(model, rule, setting, method)
    task = CellPlay(board.suite, cell).task("measured", world)
    seed, games = game_seed(board.suite, "measured", world), board.suite.games
    courses, attackers = [], []
    for each in (read_record(case.record), AgreedScripts()):
        ((_, attacker),) = seat(task, [each], 1)
        attackers.append(attacker)
        courses.append(_course(task, _rounds(task, attacker, seed, games)))
    return Replay(cell, case, world, task, attackers[0], seed, *courses)


def _rounds(
    task: AttackTask, attacker: Attacker, seed: tuple[int, ...], games: int
) -> Iterator[Round]:
    """Play games with the random numbers of `measure_world`."""
    return world_rounds(AttackedPlayers(task, attacker), seed, (1, games))


def _course(task: AttackTask, rounds: Iterator[Round]) -> Course:
    game, identities, access = task.game, task.identities, task.game.scenario.access
    assert isinstance(access, Choice)
    names, raters, providers = (
        game.roster.names,
        game.roster.rater_names,
        game.roster.provider_names,
    )
    consumers = [i for i, name in enumerate(raters) if name not in identities]
    honest = [j for j, name in enumerate(providers) if name not in identities]
    bad = [j for j, name in enumerate(providers) if name in identities]
    received, from_bad, trust_in, gained, possible = [], [], [], 0.0, 0.0
    for before, actions, state, _, weight in rounds:
        offered, able = game.offered(before, actions, state), before.properties.ability
        ability = np.ones(state.quality.shape) if able is None else able
        part = receive(state.awaiting, offered, ability, consumers, honest, access.providers)
        gained += weight * float((part.got - part.blind).sum())
        possible += weight * float((part.best - part.blind).sum())
        received.append(part.got[0])
        mine = state.awaiting[consumers]
        from_bad.append(ratio(mine[:, bad].sum(axis=(0, 1)), mine.sum(axis=(0, 1)))[0])
        trust, present = np.array(game.agent_trust(state)), game.present(state)
        known = mean_or_nan(game.known_trust(state)[consumers], axis=0)
        trust[[names.index(name) for name in providers]] = known
        trust_in.append((trust if present is None else np.where(present, trust, np.nan))[:, 0])
    sides = []
    for rates, role, members in ((True, "raters", raters), (False, "providers", providers)):
        for attacks in (False, True):
            indices = [
                k
                for k, name in enumerate(names)
                if name in members and (name in identities) == attacks
            ]
            if indices and (game.model.rates_raters or not rates):
                trust = mean_or_nan(np.stack(trust_in)[:, indices], axis=1)
                label = f"{'compromised' if attacks else 'honest'} {role}"
                sides.append(Side(label, attacks, rates, trust))
    skill = gained / possible if possible else np.nan
    return Course(skill, np.stack(received), np.stack(from_bad), tuple(sides))
