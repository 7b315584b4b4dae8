"""The measures of the house count what they say."""

from __future__ import annotations

import ast

import grimp

from studies.house import ROOTS, bare_floats, code_lines, floors_and_circles, named_constants

CODE = '''"""A page of words."""

LIMIT = 0.03
WIDE = {"no": "number"}


class Held:
    """More words."""

    SHARE = 2 * 0.4

    def asks(self, x):
        # a comment
        if x > 0.7 and x != 0.0:
            return min(x, 0.9)
        return f(0.2)
'''


def test_code_is_counted_without_words_and_blank_lines() -> None:
    assert code_lines(CODE) == 8


def test_numbers_that_decide_are_named_or_compared_with() -> None:
    tree = ast.parse(CODE)
    assert sorted(named_constants(tree)) == ["LIMIT", "SHARE"]
    assert sorted(bare_floats(tree)) == [0.7, 0.9]


def test_modules_that_import_each_other_are_one_floor_and_one_circle() -> None:
    edges = {"page": {"plot"}, "plot": {"data", "other"}, "other": {"plot"}, "data": set()}
    assert floors_and_circles(edges) == (3, [2])


def test_no_two_modules_of_the_product_import_each_other() -> None:
    """Layers hold between rooms; this holds between the files of one room as well."""
    graph = grimp.build_graph(*ROOTS, cache_dir=None)
    edges = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert floors_and_circles(edges)[1] == []
