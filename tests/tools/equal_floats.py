"""Where tests ask for equal floats: ``python -m tests.tools.equal_floats [FOLDER]`` prints the places and their number.

Counted are comparisons of arrays, bytes and files bit by bit, and each ``==`` of which a side holds a float literal or
arithmetic, or which is true for ``all``; codes, words and counts are none.
"""

import ast
import sys
from collections import Counter
from pathlib import Path

BITWISE = {"array_equal", "assert_array_equal", "tobytes", "contents", "differing", "sha256", "crc32"}
ARITHMETIC = (ast.Sub, ast.Div, ast.Mult, ast.Pow, ast.MatMult)


def name_of(node: ast.AST) -> str:
    if not isinstance(node, ast.Call):
        return ""
    return node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")


def is_float(side: ast.AST) -> bool:
    """Whether a side of a comparison is surely a float: a tolerance makes it none."""
    nodes = list(ast.walk(side))
    if any(name_of(node) in ("approx", "len", "range") for node in nodes):
        return False
    literal = any(isinstance(node, ast.Constant) and isinstance(node.value, float) for node in nodes)
    return literal or (isinstance(side, ast.BinOp) and isinstance(side.op, ARITHMETIC))


def is_exact(side: ast.AST) -> bool:
    """Whether a side is surely no float: an integer, a word, a code in capitals, a list of these, or one repeated."""
    match side:
        case ast.Constant(value):
            return not isinstance(value, float)
        case ast.Name(name) | ast.Attribute(attr=name):
            return name.isupper()
        case ast.List(members) | ast.Tuple(members):
            return all(map(is_exact, members))
        case ast.BinOp(ast.List(members), ast.Mult()):
            return all(map(is_exact, members))
    return False


def asks(node: ast.AST) -> bool:
    """Whether a node compares for equality what may be floats."""
    if not (isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.Eq)):
        return False
    return not any(map(is_exact, (node.left, node.comparators[0])))


def demands(tree: ast.AST) -> list[tuple[int, str]]:
    """Line and kind of each demand for equality."""
    places = []
    for node in ast.walk(tree):
        if name_of(node) in BITWISE:
            places.append((node.lineno, name_of(node)))
        elif isinstance(node, ast.Compare) and asks(node):
            sides = (node.left, node.comparators[0])
            if any(map(is_float, sides)) and not any(name_of(n) == "approx" for s in sides for n in ast.walk(s)):
                places.append((node.lineno, "=="))
        elif name_of(node) == "all" and any(map(asks, ast.walk(node))):
            places.append((node.lineno, "== of all"))
    return sorted(places)


def main(folder: str = "tests") -> None:
    """Print each place, then how many there are of each kind."""
    kinds: Counter[str] = Counter()
    for file in sorted(Path(folder).rglob("*.py")):
        for line, kind in demands(ast.parse(file.read_text())):
            kinds[kind] += 1
            print(f"{file}:{line}: {kind}")
    print(f"{sum(kinds.values())} demands for equal floats: {dict(kinds.most_common())}")


if __name__ == "__main__":
    main(*sys.argv[1:])
