# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Public topological maps: which are read, and which are refused and why.

The folder has a folder ``OWNER+NAME`` for each repository, below which lie its map files, whatever their folders.

    scripts/bench_maps.py FOLDER [--save]
"""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import results

from soilmoist_ros.exploration import read_topological_map
from soilmoist_ros.foundation import InputError


def outcome(path: Path) -> tuple[str, int, int]:
    """Why a map is refused, empty if it is read; its nodes and edges."""
    try:
        graph = read_topological_map(path).graph
    except InputError as error:
        return re.sub(r"^:\d+: |^: ", "", str(error).removeprefix(str(path))).partition(" -> ")[0][:70], 0, 0
    return "", len(graph.names), len(graph.edges)


def main() -> None:
    """Read all maps and print the table."""
    parser = results.parser(__doc__)
    parser.add_argument("folder", type=Path)
    given = parser.parse_args()
    found = defaultdict(list)
    for path in sorted(one for one in given.folder.glob("*/**/*") if one.is_file()):
        repository, branch, *_, name = path.relative_to(given.folder).parts
        reason, nodes, edges = outcome(path)
        name = branch if name.startswith(("network", ".network", "poi")) else name
        found[repository.replace("+", "/"), re.sub(r"^node \d+", "node 1", reason)].append((name, nodes, edges))
    rows = []
    for (repository, reason), maps in sorted(found.items()):
        counts = [[one[column] for one in maps] for column in (1, 2)]
        nodes, edges = (f"{min(each)} to {max(each)}" if max(each) else "" for each in counts)
        names = ", ".join(dict.fromkeys(name for name, *_ in maps))
        rows.append((repository, len(maps), names, nodes, edges, reason or "read"))
    settings = f"{sum(map(len, found.values()))} files with different contents, of all branches and requests"
    results.publish(
        "maps", ("repository", "files", "maps", "nodes", "edges", "read, or why not"), rows, settings, given.save
    )


if __name__ == "__main__":
    main()
