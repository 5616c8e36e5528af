from enum import IntEnum

from rclpy.duration import Duration

class QoSPolicyEnum(IntEnum):  # type: ignore[misc]  # a base, and has no members
    @classmethod
    def short_keys(cls) -> list[str]: ...
    @classmethod
    def get_from_short_key(cls, name: str) -> int: ...
    @property
    def short_key(self) -> str: ...

class HistoryPolicy(QoSPolicyEnum):
    SYSTEM_DEFAULT = 0
    KEEP_LAST = 1
    KEEP_ALL = 2
    UNKNOWN = 3

class ReliabilityPolicy(QoSPolicyEnum):
    SYSTEM_DEFAULT = 0
    RELIABLE = 1
    BEST_EFFORT = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4

class DurabilityPolicy(QoSPolicyEnum):
    SYSTEM_DEFAULT = 0
    TRANSIENT_LOCAL = 1
    VOLATILE = 2
    UNKNOWN = 3
    BEST_AVAILABLE = 4

class LivelinessPolicy(QoSPolicyEnum):
    SYSTEM_DEFAULT = 0
    AUTOMATIC = 1
    MANUAL_BY_TOPIC = 3
    UNKNOWN = 4
    BEST_AVAILABLE = 5

QoSHistoryPolicy = HistoryPolicy
QoSReliabilityPolicy = ReliabilityPolicy
QoSDurabilityPolicy = DurabilityPolicy
QoSLivelinessPolicy = LivelinessPolicy

class InvalidQoSProfileException(Exception): ...

class QoSProfile:
    history: HistoryPolicy
    depth: int
    reliability: ReliabilityPolicy
    durability: DurabilityPolicy
    lifespan: Duration
    deadline: Duration
    liveliness: LivelinessPolicy
    liveliness_lease_duration: Duration
    avoid_ros_namespace_conventions: bool
    def __init__(
        self,
        *,
        history: HistoryPolicy = ...,
        depth: int = ...,
        reliability: ReliabilityPolicy = ...,
        durability: DurabilityPolicy = ...,
        lifespan: Duration = ...,
        deadline: Duration = ...,
        liveliness: LivelinessPolicy = ...,
        liveliness_lease_duration: Duration = ...,
        avoid_ros_namespace_conventions: bool = ...,
    ) -> None: ...

qos_profile_action_status_default: QoSProfile
qos_profile_services_default: QoSProfile
qos_profile_sensor_data: QoSProfile
qos_profile_system_default: QoSProfile
