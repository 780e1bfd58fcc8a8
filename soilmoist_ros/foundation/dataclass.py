"""``dataclass`` in a quarter of the time, for programs that make some hundred classes at each start."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, Field, FrozenInstanceError, fields
from dataclasses import dataclass as standard
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any, Final

_METHODS: Final = frozenset(
    ["__init__", "__repr__", "__eq__", "__hash__", "__setattr__", "__delattr__", "__getstate__", "__setstate__"]
)

if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass
else:

    def dataclass(cls=None, /, **options):
        """A frozen dataclass that behaves as one of the standard library.

        The standard library compiles up to seven functions for each frozen class, here it is one: ``__init__``.
        The standard library makes classes that are not frozen, have such methods of their own or other options.
        """
        return _made(cls, **options) if cls is not None else lambda cls: _made(cls, **options)


def _made(
    cls: Any, *, frozen: bool = False, eq: bool = True, repr: bool = True, slots: bool = False,
    kw_only: bool = False, **others: bool,
) -> Any:  # fmt: skip
    by_standard = any(vars(base)["__dataclass_params__"].frozen for base in cls.__mro__ if _is_dataclass(base))
    if not frozen or others or by_standard or not _METHODS.isdisjoint(vars(cls)):
        return standard(frozen=frozen, eq=eq, repr=repr, slots=slots, kw_only=kw_only, **others)(cls)
    cls = standard(init=False, repr=False, eq=False, slots=slots, kw_only=kw_only)(cls)
    methods = {"__init__": _init(cls), "__setattr__": _set_attribute, "__delattr__": _delete_attribute}
    if slots:
        methods |= {"__getstate__": _state, "__setstate__": _restore}
    if repr:
        methods["__repr__"] = _repr
    if eq:
        methods |= _comparison([one.name for one in fields(cls) if one.compare])
    for name, method in methods.items():
        setattr(cls, name, method)
    return cls


def _is_dataclass(cls: type) -> bool:
    return "__dataclass_params__" in vars(cls)


def _init(cls: Any) -> Callable[..., None]:
    """The function ``__init__`` of a class, compiled from its text."""
    space: dict[str, Any] = {"_set": object.__setattr__, "_missing": MISSING}
    lines = [
        f" _set(_self, {one.name!r}, {_value(one, space)})" for one in fields(cls) if one.init or _preset(one)
    ]
    lines += [" _self.__post_init__()"] * hasattr(cls, "__post_init__")
    given = [one for one in fields(cls) if one.init]
    placed, named = ([_parameter(one) for one in given if one.kw_only is only] for only in (False, True))
    parameters = ", ".join(["_self", *placed, *["*"] * bool(named), *named])
    exec(f"def __init__({parameters}):\n" + ("\n".join(lines) or " pass"), space)
    function: Callable[..., None] = space["__init__"]
    function.__qualname__ = f"{cls.__qualname__}.__init__"
    function.__annotations__ = {one.name: one.type for one in given} | {"return": None}
    return function


def _preset(one: Field[Any]) -> bool:
    return one.default is not MISSING or one.default_factory is not MISSING


def _parameter(one: Field[Any]) -> str:
    if one.default is not MISSING:
        return f"{one.name}=_default_{one.name}"
    return f"{one.name}=_missing" if one.default_factory is not MISSING else one.name


def _value(one: Field[Any], space: dict[str, Any]) -> str:
    """Text of the value of a field; its default, or what makes it, is a name of the function."""
    if not _preset(one):
        return one.name
    space[f"_default_{one.name}"] = one.default if one.default is not MISSING else one.default_factory
    if one.default is not MISSING:
        return one.name if one.init else f"_default_{one.name}"
    return f"_default_{one.name}()" + (f" if {one.name} is _missing else {one.name}" if one.init else "")


def _comparison(names: list[str]) -> dict[str, Any]:
    """Equality and hash by the values of fields."""

    def values(of: Any) -> tuple[Any, ...]:
        return tuple([getattr(of, name) for name in names])

    def equal(self: Any, other: Any) -> Any:
        return values(self) == values(other) if other.__class__ is self.__class__ else NotImplemented

    def hashed(self: Any) -> int:
        return hash(values(self))

    return {"__eq__": equal, "__hash__": hashed}


@recursive_repr()
def _repr(self: Any) -> str:
    shown = ", ".join(f"{one.name}={getattr(self, one.name)!r}" for one in fields(self) if one.repr)
    return f"{self.__class__.__qualname__}({shown})"


def _set_attribute(self: Any, name: str, value: object) -> None:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _delete_attribute(self: Any, name: str) -> None:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for one, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)
