"""The DDS entities of one client, made with rclpy's public functions.

They are three service clients and one or two raw subscriptions. rclpy's own `ActionClient` turns
every goal that the server remembers into Python objects at each status message, decodes the
feedback of all clients' goals, and searches its tables whenever a goal ends (contract C7.2).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from action_msgs.srv import CancelGoal
from rclpy.client import Client as ServiceClient
from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_action_status_default
from rclpy.subscription import Subscription

from actionkit._ros.endpoints.names import ActionNames
from actionkit._ros.rclpy_private.wait_set import (
    EventSource,
    MessageSource,
    ResponseSource,
    Source,
    own_group,
    subscribe_raw,
    unused,
)

_STATUS_DEPTH = 20
"""Depth of the queue of status messages, which are read ten times a second."""
_DEEP = 2000
"""Depth of our queues: a thousand results and as many feedback messages may come at once (R3)."""


class Entities:
    """One client's entities for one action. On the communication thread only."""

    def __init__(
        self,
        node: Node,
        impl: Any,
        names: ActionNames,
        *,
        on_goal: Callable[[int, Any], None],
        on_result: Callable[[int, Any], None],
        on_cancel: Callable[[int, Any], None],
        on_feedback: Callable[[], None],
        on_matched: Callable[[int, int], None],
    ) -> None:
        """Make the entities; any error of rclpy for a bad name or type goes to the caller.

        Args:
            impl: The action type's `Impl`.
            names: The names of the action, used as they are.
            on_goal: Called with the sequence number of a goal request and the response to it.
            on_result: The same for result requests.
            on_cancel: The same for cancel requests.
            on_feedback: Called when feedback of the action has come, for any goal.
            on_matched: Called when servers come or go, with how many there are, and how many of
                them are new.
        """
        self._node = node
        self._impl = impl
        self._names = names
        self._clients: list[ServiceClient] = []
        self._subscriptions: list[Subscription] = []
        self._best_effort = False
        """Whether feedback is received best-effort."""
        self._on_matched = on_matched
        self._ever_matched = 0
        """How many servers the feedback's subscription has matched since it was made."""
        try:
            # The order matters: servers discover the endpoints in the order in which they are
            # made, so a server that answers a cancel request knows all the others (R4).
            subscription = self._subscribe_feedback()
            self.feedback = MessageSource(subscription, on_feedback)
            self.matched: EventSource | None = None
            for handler in list(subscription.event_handlers)[:1]:
                self.matched = EventSource(handler, self._tell_matched)
            self.goal = ResponseSource(self._goal_client(), on_goal)
            self.result = ResponseSource(self._result_client(), on_result)
            self.cancel = ResponseSource(self._cancel_client(), on_cancel)
        except BaseException:  # no entity is left behind
            self.destroy()
            raise

    def recreate(self, node: Node) -> None:
        """After `destroy`, make the entities again on another node, for the same sources.

        Any error of rclpy goes to the caller.
        """
        self._node = node
        try:
            self._use_feedback()
            self.goal.use(self._goal_client())
            self.result.use(self._result_client())
            self.cancel.use(self._cancel_client())
        except BaseException:  # as above
            self.destroy()
            raise

    def receive_best_effort(self) -> None:
        """Subscribe to feedback again, so that servers which publish it best-effort match, too.

        Not at once: from a server that repeats what was lost, this subscription gets no repetition.
        Does nothing the second time. Any error of rclpy goes to the caller.
        """
        if self._best_effort:
            return
        self._best_effort = True
        before = self._subscriptions.copy()
        self._use_feedback()
        for subscription in before:
            self._subscriptions.remove(subscription)
            self._node.destroy_subscription(subscription)

    @property
    def sources(self) -> list[Source]:
        """What the thread can wait for, except the status."""
        always: list[Source] = [self.goal, self.result, self.cancel, self.feedback]
        return always if self.matched is None else [*always, self.matched]

    def services_ready(self) -> bool:
        """Whether this side sees the endpoints of all three services.

        Raises:
            RCLError: The node's context was shut down.
        """
        return all(client.service_is_ready() for client in self._clients)

    def subscribe_status(self, on_status: Callable[[], None]) -> MessageSource:
        """Subscribe to the status messages; the latest one comes at once."""
        cls, usual = self._impl.GoalStatusMessage, qos_profile_action_status_default
        qos = QoSProfile(
            depth=_STATUS_DEPTH, reliability=usual.reliability, durability=usual.durability
        )
        return subscribe_raw(self._node, cls, self._names.status, qos, on_status)

    def unsubscribe_status(self, source: MessageSource) -> None:
        """Destroy the subscription that `subscribe_status` made."""
        self._node.destroy_subscription(source.subscription)

    def destroy(self) -> None:
        """Destroy all entities except the subscription to the status."""
        for client in self._clients:
            self._node.destroy_client(client)
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)
        self._clients.clear()
        self._subscriptions.clear()

    def _goal_client(self) -> ServiceClient:
        return self._client(self._impl.SendGoalService, self._names.send_goal)

    def _result_client(self) -> ServiceClient:
        return self._client(self._impl.GetResultService, self._names.get_result)

    def _cancel_client(self) -> ServiceClient:
        return self._client(CancelGoal, self._names.cancel_goal)

    def _client(self, srv_type: Any, name: str) -> ServiceClient:
        qos = QoSProfile(depth=_DEEP)
        client = self._node.create_client(
            srv_type, name, qos_profile=qos, callback_group=own_group()
        )
        self._clients.append(client)
        return client

    def _use_feedback(self) -> None:
        self._ever_matched = 0
        subscription = self._subscribe_feedback()
        self.feedback.use(subscription)
        for handler in list(subscription.event_handlers)[:1]:
            if self.matched is not None:
                self.matched.use(handler)

    def _tell_matched(self, event: Any) -> None:
        # Two servers that come at one moment make two events, each with `total_count_change` 1.
        # But the first one may already count both.
        came, self._ever_matched = event.total_count - self._ever_matched, event.total_count
        self._on_matched(event.current_count, came)

    def _subscribe_feedback(self) -> Subscription:
        try:
            return self._subscription(
                SubscriptionEventCallbacks(matched=unused, use_default_callbacks=False)
            )
        except UnsupportedEventTypeError:  # another middleware: the monitor asks the graph instead
            return self._subscription(SubscriptionEventCallbacks(use_default_callbacks=False))

    def _subscription(self, events: SubscriptionEventCallbacks) -> Subscription:
        subscription = self._node.create_subscription(
            self._impl.FeedbackMessage,
            self._names.feedback,
            unused,
            QoSProfile(
                depth=_DEEP,
                reliability=ReliabilityPolicy.BEST_EFFORT
                if self._best_effort
                else ReliabilityPolicy.RELIABLE,
            ),
            callback_group=own_group(),
            raw=True,
            event_callbacks=events,
        )
        self._subscriptions.append(subscription)
        return subscription
