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
    "exploration/mission/mission.py", "exploration/control/*.py", "exploration/guard/fence*.py",
    "exploration/guard/[rsw]*.py", "exploration/navigation/*.py", "sensing/survey/driver.py",
    "sensing/survey/stream.py", "sensing/position/phone.py", "recording/bag/recorder.py", "mapping/map_worker.py",
    "nodes/*navigator*.py", "nodes/planner.py", "nodes/planner_inputs.py", "nodes/mapper.py", "nodes/watchdog.py",
    "console/[bgmprsvw]*.py",
)  # fmt: skip
"""Modules whose texts an operator reads on the page."""
SILENT = r".*(_log|logging|get_logger\(\))\.\w+|(Value|Type|Key|Runtime)Error"
NOT_TOLD = """
a mission does not start without a position | a goal is sent only after the one before has ended |
(a motion below {} m/s would not show in the noise of the fixes) | a Choice of another stop |
a mission does not start before it knows where the robot may go | no mission starts before it is known |
give polygon as in ruled_out_areas of mission_state |
give one of: place as [x, y], geographic_place as [latitude, longitude], one name in stops | [x, y] in metres |
the latitude (-90 .. 90) first, then the longitude (-180 .. 180), in degrees | the polygon |
{} {} {} m from it, nearer than {} m | will stop | {}, {} m away, | by a robot that keeps {} m distance |
leaves the field | is in no-go area {} | enters no-go area {} |
{} and the nodes of the topological map in the field | the home {} | {}, where the robot stands, |
the field's, {}, and navigation_frame is | navigation_frame is | age of {} [s] |
not watched: no message has come | {} m off its route{} | , {} so far | not since {} s |
no plausible position for | no record for | the map has taken in no record for | no watchdog for |
aborted the goal{} | ended the goal without success{} | the goal to {} | a goal of before |
reported as reached, but {} | {} of the last {} records are quarantined{} |
last loss | last quarantine | age of the last record [s] |
: lines of {} are used, those of {} dropped; give one another port |
not used: {}; check its high voltage and its cable | {}, and by this computer {} (UTC) |
{} is not a valid name of a bag | use letters, digits, '_' and '-' | bag writer |
recording to %s | last skipped: {} | no map yet | (did not converge) |
source the workspace of the navigation, built for this ROS and Python, or set another navigator |
{} is not the type of an action | goals of {} have no field {} |
set the navigator that goes with this action_type | {} records removed | using another field |
says that something is wrong | is silent: {} s | names look like /safety/heartbeat | has not been heard yet |
# Drawn on the operator's page by {}, {} UTC. | drawn field |
sandbox allow-scripts allow-downloads; default-src 'unsafe-inline' 'unsafe-eval' data: blob: |
the console cannot listen on {}, port {}: {} |
set the parameter port to another number, or 0 for a free one; or end what uses it |
too many viewers are connected already |
end the program that uses it, which may be another survey, or choose another address and port |
to steer from another machine, open {} (once) | the page cannot have port {} of {}: {} |
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -subj /CN=soilmoist |
give a certificate and its key, both as PEM | is no certificate that can be used: {} |
apt install openssl, or give --certificate and --key | openssl made no certificate: {} | a host without a name
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
    return LANGUAGES[name]["sentences"] | LANGUAGES[name]["rare"]


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
