# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from action_msgs.srv._cancel_goal import CancelGoal as CancelGoal
from action_msgs.srv._cancel_goal import CancelGoal_Event as CancelGoal_Event
from action_msgs.srv._cancel_goal import CancelGoal_Request as CancelGoal_Request
from action_msgs.srv._cancel_goal import CancelGoal_Response as CancelGoal_Response
