# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Makes pages of the site that are no files in docs/: called by mkdocs (hooks in mkdocs.yml) in scripts/docs.

* Links of a page to a file outside docs/ lead to a page made of this file, such as CONTRIBUTING.md.
* ``<!-- help of every command -->`` becomes the help of the command line.
* Each folder of the package has a page of its public names, made of their docstrings. A link to its ``__init__``
  leads there.
* The gallery shows the runs that scripts/docs made. The notebooks of docs/tutorials/ become pages,
  with their outputs if scripts/docs has run them.
* Names in tables may break after their parts: ``sensor_msgs/PointCloud2`` after the underscore and the slash.
* At the end every link and picture must lead to a file of the site; nothing may come from the network.
"""

from __future__ import annotations

import base64
import html
import importlib
import json
import logging
import posixpath
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from urllib.parse import unquote

import click
import results
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parent.parent
MADE = ROOT / "out" / "docs" / "made"
"""What scripts/docs made before the build: gallery/ and tutorials/."""
WIDE = {"index.md": ["navigation"]}
"""Pages without the lists at their sides."""
DOOR = re.compile(r"soilmoist_ros/(\w+)/__init__\.py")
LINK = re.compile(r"(\]\()([^)\s]+)(\))")
FENCE = re.compile(r"^(```.*?^```$)", re.MULTILINE | re.DOTALL)
LANGUAGES = {
    ".py": "python",
    ".yaml": "yaml",
    ".yml": "yaml",
    ".xml": "xml",
    ".toml": "toml",
    ".csv": "text",
    "": "sh",
}
log = logging.getLogger("mkdocs.hooks.site_pages")


def outside_fences(markdown: str, change: Callable[[str], str]) -> str:
    """Markdown with everything but its code blocks changed."""
    return "".join(part if part.startswith("```") else change(part) for part in FENCE.split(markdown))


def repository_path(uri: str) -> str:
    """Path in the repository of a page of the site."""
    if uri.startswith("files/"):
        return uri.removeprefix("files/").removesuffix(".md")
    return f"docs/{uri}" if (ROOT / "docs" / uri).exists() or not (ROOT / uri).exists() else uri


def site_uri(path: str) -> str:
    """Place on the site of a file of the repository."""
    if path in ("README.md", "docs"):
        return "index.md"
    if door := DOOR.fullmatch(path):
        return f"api/{door[1]}.md"
    if path.startswith("docs/"):
        return path.removeprefix("docs/").replace(".ipynb", ".md")
    if path.endswith(".md"):
        return path
    return "CHANGELOG.md" if path == "CHANGELOG.rst" else f"files/{path}.md"


def links(markdown: str) -> Iterator[str]:
    """Every link of a page to a file, without its anchor."""
    for part in FENCE.split(markdown):
        if not part.startswith("```"):
            for _, link, _ in LINK.findall(part):
                path = link.partition("#")[0]
                if path and "://" not in path and not path.startswith("mailto:"):
                    yield path


def changes() -> str:
    """The changelog as Markdown."""
    text = (ROOT / "CHANGELOG.rst").read_text(encoding="utf-8").replace("``", "`")
    text = re.sub(r"^\^+\n(.*)\n\^+$", r"# Changes", text, flags=re.MULTILINE)
    return re.sub(r"^(.+)\n-{3,}$", r"## \1\n", text, flags=re.MULTILINE)


def content(path: str) -> str:
    """A file outside docs/ as a page."""
    if path == "CHANGELOG.rst":
        return changes()
    text = (ROOT / path).read_text(encoding="utf-8")
    if path.endswith(".md"):
        return text
    return f"# {path}\n\n```{LANGUAGES.get(Path(path).suffix, 'text')}\n{text.rstrip()}\n```\n"


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are no files in docs/."""
    queue = ["CONTRIBUTING.md", "SECURITY.md", "QUALITY_DECLARATION.md", "CHANGELOG.rst", "examples/README.md"]
    for file in files.documentation_pages():
        queue += [
            posixpath.normpath(posixpath.join("docs", posixpath.dirname(file.src_uri), link))
            for link in links(file.content_string)
        ]
    seen: set[str] = set()
    while queue:
        path = queue.pop()
        if (
            path in seen
            or path.startswith("docs")
            or path == "README.md"
            or DOOR.fullmatch(path)
            or not (ROOT / path).is_file()
        ):
            continue
        seen.add(path)
        text = content(path)
        files.append(File.generated(config, site_uri(path), content=text))
        if path.endswith(".md"):
            queue += [posixpath.normpath(posixpath.join(posixpath.dirname(path), link)) for link in links(text)]
    for folder in results.FOLDERS:
        files.append(File.generated(config, f"api/{folder}.md", content=public_names(folder)))
    for path in sorted((ROOT / "docs" / "tutorials").glob("*.ipynb")):
        executed = MADE / "tutorials" / path.name
        text, pictures = notebook(executed if executed.is_file() else path)
        link = f'<a href="{path.name}" download>Download this notebook</a>'
        download = f"{link} and run it with Jupyter in the clone.\n"
        files.append(File.generated(config, f"tutorials/{path.stem}.md", content=f"{text}\n---\n\n{download}"))
        for name, picture in pictures.items():
            files.append(File.generated(config, f"tutorials/{name}", content=picture))
    for path in sorted((MADE / "gallery").glob("*/*.*")):
        files.append(File.generated(config, path.relative_to(MADE).as_posix(), abs_src_path=str(path)))
    return files


