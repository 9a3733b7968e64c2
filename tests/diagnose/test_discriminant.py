"""The discriminant with shrunk scatter and calibrated probabilities."""

import numpy as np
import pytest

from elevon.diagnose.learning.discriminant import Discriminant
from elevon.diagnose.learning.fit import share_interval
from elevon.errors import InputError


def _random(seed=0):
    return np.random.default_rng(seed)


def test_discriminant_knows_its_classes_and_its_doubts():
    random = _random(1)
    labels = np.repeat(["a", "b", "c"], 40)
    centres = {"a": (0.0, 0.0), "b": (4.0, 0.0), "c": (0.0, 4.0)}
    x = np.array([centres[name] for name in labels]) + random.standard_normal((120, 2))
    groups = np.tile(np.arange(8), 15)
    fitted = Discriminant.fit(x, labels.tolist(), groups)
    p = fitted.predict_proba(x)
    np.testing.assert_allclose(p.sum(axis=1), 1.0)
    right = np.array(fitted.predict(x)) == labels
    # Overlap of 4 deviations between centres: an error of Phi(-2) = 2.3 % to each side.
    assert right.mean() > 0.9
    assert p.max(axis=1).mean() == pytest.approx(right.mean(), abs=0.06)
    middle = fitted.predict_proba([[2.0, 0.0]])[0]
    assert middle[2] < 0.1
    assert middle[0] == pytest.approx(0.5, abs=0.3)
    assert fitted.outside([[50.0, 0.0]]).tolist() == [[True, False]]


def test_scatter_is_friedmans_of_unequal_classes_and_a_feature_that_stands():
    random = _random(5)
    labels = np.repeat(["a", "b", "c"], [9, 4, 20])
    x = random.standard_normal((33, 4)) @ np.diag([1.0, 50.0, 1e-3, 0.0]) + 2.0
    x[:, 1] += x[:, 0]
    fitted = Discriminant.fit(x, labels.tolist(), np.arange(33) % 3, shrinkage=0.3)
    means = {name: x[labels == name].mean(axis=0) for name in "abc"}
    residual = np.array([row - means[name] for row, name in zip(x, labels, strict=True)])
    scale = np.array([*np.sqrt((residual[:, :3] ** 2).sum(axis=0) / 30.0), 2.0])
    unit = residual / scale
    scatter = 0.7 * unit.T @ unit / 30.0 + 0.3 * np.eye(4)
    np.testing.assert_allclose(fitted.scale, scale, rtol=1e-12)
    np.testing.assert_allclose(fitted.precision, np.linalg.inv(scatter), rtol=1e-9, atol=1e-12)


def test_groups_that_shift_make_the_probabilities_humble():
    random = _random(2)
    labels = np.tile(np.repeat(["a", "b"], 20), 4)
    groups = np.repeat(np.arange(4), 40)
    x = (labels == "b")[:, None] * 3.0 + random.standard_normal((160, 1))
    steady = Discriminant.fit(x, labels.tolist(), groups, shrinkage=0.2)
    shifted = Discriminant.fit(
        x + np.array([0.0, 3.0, -3.0, 0.0])[groups][:, None], labels.tolist(), groups, shrinkage=0.2
    )
    assert shifted.temperature > 2.0 * steady.temperature


@pytest.mark.parametrize(
    ("x", "labels", "message"),
    [
        ([[0.0], [1.0]], ["a"], "labels"),
        ([[0.0], [np.nan]], ["a", "b"], "finite"),
        ([[0.0], [1.0]], ["a", "a"], "two classes"),
    ],
)
def test_discriminant_refuses(x, labels, message):
    with pytest.raises(InputError, match=message):
        Discriminant.fit(x, labels, np.arange(len(x)))


def test_share_interval_is_that_of_the_tables():
    # No hit of 10: 1 - 0.025**(1/10); 5 of 10: 0.1871 to 0.8129 (Clopper and Pearson).
    assert share_interval(0, 10) == pytest.approx((0.0, 1.0 - 0.025**0.1))
    assert share_interval(5, 10) == pytest.approx((0.1871, 0.8129), abs=5e-5)
    assert share_interval(10, 10) == pytest.approx((0.025**0.1, 1.0))
    assert share_interval(0, 0) == (0.0, 1.0)
