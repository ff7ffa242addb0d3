"""A round of the game in loops, one game, agents by name: the slow reference."""

from collections.abc import Callable
from math import hypot, log
from typing import Any

import numpy as np
import reference

from roletrust_env import Actions, Noise, Scenario
from roletrust_env.world.presence import CUT_OFF, LEFT, PRESENT, WAITING


class Slow:
    """A game as its documentation tells it, with nothing of the library but the scenario's
    fields."""

    def __init__(self, scenario: Scenario, noise: Noise) -> None:
        self.rules, self.round = scenario, 0
        self.group, self.in_reserve = {}, set()
        for role, prefix in (("SR", "sr"), ("SP", "sp"), ("SR+SP", "srsp")):
            owners = [
                group for group in scenario.agents if group.role == role for _ in range(group.count)
            ]
            reserves = [group for group in owners for _ in range(group.reserve)]
            self.group |= {f"{prefix}_{i}": group for i, group in enumerate(owners + reserves)}
            self.in_reserve |= {f"{prefix}_{i}" for i in range(len(owners), len(owners + reserves))}
        self.names = list(self.group)
        self.raters = [k for k in self.names if "SR" in self.group[k].role]
        self.providers = [k for k in self.names if "SP" in self.group[k].role]
        self.both = [k for k in self.raters if k in self.providers]
        self.pairs = [(i, j) for i in self.raters for j in self.providers]
        self.tor = dict.fromkeys(self.raters, scenario.initial_trust)
        self.top = dict.fromkeys(self.providers, scenario.initial_trust)
        self.last, self.rated_in = {}, {}
        self.awaiting, self.service, self.quality = set(), {}, dict.fromkeys(self.providers, 0.0)
        self.late, self.arrived = [], {}  # late: (round, pair, rating)
        self.received = {}  # by pair, the newest service without a rating: (round, quality)
        self.n_rated, self.n_provided = dict.fromkeys(self.both, 0), dict.fromkeys(self.both, 0)
        self.phase, self.low = dict.fromkeys(self.names, WAITING), dict.fromkeys(self.names, 0)
        self.come_and_go(0, noise, None)
        self.value = self.draw_values(noise)
        self.ability = self.draw_trait("ability", self.providers, noise.ability)
        self.bias = self.draw_trait("bias", self.raters, noise.bias)
        self.scale = self.draw_trait("scale", self.raters, noise.scale)
        self.place = self.goal = None
        if scenario.access.kind == "in-range":
            self.place, self.goal = self.spots(noise.position), self.spots(noise.goal)

    def spots(self, luck: np.ndarray) -> dict[str, tuple[float, float]]:
        return {k: tuple(self.rules.access.arena * luck[n]) for n, k in enumerate(self.names)}

    def draw_values(self, noise: Noise) -> dict[str, float]:
        values = self.rules.values
        return {
            j: values[0] if len(set(values)) == 1 else values[int(noise.value[n] * len(values))]
            for n, j in enumerate(self.providers)
        }

    def draw_trait(
        self, trait: str, agents: list[str], luck: np.ndarray | None
    ) -> dict[str, float]:
        drawn = {}
        for n, k in enumerate(agents):
            drawn[k] = getattr(self.group[k], trait)
            if isinstance(drawn[k], tuple):
                low, high = drawn[k]
                drawn[k] = low if low == high else low * (1 - luck[n]) + high * luck[n]
        return drawn

    def change_abilities(self, noise: Noise) -> None:
        for n, j in enumerate(self.providers):
            group = self.group[j]
            low, high = np.broadcast_to(group.ability, 2)
            if low < high:
                if group.drift:
                    self.ability[j] += group.drift * noise.drift[n]
                while not low <= self.ability[j] <= high:
                    end = low if self.ability[j] < low else high
                    self.ability[j] = 2 * end - self.ability[j]
                if group.switch and noise.switch[n] < group.switch:
                    self.ability[j] = low + (high - low) * noise.switch[n] / group.switch

    def come_and_go(self, round: int, noise: Noise, wanted: np.ndarray | None) -> None:
        for n, k in enumerate(self.names):
            group = self.group[k]
            luck = 0.5 if noise.presence is None else noise.presence[n]
            called = k not in self.in_reserve or (wanted is not None and wanted[n])
            withdraws = wanted is not None and group.reserve > 0 and not wanted[n]
            if (
                self.phase[k] == WAITING
                and round >= group.joins
                and luck < group.join_rate
                and called
            ):
                self.phase[k] = PRESENT
            elif self.phase[k] == PRESENT and (luck < group.leave_rate or withdraws):
                self.phase[k] = LEFT
            if (
                self.phase[k] in (WAITING, PRESENT)
                and group.leaves is not None
                and round >= group.leaves
            ):
                self.phase[k] = LEFT

    def trust(self, k: str) -> float:
        if k not in self.both:
            return self.tor[k] if k in self.tor else self.top[k]
        services = self.n_rated[k] + self.n_provided[k]
        if not services:
            return self.rules.initial_trust
        return (self.n_rated[k] * self.tor[k] + self.n_provided[k] * self.top[k]) / services

    def on_duty(self, k: str, role: str) -> bool:
        group = self.group[k]
        turns = group.turns or (group.role,)
        return role in turns[self.round // group.turn_length % len(turns)].split("+")

    def step(self, actions: Actions, noise: Noise) -> dict[str, float]:
        self.deliver(actions.ratings, self.sent(actions, noise), noise)
        self.update_trust()
        before = dict(self.phase)
        if self.rules.admission is not None:
            for k in self.names:
                danger = self.phase[k] == PRESENT and self.trust(k) < self.rules.admission.threshold
                self.low[k] = self.low[k] + 1 if danger else 0
                if self.low[k] >= self.rules.admission.rounds:
                    self.phase[k] = CUT_OFF
        self.come_and_go(self.round + 1, noise, actions.presence)
        if self.place is not None:
            self.move(noise)
        acting = {k for k in self.names if before[k] == self.phase[k] == PRESENT}
        self.serve(actions.quality, actions.treatment, acting, noise)
        self.received |= {pair: (self.round, service) for pair, service in self.service.items()}
        for pair, (round, _) in [*self.received.items()]:
            overdue = self.round - round >= self.rules.ratings.deadline
            if overdue or any(self.phase[k] != PRESENT for k in pair):
                del self.received[pair]
        rewards = self.rewards()
        self.value = self.value if noise.value is None else self.draw_values(noise)
        self.change_abilities(noise)
        self.round += 1
        return rewards

    def sent(self, actions: Actions, noise: Noise) -> set[tuple[str, str]]:
        """Pairs whose rating is sent: services first, then the largest claims."""
        sent, number = set(), self.rules.ratings.open
        for s, i in enumerate(self.raters):
            reports, claims = [], []
            for p, j in enumerate(self.providers):
                luck = 0.0 if number is None else noise.claim[s, p]
                claim = 0.0 if actions.claims is None else actions.claims[s, p]
                here = self.phase[i] == self.phase[j] == PRESENT
                if actions.withheld is not None and actions.withheld[s, p]:
                    continue
                if (i, j) in self.received:
                    reports.append((luck, (i, j)))
                elif number is not None and claim > 0 and i != j and here:
                    claims.append((claim + 1e-5 * luck, (i, j)))
            chosen = sorted(reports, reverse=True) + sorted(claims, reverse=True)
            sent |= {pair for _, pair in chosen[:number]}
        for pair in sent:
            self.received.pop(pair, None)
        return sent

    def deliver(self, ratings: np.ndarray, sent: set[tuple[str, str]], noise: Noise) -> None:
        channel = self.rules.ratings
        self.arrived = {pair: rating for due, pair, rating in self.late if due == self.round}
        for s, i in enumerate(self.raters):
            for p, j in enumerate(self.providers):
                if (i, j) not in sent or (channel.lost > 0 and noise.lost[s, p] < channel.lost):
                    continue
                if channel.late > 0 and noise.late[s, p] < channel.late:
                    self.late.append((self.round + channel.delay, (i, j), ratings[s, p]))
                else:
                    self.arrived[i, j] = ratings[s, p]
        for k in self.both:
            self.n_rated[k] += sum(rater == k for rater, _ in self.arrived)
            self.n_provided[k] += sum(provider == k for _, provider in self.awaiting)

    def update_trust(self) -> None:
        def matrix(of: Callable[[tuple[str, str]], float]) -> list[list[float]]:
            return [[of((i, j)) for j in self.providers] for i in self.raters]

        notes, mask = (
            matrix(lambda c: self.arrived.get(c, 0.0)),
            matrix(lambda c: c in self.arrived),
        )
        last = matrix(lambda c: self.last.get(c, 0.0))
        elapsed = matrix(lambda c: self.round - self.rated_in[c] if c in self.rated_in else 0)
        lam = self.rules.lam
        tor = reference.rater_trust(notes, mask, list(self.tor.values()), lam)
        top = reference.provider_trust(
            notes, mask, tor, list(self.top.values()), last, elapsed, lam
        )
        self.tor, self.top = (
            dict(zip(self.raters, tor, strict=True)),
            dict(zip(self.providers, top, strict=True)),
        )
        self.last |= self.arrived
        self.rated_in |= dict.fromkeys(self.arrived, self.round)

    def move(self, noise: Noise) -> None:
        goals = self.spots(noise.goal)
        for k in self.names:
            (x, y), (goal_x, goal_y) = self.place[k], self.goal[k]
            distance = hypot(goal_x - x, goal_y - y)
            if distance <= self.rules.access.speed:
                self.place[k], self.goal[k] = self.goal[k], goals[k]
            else:
                share = self.rules.access.speed / distance
                self.place[k] = (x + share * (goal_x - x), y + share * (goal_y - y))

    def serve(
        self, quality: np.ndarray, treatment: np.ndarray | None, acting: set[str], noise: Noise
    ) -> None:
        access = self.rules.access
        self.awaiting = set()
        for s, i in enumerate(self.raters):
            within, met = (
                [],
                self.meet(i, noise.choice[s]) if access.kind == "encounters" else self.providers,
            )
            for p, j in enumerate(self.providers):
                near = self.place is None or (
                    hypot(self.place[i][0] - self.place[j][0], self.place[i][1] - self.place[j][1])
                    <= access.radius
                )
                duty = self.on_duty(i, "SR") and self.on_duty(j, "SP")
                if i != j and {i, j} <= acting and duty and near and j in met:
                    within.append((p, j))
            if access.kind == "choice":
                luck, t = noise.choice[s], access.temperature
                if noise.explore is not None and noise.explore[s] < access.explore:
                    within.sort(key=lambda pj: luck[pj[0]], reverse=True)
                elif t:
                    within.sort(
                        key=lambda pj: self.top[pj[1]] / t - log(-log(luck[pj[0]])), reverse=True
                    )
                else:
                    # Luck decides between trusts as near as 1e-5.
                    within.sort(key=lambda pj: self.top[pj[1]] + 1e-5 * luck[pj[0]], reverse=True)
                within = within[: access.providers]
            self.awaiting |= {(i, j) for _, j in within}
        strength = max(
            (b.strength for b in self.rules.perturbations if b.start <= self.round < b.stop),
            default=0.0,
        )
        self.service, got = {}, {j: [] for j in self.providers}
        for s, i in enumerate(self.raters):
            for p, j in enumerate(self.providers):
                if (i, j) in self.awaiting:
                    share = 1.0 if treatment is None else treatment[s, p]
                    got[j].append(self.ability[j] * quality[p] * share)
                    seen = self.scale[i] * got[j][-1] * (1 - strength) + self.bias[i]
                    seen += self.group[i].noise * noise.perception[s, p]
                    self.service[i, j] = min(max(seen, 0.0), 1.0)

        self.quality = {
            j: sum(services) / len(services) if services else 0.0 for j, services in got.items()
        }

    def meet(self, i: str, luck: np.ndarray) -> set[str]:
        """Floyd's sample of other providers."""
        others, met = [j for j in self.providers if j != i], set()
        for n, u in enumerate(luck):
            last = len(others) - len(luck) + n
            drawn = others[int(u * (last + 1))]
            met.add(others[last] if drawn in met else drawn)
        return met

    def rewards(self) -> dict[str, float]:
        weights, rewards = self.rules.rewards, {}
        for k in self.names:
            weight = weights.rater_trust if k in self.raters else weights.provider_trust
            weight = weights.agent_trust if k in self.both else weight
            cost = (
                weights.quality_cost * self.value[k] * self.quality[k]
                if k in self.providers
                else 0.0
            )
            rewards[k] = weight * self.trust(k) - cost
        return rewards

    def expected(self) -> dict[str, Any]:
        """The fields of `State`, in arrays."""

        def cells(of: dict, default: float = 0.0) -> np.ndarray:
            return np.array(
                [[of.get((i, j), default) for j in self.providers] for i in self.raters]
            )

        fields = {
            "round": self.round,
            "ratings": cells(self.arrived),
            "rated": cells(dict.fromkeys(self.arrived, True), False),
            "quality": np.array(list(self.quality.values())),
            "service": cells(self.service),
            "awaiting": cells(dict.fromkeys(self.awaiting, True), False),
            "value": np.array(list(self.value.values())) / max(self.rules.values),
        }
        if self.rules.ratings.deadline > 1:
            last, due = self.round - 1, {}
            for pair, (round, service) in self.received.items():
                if round < last:
                    due[pair] = service, round + self.rules.ratings.deadline - last
            fields["due"] = np.array([cells({c: due[c][n] for c in due}) for n in range(2)])
        if self.both:
            fields["counts"] = np.array(
                [list(self.n_rated.values()), list(self.n_provided.values())]
            )
        return fields
