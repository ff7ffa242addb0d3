"""A DDS domain of its own for every process of tests, since several may run on this machine."""

import contextlib
import functools
import os
import socket

import pytest

DOMAINS = range(1, 102)  # on Linux, ports of higher ones may be taken by other sockets at any time


@contextlib.contextmanager
def own_dds_domain():
    """Use the domain of this process, and yield its number."""
    with pytest.MonkeyPatch.context() as patch:
        number, _ = _claimed()
        patch.setenv("ROS_DOMAIN_ID", str(number))
        patch.delenv("CYCLONEDDS_URI", raising=False)
        yield number


@functools.cache
def _claimed():
    """Return a domain, and a socket whose name keeps it for this process."""
    for k in range(len(DOMAINS)):
        number = DOMAINS[(os.getpid() + k) % len(DOMAINS)]
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0roletrust-domain-{number}")
        except OSError:
            claim.close()
        else:
            return number, claim
    raise RuntimeError("every DDS domain of this machine is used by tests")
