"""Asks the ROS graph about actions, their servers and clients."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from rclpy.node import Node
from rclpy.qos import ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rclpy.utilities import get_rmw_implementation_identifier

from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.rclpy_private.native import RCLError

_FEEDBACK = "/_action/feedback"
_KNOWN_HASH = 1
"""The version of a type hash (RIHS01). Some middleware has no type hashes."""
_OF_EVERY_NODE = "/parameter_events"
_PARTICIPANT = 12
"""Bytes of an endpoint's id that identify its DDS participant."""
_FEEDBACK_TYPE = "_FeedbackMessage"
_DDS = ("rmw_fastrtps", "rmw_cyclonedds", "rmw_connext")
"""Middleware that shows the answers of services as topics; Zenoh does not."""


@dataclass(frozen=True)
class Endpoint:
    """A server or client of an action, or another publisher: one end of its feedback topic."""

    gid: bytes  # of its publisher or subscription; a restarted server has another one (R1)
    action_type: str  # such as `test_msgs/action/Fibonacci`
    node: str  # the full name of its node; `""` while it is not known yet
    best_effort: bool = False  # whether it publishes, or wants to receive, feedback best-effort
    serves: bool = True  # `False` if its node only publishes: it lacks the action's services

    @property
    def participant(self) -> bytes:
        """What all endpoints of one process have in common, or of one of its contexts."""
        return self.gid[:_PARTICIPANT]


@dataclass(frozen=True)
class Versions:
    """The type hashes of one part of an action, such as `RIHS01_dfe7...`."""

    end: str  # `"goal"`, `"result"` or `"feedback"`
    servers: tuple[str, ...]
    clients: tuple[str, ...]

    def __str__(self) -> str:
        sides = {"server": self.servers, "client": self.clients}
        told = (f"{side} {' and '.join(hashes)}" for side, hashes in sides.items() if hashes)
        return f"{self.end}: {', '.join(told)}"

    @property
    def differ(self) -> bool:
        """Whether one side would misread the other's messages."""
        return bool(self.servers) and len({*self.servers, *self.clients}) > 1


def feedback_topic(action_name: str) -> str:
    """Return the topic on which the servers of an action publish feedback."""
    return action_name + _FEEDBACK


def servers(node: Node, names: ActionNames) -> list[Endpoint]:
    """Return the servers of an action.

    Raises:
        RCLError: The node's context was shut down.
    """
    return [end for end in publishers(node, names) if end.serves]


def publishers(node: Node, names: ActionNames) -> list[Endpoint]:
    """Return all that publish an action's feedback: its servers, but also players and relays.

    A server is made with its services first, so nearly always they are discovered first, too.

    Raises:
        RCLError: The node's context was shut down.
    """
    found = list(map(endpoint_of, node.get_publishers_info_by_topic(names.feedback)))
    # Where the feedback is remapped, it may come by a relay.
    remapped = names.feedback != feedback_topic(names.action)
    if not found or remapped or not middleware().startswith(_DDS):
        return found
    answering = node.get_publishers_info_by_topic(_replies(names.send_goal), no_mangle=True)
    serving = {(bytes(info.endpoint_gid[:_PARTICIPANT]), _node_of(info)) for info in answering}

    def serves(end: Endpoint) -> bool:
        # Names of nodes come later; until then, the process decides.
        return any(
            participant == end.participant and (node == end.node or not (node and end.node))
            for participant, node in serving
        )

    return [end if serves(end) else replace(end, serves=False) for end in found]


def endpoint_of(info: TopicEndpointInfo) -> Endpoint:
    """Return the end of a feedback topic that a publisher or subscription is."""
    return Endpoint(
        gid=bytes(info.endpoint_gid),
        action_type=info.topic_type.removesuffix(_FEEDBACK_TYPE),
        node=_node_of(info),
        best_effort=_is_best_effort(info),
    )


def _node_of(info: TopicEndpointInfo) -> str:
    # For a moment after discovery, the middleware has a placeholder.
    if "_UNKNOWN_" in info.node_name:
        return ""
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def _replies(service: str) -> str:
    """Return the middleware's own name for the topic of a service's answers."""
    return f"rr{service}Reply"


