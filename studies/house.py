"""``python -m studies.house FOLDER [FOLDER …]``: measures of the code in checkouts, one column each.

Files per folder, floors and circles of imports, lines and functions of each package, numbers that decide in
the gap diagnosis, words of documentation; as a Markdown table. Nothing of a checkout is executed.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final

import grimp
import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

ROOTS: Final = ("daq_app", "drivers", "sim_hardware")
PACKAGES: Final = (
    "drivers",
    "sim_hardware",
    "sim_hardware.daqmx_server",
    "daq_app.config",
    "daq_app.runfile",
    "daq_app.rocking",
    "daq_app.acquisition",
    "daq_app.campaign",
    "daq_app.gap",
    "daq_app.gap.core",
    "daq_app.gap.rocking_model",
    "daq_app.gap.blind",
    "daq_app.monitor",
    "daq_app.cli",
)
DIAGNOSIS: Final = ("daq_app/gap/core", "daq_app/gap/rocking_model")
POLICY: Final = ("policy", "tolerances")
"""Modules and folders in which numbers that decide may stand."""
_PLAIN: Final = frozenset({0.0, 1.0, 2.0, 0.5})
"""Numbers in a comparison that belong to its form and decide nothing by their size."""
_CLIPS: Final = frozenset({"min", "max", "clip", "minimum", "maximum"})
_TEXT_FOLDERS: Final = (
    "daq_app",
    "drivers",
    "sim_hardware",
    "tests",
    "benchmarks",
    "studies",
    "docs",
    "configs",
)

Measures = dict[str, str]


def measure(folder: Path) -> Measures:
    """All measures of the checkout in `folder`, in the order in which they are shown."""
    return {
        **_folders(folder),
        **_imports(folder),
        **_code(folder),
        **_numbers(folder),
        **_words(folder),
    }


def _folders(folder: Path) -> Measures:
    """The fullest folders: files side by side, without ``__init__.py``."""
    files = [
        file
        for name in _TEXT_FOLDERS
        for file in (folder / name).rglob("*")
        if file.is_file() and "__pycache__" not in file.parts and file.name != "__init__.py"
    ]
    full = Counter(file.parent.relative_to(folder).as_posix() for file in files)
    worst = ", ".join(f"`{name}` {count}" for name, count in full.most_common(4))
    return {
        "fullest folders (files)": worst,
        "folders with more than 15 files": str(sum(count > 15 for count in full.values())),
    }


def _imports(folder: Path) -> Measures:
    """Floors (modules in the longest chain of imports) and circles of each package."""
    sys.path.insert(0, str(folder))
    try:
        graph = grimp.build_graph(*ROOTS, cache_dir=None)
    finally:
        sys.path.remove(str(folder))
    found = {}
    for package in PACKAGES:
        modules = sorted(m for m in graph.modules if m == package or m.startswith(package + "."))
        if modules:
            edges = {m: graph.find_modules_directly_imported_by(m) & set(modules) for m in modules}
            floors, circles = floors_and_circles(edges)
            found[f"{package}: floors; circles (modules in them)"] = (
                f"{floors}; {len(circles)} ({sum(circles)})"
            )
    return found


def floors_and_circles(edges: Mapping[str, set[str]]) -> tuple[int, list[int]]:
    """Number of floors of a graph of imports, and the sizes of its circles; a circle lies on one floor."""
    names = list(edges)
    place = {name: index for index, name in enumerate(names)}
    pairs = [(place[a], place[b]) for a in names for b in edges[a] if a != b]
    rows, columns = (np.array(side, dtype=int) for side in (zip(*pairs, strict=True) if pairs else ((), ())))
    matrix = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(names), len(names)))
    count, group = connected_components(matrix, directed=True, connection="strong")
    below: dict[int, set[int]] = {index: set() for index in range(count)}
    for row, column in pairs:
        if group[row] != group[column]:
            below[int(group[row])].add(int(group[column]))

    @cache
    def height(index: int) -> int:
        return 1 + max((height(lower) for lower in below[index]), default=0)

    sizes = np.bincount(group, minlength=count)
    return max(map(height, below), default=0), [int(size) for size in sizes if size > 1]


def _code(folder: Path) -> Measures:
    """Lines of code, without blank lines, comments and docstrings, and the functions of each package."""
    found = {}
    total = 0
    for package in PACKAGES:
        files = sorted((folder / package.replace(".", "/")).rglob("*.py"))
        lines = sum(code_lines(file.read_text(encoding="utf-8")) for file in files)
        if package in ROOTS or (package.count(".") == 1 and package.startswith("daq_app.")):
            total += lines
        found[f"{package}: lines of code"] = str(lines)
    beside = (folder / "daq_app").glob("*.py")
    total += sum(code_lines(file.read_text(encoding="utf-8")) for file in beside)
    found["product: lines of code"] = str(total)
    lengths = [length for root in ROOTS for length in _function_lengths(folder / root)]
    complexity = _complexities(folder)
    found["functions: mean length in lines; above 60 lines"] = (
        f"{np.mean(lengths):.1f}; {sum(length > 60 for length in lengths)}"
    )
    found["functions: mean cyclomatic complexity; above 10"] = (
        f"{np.mean(complexity):.2f}; {sum(value > 10 for value in complexity)}"
    )
    return found


def code_lines(text: str) -> int:
    """Lines that hold code: no blank lines, comments or docstrings."""
    skip = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT}
    skip |= {tokenize.ENCODING, tokenize.ENDMARKER}
    held = {
        line
        for token in tokenize.generate_tokens(io.StringIO(text).readline)
        if token.type not in skip
        for line in range(token.start[0], token.end[0] + 1)
    }
    for node in ast.walk(ast.parse(text)):
        if (
            isinstance(node, ast.Expr)
            and isinstance(node.value, ast.Constant)
            and isinstance(node.value.value, str)
        ):
            held -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(held)


def _function_lengths(folder: Path) -> Iterator[int]:
    for tree in _trees(folder):
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno:
                yield node.end_lineno - node.lineno + 1


def _complexities(folder: Path) -> list[int]:
    """Cyclomatic complexity of every function, as ruff counts it."""
    command = [
        sys.executable,
        "-m",
        "ruff",
        "check",
        "--isolated",
        "--select",
        "C901",
        "--output-format",
        "json",
    ]
    command += ["--exit-zero", "--no-cache", "--config", "lint.mccabe.max-complexity=0", *ROOTS]
    said = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    return [int(entry["message"].rpartition("(")[2].split()[0]) for entry in json.loads(said)]


def _numbers(folder: Path) -> Measures:
    """Numbers that decide in the diagnosis: inside and outside of the modules that are meant to hold them."""
    named = {True: 0, False: 0}
    bare = 0
    for place in DIAGNOSIS:
        for file in sorted((folder / place).rglob("*.py")):
            tree = ast.parse(file.read_text(encoding="utf-8"))
            inside = file.stem in POLICY or file.parent.name in POLICY
            named[inside] += len(list(named_constants(tree, fields=inside)))
            bare += len(list(bare_floats(tree)))
    return {
        "gap diagnosis: named numbers outside policy and tolerances": str(named[False]),
        "gap diagnosis: named numbers in policy and tolerances": str(named[True]),
        "gap diagnosis: bare floats that are compared or clipped with": str(bare),
    }


def named_constants(tree: ast.AST, *, fields: bool = False) -> Iterator[str]:
    """Names in capitals, or all `fields`, that are given a number at the top of a module or of a class."""
    for holder in ast.walk(tree):
        if not isinstance(holder, ast.Module | ast.ClassDef):
            continue
        for node in holder.body:
            if isinstance(node, ast.Assign):
                targets, value = node.targets, node.value
            elif isinstance(node, ast.AnnAssign) and node.value is not None:
                targets, value = [node.target], node.value
            else:
                continue
            for target in targets:
                if isinstance(target, ast.Name) and _is_number(value) and (fields or target.id.isupper()):
                    yield target.id


def bare_floats(tree: ast.AST) -> Iterator[float]:
    """Floats in comparisons and in calls that clip."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Compare):
            parts = [node.left, *node.comparators]
        elif isinstance(node, ast.Call) and _called(node) in _CLIPS:
            parts = list(node.args)
        else:
            continue
        inside = (inner for part in parts for inner in ast.walk(part) if isinstance(inner, ast.Constant))
        yield from (i.value for i in inside if isinstance(i.value, float) and i.value not in _PLAIN)


