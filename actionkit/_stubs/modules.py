"""Writes the stub files of a package: one for each type, and those that hand them on."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from actionkit._stubs.fields import FieldType, Names, class_path, constant, field_type
from actionkit._stubs.loading import Loaded, Package

MARK = "# Made by `actionkit stubs`, which overwrites it."
"""The first line of each file: what lacks it is somebody else's."""
_QUIET = "# fmt: off\n# ruff: noqa"
"""Formatters and linters have no business here: each run must give the same text."""
_WIDTH = 100


def files(package: Package, loaded: Loaded) -> dict[str, str]:
    """Return the stub files of a package: path below its folder -> text.

    The same classes always give the same text.
    """
    written = {"__init__.pyi": _text(())}
    for kind, types in package.types.items():
        bodies: dict[str, list[str]] = {}
        imports: dict[str, set[str]] = {}
        for name, cls in types.items():
            module = str(cls.__module__)
            body = bodies.setdefault(module, [])
            needed = imports.setdefault(module, set())
            body += ["", *_type(kind, name, cls, loaded, needed)]
            handed_on = [extra for extra in package.extras[kind] if extra.startswith(f"{name}_")]
            body += ["", *(f"{e} = {class_path(kind, e)}" for e in handed_on)] if handed_on else []
        for module, body in bodies.items():
            stem = module.rpartition(".")[2]
            written[f"{kind}/{stem}.pyi"] = _text([*_sorted(imports[module]), *body])
        lines = []
        for name, cls in types.items():
            module = str(cls.__module__)
            mine = [name, *(e for e in package.extras[kind] if e.startswith(f"{name}_"))]
            lines += [f"from {module} import {each} as {each}" for each in mine]
        written[f"{kind}/__init__.pyi"] = _text(lines)
    return written


def placeholders(package: Package) -> dict[str, str]:
    """Return files for what else the package has, which would be hidden without them."""
    lines = [
        "from typing import Any as _Any",
        "",
        "def __getattr__(name: str) -> _Any: ...  # pyright: ignore[reportIncompleteStub]",
    ]
    return {f"{name}.pyi": _text(lines) for name in package.others}


def _text(lines: Iterable[str]) -> str:
    body = "\n".join(lines).lstrip("\n")
    return f"{MARK}\n{_QUIET}\n\n{body}\n" if body else f"{MARK}\n{_QUIET}\n"


def _sorted(imports: set[str]) -> list[str]:
    """Return imports as isort has them: first the modules, then what comes from them."""
    plain = [line for line in imports if line.startswith("import ")]
    return sorted(plain) + sorted(imports - set(plain))


def _type(kind: str, name: str, cls: Any, loaded: Loaded, imports: set[str]) -> Iterator[str]:
    if kind == "msg":
        yield from _message(cls, name, loaded, imports)
    elif kind == "srv":
        yield from _service(cls, name, loaded, imports)
    else:
        yield f"class {name}:"
        for part in ("Goal", "Result", "Feedback"):
            yield from _indented(_message(getattr(cls, part), part, loaded, imports))
            yield ""
        yield from _indented(_impl(cls.Impl, loaded, imports))


def _impl(impl: Any, loaded: Loaded, imports: set[str]) -> Iterator[str]:
    """Write what rclpy's own action classes work with."""
    names = Names(imports, set())
    yield "class Impl:"
    for part in ("SendGoalService", "GetResultService"):
        yield from _indented(_service(getattr(impl, part), part, loaded, imports))
        yield ""
    yield from _indented(_message(impl.FeedbackMessage, "FeedbackMessage", loaded, imports))
    yield ""
    for part, kind, name in (
        ("CancelGoalService", "srv", "CancelGoal"),
        ("GoalStatusMessage", "msg", "GoalStatusArray"),
    ):
        if loaded.has("action_msgs", kind, name):
            yield f"    {part} = {names.ros('action_msgs', kind, name)}"
        else:
            yield f"    {part}: {names.imported('typing', 'Any')}"


