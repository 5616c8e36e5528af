"""The place of a round's processes: this machine, or two hosts with a network between."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext

from actionkit.testing._domains import isolated_domain
from tests.faults import network
from tests.faults.network import Network


class Place:
    """A ROS domain, and where its clients and servers run.

    Attributes:
        name: "local" or "network".
        domain: The id of the ROS domain.
        cable: The two hosts and what joins them; `None` where all is on this machine.
        lingering: The actions whose servers of the round before may still be in sight, dead.
    """

    def __init__(self, domain: int, cable: Network | None) -> None:
        self.name = "local" if cable is None else "network"
        self.domain = domain
        self.cable = cable
        self.lingering: frozenset[str] = frozenset()

    def enter(self) -> None:
        """Let all processes that are started from now on belong here."""
        os.environ["ROS_DOMAIN_ID"] = str(self.domain)
        os.environ.pop("ROS_LOCALHOST_ONLY", None)
        os.environ.pop("ROS_STATIC_PEERS", None)
        if self.cable is None:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
            os.environ.pop("FASTDDS_BUILTIN_TRANSPORTS", None)
        else:
            os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "SUBNET"
            # The two hosts share this machine's memory, which a cable has no part in.
            os.environ["FASTDDS_BUILTIN_TRANSPORTS"] = "UDPv4"

    def clients(self) -> AbstractContextManager[None]:
        """Let this thread start processes on the host of the clients."""
        return nullcontext() if self.cable is None else self.cable.first.inside()

    def servers(self) -> AbstractContextManager[None]:
        """Let this thread start processes on the host of the servers."""
        return nullcontext() if self.cable is None else self.cable.second.inside()


@contextmanager
def places(*, with_network: bool) -> Iterator[list[Place]]:
    """Make the places: this machine, and two hosts where that is asked for."""
    with ExitStack() as stack:
        found = [Place(stack.enter_context(isolated_domain()), None)]
        if with_network:
            cable = stack.enter_context(network.two_hosts())
            found.append(Place(stack.enter_context(isolated_domain()), cable))
        yield found
