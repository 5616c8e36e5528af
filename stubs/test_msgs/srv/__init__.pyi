# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from test_msgs.srv._arrays import Arrays as Arrays
from test_msgs.srv._arrays import Arrays_Event as Arrays_Event
from test_msgs.srv._arrays import Arrays_Request as Arrays_Request
from test_msgs.srv._arrays import Arrays_Response as Arrays_Response
from test_msgs.srv._basic_types import BasicTypes as BasicTypes
from test_msgs.srv._basic_types import BasicTypes_Event as BasicTypes_Event
from test_msgs.srv._basic_types import BasicTypes_Request as BasicTypes_Request
from test_msgs.srv._basic_types import BasicTypes_Response as BasicTypes_Response
from test_msgs.srv._empty import Empty as Empty
from test_msgs.srv._empty import Empty_Event as Empty_Event
from test_msgs.srv._empty import Empty_Request as Empty_Request
from test_msgs.srv._empty import Empty_Response as Empty_Response
