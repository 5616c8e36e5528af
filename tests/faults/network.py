"""Two hosts on one machine: network namespaces, connected by a virtual cable."""

from __future__ import annotations

import ctypes
import itertools
import os
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

_CLONE_NEWNET = 0x40000000
_PREFIX = "actionkit"
_numbers = itertools.count(1)

_LOSSES = """
table inet faults {{
  chain lose {{
    type filter hook input priority 0;
    iifname "cable" numgen random mod 100 < {percent} drop
  }}
}}
"""

_FIRST_LOSSES = """
table inet faults {
  set met { type inet_service; flags dynamic; }
  set meeting { type inet_service; flags dynamic, timeout; timeout 80ms; }
  chain lose {
    type filter hook input priority 0;
    iifname "cable" ip daddr 224.0.0.0/4 counter drop
    iifname "cable" ip daddr != 224.0.0.0/4 udp dport != @met add @meeting { udp dport } \
        add @met { udp dport }
    iifname "cable" ip daddr != 224.0.0.0/4 udp dport @meeting counter drop
  }
}
"""
"""What comes to a port within 80 ms of the first packet to it; the next announcement is not missed,
it comes after 100 ms."""


class Host:
    """A network namespace, in which processes can be started."""

    def __init__(self, name: str) -> None:
        self.name = name

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Let processes that this thread starts run on the host; the thread itself is there."""
        libc = ctypes.CDLL(None, use_errno=True)
        own = os.open("/proc/thread-self/ns/net", os.O_RDONLY)
        other = os.open(f"/run/netns/{self.name}", os.O_RDONLY)
        try:
            self._enter(libc, other)
            try:
                yield
            finally:
                self._enter(libc, own)
        finally:
            os.close(own)
            os.close(other)

    def run(self, *command: str, text: str | None = None) -> None:
        """Run a command on the host.

        Raises:
            subprocess.CalledProcessError: It failed; with what it said.
        """
        _run("ip", "netns", "exec", self.name, *command, text=text)

    @staticmethod
    def _enter(libc: ctypes.CDLL, descriptor: int) -> None:
        if libc.setns(descriptor, _CLONE_NEWNET) != 0:
            number = ctypes.get_errno()
            raise OSError(number, os.strerror(number))


class Network:
    """Two hosts and the cable between them."""

    def __init__(self, first: Host, second: Host) -> None:
        self.first = first
        self.second = second

    def cut(self) -> None:
        """Let nothing through any more, in either direction."""
        _run("ip", "-n", self.second.name, "link", "set", "cable", "down")

    def mend(self) -> None:
        """Undo `cut`."""
        _run("ip", "-n", self.second.name, "link", "set", "cable", "up")
        _route(self.second)

    def lose_nothing(self) -> None:
        """Undo `lose`."""
        for host in (self.first, self.second):
            if shutil.which("nft"):
                host.run("nft", "delete", "table", "inet", "faults")
            else:
                host.run("tc", "qdisc", "delete", "dev", "cable", "root")

    def lose(self, percent: int) -> None:
        """Drop so many of 100 packets that come in, on each host, by nftables or netem."""
        for host in (self.first, self.second):
            if shutil.which("nft"):
                host.run("nft", "-f", "-", text=_LOSSES.format(percent=percent))
            else:
                host.run(
                    "tc", "qdisc", "add", "dev", "cable", "root", "netem", "loss", f"{percent}%"
                )

    def lose_first_answers(self) -> None:
        """Drop what the first host is sent at first, on each of its ports; needs nftables."""
        self.first.run("nft", "-f", "-", text=_FIRST_LOSSES)


@contextmanager
def two_hosts() -> Iterator[Network]:
    """Make the hosts; they go with the `with` statement, and everything in them.

    Those that a killed run has left behind do no harm: each has the id of its process in its
    name, and is removed here when that is gone.
    """
    _remove_leftovers()
    number = next(_numbers)
    hosts = [Host(f"{_PREFIX}-{os.getpid()}-{number}-{side}") for side in ("a", "b")]
    try:
        for host in hosts:
            _run("ip", "netns", "add", host.name)
        _run(
            *("ip", "link", "add", "cable", "netns", hosts[0].name, "type", "veth"),
            *("peer", "name", "cable", "netns", hosts[1].name),
        )
        for index, host in enumerate(hosts, 1):
            _run("ip", "-n", host.name, "address", "add", f"10.99.0.{index}/24", "dev", "cable")
            _run("ip", "-n", host.name, "link", "set", "lo", "up")
            _run("ip", "-n", host.name, "link", "set", "cable", "up")
            _route(host)
        yield Network(*hosts)
    finally:
        for host in hosts:
            subprocess.run(["ip", "netns", "delete", host.name], check=False, capture_output=True)


def why_not() -> str:
    """Why hosts cannot be made here; `""` where they can."""
    if os.geteuid() != 0:
        return "network namespaces need root"
    if not shutil.which("ip"):
        return "network namespaces need iproute2 (the command ip)"
    try:
        with two_hosts():
            return ""
    except subprocess.CalledProcessError as error:
        return f"network namespaces cannot be made here: {error.stderr.strip()}"


def why_nothing_can_be_lost(network: Network) -> str:
    """Why no packets can be lost here; `""` where they can, by nftables or netem."""
    try:
        network.lose(0)
    except (subprocess.CalledProcessError, FileNotFoundError) as error:
        said = getattr(error, "stderr", "") or str(error)
        return f"no nftables here (the command nft), and no netem: {said.strip()}"
    network.lose_nothing()
    return ""


def skip_where_nothing_can_be_lost(network: Network) -> None:
    """Skip the test where neither nftables nor netem is there."""
    if problem := why_nothing_can_be_lost(network):
        pytest.skip(problem)


def _route(host: Host) -> None:
    # Multicast has to find the cable too; the route goes with each `cut`.
    _run("ip", "-n", host.name, "route", "replace", "224.0.0.0/4", "dev", "cable")


def _remove_leftovers() -> None:
    listed = subprocess.run(["ip", "netns", "list"], check=True, capture_output=True, text=True)
    for line in listed.stdout.splitlines():
        prefix, _, rest = line.split()[0].partition("-")
        process = rest.split("-")[0]
        if prefix == _PREFIX and process.isdigit() and not os.path.exists(f"/proc/{process}"):
            name = line.split()[0]
            subprocess.run(["ip", "netns", "delete", name], check=False, capture_output=True)


def _run(*command: str, text: str | None = None) -> None:
    subprocess.run(command, check=True, capture_output=True, text=True, input=text, timeout=20)
