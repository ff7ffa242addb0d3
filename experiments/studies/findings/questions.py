"""The questions by name."""

from collections.abc import Callable

from studies.findings import admission, both_roles, breaking, dilution, mirrored, movement, noise, roles
from studies.findings.finding import Finding
from studies.findings.games import Effort

QUESTIONS: dict[str, Callable[[Effort], Finding]] = {
    "roles": roles.answer,
    "dilution": dilution.answer,
    "noise": noise.answer,
    "breaking": breaking.answer,
    "mirrored": mirrored.answer,
    "both-roles": both_roles.answer,
    "admission": admission.answer,
    "movement": movement.answer,
}
