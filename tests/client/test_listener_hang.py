"""Leaving the graph while others come and go (what `listener_hang` works around)."""

from __future__ import annotations

import ctypes
import os
import queue
import time
from collections.abc import Iterator
from contextlib import contextmanager

from rclpy.context import Context
from rclpy.node import Node

from actionkit._ros.workarounds import listener_hang

_GET_LISTENER = "_ZNK8eprosima7fastdds3dds17DomainParticipant12get_listenerEv"
"""`DomainParticipant::get_listener() const`"""


@contextmanager
def bare_node(name: str, domain: int) -> Iterator[Node]:
    context = Context()
    context.init(args=[], initialize_logging=False, domain_id=domain)
    node = Node(name, context=context, enable_rosout=False, start_parameter_services=False)
    yield node
    listener_hang.stop_listening(node)
    node.destroy_node()
    context.try_shutdown()


def servers_seen(node: Node) -> int:
    return int(node.count_publishers("/fibonacci/_action/status"))


def test_a_node_that_stops_listening_hears_no_more(action_server, ros_domain):
    with bare_node("deaf", ros_domain) as deaf, bare_node("hearing", ros_domain) as hearing:
        assert has_listener(deaf)
        assert listener_hang.stop_listening(deaf)
        assert not has_listener(deaf)
        assert listener_hang.stop_listening(deaf)  # twice does no harm
        action_server("fibonacci")
        give_up = time.monotonic() + 20
        while not servers_seen(hearing):  # there is no event to wait for in rclpy
            assert time.monotonic() < give_up
        assert servers_seen(deaf) == 0


def has_listener(node: Node) -> bool:
    """Whether Fast DDS still calls the node's listener, and could hang while it is detached."""
    library = listener_hang._fast_dds()
    assert library is not None
    rmw = ctypes.CDLL("librmw_fastrtps_cpp.so", os.RTLD_NOLOAD | os.RTLD_LAZY)
    get_listener = listener_hang._function(rmw, _GET_LISTENER, ctypes.c_void_p, 1)
    with node.handle:
        participant = library.participant(library.rmw_handle(node.handle.pointer))
        return get_listener(participant) is not None


def test_a_client_stops_listening_before_its_node_is_destroyed(make_client, monkeypatch):
    """The hang is too rare to be provoked, so this looks for what makes it impossible."""
    listening: queue.Queue[bool] = queue.Queue()
    destroy_node = Node.destroy_node

    def destroy(node: Node) -> None:
        listening.put(has_listener(node))
        destroy_node(node)

    client = make_client()
    assert not client.server_is_ready()
    monkeypatch.setattr(Node, "destroy_node", destroy)
    client.close()
    assert not listening.get(timeout=20)


def test_another_middleware_is_left_alone(monkeypatch, ros_domain):
    with bare_node("alone", ros_domain) as node:
        monkeypatch.setattr(listener_hang, "_fast_dds", lambda: None)
        assert not listener_hang.stop_listening(node)
        monkeypatch.undo()
