# Made by `actionkit stubs`, which overwrites it.
# fmt: off
# ruff: noqa

from test_msgs.msg._arrays import Arrays as Arrays
from test_msgs.msg._basic_types import BasicTypes as BasicTypes
from test_msgs.msg._bounded_plain_sequences import BoundedPlainSequences as BoundedPlainSequences
from test_msgs.msg._bounded_sequences import BoundedSequences as BoundedSequences
from test_msgs.msg._builtins import Builtins as Builtins
from test_msgs.msg._constants import Constants as Constants
from test_msgs.msg._defaults import Defaults as Defaults
from test_msgs.msg._empty import Empty as Empty
from test_msgs.msg._multi_nested import MultiNested as MultiNested
from test_msgs.msg._nested import Nested as Nested
from test_msgs.msg._strings import Strings as Strings
from test_msgs.msg._unbounded_sequences import UnboundedSequences as UnboundedSequences
from test_msgs.msg._w_strings import WStrings as WStrings
