"""What is served to this machine alone: a socket at its loopback, and a server that is quiet."""

import socket

import uvicorn
from starlette.types import ASGIApp

from biodance.errors import BiodanceError

LOOPBACK = "127.0.0.1"


def loopback_socket(port: int, option: str) -> socket.socket:
    """Return a socket that listens at a ``port`` of 127.0.0.1 (0 = a free one). Raises BiodanceError: another program
    has it; ``option`` is what asked for it.
    """
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((LOOPBACK, port))
        listener.listen()
    except (OSError, OverflowError) as error:
        listener.close()
        raise BiodanceError(
            f"{option} {port}: this port of 127.0.0.1 cannot be used ({error}). Give another one, or 0 for any."
        ) from error
    return listener


def quiet_server(application: ASGIApp) -> uvicorn.Server:
    """Return a server of an ``application`` that says nothing of its own and keeps no connection for long."""
    return uvicorn.Server(
        uvicorn.Config(
            application,
            log_config=None,
            access_log=False,
            server_header=False,
            timeout_keep_alive=30,
            timeout_graceful_shutdown=5,
            limit_concurrency=64,
        )
    )
