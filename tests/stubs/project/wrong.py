"""What a type checker must refuse. For type checkers only, with stubs in `typings/`.

Each marked line, and no other, is an error to mypy and to pyright, of the kinds in brackets.
"""
# pyright: reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownLambdaType=false, reportUnknownArgumentType=false
# pyright: reportUnusedExpression=false, reportUnknownParameterType=false
# ruff: noqa: B018

from __future__ import annotations

import numpy
import odd_interfaces.msg
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Point, Pose, PoseStamped, PoseWithCovariance
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from odd_interfaces.action import Pick
from odd_interfaces.msg import Odd, Wide
from plain_interfaces.msg import Plain
from sensor_msgs.msg import JointState
from std_msgs.msg import Header, String
from test_msgs.action import Fibonacci
from test_msgs.msg import BasicTypes, BoundedSequences

from actionkit import Client


def a_mere_client(client: Client) -> None: ...  # error[type-arg, reportMissingTypeArgument]


def calls(client: Client[Pick]) -> None:
    client.call(Pick.Goal(itme="cup"))  # error[call-arg, reportCallIssue]: mistyped
    client.call(Pick.Goal(item=5))  # error[arg-type, reportArgumentType]
    client.call(Fibonacci.Goal())  # error[arg-type, reportArgumentType]: another action's
    client.call(Pick.Goal()).okay  # error[attr-defined, reportAttributeAccessIssue]
    client.call(Pick.Goal("cup"))  # error[misc, call-arg, reportCallIssue]: by keyword only
    client.call({}).ok.real.nothing  # error[attr-defined, reportAttributeAccessIssue]
    client.call({}, on_feedback=lambda it: it.no)  # error[attr-defined, reportAttributeAccessIssue]


def fields() -> None:
    PoseStamped(header=Header(frame="map"))  # error[call-arg, reportCallIssue]
    PoseStamped(pose=Point())  # error[arg-type, reportArgumentType]
    PoseStamped().pose = Point()  # error[assignment, reportAttributeAccessIssue]
    Pose().position.u = 1.0  # error[attr-defined, reportAttributeAccessIssue]
    Time(sec=1.5)  # error[arg-type, reportArgumentType]
    Time(sec=None)  # error[arg-type, reportArgumentType]
    String(data=b"a")  # error[arg-type, reportArgumentType]
    BasicTypes(bool_value="yes")  # error[arg-type, reportArgumentType]
    GetPlan.Request(strat=PoseStamped())  # error[call-arg, reportCallIssue]
    GetPlan.Response().path  # error[attr-defined, reportAttributeAccessIssue]
    GoalStatus.STATUS_SUCEEDED  # error[attr-defined, reportAttributeAccessIssue]


def arrays() -> None:
    Path(poses=PoseStamped())  # error[arg-type, reportArgumentType]: not a list
    Path(poses=[Pose()])  # error[list-item, reportArgumentType]
    Path().poses.append(Pose())  # error[arg-type, reportArgumentType]
    JointState(name="arm")  # error[arg-type, reportArgumentType]: not a list
    JointState(position=["1"])  # error[list-item, reportArgumentType]
    JointState().position = 1.0  # error[assignment, reportAttributeAccessIssue]
    JointState().position.append("1")  # error[arg-type, reportArgumentType]
    PoseWithCovariance(covariance=0.0)  # error[arg-type, reportArgumentType]
    PoseWithCovariance().covariance = "36"  # error[assignment, reportAttributeAccessIssue]
    BoundedSequences(bool_values=["yes"])  # error[list-item, reportArgumentType]


def odd() -> None:
    Odd(self=3)  # error[misc, call-arg, reportCallIssue]: what ROS generates refuses it, too
    Odd(array="1")  # error[arg-type, reportArgumentType]
    Odd(str=1)  # error[arg-type, reportArgumentType]
    Odd().int = numpy.zeros(3).tolist  # error[assignment, reportAttributeAccessIssue]
    Wide(field200=1)  # error[call-arg, reportCallIssue]
    Plain(number="1")  # error[arg-type, reportArgumentType]
    {Odd(): 1}  # error[reportUnhashable]: nor can it be hashed
    odd_interfaces.msg.Broken  # error[attr-defined, reportAttributeAccessIssue]
