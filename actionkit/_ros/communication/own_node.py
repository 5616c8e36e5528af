"""Makes ActionKit's own nodes, and removes them from the graph."""

from __future__ import annotations

import sys

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter

from actionkit._ros.communication.secured import explained, raise_if_secured
from actionkit._ros.endpoints.graph import is_last
from actionkit._ros.endpoints.names import ActionNames, resolve
from actionkit._ros.rclpy_private.native import node_is_destroyed, outlive_shutdown
from actionkit._ros.workarounds.listener_hang import stop_listening


def start(context: Context, domain_id: int) -> None:
    """Initialise a context of ours, with the ROS arguments of the process.

    Raises:
        ValueError: rcl refuses the arguments.
        SecurityError: Files of security are missing.
    """
    try:
        context.init(None, initialize_logging=False, domain_id=domain_id)
    except (RuntimeError, UnicodeError) as error:
        text = str(error).rsplit(", at ", 1)[0]
        if "SECURITY ERROR" in text:
            raise_if_secured(error, own=True)
        reason = "one is not UTF-8" if isinstance(error, UnicodeError) else text
        raise ValueError(
            f"ROS cannot be started with the arguments of this process, sys.argv={sys.argv!r}:"
            f" {reason}. Correct them, or call rclpy.init(args=[...]) first, with those that are"
            " meant for ROS"
        ) from error


def make_node(name: str, context: Context, *, own: bool) -> Node:
    """Make our node in a context; `own` means that it is one of ours.

    It ignores the process's ROS arguments: every name that it uses is resolved already.

    Raises:
        SecurityError: Security forbids it.
        Exception: Any error of rclpy, if the node cannot be made.
    """
    with explained(context, own=own):
        return _node(name, context, use_global_arguments=False)


def resolve_without_node(context: Context, node: Node, action_name: str) -> ActionNames:
    """Return an action's names by the ROS arguments of a context.

    Only a node has these rules, so there is one for a millisecond, named after our own.

    Raises:
        ValueError: It is not a valid action name.
    """
    name = f"{node.get_name()}_names"
    # __node in a launch file is for the user's node: two nodes with one name confuse every tool.
    rename = ["--ros-args", "-r", f"__node:={name}"]
    resolver = _node(name, context, use_global_arguments=True, cli_args=rename)
    try:
        return resolve(resolver, action_name)
    finally:
        resolver.destroy_node()


def leave_graph(node: Node) -> None:
    """Destroy our node if it still exists; its entities were destroyed before."""
    if not node_is_destroyed(node):
        # The nodes of one context share a listener, which ends with the last of them.
        if is_last(node):
            stop_listening(node)
        node.destroy_node()


def _node(
    name: str,
    context: Context,
    *,
    use_global_arguments: bool,
    cli_args: list[str] | None = None,
) -> Node:
    node = Node(
        name,
        context=context,
        cli_args=cli_args,
        use_global_arguments=use_global_arguments,
        enable_rosout=False,
        start_parameter_services=False,
        parameter_overrides=[Parameter("start_type_description_service", value=False)],
    )
    outlive_shutdown(node)
    return node
