"""Dataclasses behave as those of the standard library (dataclass.py)."""

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, asdict, field, fields, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation.dataclass import dataclass

OPTIONS = st.fixed_dictionaries(
    {"frozen": st.booleans()},
    optional={name: st.booleans() for name in ("eq", "repr", "slots", "kw_only", "order")},
).filter(lambda options: options.get("eq", True) or not options.get("order"))


def both(options, name="Made", bases=((), ()), **space):
    """The same class by both decorators."""
    return [
        decorate(**options)(type(name, its, {"__module__": __name__, "__doc__": "Text.", **space}))
        for decorate, its in zip((dataclass, dataclasses.dataclass), bases, strict=True)
    ]


def outcome(work):
    """What a call returns or raises."""
    try:
        return work()
    except Exception as error:
        return type(error)


@given(OPTIONS, st.integers(0, 3), st.integers(0, 3))
def test_behaves_as_the_standard_one(options, first, second):
    made = both(
        options,
        __annotations__={"a": int, "b": float, "c": list, "d": str, "e": int, "f": list, "set": int},
        b=2.5,
        c=field(default_factory=list, compare=False),
        d=field(default="x", repr=False, kw_only=True),
        e=field(default=4, init=False),
        set=3,
        f=field(default_factory=lambda: [1], init=False),
        double=property(lambda self: 2 * self.a),
    )
    seen = []
    for cls in made:
        one, other = cls(a=first), cls(a=second, c=[7])
        seen.append(
            {
                "signature": [(p.name, p.kind) for p in inspect.signature(cls).parameters.values()],
                "match": cls.__match_args__,
                "values": [asdict(one), asdict(other), asdict(replace(one, b=9.0)), one.double],
                "equal": (
                    one == cls(a=first),
                    one == other,
                    one == 3,
                    one < other if options.get("order") else None,
                ),
                "hash": outcome(lambda one=one, cls=cls: hash(one) == hash(cls(a=first))),
                "repr": repr(one) if options.get("repr", True) else "",
                "copies": [asdict(copy.copy(one)), asdict(copy.deepcopy(other))],
                "set": outcome(lambda one=one: setattr(one, "a", 5)),
                "new": outcome(lambda one=one: setattr(one, "unknown", 5)),
                "delete": outcome(lambda other=other: delattr(other, "a")),
                "few": outcome(lambda cls=cls: cls()),
                "many": outcome(lambda cls=cls: cls(a=1, z=2)),
                "slots": hasattr(one, "__dict__"),
                "own": one.f is not cls(a=first).f,
                "fields": [(f.name, f.init, f.kw_only) for f in fields(cls)],
            }
        )
    assert seen[0] == seen[1] or (options.get("slots") and seen[1]["new"] is TypeError)


@given(OPTIONS)
def test_children_have_the_fields_of_their_parents(options):
    parents = both(options, "Parent", __annotations__={"a": int, "b": int}, b=1)
    children = both(
        options, "Child", [(parent,) for parent in parents], __annotations__={"b": int, "c": int}, b=2, c=3
    )
    one, other = (cls(a=5) for cls in children)
    assert asdict(one) == asdict(other) == {"a": 5, "b": 2, "c": 3}


@dataclass(frozen=True, slots=True)
class Slotted:
    a: int
    b: tuple[int, ...] = ()


@dataclass(frozen=True)
class Checked:
    a: float
    more: "Checked | None" = None

    def __post_init__(self):
        if self.a < 0:
            raise ValueError("negative")


def test_pickled_objects_return():
    for one in (Slotted(3, (4, 5)), Checked(2.0, Checked(1.0))):
        assert pickle.loads(pickle.dumps(one)) == one


def test_a_check_is_made_at_every_creation():
    with pytest.raises(ValueError, match="negative"):
        Checked(-1.0)
    with pytest.raises(ValueError, match="negative"):
        replace(Checked(1.0), a=-1.0)
    with pytest.raises(FrozenInstanceError, match="'a'"):
        Checked(1.0).a = 2.0


def test_methods_of_a_class_are_kept():
    @dataclass(frozen=True)
    class Named:
        name: str

        def __eq__(self, other):
            return self.name.lower() == other.name.lower()

        def __hash__(self):
            return hash(self.name.lower())

    assert Named("A") == Named("a")
    assert len({Named("A"), Named("a")}) == 1
