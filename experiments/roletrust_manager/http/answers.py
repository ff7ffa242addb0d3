"""Requests to the trust manager and its answers on HTTP, for both sides."""

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from roletrust_manager.admission.keys import NAME
from roletrust_manager.http.tokens import MAX_TOKEN, Key, Name

MAX_TOKENS = 1000
"""Number of ratings that a request may have."""

Share = Annotated[float, Field(ge=0, le=1)]
Count = Annotated[int, Field(ge=0)]
Seconds = Annotated[float, Field(description="Time, seconds since 1970.", examples=[1764181371.5])]
Identity = Annotated[str, Field(pattern=f"^{NAME}(~[1-9][0-9]*)?$", examples=["ann~2"])]
"""Name of an agent in the journal: an agent that has come back has a suffix with a number."""
Token = Annotated[str, Field(max_length=MAX_TOKEN, description="Signed JSON Web Token.")]


class _Message(BaseModel):
    model_config = ConfigDict(frozen=True, use_attribute_docstrings=True)


class TokenRequest(_Message):
    """Registration or farewell of an agent."""

    token: Token


class RatingTokens(_Message):
    """Ratings by one agent. They count as a whole: if one is refused, none does."""

    tokens: Annotated[list[Token], Field(min_length=1, max_length=MAX_TOKENS)]


class TokenReceipt(_Message):
    """Acknowledgement of a token: it is in the store."""

    seq: Count
    """Number in the journal, ascending."""
    time: Seconds


class TokenReceipts(_Message):
    """Acknowledgement of ratings."""

    receipts: list[TokenReceipt]
    """Receipts, in the order of the tokens."""


class Proof(_Message):
    """Proof about the journal."""

    hashes: list[Annotated[str, Field(pattern="^[0-9a-f]{64}$")]]
    """Hashes in hexadecimal, in the order of RFC 6962."""


class About(_Message):
    """Description of a manager, its settings and its state."""

    name: Name
    """Name of the manager, to which tokens are addressed (`aud`)."""
    key: str
    """Key by which it signs checkpoints, as NAME+ID+KEY (C2SP signed-note)."""
    model: str
    """Trust model, as `roletrust list models` names it."""
    every: Annotated[float, Field(gt=0)]
    """Length of a round, seconds. Ratings make trust when their round ends."""
    scale: Annotated[list[float], Field(min_length=2, max_length=2)]
    """Worst and best rating."""
    same_agents: bool
    """Whether the name of an agent is one agent in both roles, so that trust in it as a rater
    counts."""
    work: Annotated[int, Field(ge=0, le=256)]
    """Zero bits of the proof of work of a newcomer."""
    quota: Count
    """Number of ratings that an agent may send in a round."""
    newcomers: Count
    """Number of agents that may register in a round."""
    tolerance: float
    """Largest difference between the time of signing and the clock of the manager, seconds."""
    version: str
    """Version of RoleTrust."""
    agents: Count
    """Number of registered agents."""
    ratings: Count
    """Number of acknowledged ratings."""
    rounds: Count
    """Number of rounds that have ended."""
    counted: Count
    """Number of ratings in these rounds, which make the trust."""
    time: Seconds


class AgentTrust(_Message):
    """Trust in an agent in one role, and what it rests on."""

    trust: Share
    ratings: Count
    """Number of ratings that it got, or as a rater gave."""
    agents: Count
    """Number of agents in these ratings: its raters, or the agents that it rated."""
    independent: Annotated[float, Field(ge=0)]
    """Effective number of these agents: near 1 where one of them has given nearly all ratings."""
    last: Seconds | None
    """Time of the last rating; null without ratings."""
    rank: Annotated[int, Field(ge=1)] | None
    """Rank by trust, 1 for the best; null without ratings."""
    of: Count
    """Number of agents that are ranked, also those that have left."""


class TrustReason(_Message):
    """Ratings by one other agent, or of one, and the trust without them."""

    agent: Identity
    trust: Share
    """Trust in this other agent."""
    ratings: list[Share]
    """Ratings on [0, 1], in the order of time."""
    others: Share | None
    """Mean rating that the rated agent has from all others; null if there are none."""
    without: Share
    """Trust without these ratings."""
    rank: Count
    """Rank without them."""


class ExplainedTrust(_Message):
    """Trust in an agent in one role, and what makes it."""

    trust: Share
    rank: Count
    """Rank by trust among the agents with ratings."""
    n_ratings: Count
    n_others: Count
    reasons: list[TrustReason]
    """Most important reasons; those first without which trust would differ most."""


class ExplainedRoles(_Message):
    """Explanations of the trust in an agent by role; null without ratings."""

    provider: ExplainedTrust | None
    rater: ExplainedTrust | None


class Agent(_Message):
    """Registered agent."""

    name: Name
    key: Key
    """Public key, ed25519, 32 bytes in base64url."""
    registered: Seconds
    provider: AgentTrust
    rater: AgentTrust | None
    """Trust in it as a rater; null if the model has none in raters."""
    rounds: Count
    """Number of rounds that have ended."""
    time: Seconds
    explanation: ExplainedRoles | None = None
    """What makes the trust, if it was asked for."""


class Agents(_Message):
    """Part of the list of agents, the best provider first."""

    agents: list[Agent]
    total: Count
    """Number of registered agents."""


class Refusals(_Message):
    """Refusals since the manager was started."""

    refusals: Annotated[dict[str, Count], Field(examples=[{"replayed": 3}])]
    """Number by reason."""


class Problem(_Message):
    """Refusal of a request, or the failure of an answer."""

    reason: Annotated[str, Field(examples=["replayed"])]
    """Reason in a few words, by which refusals are counted."""
    detail: str
    """Explanation in a sentence."""
    at: Count | None = None
    """Place of the refused token in the request, from 0."""