def _is_number(node: ast.expr) -> bool:
    """Whether an expression is worked out from numbers alone."""
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return _is_number(node.operand)
    return isinstance(node, ast.BinOp) and _is_number(node.left) and _is_number(node.right)


def _called(node: ast.Call) -> str:
    if isinstance(node.func, ast.Attribute):
        return node.func.attr
    return node.func.id if isinstance(node.func, ast.Name) else ""


def _trees(folder: Path) -> Iterator[ast.Module]:
    for file in sorted(folder.rglob("*.py")):
        yield ast.parse(file.read_text(encoding="utf-8"))


def _words(folder: Path) -> Measures:
    pages = {page: len(page.read_text(encoding="utf-8").split()) for page in (folder / "docs").rglob("*.md")}
    longest = max(pages, key=lambda page: pages[page])
    return {
        "documentation: words; pages": f"{sum(pages.values())}; {len(pages)}",
        "documentation: longest page": f"`{longest.name}` {pages[longest]}",
    }


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m studies.house", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER", help="checkouts to measure")
    columns = [measure(folder.resolve()) for folder in parser.parse_args().folders]
    names = dict.fromkeys(name for column in columns for name in column)
    print("| measure |" + "".join(f" {number} |" for number in range(1, len(columns) + 1)))
    print("|---|" + "---|" * len(columns))
    for name in names:
        print(f"| {name} |" + "".join(f" {column.get(name, '–')} |" for column in columns))
    return 0


if __name__ == "__main__":
    sys.exit(main())
