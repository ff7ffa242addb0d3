"""Programs of ROS 2 as guests of a test: they end with it, however it ends."""

import contextlib
import ctypes
import os
import signal
import subprocess

_PR_SET_PDEATHSIG = 1  # of Linux


@contextlib.contextmanager
def guest(command, **options):
    """Run a program until the end of the context; it is killed, since nodes of rclpy may ignore
    SIGTERM."""
    process = subprocess.Popen(
        [*map(str, command)], preexec_fn=_killed_with(os.getpid()), **options
    )
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def _killed_with(parent):
    """Return a function that has the calling process killed at the end of its parent, even if that
    is killed."""
    libc = ctypes.CDLL(None)

    def prepare():
        libc.prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:
            os._exit(1)

    return prepare
