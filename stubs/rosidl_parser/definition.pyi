class AbstractType: ...
class AbstractNestableType(AbstractType): ...

class BasicType(AbstractNestableType):
    typename: str
    def __init__(self, typename: str) -> None: ...

class NamespacedType(AbstractNestableType):
    namespaces: list[str]
    name: str

class AbstractGenericString(AbstractNestableType): ...
class AbstractString(AbstractGenericString): ...
class AbstractWString(AbstractGenericString): ...

class AbstractNestedType(AbstractType):
    value_type: AbstractNestableType

class Array(AbstractNestedType):
    size: int

class AbstractSequence(AbstractNestedType): ...

class BoundedSequence(AbstractSequence):
    maximum_size: int

class UnboundedSequence(AbstractSequence): ...