def action_names(node: Node) -> list[str]:
    """Return the names of all actions that have a server or a client."""
    return list(action_types(node))


def action_types(node: Node) -> dict[str, list[str]]:
    """Return the names of all actions that have a server or a client, with their types."""
    return {
        topic.removesuffix(_FEEDBACK): [name.removesuffix(_FEEDBACK_TYPE) for name in types]
        for topic, types in node.get_topic_names_and_types()
        if topic.endswith(_FEEDBACK)
    }


def all_actions(node: Node) -> dict[str, tuple[str, ...]]:
    """Return every action name that has a server, with the types it is served with."""
    found: dict[str, tuple[str, ...]] = {}
    for name in action_names(node):
        types = {server.action_type for server in servers(node, ActionNames.of(name))}
        if types:
            found[name] = tuple(sorted(types))
    return found


def best_effort_services(node: Node, names: ActionNames) -> tuple[str, ...]:
    """Return an action's services that a server offers best-effort: we get no answer from these.

    Raises:
        RCLError: The node's context was shut down.
    """
    topics = {
        "send_goal": _replies(names.send_goal),
        "get_result": _replies(names.get_result),
        "cancel_goal": _replies(names.cancel_goal),
    }
    return tuple(
        end
        for end, topic in topics.items()
        if any(map(_is_best_effort, node.get_publishers_info_by_topic(topic, no_mangle=True)))
    )


def no_data_from(ends: Iterable[Endpoint]) -> bool:
    """Return whether none of these servers, if any, has sent anything: they are in sight only.

    The names of nodes are the first data of a process. The middleware sends them by itself, so also
    those of a process that is busy.
    """
    names = [end.node for end in ends]
    return bool(names) and not any(names)


def _is_best_effort(info: TopicEndpointInfo) -> bool:
    return bool(info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT)


def versions(node: Node, names: ActionNames, of_client: str | None = None) -> list[Versions]:
    """Return the type hashes of an action's servers and clients.

    They are empty if the middleware has none. `of_client` is the name of a node: only its clients
    are listed; `None` means all.

    Raises:
        RCLError: The node's context was shut down.
    """
    readers, writers = node.get_subscriptions_info_by_topic, node.get_publishers_info_by_topic
    ends = (
        # The middleware's own names for the topics.
        ("goal", f"rq{names.send_goal}Request", readers, writers),
        ("result", _replies(names.get_result), writers, readers),
        ("feedback", f"rt{names.feedback}", writers, readers),
    )
    found = []
    for end, topic, of_servers, of_clients in ends:
        servers, clients = of_servers(topic, no_mangle=True), of_clients(topic, no_mangle=True)
        ours = [info for info in clients if of_client in (None, info.node_name)]
        found.append(Versions(end, _hashes(servers), _hashes(ours)))
    return found


def _hashes(infos: list[TopicEndpointInfo]) -> tuple[str, ...]:
    hashes = [info.topic_type_hash for info in infos]
    return tuple(sorted({str(each) for each in hashes if each.version == _KNOWN_HASH}))


def is_alone(node: Node) -> bool:
    """Return whether this node sees no other one, of any process."""
    try:
        return len(node.get_node_names()) <= 1
    except RCLError:  # the context was shut down
        return False


def is_last(node: Node) -> bool:
    """Return whether no other node in this node's context needs discovery.

    Either there is no other node, or the context was shut down: then nothing is discovered.
    """
    try:
        # Every node of rclpy publishes this; the ids of one participant begin alike.
        infos = node.get_publishers_info_by_topic(_OF_EVERY_NODE)
    except RCLError:
        return True
    nodes = [(info.node_name, bytes(info.endpoint_gid[:_PARTICIPANT])) for info in infos]
    ours = {participant for name, participant in nodes if name == node.get_name()}
    return not any(participant in ours for name, participant in nodes if name != node.get_name())


def middleware() -> str:
    """Return the name of the middleware in use, such as `rmw_fastrtps_cpp`."""
    return str(get_rmw_implementation_identifier())
