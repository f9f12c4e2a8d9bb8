"""A decoded layout comes back from its table as it was."""

from dataclasses import fields

import numpy as np
import pytest

from storage.artifacts import kind_of
from storage.layout import HIDDEN, LINE_END, Layout


def layout(n):
    each = np.arange(n)
    return Layout(
        line_ids=np.array([f"rls{i // 2}" for i in each], np.str_),
        hypotheses=each % 2,
        orders=each // 3,
        from_m=each / 3,
        to_m=each / 3 + 1,
        from_cuts=np.where(each % 2, HIDDEN, LINE_END),
        to_cuts=each,
        classes=np.array(["", "office", "lab"] * n, np.str_)[:n],
        rules=np.array(["", "r1", "u2"] * n, np.str_)[:n],
        parts=each % 3,
        widths_m=np.where(each % 3, each / 7, np.nan),
        spreads_m=np.where(each % 3, 0.1, np.nan),
        posteriors=1 / (each + 1),
        from_posteriors=1 / (each + 2),
        to_posteriors=1 / (each + 3),
        undivided=1 / (each + 4),
        gains=each / 5,
        log_p=np.where(each % 5, -each / 9, -np.inf),
    )


@pytest.mark.parametrize("n", [0, 1, 7])
def test_a_layout_comes_back_from_its_table(n):
    kind, value = kind_of(Layout), layout(n)
    table = kind.to_table(value)
    back = kind.from_table(table)
    assert table.schema.equals(kind.schema)
    table.validate(full=True)
    for field in fields(Layout):
        np.testing.assert_array_equal(getattr(back, field.name), getattr(value, field.name))


def test_a_room_that_no_rule_explains_has_nulls_for_what_a_rule_would_say():
    row = kind_of(Layout).to_table(layout(1)).to_pylist()[0]
    assert [row[name] for name in ("class", "rule", "width_m", "spread_m")] == [None] * 4


def test_rooms_know_whether_a_rule_explains_them():
    assert layout(4).explained.tolist() == [False, True, True, False]
