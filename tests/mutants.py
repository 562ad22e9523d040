"""How many planted mistakes the tests find: ``python tests/mutants.py --seed 0`` plants 24, one at a time.

Each is one line of framework, systems or plugins with another sign, bound or constant, or without its statement. The
tests that name the module or its functions run first, then all others, until one fails. ``--into FILE`` keeps the list;
``--of FILE`` plants the same ones again where their lines still stand. Works on a clean tree only, and leaves it clean.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parent.parent
PRODUCT = ("framework", "systems", "plugins")
KINDS = ("sign", "bound", "constant", "dropped")
COMPARISONS = {ast.Lt: ("<", "<="), ast.LtE: ("<=", "<"), ast.Gt: (">", ">="), ast.GtE: (">=", ">")}
SIGNS = {ast.Add: ("+", "-"), ast.Sub: ("-", "+")}
TIME = 1800  # s for one: a test that no longer ends has found it


def git(*words):
    return subprocess.run(("git", *words), cwd=ROOT, capture_output=True, text=True, check=True).stdout


def mutations(path):
    """(line number, kind, line, mutated line) of what can be changed in a file, on one line each."""
    text = path.read_text()
    lines = text.splitlines()

    def between(left, right, old, new, kind):
        if left.end_lineno == right.lineno:
            line, start, stop = lines[left.end_lineno - 1], left.end_col_offset, right.col_offset
            middle = line[start:stop].replace(old, new, 1)
            if middle != line[start:stop]:
                yield left.end_lineno, kind, line, line[:start] + middle + line[stop:]

    def replaced(node, new):
        line = lines[node.lineno - 1]
        return line, line[: node.col_offset] + new + line[node.end_col_offset :]

    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in (inner for statement in function.body for inner in ast.walk(statement)):
            if isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
                yield from between(node.left, node.right, *SIGNS[type(node.op)], "sign")
            elif isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
                yield from between(node.left, node.comparators[0], *COMPARISONS[type(node.ops[0])], "bound")
            elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
                new = not node.value if isinstance(node.value, bool) else node.value + 1
                yield node.lineno, "constant", *replaced(node, str(new))
            elif isinstance(node, ast.Assign | ast.AugAssign | ast.Expr):
                docstring = isinstance(node.value, ast.Constant)
                if node.lineno == node.end_lineno and not docstring:
                    yield node.lineno, "dropped", *replaced(node, "pass")


def choose(seed, count):
    """Mutations, as many of each kind, from files by their length."""
    found = {kind: [] for kind in KINDS}
    for name in git("ls-files", *PRODUCT).split():
        if name.endswith(".py"):
            for number, kind, line, mutated in mutations(ROOT / name):
                found[kind].append({"file": name, "line": number, "kind": kind, "old": line, "new": mutated})
    pick = random.Random(seed)
    return [pick.choice(found[KINDS[k % len(KINDS)]]) for k in range(count)]


def place(mutation):
    """(file, line number) where its line stands now, in the same file if it can be, else None."""
    names = [mutation["file"]] + [name for name in git("ls-files", *PRODUCT).split() if name.endswith(".py")]
    for name in names:
        if (ROOT / name).exists():
            numbers = [k for k, line in enumerate((ROOT / name).read_text().splitlines(), 1) if line == mutation["old"]]
            if numbers:
                return name, min(numbers, key=lambda number: abs(number - mutation["line"]))
    return None


def tests_nearest(name):
    """All test files, first those that mention the module or its functions most often."""
    words = [Path(name).stem, *re.findall(r"^(?:def|class) (\w+)", (ROOT / name).read_text(), re.MULTILINE)]
    pattern = re.compile(r"\b(" + "|".join(map(re.escape, words)) + r")\b")
    files = [test for test in git("ls-files", "tests").split() if Path(test).name.startswith("test_")]
    return sorted(files, key=lambda test: -len(pattern.findall((ROOT / test).read_text())))


def killed_by(name):
    """The first test that fails, "no end", or None."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-n2", "--dist", "loadfile", "--no-loadscope-reorder"]
    try:
        run = subprocess.run((*command, *tests_nearest(name)), cwd=ROOT, capture_output=True, text=True, timeout=TIME)
    except subprocess.TimeoutExpired:
        return "no end"
    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", run.stdout, re.MULTILINE)
    return None if run.returncode == 0 else (failed or ["the tests do not start"])[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--of", type=Path, help="a list that --into has written")
    parser.add_argument("--into", type=Path)
    options = parser.parse_args()
    if git("status", "--porcelain", *PRODUCT):
        sys.exit("there are changes that are not committed: the lines of mutants would be lost among them")
    chosen = json.loads(options.of.read_text()) if options.of else choose(options.seed, options.count)
    killed = standing = 0
    for number, mutation in enumerate(chosen):
        found = place(mutation)
        if found is None:
            print(f"{number:2} gone      {mutation['file']}: {mutation['old'].strip()}", flush=True)
            continue
        path, lines = ROOT / found[0], (ROOT / found[0]).read_text().splitlines(keepends=True)
        try:
            changed = lines.copy()
            changed[found[1] - 1] = mutation["new"] + "\n"
            path.write_text("".join(changed))
            killer = killed_by(found[0])
        finally:
            path.write_text("".join(lines))
        standing, killed = standing + 1, killed + (killer is not None)
        mutation["killed"] = killer
        print(f"{number:2} {killer or 'SURVIVES'}\n   {found[0]}:{found[1]} {mutation['new'].strip()}", flush=True)
    print(f"{killed} of {standing} killed")
    if options.into:
        options.into.write_text(json.dumps(chosen, indent=1))


if __name__ == "__main__":
    main()
