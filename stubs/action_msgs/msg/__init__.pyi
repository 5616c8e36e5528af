# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from action_msgs.msg._goal_info import GoalInfo as GoalInfo
from action_msgs.msg._goal_status import GoalStatus as GoalStatus
from action_msgs.msg._goal_status_array import GoalStatusArray as GoalStatusArray
