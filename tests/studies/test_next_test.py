"""`python -m studies next-test`: how orders of tests are counted; the whole study."""

import json
from itertools import permutations
from types import SimpleNamespace

import pytest

from studies import main
from studies import next_test as module


def test_fixed_orders_are_counted_as_they_would_be_run(monkeypatch):
    """By a table of log odds: the order of the list and the mean over all orders, by hand."""
    odds = {(0, 0): 1.0, (1, 0): 4.0, (2, 0): 0.5, (0, 1): 1.0, (1, 1): -9.0, (2, 1): 0.5}
    unit = object.__new__(module._Unit)
    unit._pair, unit._truth, unit._bench = "p", 1, SimpleNamespace(cases=[0, 1, 2])
    monkeypatch.setattr(module._Unit, "odds", lambda _, k, r: odds.get((k, r), 0.0))
    tests, certain, right = unit.by_orders()
    # Sure with the second test of the list, wherever it stands: first, second or third.
    orders = list(permutations(range(3)))
    assert tests.tolist() == [order.index(1) + 1.0 for order in orders]
    assert certain.all()
    assert right.all()
    assert unit.mean_of_orders(tests, certain, right).tests == pytest.approx(2.0)


@pytest.mark.long
def test_information_beats_fixed_orders(capsys):
    main(["next-test", "--json"])
    document = json.loads(capsys.readouterr().out)
    assert document["status"] == "pass", document["checks"]
    rows = {r["strategy"]: r["tests"] for r in document["rows"] if r["pair"] == "all"}
    assert rows["information"] < document["best_fixed_order"]["tests"] < rows["orders"]
