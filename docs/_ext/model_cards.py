"""Model cards of the attackers in the zoo: `python docs/_ext/model_cards.py FOLDER`; `make cards`
calls it.
"""

import sys
from pathlib import Path

from roletrust_agents.learned.cards import Card
from roletrust_agents.learned.saved import load_attacker, zoo

_PAGE = """\
# Model cards

Attackers that come with RoleTrust, from the files beside their weights. All are MIT-licensed, were trained on synthetic
games only, and are for tests of trust models: they see and change ratings and services in these games, and nothing
else. The score is the mean reward in games that were not used for training, ± half of its 95% interval, which is 0
where no chance is in a game. In other worlds and against other models it is another. `roletrust list zoo NAME --games
256` measures it again.
"""  # noqa: E501
_CARD = """
## {name}

- **Task**: `{card.task.id}`, {agents} in `{card.scenario.name}`, {card.scenario.max_cycles} rounds
- **Objective**: {card.task.objective}; knowledge: {card.task.knowledge}
- **Trained against**: {models}
- **Training**: {card.training.algorithm}, {card.training.rounds:,} rounds, seed {card.training.seed}
- **Version**: {card.package_version}
- **Score per round**: {card.score.mean:.4f} ± {card.score.half_95:.4f} in {card.score.games} games
- **Score of honest play**: {card.score.honest:.4f}
- **Weights**: SHA-256 `{card.weights_sha256}`
"""  # noqa: E501


def page(cards: dict[str, Card]) -> str:
    """Return the page of some attackers, given by their names."""
    text = _PAGE
    for name, card in cards.items():
        agents = ", ".join(card.task.compromised)
        models = ", ".join(f"`{model.name}`" for model in (card.trust_model, *card.further_models))
        text += _CARD.format(name=name, card=card, agents=agents, models=models)
    return text


if __name__ == "__main__":
    shipped = {name: load_attacker(name).card for name in zoo()}
    (Path(sys.argv[1]) / "model-cards.md").write_text(page(shipped), encoding="utf-8")
