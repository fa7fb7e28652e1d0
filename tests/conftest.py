"""Garbage is looked for less often than Python does by itself, which took some seconds in a hundred.

Coverage looks at the project's Python where it says something new, for tracing doubles what a test costs.

Not at what others do, nor at laws, whose examples go through the same lines again and again, nor at the few tests of
many or large cases that are marked ``no_cover``.  Nearly all that they run is run by tests of single cases, too; what
is not (half a percent of all lines) counts as not covered, though it is tested.
"""

import gc

import pytest
from hypothesis import is_hypothesis_test

from tests import tracing

gc.set_threshold(20_000)  # a worker holds half a million objects, hardly any of them garbage
tracing.not_while_numba_compiles()
tracing.not_while_a_picture_is_drawn()
tracing.not_in_textbook_twins()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Laws are run without coverage.  The longest test comes first: one worker alone would run it at the end."""
    items.sort(key=lambda item: item.path.stem != "test_warmup")
    for item in items:
        if isinstance(item, pytest.Function) and is_hypothesis_test(item.obj):
            item.add_marker(pytest.mark.no_cover)
