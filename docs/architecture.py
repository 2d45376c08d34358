"""Draws docs/architecture.svg from the imports of the code itself: `make docs`.

A box is a room, a package or module right under `controller/` or `sim/`; it stands one floor above the highest room it
imports. A line is an import; one that follows from others (a imports b, b imports c, a imports c) is left out.
"""

import ast
import html
import sys
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
WORLDS = ("sim", "controller")
LEFT_OUT = {"__init__", "__main__"}
BOX, HEIGHT, FLOOR, GAP, MARGIN = 104, 26, 58, 14, 24  # [px]

STYLE = """
svg{font:13px system-ui,sans-serif;background:#fff}rect{fill:#f3f5f8;stroke:#98a2b3}
text{fill:#1c2430;text-anchor:middle}
.world{font-weight:600;text-anchor:start}path{stroke:#98a2b3;fill:none}.across{stroke:#d9690f;stroke-width:1.6}
@media(prefers-color-scheme:dark){svg{background:#12161c}rect{fill:#1f2733;stroke:#56637a}text{fill:#e7ebf0}
path{stroke:#56637a}.across{stroke:#f59a4b}}
"""


def rooms() -> dict[str, set[str]]:
    """Each room, such as "sim.plant", and the rooms it imports."""
    files = {path: _room(path) for world in WORLDS for path in sorted((ROOT / world).rglob("*.py"))}
    known = set(files.values()) - {None}
    graph: dict[str, set[str]] = {room: set() for room in sorted(known)}
    for path, room in files.items():
        if room:
            graph[room] |= {found for name in _imports(path) for found in [_named(name, known)] if found} - {room}
    return graph


def _room(path: Path) -> str | None:
    world, *inner = path.relative_to(ROOT).with_suffix("").parts
    return f"{world}.{inner[0]}" if inner[0] not in LEFT_OUT else None


def _named(name: str, known: set[str]) -> str | None:
    room = ".".join(name.split(".")[:2])
    return room if room in known else None


def _imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Constant) and str(node.value).startswith(tuple(f"{world}." for world in WORLDS)):
            yield node.value.partition(":")[0]  # a module that is named in a string and loaded when it is needed


def floors(graph: Mapping[str, set[str]]) -> dict[str, int]:
    """Floor of each room, 0 for one that imports no other of its world."""

    @cache
    def floor(room: str) -> int:
        return max((1 + floor(other) for other in graph[room] if _world(other) == _world(room)), default=0)

    return {room: floor(room) for room in graph}


def _world(room: str) -> str:
    return room.partition(".")[0]


def needed(graph: Mapping[str, set[str]]) -> list[tuple[str, str]]:
    """The imports that do not follow from others."""

    @cache
    def below(room: str) -> frozenset[str]:
        return frozenset(graph[room]).union(*(below(other) for other in graph[room]))

    return [(a, b) for a in graph for b in sorted(graph[a]) if not any(b in below(c) for c in graph[a] - {b})]


def picture() -> str:
    """The SVG."""
    graph = rooms()
    floor = floors(graph)
    top, widest = max(floor.values()), {}
    for world in WORLDS:
        rows = [sum(_world(room) == world and level == f for room, level in floor.items()) for f in range(top + 1)]
        widest[world] = max(rows) * (BOX + GAP) - GAP
    start = {"sim": MARGIN, "controller": 3 * MARGIN + widest["sim"]}
    place = {}
    for world in WORLDS:
        for level in range(top + 1):
            row = [room for room in graph if _world(room) == world and floor[room] == level]
            indent = (widest[world] - len(row) * (BOX + GAP) + GAP) // 2
            for i, room in enumerate(row):
                place[room] = start[world] + indent + i * (BOX + GAP), 2 * MARGIN + (top - level) * FLOOR
    lines = []
    for a, b in needed(graph):
        (x0, y0), (x1, y1) = place[a], place[b]
        x0, x1, y0 = x0 + BOX // 2, x1 + BOX // 2, y0 + HEIGHT
        bend = max(20, abs(y1 - y0) // 2)
        kind = ' class="across"' if _world(a) != _world(b) else ""
        lines.append(f'<path{kind} d="M{x0} {y0}C{x0} {y0 + bend} {x1} {y1 - bend} {x1} {y1}"/>')
    boxes = [
        f'<rect x="{x}" y="{y}" width="{BOX}" height="{HEIGHT}" rx="5"/>'
        f'<text x="{x + BOX // 2}" y="{y + 17}">{html.escape(room.partition(".")[2])}</text>'
        for room, (x, y) in place.items()
    ]
    heads = [
        f'<text class="world" x="{start[world]}" y="24">{world}/ - {words}</text>'
        for world, words in (("sim", "the truth"), ("controller", "a belief"))
    ]
    width, height = start["controller"] + widest["controller"] + MARGIN, 3 * MARGIN + top * FLOOR + HEIGHT
    title = "<title>Rooms of sim and controller, and what imports what</title>"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">'
    return "\n".join([f"{head}{title}<style>{STYLE}</style>", *heads, *lines, *boxes, "</svg>"]) + "\n"


if __name__ == "__main__":
    target = ROOT / "docs" / "architecture.svg"
    target.write_text(picture(), encoding="utf-8")
    print(target, file=sys.stderr)
