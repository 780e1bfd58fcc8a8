# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The languages of the page: which keys are missing or unused; and that robots are not told to persons."""

from __future__ import annotations

import ast
import json
import re
from dataclasses import fields
from pathlib import Path

import pytest

from soilmoist_ros.console.server import PAGE
from soilmoist_ros.exploration.guard.failsafes import FAILSAFES, Cause
from soilmoist_ros.exploration.mission.types import Changes, Verb
from soilmoist_ros.sensing.problems import Kind

SOURCES = Path(__file__).resolve().parents[2] / "soilmoist_ros"
LANGUAGES = {path.stem: json.loads(path.read_text()) for path in sorted(PAGE.glob("*.json"))}
ENGLISH = LANGUAGES["en"]["texts"]
CODE = "".join(path.read_text() for path in sorted(PAGE.iterdir()) if path.suffix in (".js", ".html"))
MADE = re.findall(r"`(\w+_)\$\{", CODE)
"""Beginnings of keys that end with a code."""

TELLING = (
    "exploration/mission/mission.py", "exploration/control/[mtw]*.py", "exploration/guard/watch.py",
    "exploration/guard/fence.py", "exploration/navigation/goal_client.py", "exploration/navigation/person.py",
    "sensing/survey/driver.py", "sensing/position/phone.py", "recording/bag/recorder.py", "console/guide*.py",
    "console/plan_work.py",
)  # fmt: skip
"""Modules whose texts an operator reads in the field; what helps with the set-up may stay English."""
SILENT = r".*(_log|logging|get_logger\(\))\.\w+|(Value|Type|Key|Runtime)Error"
NOT_TOLD = """
a mission does not start without a position | a goal is sent only after the one before has ended |
(a motion below {} m/s would not show in the noise of the fixes) |
a mission does not start before it knows where the robot may go | no mission starts before it is known |
{} {} {} m from it, nearer than {} m | will stop | {}, {} m away, | by a robot that keeps {} m distance |
leaves the field | is in no-go area {} | enters no-go area {} | age of {} [s] |
not watched: no message has come | {} m off its route{} | , {} so far | not since {} s |
no plausible position for | no record for | the map has taken in no record for | no watchdog for |
aborted the goal{} | ended the goal without success{} | the goal to {} | a goal of before |
reported as reached, but {} | {} of the last {} records are quarantined{} | last loss | last quarantine |
age of the last record [s] | : lines of {} are used, those of {} dropped; give one another port |
not used: {}; check its high voltage and its cable | {}, and by this computer {} (UTC) |
{} is not a valid name of a bag | use letters, digits, '_' and '-' | bag writer | recording to %s |
drawn field
"""
"""Texts of these modules that are not on the page, or only as a part of what is."""


def of(key):
    return key.removesuffix("@person")


def test_keys_of_the_page_are_in_the_english_file_and_none_is_unused():
    said = {*re.findall(r'"([a-z]\w*)"', CODE), *re.findall(r'\bname="([a-z]\w*)"', CODE)}
    asked = {*re.findall(r'\bt\("(\w+)"', CODE), *re.findall(r'data-(?:text|label|title)="(\w+)"', CODE)}
    assert {key for key in asked if key not in ENGLISH} == set(), "missing"
    used = {key for key in map(of, ENGLISH) if key in said or key.startswith(tuple(MADE))}
    assert {key for key in ENGLISH if of(key) not in used} == set(), "unused"


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_language_has_all_texts_with_their_values(name):
    """The words of a language are its own; a text that it lacks would be English."""
    texts = LANGUAGES[name]["texts"]
    assert ENGLISH.keys() - texts.keys() == set(), "missing"
    assert texts.keys() - ENGLISH.keys() == set(), "unused"
    for key, text in texts.items():
        for words in text.values() if isinstance(text, dict) else [text]:
            english = json.dumps(ENGLISH[key])
            assert set(re.findall(r"\{\w+\}", words)) <= set(re.findall(r"\{\w+\}", english)), key


def sentences_of(path, told=False):
    """Texts of a module, with {} for what varies; ``told``: without keys, logs and errors of programmers."""
    tree = ast.parse(path.read_text())
    inner = {id(one) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for one in node.values}
    quoted = inner | {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if told and isinstance(node, ast.Call) and re.fullmatch(SILENT, ast.unparse(node.func)):
            quoted |= {id(one) for one in ast.walk(node)}
        quoted |= {id(one) for one in node.keys} if told and isinstance(node, ast.Dict) else set()
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(node, ast.JoinedStr):
            text = "".join(one.value if isinstance(one, ast.Constant) else "{}" for one in node.values)
        if isinstance(text, str) and id(node) not in quoted:
            yield re.sub(r"(\{[^}]*\})+", "{}", text)


def sentences(name):
    return LANGUAGES[name]["sentences"]


@pytest.mark.parametrize("name", LANGUAGES)
def test_sentences_that_a_language_translates_are_those_of_the_robot(name):
    spoken = "\n".join(text for path in sorted(SOURCES.rglob("*.py")) for text in sentences_of(path))
    parts = {form: [part.strip(" :;,()") for part in of(form).split("{}")] for form in sentences(name)}
    assert {form for form in parts if not all(part in spoken for part in parts[form])} == set(), "unused"
    for form, words in sentences(name).items():
        assert {int(n) for n in re.findall(r"\{(\d+)\}", words)} <= set(range(1, form.count("{}") + 1)), form


def words_for(name):
    """Whether a language has words for all parts of a text, as texts.js looks for them."""
    forms = sorted(map(of, sentences(name)), key=len, reverse=True)
    anything = [(form, re.search(r"[;:.,] |\(\{\}\)", form)) for form in forms]
    holes = [(form, "(.*?)" if one else "((?:(?![;:.] ).)*?)") for form, one in anything]
    patterns = [re.compile(hole.join(map(re.escape, form.split("{}")))) for form, hole in holes]

    def has(text):
        found = next(filter(None, (one.fullmatch(text) for one in patterns)), None)
        gap = next((gap for gap in (" -> ", "; ", ": ", ". ", ", ") if gap in text), None)
        if found is None and gap is None:
            return not re.search("[a-z] [a-z]", text)
        return all(map(has, found.groups() if found else text.split(gap, 1)))

    return has


@pytest.mark.parametrize("name", LANGUAGES)
def test_a_language_has_words_for_every_alarm_reason_and_refusal(name):
    """Whoever adds one adds its words, or names it in ``NOT_TOLD``."""
    assert set(Cause) - sentences(name).keys() == set()
    if name == "en":
        return
    codes = {*Verb, *(field.name for field in fields(Changes)), *(kind.text for kind in Kind)}
    assert codes - {*sentences(name), *LANGUAGES[name]["texts"]} == set()
    has = words_for(name)
    assert [one.remedy for one in FAILSAFES.values() if not has(one.remedy)] == []
    told = {
        text for pattern in TELLING for path in SOURCES.glob(pattern) for text in sentences_of(path, told=True)
    }
    parts = {part.strip() for part in NOT_TOLD.split("|")}
    assert {text for text in told if text.strip() not in parts and not has(text.replace("{}", "7"))} == set()
