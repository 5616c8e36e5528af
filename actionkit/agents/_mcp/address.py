"""Where to serve over HTTP, and who may come: decided before anything is opened."""

from __future__ import annotations

import ipaddress
import re
import socket
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

TOKEN_VARIABLE = "ACTIONKIT_MCP_TOKEN"
_SHORTEST_TOKEN = 16
_LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
_ADDRESS = re.compile(r"(\[[0-9a-fA-F:.]+\]|[^:\s\[\]]+):([0-9]{1,5})")


@dataclass(frozen=True)
class Address:
    """Where to serve, checked.

    Attributes:
        host: A name or an address, without brackets.
        port: 0 takes one that is free.
        token: What a client has to show; `""` where it need not.
        names: Under which names of hosts, as URLs have them, clients may come.
    """

    host: str
    port: int
    token: str
    names: tuple[str, ...]


def address(text: str, allowed: Sequence[str], environment: Mapping[str, str]) -> Address:
    """Check where to serve.

    Args:
        text: HOST:PORT.
        allowed: More names under which clients may come.
        environment: Has the token.

    Raises:
        ValueError: Something is wrong; the text says what to do.
    """
    found = _ADDRESS.fullmatch(text)
    if not found or int(found[2]) > 65535:
        raise ValueError(f"{text!r} must be HOST:PORT, such as 127.0.0.1:8765 or [::1]:8765")
    host, port = found[1], int(found[2])
    token = environment.get(TOKEN_VARIABLE, "").strip()
    if not token and not _is_loopback(host):
        raise ValueError(
            f"{text!r} can be reached from other machines, and everybody there could drive the"
            f" robot: put a secret into the environment variable {TOKEN_VARIABLE} (such as the"
            " output of `openssl rand -hex 32`), which clients have to send as a bearer token,"
            " or serve at 127.0.0.1"
        )
    if token and (len(token) < _SHORTEST_TOKEN or not token.isascii() or not token.isprintable()):
        raise ValueError(
            f"the token in {TOKEN_VARIABLE} must be {_SHORTEST_TOKEN} or more printable ASCII"
            " characters, such as the output of `openssl rand -hex 32`"
        )
    for name in allowed:
        if not re.fullmatch(r"[A-Za-z0-9._-]+|\[[0-9a-fA-F:.]+\]", name):
            raise ValueError(f"{name!r} must be the name of a host, without http:// and port")
    names = dict.fromkeys([host.lower(), *(name.lower() for name in allowed)])
    if _is_loopback(host) or _is_every(host):
        names |= dict.fromkeys(_LOOPBACK)
    if _is_every(host):
        names |= dict.fromkeys([socket.gethostname().lower(), socket.getfqdn().lower()])
    return Address(host.strip("[]"), port, token, tuple(names))


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def _is_every(host: str) -> bool:
    try:
        return ipaddress.ip_address(host.strip("[]")).is_unspecified
    except ValueError:
        return False


def listen(where: Address) -> socket.socket:
    """Open the socket, which notices clients that are gone without a word.

    Not those that hang: their machine acknowledges what is sent, and keeps it.

    Raises:
        OSError: It is in use, or is not an address of this machine.
    """
    family, kind, protocol, _, name = socket.getaddrinfo(
        where.host, where.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    opened = socket.socket(family, kind, protocol)
    try:
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # Linux hands these on to the connections. A client on a machine that lost its power or
        # its network is told from a silent one within 11 seconds; without them it takes hours.
        opened.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 5)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2)
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)
        # The same where we have sent something.
        opened.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 10_000)
        opened.bind(name)
        opened.listen(128)
    except BaseException:  # after any error no socket is left behind
        opened.close()
        raise
    return opened
