"""Leaving the graph while others come and go (the hang that `_ros.discovery` tells of)."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.context import Context
from rclpy.node import Node

from actionkit._ros import discovery


@contextmanager
def bare_node(name: str, domain: int) -> Iterator[Node]:
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=domain)
    node = Node(name, context=context, enable_rosout=False, start_parameter_services=False)
    yield node
    discovery.stop_listening(node)
    node.destroy_node()
    context.try_shutdown()


def servers_seen(node: Node) -> int:
    return int(node.count_publishers("/fibonacci/_action/status"))


def test_a_node_that_stops_listening_hears_no_more(action_server, ros_domain):
    with bare_node("deaf", ros_domain) as deaf, bare_node("hearing", ros_domain) as hearing:
        assert discovery.stop_listening(deaf)
        assert discovery.stop_listening(deaf)  # twice does no harm
        action_server("fibonacci")
        give_up = time.monotonic() + 20
        while not servers_seen(hearing):  # there is no event to wait for in rclpy
            assert time.monotonic() < give_up
        assert servers_seen(deaf) == 0


def test_others_may_come_and_go_while_clients_are_closed(make_client, action_server):
    """Without `stop_listening` this hangs, though not each time: see the module's docstring."""
    client = make_client(name="other")
    client.close()
    for _ in range(5):
        server = action_server("fibonacci")
        client = make_client()
        server.kill()
        client.close()


def test_another_middleware_is_left_alone(monkeypatch, ros_domain):
    with bare_node("alone", ros_domain) as node:
        monkeypatch.setattr(discovery, "_fast_dds", lambda: None)
        assert not discovery.stop_listening(node)
        monkeypatch.undo()
