// SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
// SPDX-License-Identifier: Apache-2.0
// Texts in the operator's language: en.json, and a file for each other one, in which the server fills in what it lacks.

const root = document.documentElement;
export const languages = JSON.parse(root.dataset.languages);  // names by code, written by the server
const wanted = [localStorage.getItem("language"), ...navigator.languages.flatMap((one) => [one, one.split("-")[0]])];
export const language = wanted.find((one) => one in languages) ?? "en";
root.lang = language;

const own = await fetch(`page/${language}.json`).then((answer) => answer.json()).catch(() => ({ texts: {}, sentences: {} }));
const plurals = new Intl.PluralRules(language);
let person = false;
// A number with the decimal sign of the language.
export const fixed = (value, digits) => value.toLocaleString(language, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: false });

// A text with values in it; the value "n" chooses between singular and plural.
export function t(key, values = {}) {
  const words = (person && own.texts[`${key}@person`]) || own.texts[key] || key;
  const text = typeof words === "string" ? words : words[plurals.select(values.n)] ?? words.other;
  return text.replace(/\{(\w+)\}/g, (_, name) => values[name] ?? "");
}

// The texts of index.html: content, names for screen readers, titles.
export function fillTexts() {
  for (const [name, set] of [["text", (node, text) => { node.textContent = text; }], ["label", (node, text) => node.setAttribute("aria-label", text)], ["title", (node, text) => { node.title = text; }]]) {
    for (const node of document.querySelectorAll(`[data-${name}]`)) set(node, t(node.dataset[name]));
  }
}

// Sentences that come from elsewhere: a language has their English forms, with {} for what varies, and its own words.
// Rare ones come after the first view.
const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\]/g, "\\$&");
const rulesOf = (sentences) => Object.entries(sentences).map(([form, words]) => {
  const [template, kind] = form.split("@");
  // What varies goes over the end of a part only where the form does so, or in brackets.
  const any = /[;:.,] /.test(template) || template.includes("({})") ? "(.*?)" : "((?:(?![;:.] ).)*?)";
  return { pattern: new RegExp(`^${template.split("{}").map(escaped).join(any)}$`), words, kind, length: form.length };
}).sort((one, other) => other.length - one.length);
const decimal = (1.5).toLocaleString(language)[1];
let rules = rulesOf(own.sentences), known = new Map(), later = null;

export async function loadRare() {
  later ??= fetch(`page/${language}.rare.json`).then((answer) => answer.json()).catch(() => null);
  const rare = await later;
  if (!rare) later = null;
  else { rules = rulesOf({ ...own.sentences, ...rare }); forget(); }
}

// A sentence in the operator's language as far as it has words for it, part by part; the rest stays English.
export function said(text) {
  if (!text || !rules.length) return text ?? "";
  if (known.size > 500) known = new Map();
  if (!known.has(text)) known.set(text, translated(text));
  return known.get(text);
}

// Where a gap is that is in no brackets; -1 if there is none.
function cut(text, gap) {
  for (let at = text.indexOf(gap); at >= 0; at = text.indexOf(gap, at + 1)) {
    const before = text.slice(0, at);
    if (before.split("(").length === before.split(")").length) return at;
  }
  return -1;
}

function translated(text) {
  for (const { pattern, words, kind } of rules) {
    const parts = kind && !person ? null : pattern.exec(text);
    if (parts) return words.replace(/\{(\d+)\}/g, (_, index) => said(parts[index]));
  }
  for (const gap of [" -> ", "; ", ": ", ". ", ", "]) {
    const at = cut(text, gap);
    if (at >= 0) return said(text.slice(0, at)) + gap + said(text.slice(at + gap.length));
  }
  const [, before, within] = /^(.*\S) \((.*)\)$/.exec(text) ?? [];
  if (before) return `${said(before)} (${said(within)})`;
  return /^[±+-]?\d+\.\d+$/.test(text) ? text.replace(".", decimal) : text;
}

// "@person" marks texts for a survey whose sensor a person carries.
export function forPerson(is) {
  if (person === is) return;
  person = is;
  forget();
  fillTexts();
}

function forget() {
  known = new Map();
  for (const node of document.querySelectorAll("[data-key]")) delete node.dataset.key;  // what "fill" has made
}

fillTexts();