def public_names(folder: str) -> str:
    """Page of a folder: what its ``__init__`` says, and every public name with its docstring."""
    module = importlib.import_module(f"soilmoist_ros.{folder}")
    names = "\n".join(f"::: soilmoist_ros.{folder}.{name}\n" for name in module.__all__)
    return f"# soilmoist_ros.{folder}\n\n{about(folder)}\n\n{names}"


def about(folder: str) -> str:
    """What the ``__init__`` of a folder says, as Markdown."""
    module = importlib.import_module(f"soilmoist_ros.{folder}")
    return re.sub(r":\w+:`([^`]+)`", r"`\1`", (module.__doc__ or "").replace("``", "`"))


def help_of_all() -> str:
    """Help of every command, by heading."""
    from soilmoist_ros.cli.main import COMMANDS, main

    def section(command: click.Command, names: list[str]) -> Iterator[str]:
        context = click.Context(command, info_name=" ".join(names), max_content_width=92, terminal_width=92)
        yield f"{'#' * len(names)} {' '.join(names)}\n\n```text\n{command.get_help(context)}\n```\n"
        if isinstance(command, click.Group):
            for name in command.list_commands(context):
                inner = command.get_command(context, name)
                if inner is not None:
                    yield from section(inner, [*names, name])

    parent = click.Context(main)
    parts = []
    for name in COMMANDS:
        command = main.get_command(parent, name)
        if command is not None:
            parts += list(section(command, ["soilmoist", name]))
    return "\n".join(parts)


def gallery(markdown: str) -> str:
    """Pictures of the runs instead of their list in the page, where scripts/docs made them."""
    path = MADE / "gallery" / "gallery.json"
    if not path.is_file():
        return markdown
    runs = json.loads(path.read_text(encoding="utf-8"))
    cards = [
        f'<a href="gallery/{run["name"]}/report.html">'
        + (f'<img src="gallery/{run["name"]}/picture.png" alt="" loading="lazy">' if run["picture"] else "")
        + f"<span><b>{html.escape(run['title'])}</b>{html.escape(run['about'])}</span></a>"
        for run in runs
    ]
    commands = "\n".join(run["command"] for run in runs)
    shown = f'\n<div class="gallery">{"".join(cards)}</div>\n\n```sh\n{commands}\n```\n\n'
    return results.MADE.sub(lambda match: f"gallery -->\n{shown}" if match[1] == "gallery" else match[0], markdown)


