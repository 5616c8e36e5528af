"""The stubs are true: all their names exist in the installed packages, with the same kinds."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from actionkit._ros.rclpy_private.release import is_kilted_or_later

# rosidl loads its IDL parser with some of its modules, and that an old lark
pytestmark = pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning")

STUBS = Path(__file__).resolve().parent.parent / "stubs"

Function = ast.FunctionDef | ast.AsyncFunctionDef


def module_name(path: Path) -> str:
    parts = path.relative_to(STUBS).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def untrue(path: Path) -> list[str]:
    """Return what a stub file says and the installed module does not bear out."""
    name = module_name(path)
    module = importlib.import_module(name)
    return list(check_body(ast.parse(path.read_text()).body, module, name))


def check_body(body: list[ast.stmt], real: Any, where: str) -> Iterator[str]:
    """Check the definitions of a stub's module or class against the real one."""
    for statement in body:
        if isinstance(statement, ast.ClassDef):
            yield from check_class(statement, real, where)
        elif isinstance(statement, Function):
            yield from check_function(statement, real, where)
        elif isinstance(statement, (ast.Import, ast.ImportFrom)):
            yield from check_import(statement, real, where)
        elif isinstance(statement, (ast.Assign, ast.AnnAssign)):
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            for target in targets:
                assert isinstance(target, ast.Name)
                if not has_member(real, target.id) and not is_private_typevar(statement):
                    yield f"{where}.{target.id} does not exist"
        else:  # docstrings and `...`
            assert isinstance(statement, ast.Expr), ast.dump(statement)


def check_class(node: ast.ClassDef, real: Any, where: str) -> Iterator[str]:
    path = f"{where}.{node.name}"
    found = getattr(real, node.name, None)
    if not inspect.isclass(found):
        yield f"{path} is no class"
        return
    for base in node.bases:
        wanted = ast.unparse(base)
        if wanted not in {ancestor.__name__ for ancestor in found.__mro__}:
            yield f"{path} is no {wanted}"
    if "Enum" in "".join(map(ast.unparse, node.bases)):
        for item in node.body:
            if isinstance(item, ast.Assign):
                member = ast.unparse(item.targets[0])
                if getattr(getattr(found, member, None), "value", None) != ast.literal_eval(
                    item.value
                ):
                    yield f"{path}.{member} is not {ast.unparse(item.value)}"
    yield from check_body(node.body, found, path)


def check_import(node: ast.Import | ast.ImportFrom, real: Any, where: str) -> Iterator[str]:
    """Check that what is imported exists; and is handed on, where the stub says so."""
    for alias in node.names:
        if isinstance(node, ast.ImportFrom):
            source = importlib.import_module(str(node.module))
            if not hasattr(source, alias.name):
                try:
                    importlib.import_module(f"{node.module}.{alias.name}")
                except ImportError:
                    yield f"{where} imports {alias.name} from {node.module}, where it is not"
        if alias.asname == alias.name and not hasattr(real, alias.name):
            yield f"{where}.{alias.name} does not exist"


def check_function(node: Function, real: Any, where: str) -> Iterator[str]:
    path = f"{where}.{node.name}"
    if node.name == "__getattr__" and inspect.ismodule(real):
        return  # stands for whatever the module has
    if not has_member(real, node.name):
        yield f"{path} does not exist"
        return
    if inspect.isclass(real) and node.name not in dir(real):
        return  # an attribute that instances get, which a property of the stub stands for
    found = inspect.getattr_static(real, node.name)
    decorators = {ast.unparse(decorator) for decorator in node.decorator_list}
    is_property = "property" in decorators or any(d.endswith(".setter") for d in decorators)
    if is_property != (isinstance(found, property) or inspect.isdatadescriptor(found)):
        yield f"{path} is {'no' if is_property else 'a'} property"
        return
    if ("classmethod" in decorators) != isinstance(found, classmethod):
        yield f"{path}: class method or not?"
        return
    if not is_property:
        yield from check_parameters(node, getattr(real, node.name), real, path)


def check_parameters(node: Function, found: Any, owner: Any, path: str) -> Iterator[str]:
    """Check the names and kinds of a function's parameters, as far as they can be had."""
    arguments = node.args
    positional = [
        argument.arg for argument in arguments.args if argument.arg not in ("self", "cls")
    ]
    keyword_only = [argument.arg for argument in arguments.kwonlyargs]
    unnamed = [
        argument for argument in arguments.posonlyargs if argument.arg not in ("self", "cls")
    ]
    try:
        parameters = inspect.signature(found).parameters
    except ValueError:  # pybind11: names are not kept, but their number is, in the docstring
        first_line = (found.__doc__ or "").partition("\n")[0]
        count = len(re.findall(r"\barg\d+:", first_line))
        if "*args" not in first_line and count != len(unnamed):
            yield f"{path} takes {count} arguments, not {len(unnamed)}: {first_line}"
        if positional or keyword_only:
            yield f"{path}: pybind11 takes no keywords here"
        return
    kinds = {parameter.kind for parameter in parameters.values()}
    if unnamed and inspect.Parameter.VAR_POSITIONAL not in kinds:
        yield f"{path}: its positional parameters have names"
    for name in positional:
        known = parameters.get(name)
        if known is None or known.kind is not inspect.Parameter.POSITIONAL_OR_KEYWORD:
            yield f"{path}({name}=) is no positional parameter"
    for name in keyword_only:
        if name in parameters:
            if parameters[name].kind is not inspect.Parameter.KEYWORD_ONLY:
                yield f"{path}({name}=) is not by keyword only"
        # **kwargs: messages and QoS profiles take what they have slots for
        elif inspect.Parameter.VAR_KEYWORD not in kinds or f"_{name}" not in slots(owner):
            yield f"{path}({name}=) does not exist"
    offered = [name for name in parameters if name not in ("self", "cls")]
    if positional != [name for name in offered if name in positional]:
        yield f"{path}: another order, {positional}"
    needed = {
        name
        for name, parameter in parameters.items()
        if parameter.default is parameter.empty
        and parameter.kind not in (inspect.Parameter.VAR_KEYWORD, inspect.Parameter.VAR_POSITIONAL)
    } - {"self"}
    optional = set(positional[len(positional) - len(arguments.defaults) :])
    optional |= {
        name for name, default in zip(keyword_only, arguments.kw_defaults, strict=True) if default
    }
    if not unnamed and (wrong := needed ^ ({*positional, *keyword_only} - optional)):
        yield f"{path}: needed or not? {sorted(wrong)}"


