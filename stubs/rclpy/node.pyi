from collections.abc import Callable
from typing import Any

from rclpy import _rclpy_pybind11
from rclpy.callback_groups import CallbackGroup
from rclpy.client import Client
from rclpy.context import Context
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import Executor
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.topic_endpoint_info import TopicEndpointInfo

class Node:
    executor: Executor | None
    def __init__(
        self,
        node_name: str,
        *,
        context: Context | None = None,
        cli_args: list[str] | None = None,
        namespace: str | None = None,
        use_global_arguments: bool = True,
        enable_rosout: bool = True,
        start_parameter_services: bool = True,
        parameter_overrides: list[Parameter] | None = None,
        allow_undeclared_parameters: bool = False,
        automatically_declare_parameters_from_overrides: bool = False,
        enable_logger_service: bool = False,
    ) -> None: ...
    @property
    def context(self) -> Context: ...
    @property
    def handle(self) -> _rclpy_pybind11.Node: ...
    @property
    def default_callback_group(self) -> CallbackGroup: ...
    def get_name(self) -> str: ...
    def get_namespace(self) -> str: ...
    def get_fully_qualified_name(self) -> str: ...
    def get_logger(self) -> RcutilsLogger: ...
    def create_client(
        self,
        srv_type: type[Any],
        srv_name: str,
        *,
        qos_profile: QoSProfile = ...,
        callback_group: CallbackGroup | None = None,
    ) -> Client: ...
    # With raw=True the callback gets bytes, and callbacks may take the message's info besides.
    def create_subscription(
        self,
        msg_type: type[Any],
        topic: str,
        callback: Callable[..., object],
        qos_profile: QoSProfile | int,
        *,
        callback_group: CallbackGroup | None = None,
        event_callbacks: SubscriptionEventCallbacks | None = None,
        raw: bool = False,
    ) -> Subscription: ...
    def create_publisher(
        self, msg_type: type[Any], topic: str, qos_profile: QoSProfile | int
    ) -> Any: ...
    def destroy_client(self, client: Client) -> bool: ...
    def destroy_subscription(self, subscription: Subscription) -> bool: ...
    def destroy_node(self) -> None: ...
    def resolve_service_name(self, service: str, *, only_expand: bool = False) -> str: ...
    def resolve_topic_name(self, topic: str, *, only_expand: bool = False) -> str: ...
    def count_publishers(self, topic_name: str) -> int: ...
    def get_publishers_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]: ...
    def get_subscriptions_info_by_topic(
        self, topic_name: str, no_mangle: bool = False
    ) -> list[TopicEndpointInfo]: ...
    def get_node_names(self) -> list[str]: ...
    def get_topic_names_and_types(
        self, no_demangle: bool = False
    ) -> list[tuple[str, list[str]]]: ...
    def get_service_names_and_types(self) -> list[tuple[str, list[str]]]: ...
    def get_node_names_and_namespaces(self) -> list[tuple[str, str]]: ...
