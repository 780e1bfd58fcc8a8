# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The languages of the page: which keys are missing or unused; and that robots are not told to persons."""

from __future__ import annotations

import ast
import json
import re
from pathlib import Path

import pytest

from soilmoist_ros.console.server import PAGE

SOURCES = Path(__file__).resolve().parents[2] / "soilmoist_ros"
LANGUAGES = {path.stem: json.loads(path.read_text()) for path in sorted(PAGE.glob("*.json"))}
ENGLISH = LANGUAGES["en"]["texts"]
CODE = "".join(path.read_text() for path in sorted(PAGE.iterdir()) if path.suffix in (".js", ".html"))
MADE = re.findall(r"`(\w+_)\$\{", CODE)
"""Beginnings of keys that end with a code."""


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


def sentences_of(path):
    """Texts of a module, with {} for what varies."""
    tree = ast.parse(path.read_text())
    inner = {id(one) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for one in node.values}
    quoted = inner | {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        text = node.value if isinstance(node, ast.Constant) else None
        if isinstance(node, ast.JoinedStr):
            text = "".join(one.value if isinstance(one, ast.Constant) else "{}" for one in node.values)
        if isinstance(text, str) and id(node) not in quoted:
            yield re.sub(r"(\{[^}]*\})+", "{}", text)


@pytest.mark.parametrize("name", LANGUAGES)
def test_sentences_that_a_language_translates_are_those_of_the_robot(name):
    whole = [text for path in sorted(SOURCES.rglob("*.py")) for text in sentences_of(path)]
    gaps = ("$^", "; ", "; |: ", r"; |: |\. |, ")
    spoken = {part for text in whole for gap in gaps for part in re.split(gap, text)}
    sentences = LANGUAGES[name]["sentences"]
    said = {of(form) for form in sentences} - spoken  # some end with a time that is added to them
    assert {form for form in said if form.removesuffix(" {} s") not in spoken} == set(), "unused"
    for form, words in sentences.items():
        assert {int(n) for n in re.findall(r"\{(\d+)\}", words)} <= set(range(1, form.count("{}") + 1)), form