def _service(cls: Any, name: str, loaded: Loaded, imports: set[str]) -> Iterator[str]:
    yield f"class {name}:"
    first = True
    for part in ("Request", "Response", "Event"):
        if hasattr(cls, part):  # Event came with ROS 2 Iron
            if not first:
                yield ""
            first = False
            yield from _indented(_message(getattr(cls, part), part, loaded, imports))


def _message(cls: Any, name: str, loaded: Loaded, imports: set[str]) -> Iterator[str]:
    said: dict[str, str] = cls.get_fields_and_field_types()
    constants: dict[str, Any] = getattr(type(cls), f"_Metaclass_{cls.__name__}__constants", {})
    names = Names(imports, {*said, *constants})
    types = {
        field: field_type(slot, names, loaded.has)
        for field, slot in zip(said, cls.SLOT_TYPES, strict=True)
    }
    class_var = names.imported("typing", "ClassVar")
    package, kind, *_ = cls.__module__.split(".")
    head, comments = loaded.comments(f"{package}/{kind}/{cls.__name__}")
    yield f"class {name}:"
    yield from _indented(_docstring(head))
    for each in sorted(constants):
        yield f"    {each}: {constant(constants[each], names)}"
    for field in said:
        default = f"{field.upper()}__DEFAULT"
        if default in vars(cls):
            yield f"    {default}: {class_var}[{types[field].read}]"
    anything = names.imported("typing", "Any")
    yield f"    SLOT_TYPES: {class_var}[{names.builtin('tuple')}[{anything}, ...]]"
    for field, type_ in types.items():
        doc = list(_docstring(comments.get(field, ())))
        yield from _indented(_field(field, type_, said[field], names, doc))
    yield from _indented(_init(cls, types, names))
    text = names.builtin("str")
    yield f"    @{names.builtin('classmethod')}"
    yield (
        f"    def get_fields_and_field_types(cls) -> {names.builtin('dict')}[{text}, {text}]: ..."
    )
    if cls.__hash__ is None:
        yield f"    __hash__: {class_var}[None]  # type: ignore[assignment]"


def _docstring(lines: Sequence[str]) -> Iterator[str]:
    """Write comments of an interface file where editors look for them."""
    shown = ["".join(c if c.isprintable() else " " for c in line).strip() for line in lines]
    text = "\n".join(filter(None, shown))
    if text:
        quoted = text.replace("\\", "\\\\").replace('"', '\\"')
        yield from f'"""{quoted}"""'.split("\n")


def _field(
    name: str, type_: FieldType, said: str, names: Names, doc: Sequence[str]
) -> Iterator[str]:
    if type_.read == type_.given:
        yield f"{name}: {type_.read}  # {said}"
        yield from doc
        return
    yield f"@{names.builtin('property')}"
    yield f"def {name}(self) -> {type_.read}:{'' if doc else ' ...'}  # {said}"
    yield from _indented(doc)
    yield f"@{name}.setter"
    yield f"def {name}(self, value: {type_.given}) -> None: ..."


def _init(cls: Any, types: dict[str, FieldType], names: Names) -> Iterator[str]:
    # `self` is the first parameter of what ROS generates, so it can be no keyword.
    given = [f"{field}: {t.given} = ..." for field, t in types.items() if field != "self"]
    if "_check_fields" in cls.__slots__ and "check_fields" not in types:
        given.append(f"check_fields: {names.builtin('bool')} = ...")
    if not given:
        yield "def __init__(self) -> None: ..."
        return
    line = f"def __init__(self, *, {', '.join(given)}) -> None: ..."
    if len(line) <= _WIDTH - 8:
        yield line
        return
    yield "def __init__("
    yield from (f"    {each}," for each in ("self", "*", *given))
    yield ") -> None: ..."


def _indented(lines: Iterable[str]) -> Iterator[str]:
    for line in lines:
        yield f"    {line}" if line else line
