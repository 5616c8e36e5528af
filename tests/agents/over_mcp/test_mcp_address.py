"""Where to serve over HTTP, and under which names."""

from __future__ import annotations

import asyncio
import socket

import pytest

from actionkit.agents._mcp.address import TOKEN_VARIABLE, address, listen
from actionkit.agents._mcp.http import _OneToken

TOKEN = {TOKEN_VARIABLE: "a-secret-of-the-test"}


@pytest.mark.parametrize("text", ["127.0.0.1:8765", "localhost:0", "[::1]:8765", "LocalHost:1"])
def test_this_machine_needs_no_token(text: str) -> None:
    checked = address(text, [], {})
    assert checked.token == ""
    assert {"127.0.0.1", "localhost", "[::1]"} <= set(checked.names)


@pytest.mark.parametrize("text", ["0.0.0.0:1", "[::]:1", "192.0.2.1:1", "robot.local:1"])
def test_others_need_one(text: str) -> None:
    with pytest.raises(ValueError, match=TOKEN_VARIABLE) as error:
        address(text, [], {})
    assert repr(text) in str(error.value)
    assert address(text, [], TOKEN).token == TOKEN[TOKEN_VARIABLE]


def test_which_names_lead_to_it() -> None:
    assert address("192.0.2.1:1", ["Robot.test"], TOKEN).names == ("192.0.2.1", "robot.test")
    assert socket.gethostname().lower() in address("0.0.0.0:1", [], TOKEN).names


@pytest.mark.parametrize(
    ("text", "names", "token", "told"),
    [
        ("8765", [], "", "HOST:PORT"),
        (":8765", [], "", "HOST:PORT"),
        ("::1:8765", [], "", "HOST:PORT"),
        ("localhost:99999", [], "", "HOST:PORT"),
        ("localhost:1", ["http://robot"], "", "without http://"),
        ("localhost:1", ["*"], "", "name of a host"),
        ("localhost:1", [], "short", "16 or more"),
        ("localhost:1", [], "ö" * 20, "ASCII"),
        ("0.0.0.0:1", [], " ", TOKEN_VARIABLE),
    ],
)
def test_what_is_wrong_is_told(text: str, names: list[str], token: str, told: str) -> None:
    with pytest.raises(ValueError, match=told):
        address(text, names, {TOKEN_VARIABLE: token})


def test_a_port_that_is_taken() -> None:
    with listen(address("127.0.0.1:0", [], {})) as first:
        taken = first.getsockname()[1]
        with pytest.raises(OSError, match="in use"):
            listen(address(f"127.0.0.1:{taken}", [], {}))
        # Connections have it from the socket that listens.
        with socket.create_connection(first.getsockname()), first.accept()[0] as connection:
            assert connection.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
            timeout = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT)
            assert timeout == 10_000


def test_only_the_right_token_lets_in() -> None:
    known = _OneToken("a-secret-of-the-test")
    assert asyncio.run(known.verify_token("a-secret-of-the-test")) is not None
    for wrong in ("", "a-secret-of-the-tes", "a-secret-of-the-testx", "A-secret-of-the-test"):
        assert asyncio.run(known.verify_token(wrong)) is None
