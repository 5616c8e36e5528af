class Log:
    name: str
    msg: str
    def __init__(self, *, name: str = ..., msg: str = ..., check_fields: bool = ...) -> None: ...
