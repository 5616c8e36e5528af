"""Writes the stub files of a package: one for each type, and those that re-export the types."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import Any

from actionkit._stubs.fields import Names, class_path, constant, field_types
from actionkit._stubs.folders import MARK
from actionkit._stubs.loading import Loaded, Package

_QUIET = "# fmt: off\n# ruff: noqa"
"""Formatters and linters must not change the files: each run must give the same text."""
_WIDTH = 100


def files(package: Package, loaded: Loaded) -> dict[str, str]:
    """Return the stub files of a package: path below its folder -> text.

    The same classes always give the same text. Packages that these use are added to `loaded`.
    """
    written = {"__init__.pyi": _text(())}
    for kind, types in package.types.items():
        handed_on = []
        for name, cls in types.items():
            parts = [part for part in package.parts[kind] if part.startswith(f"{name}_")]
            handed_on += [f"from {cls.__module__} import {n} as {n}" for n in (name, *parts)]
            classes = _Classes(package.name, loaded)
            body = list(classes.of_type(kind, name, cls))
            if parts:
                body += ["", *(f"{each} = {class_path(each)}" for each in parts)]
            stem = cls.__module__.rpartition(".")[2]
            # In the order of isort: first `import`, then `from ... import`.
            imports = sorted(classes.imports, key=lambda line: (line.startswith("from "), line))
            written[f"{kind}/{stem}.pyi"] = _text([*imports, "", *body])
        written[f"{kind}/__init__.pyi"] = _text(handed_on)
    return written


def placeholders(package: Package) -> dict[str, str]:
    """Return files for other modules, such as `message_fixtures`: stubs would hide these."""
    lines = [
        "from typing import Any as _Any",
        "",
        "def __getattr__(name: str) -> _Any: ...  # pyright: ignore[reportIncompleteStub]",
    ]
    modules = sorted(path.stem for path in package.folder.glob("[!_]*.py"))
    return {f"{name}.pyi": _text(lines) for name in modules if name.isidentifier()}


def _text(lines: Iterable[str]) -> str:
    body = "\n".join(lines).lstrip("\n")
    return f"{MARK}\n{_QUIET}\n\n{body}\n" if body else f"{MARK}\n{_QUIET}\n"


class _Classes:
    """Writes the classes of one file, and gathers the imports that they need."""

    def __init__(self, package: str, loaded: Loaded) -> None:
        self.imports: set[str] = set()
        self._comments = loaded.comments
        self._has = partial(loaded.has, package)

    def of_type(self, kind: str, name: str, cls: Any) -> Iterator[str]:
        if kind == "msg":
            return self._message(cls, name)
        if kind == "srv":
            return self._service(cls, name)
        return _class(name, *self._parts(cls, "Goal", "Result", "Feedback"), self._impl(cls.Impl))

    def _impl(self, impl: Any) -> Iterator[str]:
        """Write the members that rclpy's own action classes use."""
        names = Names(self.imports, set(), self._has)
        others = [
            f"CancelGoalService = {names.ros('action_msgs', 'srv', 'CancelGoal')}",
            f"GoalStatusMessage = {names.ros('action_msgs', 'msg', 'GoalStatusArray')}",
        ]
        return _class(
            "Impl",
            self._service(impl.SendGoalService, "SendGoalService"),
            self._service(impl.GetResultService, "GetResultService"),
            *self._parts(impl, "FeedbackMessage"),
            others,
        )

    def _service(self, cls: Any, name: str) -> Iterator[str]:
        return _class(name, *self._parts(cls, "Request", "Response", "Event"))

    def _parts(self, cls: Any, *names: str) -> list[Iterator[str]]:
        return [self._message(getattr(cls, name), name) for name in names]

    def _message(self, cls: Any, name: str) -> Iterator[str]:
        said: dict[str, str] = cls.get_fields_and_field_types()
        constants: dict[str, Any] = getattr(type(cls), f"_Metaclass_{cls.__name__}__constants", {})
        names = Names(self.imports, {*said, *constants}, self._has)
        slots = zip(said, cls.SLOT_TYPES, strict=True)
        types = {field: field_types(slot, names) for field, slot in slots}
        class_var = names.imported("typing", "ClassVar")
        package, kind, *_ = cls.__module__.split(".")
        head, comments = self._comments(f"{package}/{kind}/{cls.__name__}")
        yield f"class {name}:"
        yield from _indented(_docstring(head))
        for each in sorted(constants):
            yield f"    {each}: {constant(constants[each], names)}"
        for field in said:
            default = f"{field.upper()}__DEFAULT"
            if default in vars(cls):
                yield f"    {default}: {class_var}[{types[field][0]}]"
        anything = names.imported("typing", "Any")
        yield f"    SLOT_TYPES: {class_var}[{names.builtin('tuple')}[{anything}, ...]]"
        for field, (read, given) in types.items():
            doc = list(_docstring(comments.get(field, ())))
            yield from _indented(_field(field, read, given, said[field], names, doc))
        yield from _indented(_init(cls, types, names))
        said_type = "{0}[{1}, {1}]".format(names.builtin("dict"), names.builtin("str"))
        yield f"    @{names.builtin('classmethod')}"
        yield f"    def get_fields_and_field_types(cls) -> {said_type}: ..."
        if cls.__hash__ is None:
            yield f"    __hash__: {class_var}[None]  # type: ignore[assignment]"


def _class(name: str, *parts: Iterable[str]) -> Iterator[str]:
    """Write a class of other classes, with an empty line between them."""
    yield f"class {name}:"
    for number, part in enumerate(parts):
        if number:
            yield ""
        yield from _indented(part)


def _docstring(lines: Sequence[str]) -> Iterator[str]:
    """Write comments of an interface file where editors look for them."""
    shown = ["".join(c if c.isprintable() else " " for c in line).strip() for line in lines]
    if text := "\n".join(filter(None, shown)):
        quoted = text.replace("\\", "\\\\").replace('"', '\\"')
        yield from f'"""{quoted}"""'.split("\n")


def _field(
    name: str, read: str, given: str, said: str, names: Names, doc: Sequence[str]
) -> Iterator[str]:
    if read == given:
        yield f"{name}: {read}  # {said}"
        yield from doc
        return
    yield f"@{names.builtin('property')}"
    yield f"def {name}(self) -> {read}:{'' if doc else ' ...'}  # {said}"
    yield from _indented(doc)
    yield f"@{name}.setter"
    yield f"def {name}(self, value: {given}) -> None: ..."


def _init(cls: Any, types: dict[str, tuple[str, str]], names: Names) -> Iterator[str]:
    # `self` is the first parameter of the generated class, so it cannot be a keyword.
    given = [f"{field}: {one} = ..." for field, (_, one) in types.items() if field != "self"]
    if "_check_fields" in cls.__slots__ and "check_fields" not in types:
        given.append(f"check_fields: {names.builtin('bool')} = ...")
    parameters = ["self", "*", *given] if given else ["self"]
    line = f"def __init__({', '.join(parameters)}) -> None: ..."
    if len(line) <= _WIDTH - 8:
        yield line
        return
    yield "def __init__("
    yield from (f"    {each}," for each in parameters)
    yield ") -> None: ..."


def _indented(lines: Iterable[str]) -> Iterator[str]:
    for line in lines:
        yield f"    {line}" if line else line