def notebook(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and the pictures among its outputs by name."""
    parts, pictures = [], {}
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"]):
        source = "".join(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
            continue
        parts.append(f"```python\n{source}\n```")
        for output in cell["outputs"]:
            data = output.get("data", {})
            text = "".join(output.get("text") or data.get("text/plain", ""))
            if "image/png" in data:
                name = f"{path.stem}_{number}.png"
                pictures[name] = base64.b64decode(data["image/png"])
                parts.append(f"![output of the code above]({name})")
            elif text.strip():
                parts.append(f'```{{.text .output title="output"}}\n{text.rstrip()}\n```')
    return "\n\n".join(parts) + "\n", pictures


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put in what the build makes, and turn links of the repository into links of the site."""
    here = repository_path(page.file.src_uri)
    page.meta["hide"] = WIDE.get(page.file.src_uri, [])
    if "<!-- help of every command -->" in markdown:
        markdown = markdown.replace("<!-- help of every command -->", help_of_all())
    markdown = gallery(markdown)

    def link(match: re.Match[str]) -> str:
        path, mark, anchor = match[2].partition("#")
        if not path or "://" in path or path.startswith("mailto:") or path.startswith("api/"):
            return match[0]
        target = site_uri(posixpath.normpath(posixpath.join(posixpath.dirname(here), path)))
        relative = posixpath.relpath(target, posixpath.dirname(page.file.src_uri) or ".")
        return f"{match[1]}{relative}{mark}{anchor}{match[3]}"

    markdown = re.sub(r"(\.csv\)\.)(?=\n\n<!-- end -->)", r"\1\n{: .made }", markdown)
    return outside_fences(markdown, lambda text: LINK.sub(link, text))


def on_post_page(output: str, page: Page, config: MkDocsConfig) -> str:
    """Let names in tables break after their parts; the search has read the page by now."""

    def cell(match: re.Match[str]) -> str:
        return re.sub(
            r"(?<=<code>)[^<]+", lambda code: re.sub(r"(?<=\w)([/_.:=]+)(?=\w)", r"\1<wbr>", code[0]), match[0]
        )

    return re.sub(r"<td\b.*?</td>", cell, output, flags=re.DOTALL)


def on_post_build(config: MkDocsConfig) -> None:
    """Warn, which ends a strict build, of links that lead nowhere, and of what a page loads from the network."""
    site = Path(config.site_dir)
    anchors: dict[Path, set[str]] = {}

    def ids(path: Path) -> set[str]:
        if path not in anchors:
            anchors[path] = set(re.findall(r"""\bid=["']?([^"'\s>]+)""", path.read_text(encoding="utf-8")))
        return anchors[path]

    for page in sorted(site.rglob("*.html")):
        if page.name == "404.html" or "gallery" in page.parent.parts:  # reports are tested by themselves
            continue
        text = page.read_text(encoding="utf-8")
        here = page.relative_to(site)
        for tag, target in re.findall(r"""<(a|img|script|link)\b[^>]*?\b(?:href|src)=["']?([^"'\s>]+)""", text):
            target = html.unescape(target)
            if target.startswith(("http:", "https:", "//")):
                if tag != "a" and 'rel="canonical"' not in text[: text.find(target)][-80:]:
                    log.warning("%s loads %s from the network", here, target)
                continue
            path, _, anchor = target.partition("#")
            if target.startswith(("mailto:", "data:", "javascript:")):
                continue
            found = (page.parent / path) if path else page
            if not found.is_file():
                log.warning("%s has a link to %s, which is not there", here, target)
            elif anchor and found.suffix == ".html" and unquote(anchor) not in ids(found):
                log.warning("%s has a link to %s, which has no such anchor", here, target)