def slots(cls: Any) -> list[str]:
    return list(getattr(cls, "__slots__", ()))


def has_member(real: Any, name: str) -> bool:
    """Tell whether a module, a class, or a class's instances have a member."""
    if hasattr(real, name):
        return True
    if not inspect.isclass(real):
        return False
    if name in slots(real):
        return True
    try:
        source = textwrap.dedent(inspect.getsource(real))
    except (OSError, TypeError):
        return False
    return any(
        isinstance(node, ast.Attribute)
        and node.attr == name
        and isinstance(node.ctx, ast.Store)
        and ast.unparse(node.value) == "self"
        for node in ast.walk(ast.parse(source))
    )


def is_private_typevar(statement: ast.Assign | ast.AnnAssign) -> bool:
    return statement.value is not None and ast.unparse(statement.value).startswith("TypeVar(")


STUB_FILES = sorted(STUBS.rglob("*.pyi"))


@pytest.mark.parametrize("path", STUB_FILES, ids=module_name)
def test_a_stub_names_nothing_but_what_there_is(path: Path) -> None:
    assert untrue(path) == []


MADE_FROM = ("test_msgs",)
"""Their stubs, and those of the packages that they use, are made by `actionkit stubs`."""


@pytest.mark.skipif(is_kilted_or_later(), reason="the stubs are those of Jazzy's packages")
def test_the_stubs_of_interface_packages_are_as_actionkit_makes_them() -> None:
    from actionkit._stubs.folders import MARK
    from actionkit._stubs.modules import files, placeholders
    from actionkit.cli.interfaces.stubs import load_with_comments

    loaded = load_with_comments(MADE_FROM)
    wanted = {
        f"{package.name}/{name}": text
        for package in loaded.packages
        for name, text in {**files(package, loaded), **placeholders(package)}.items()
    }
    texts = {path.relative_to(STUBS).as_posix(): path.read_text("utf-8") for path in STUB_FILES}
    told = "make them anew: .venv/bin/actionkit stubs test_msgs -o stubs"
    assert {name: text for name, text in texts.items() if text.startswith(MARK)} == wanted, told


def test_the_stubs_were_found() -> None:
    names = {module_name(path) for path in STUB_FILES}
    assert {"rclpy.node", "rclpy._rclpy_pybind11", "test_msgs.action", "action_msgs.srv"} <= names


@pytest.mark.parametrize(
    ("module", "stub", "complaint"),
    [
        ("rclpy.node", "class Node:\n def get_nam(self) -> str: ...", "get_nam does not exist"),
        ("rclpy.node", "class Nod: ...", "Nod is no class"),
        ("rclpy.node", "class Node:\n def context(self) -> str: ...", "context is a property"),
        ("rclpy.node", "class Node:\n @property\n def get_name(self): ...", "is no property"),
        ("rclpy.node", "class Node:\n def destroy_client(self, clent): ...", "(clent=) is no"),
        (
            "rclpy.node",
            "class Node:\n def create_client(self, srv_name, srv_type): ...",
            "another order",
        ),
        (
            "rclpy.node",
            "class Node:\n def create_client(self, srv_type, srv_name, qos_profile=...): ...",
            "(qos_profile=) is no positional",
        ),
        ("rclpy.node", "class Node:\n def destroy_client(self, client=...): ...", "needed or not"),
        ("rclpy.node", "class Node:\n wrong: int", "wrong does not exist"),
        ("rclpy.client", "class Client:\n srv_typ: int", "srv_typ does not exist"),
        ("rclpy.qos", "class QoSProfile:\n def __init__(self, *, dept=...): ...", "(dept=)"),
        ("rclpy.qos", "class HistoryPolicy(IntEnum):\n KEEP_LAST = 2", "KEEP_LAST is not 2"),
        ("rclpy.qos", "class QoSProfile(int): ...", "QoSProfile is no int"),
        ("rclpy.qos", "from rclpy.duration import Duratio", "imports Duratio"),
        ("rclpy.qos", "qos_profile_default: int\nqos_profile_defaul: int", "defaul does not exist"),
        (
            "rclpy._rclpy_pybind11",
            "class WaitSet:\n def is_ready(self, kind, /): ...",
            "takes 2 arguments, not 1",
        ),
        (
            "rclpy._rclpy_pybind11",
            "class WaitSet:\n def wait(self, nanoseconds): ...",
            "takes no keywords",
        ),
        (
            "test_msgs.action",
            "class Fibonacci:\n class Goal:\n  def __init__(self, *, ordr=...): ...",
            "Goal.__init__(ordr=) does not exist",
        ),
        ("test_msgs.action", "class Fibonacci:\n class Gaol: ...", "Gaol is no class"),
    ],
)
def test_a_stub_that_lies_is_caught(module: str, stub: str, complaint: str) -> None:
    found = list(check_body(ast.parse(stub).body, importlib.import_module(module), module))
    assert any(complaint in text for text in found), found
