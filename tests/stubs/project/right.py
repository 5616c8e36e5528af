"""Users' code on messages of many packages. For type checkers only, with stubs in `typings/`."""

from __future__ import annotations

from array import array

import numpy
from action_msgs.msg import GoalInfo, GoalStatus
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Duration, Time
from geometry_msgs.msg import Point, Pose, PoseStamped, PoseWithCovariance, Quaternion
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetPlan, GetPlan_Request
from numpy.typing import NDArray
from odd_interfaces.action import Pick
from odd_interfaces.msg import Odd, Part, Wide
from plain_interfaces.msg import Plain, Second
from sensor_msgs.msg import BatteryState, Image, JointState, LaserScan
from std_msgs.msg import ColorRGBA, Float64MultiArray, Header, String
from test_msgs.action import Fibonacci, NestedMessage
from test_msgs.msg import Arrays, BoundedSequences, Constants, Defaults, WStrings
from test_msgs.srv import BasicTypes
from typing_extensions import assert_type

from actionkit import Client


def calls() -> None:
    with Client(Pick, "pick") as client:
        assert_type(client, Client[Pick])
        result = client.call(Pick.Goal(item="cup", odd=Odd(str="a", array=range(3))), timeout=5.0)
        assert_type(result, Pick.Result)
        assert_type(result.ok, bool)
        future = client.call_async(Pick.Goal(), lambda feedback: print(feedback.percent + 1.0))
        assert_type(future.result().ok, bool)
        for feedback in future.feedback():
            assert_type(feedback.percent, float)
    nested = Client(NestedMessage, "nested").call({})
    assert_type(nested.nested_field.float64_value, float)
    assert_type(Client(Fibonacci, "fibonacci").call(Fibonacci.Goal(order=1)).sequence, "array[int]")


def nested_messages() -> None:
    pose = PoseStamped(header=Header(frame_id="map", stamp=Time(sec=1)))
    pose.pose.position = Point(x=1.0, y=2)
    pose.pose.orientation.w = 1.0
    assert_type(pose.header.stamp.nanosec, int)
    assert_type(pose.pose, Pose)
    path = Path(poses=[pose])
    path.poses.append(pose)
    path.poses = (pose, pose)
    assert_type(path.poses, list[PoseStamped])
    assert_type(Quaternion().get_fields_and_field_types(), dict[str, str])


def arrays() -> None:
    covariance = PoseWithCovariance(covariance=[0.0] * 36)
    assert_type(covariance.covariance, NDArray[numpy.float64])
    covariance.covariance = numpy.zeros(36)
    covariance.covariance = range(36)
    joints = JointState(name=["a", "b"], position=(1.0, 2.0), velocity=numpy.ones(2))
    assert_type(joints.name, list[str])
    assert_type(joints.position, "array[float]")
    joints.position = [1.0]
    joints.name = ("a",)
    image = Image(data=b"123", height=1, width=1)
    assert_type(image.data, "array[int]")
    OccupancyGrid(data=array("b", [1]))
    LaserScan(ranges=[1.0]).ranges.append(2)
    Float64MultiArray().layout.dim.clear()
    bounded = BoundedSequences(bool_values=[True], byte_values=[b"a"], string_values=["a"])
    assert_type(bounded.bool_values, list[bool])
    assert_type(bounded.byte_values, list[bytes])
    assert_type(bounded.int64_values, "array[int]")
    assert_type(Arrays().uint8_values, NDArray[numpy.uint8])
    assert_type(Arrays().constants_values, list[Constants])


def constants() -> None:
    assert_type(GoalStatus.STATUS_SUCCEEDED, int)
    assert_type(GoalStatus().STATUS_SUCCEEDED, int)
    assert_type(CancelGoal.Response.ERROR_NONE, int)
    assert_type(Constants.BYTE_CONST, bytes)
    assert_type(Constants.FLOAT32_CONST, float)
    assert_type(Defaults.BOOL_VALUE__DEFAULT, bool)
    assert_type(Odd.WORD, str)
    assert_type(BatteryState.POWER_SUPPLY_STATUS_FULL, int)
    if GoalStatus(status=4).status == GoalStatus.STATUS_SUCCEEDED:
        print({GoalStatus.STATUS_SUCCEEDED: "succeeded"})


def services() -> None:
    request = GetPlan.Request(start=PoseStamped(), tolerance=0.5)
    assert_type(request.tolerance, float)
    same: GetPlan_Request = request
    assert_type(GetPlan.Response().plan, Path)
    assert_type(BasicTypes.Request(int8_value=1).int8_value, int)
    assert_type(GetPlan.Event(request=[same]).request, list[GetPlan.Request])
    assert_type(CancelGoal.Request(goal_info=GoalInfo()).goal_info.stamp, Time)


def fields_with_odd_names() -> None:
    odd = Odd(array=[1], str="a", int=[1.0], list=["a"], property=True, check_fields=1)
    assert_type(odd.array, "array[int]")
    assert_type(odd.str, str)
    assert_type(odd.int, NDArray[numpy.float32])
    assert_type(odd.list, list[str])
    assert_type(odd.property, bool)
    assert_type(odd.bool, list[bool])
    assert_type(odd.self, int)
    assert_type(odd.object, list[Part])
    assert_type(odd.type, str)
    odd.self = 3
    assert_type(Wide(field199=1).field0, int)


def installed_beside_the_package() -> None:
    assert_type(Plain(number=1, words=["a"]).words, list[str])
    assert_type(Second().plain, Plain)


def texts() -> None:
    assert_type(String(data="a").data, str)
    assert_type(WStrings().wstring_value, str)
    ColorRGBA(r=1.0, check_fields=True)
    print(Duration(sec=1) == Duration(sec=2))
