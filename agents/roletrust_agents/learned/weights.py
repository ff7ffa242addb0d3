"""Weights of a network as the content of a safetensors file."""

import numpy as np
from safetensors import SafetensorError
from safetensors import numpy as safetensors

from roletrust_agents.learned.deep_set import DeepSet
from roletrust_agents.learned.network import Floats, Network
from roletrust_env.errors import short


def weights_bytes(network: Network | DeepSet) -> bytes:
    """Return the weights as the content of a safetensors file. The same weights give the same
    bytes.
    """
    return safetensors.save(
        {name: np.ascontiguousarray(network.weights[name]) for name in sorted(network.weights)}
    )


def read_weights(data: bytes) -> dict[str, Floats]:
    """Return the arrays of a safetensors file.

    Raises:
        ValueError: The data is not a safetensors file.
    """
    try:
        return safetensors.load(data)
    except (SafetensorError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(f"the weights are not a safetensors file: {short(str(error))}") from None
