"""ActionKit's own node: how it is made, and how it leaves the graph."""

from __future__ import annotations

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from actionkit._ros.discovery import stop_listening
from actionkit._ros.joining import joining
from actionkit._ros.native import node_is_destroyed


def make_node(name: str, context: Context) -> Node:
    """Make the only node of a context.

    Raises:
        Exception: Whatever rclpy raises where that cannot be done.
    """
    with joining():
        return Node(
            name,
            context=context,
            # A launch file's __node is meant for the user's node: two nodes of one name
            # confuse every tool.
            cli_args=["--ros-args", "-r", f"__node:={name}"],
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[
                Parameter("start_type_description_service", value=False),
            ],
        )


def leave_graph(node: Node) -> None:
    """Destroy the only node of a context, unless that was done; its entities were before."""
    if not node_is_destroyed(node):
        stop_listening(node)
        node.destroy_node()
