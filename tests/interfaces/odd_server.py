"""A plain rclpy server of the actions of odd_actions, as a user would write it."""

from __future__ import annotations

from typing import Any

import rclpy
from odd_actions.action import Odd, Wide  # type: ignore[import-not-found]
from rclpy.action.server import ActionServer
from rclpy.node import Node


def odd(handle: Any) -> Any:
    feedback = Odd.Feedback()
    feedback.percent = float(Odd.Feedback.A_CONSTANT)
    handle.publish_feedback(feedback)
    handle.succeed()
    goal = handle.request
    told = (goal.array, goal.str, list(goal.self), goal.order, goal.part.holder.at.x, goal.type)
    return Odd.Result(msg=repr(told), class_name=len(goal.parts))


def wide(handle: Any) -> Any:
    handle.succeed()
    return Wide.Result(sum=sum(getattr(handle.request, f"field_{n}") for n in range(200)))


def main() -> None:
    rclpy.init()
    node = Node("odd_server")
    servers = [ActionServer(node, Odd, "odd", odd), ActionServer(node, Wide, "wide", wide)]
    print("ready", flush=True)
    rclpy.spin(node)
    del servers


if __name__ == "__main__":
    main()
