"""Converts the arguments of a launch file, which are texts, to parameters of nodes."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Mapping

from soilmoist_ros.foundation.configuration import parse_yaml
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.nodes.parameters.parameter import Value, check_values


def parameters_from(node: str, arguments: Mapping[str, str]) -> dict[str, Value]:
    """Arguments that are parameters of a node, by name, converted to the type of the parameter.

    :param node: name of the node
    :param arguments: texts by name; an empty text leaves the parameter unchanged
    :raises InputError: with every invalid value
    """
    table = {row.name: row for row in importlib.import_module(f"soilmoist_ros.nodes.{node}").PARAMETERS}
    given = {
        name: text if isinstance(table[name].default, str) else _value(text)
        for name, text in arguments.items()
        if text and name in table
    }
    values, mistakes = check_values(table, given)
    if mistakes:
        raise InputError([Mistake(f"{node}: {mistake.message}", mistake.remedy) for mistake in mistakes])
    return {name: values[name] for name in given}


def property_argument(given: str, old_name: str, old: str) -> list[str]:
    """Items of the argument ``property``: ``NAME[:WEIGHT]``, separated by commas.

    >>> property_argument("compaction:2, salt", "properties", "")
    ['compaction:2', 'salt']

    :param given: the argument
    :param old_name: name of the argument in earlier releases
    :param old: value of the old argument, maybe in brackets; accepted with a warning
    :raises InputError: if both are given
    """
    if old and given:
        raise InputError(f"{old_name} is the old name of property, and both are given", f"leave out {old_name}")
    if old:
        print(
            f"warning: {old_name} is called property now; the old name is read in this release only",
            file=sys.stderr,
        )
    return [item.strip() for item in (given or old).strip("[] ").split(",") if item.strip()]


def _value(text: str) -> object:
    try:
        value: object = parse_yaml(text)
    except InputError:
        return text
    return value
