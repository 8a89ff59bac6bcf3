#!/usr/bin/env python3
"""Checks that the includes below src/ follow the layers of docs/architecture.md.

Arrows only point downward, headers do not include each other in circles, and what a user of the
library need not have installed stays out of the headers.

    scripts/check_layers.py [directory with the layers, default: src]
"""

import re
import sys
from pathlib import Path

# A layer may include itself and these.
LAYERS = {
    "graph": set(),
    "frames": {"graph"},
    "solvers": {"graph", "frames"},
    "joining": {"graph", "frames", "solvers"},
    "filtering": {"graph", "frames", "solvers", "joining"},
    "io": {"graph", "frames"},
    "evaluation": {"graph", "frames", "solvers"},
    "association": {"graph", "frames", "solvers", "joining", "evaluation"},
    "building": {"graph", "frames", "solvers", "joining", "io", "evaluation"},
    "cli": {"graph", "frames", "solvers", "joining", "filtering", "io", "evaluation", "association",
            "building"},
}

# Dependencies that only these layers may include; None: any layer.
ONLY_IN = {
    "ceres": {"building"},
    "cholmod": None,
    "amd": None,
    "camd": None,
    "metis": None,
    "matio": {"io"},
    "tbb": None,
    "oneapi": None,
    "CLI": {"cli"},
    "nlohmann": {"cli"},
}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]', re.MULTILINE)


def includes_of(path):
    """Yields (line number, '<' or '"', included name)."""
    text = path.read_text(encoding="utf-8")
    for match in INCLUDE.finditer(text):
        yield text.count("\n", 0, match.start(1)) + 1, match.group(1), match.group(2)


def dependency_of(name):
    """The dependency an include belongs to: <suitesparse/cholmod.h> and <cholmod.h> are cholmod."""
    parts = name.removeprefix("suitesparse/").split("/")
    return parts[0].removesuffix(".h")


def check_dependency(path, layer, name):
    dependency = dependency_of(name)
    if dependency not in ONLY_IN:
        return None
    allowed = ONLY_IN[dependency]
    if allowed is not None and layer not in allowed:
        return f"only {', '.join(sorted(allowed))} may include <{name}>"
    if path.suffix == ".h" and layer != "cli":
        return f"<{name}> belongs in a .cpp file: users of this header may not have it"
    return None


def check_own_include(root, layer, quote, name):
    if not name.startswith("mapjoin/"):
        if quote == '"':
            return f'write "{name}" as "mapjoin/<layer>/<file>.h"'
        return None
    if quote == "<":
        return f'write <{name}> in quotes'
    if not (root / name.removeprefix("mapjoin/")).is_file():
        return f'"{name}" does not exist'
    parts = name.split("/")
    target = parts[1] if len(parts) > 2 else None
    if layer is None or target == layer:
        return None  # headers directly in src/ gather others
    if target not in LAYERS[layer]:
        return f"{layer} must not include {target or 'a header directly in src'}: \"{name}\""
    return None


def find_cycle(graph):
    """One circle of includes as a list of files, or None."""
    done, path = set(), []

    def visit(node):
        if node in path:
            return path[path.index(node):] + [node]
        if node in done:
            return None
        path.append(node)
        for target in graph.get(node, ()):
            cycle = visit(target)
            if cycle:
                return cycle
        path.pop()
        done.add(node)
        return None

    for node in sorted(graph):
        cycle = visit(node)
        if cycle:
            return cycle
    return None


def main():
    root = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent.parent / "src")
    files = sorted(p for p in root.rglob("*") if p.suffix in (".h", ".cpp"))
    problems, graph, count = [], {}, 0
    for path in files:
        relative = path.relative_to(root)
        layer = relative.parts[0] if len(relative.parts) > 1 else None
        if layer is not None and layer not in LAYERS:
            problems.append(f"{path}: {layer} is not a layer (see LAYERS in {sys.argv[0]})")
            continue
        for line, quote, name in includes_of(path):
            count += 1
            problem = check_own_include(root, layer, quote, name) or check_dependency(path, layer, name)
            if problem:
                problems.append(f"{path}:{line}: {problem}")
            if name.startswith("mapjoin/"):
                graph.setdefault(str(relative), set()).add(name.removeprefix("mapjoin/"))
    cycle = find_cycle(graph)
    if cycle:
        problems.append("headers include each other in a circle: " + " -> ".join(cycle))

    for problem in problems:
        print(problem, file=sys.stderr)
    print(f"layers: {len(files)} files, {count} includes, {len(problems)} problems")
    if not files:
        print(f"layers: no sources in {root}", file=sys.stderr)
    return 1 if problems or not files else 0


if __name__ == "__main__":
    sys.exit(main())
