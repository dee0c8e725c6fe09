from __future__ import annotations

import numpy as np
import pytest

from gmr_traj.exceptions import ResourceError
from gmr_traj.retarget.descent import Adadelta, Adam, step_rule


def test_adams_first_steps_are_the_rate_whatever_the_gradient():
    for scale in (1e-3, 1.0, 1e4):
        step = Adam(0.01).step(scale * np.array([1.0, -2.0]))
        np.testing.assert_allclose(step, [-0.01, 0.01], rtol=1e-4)


def test_adam_of_two_different_gradients():
    rule = Adam(0.1)
    rule.step(np.array([1.0]))
    m, v = (0.9 * 0.1 + 0.1 * 3.0) / (1 - 0.9**2), (0.999 * 0.001 + 0.001 * 9.0) / (1 - 0.999**2)
    assert rule.step(np.array([3.0]))[0] == pytest.approx(-0.1 * m / (np.sqrt(v) + 1e-8))


def test_adadelta_by_hand():
    rule = Adadelta(2.0)
    first = np.sqrt(1e-6) / np.sqrt(0.1 * 0.25 + 1e-6) * 0.5
    assert rule.step(np.array([0.5]))[0] == pytest.approx(-2.0 * first)
    square, moved = 0.9 * 0.1 * 0.25 + 0.1 * 1.0, 0.1 * first**2
    second = np.sqrt(moved + 1e-6) / np.sqrt(square + 1e-6)
    assert rule.step(np.array([1.0]))[0] == pytest.approx(-2.0 * second)


def test_adadelta_of_small_gradients_is_plain_descent():
    """What makes PHC's joints move less the longer the clip is."""
    gradient = np.array([1e-5, -3e-5])
    np.testing.assert_allclose(Adadelta(100.0).step(gradient), -100.0 * gradient, rtol=1e-3)


@pytest.mark.parametrize(("name", "rate"), [("adam", 0.05), ("adadelta", 1.0)])
def test_they_find_the_minimum_of_a_bowl(name, rate):
    rule, x = step_rule(name, rate), np.array([3.0, -2.0])
    for _ in range(2000):
        x = x + rule.step(np.array([1.0, 4.0]) * x)
    np.testing.assert_allclose(x, 0.0, atol=0.05)


def test_an_unknown_rule():
    with pytest.raises(ResourceError, match="'sgd'; there are adam, adadelta"):
        step_rule("sgd", 1.0)
