"""The learning environment keeps to its library's rules, and to the session's bits."""

import warnings

import numpy as np
import pytest

import elevon

gymnasium = pytest.importorskip("gymnasium")


@pytest.fixture
def env():
    from elevon.environment import ActuatorEnv

    return ActuatorEnv("torino-rotary", "2 N m", lambda time: 0.02 * np.sin(6 * time))


def test_it_keeps_to_the_rules(env):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        # Its advice: signals have no bounds of their own, and the seed changes nothing.
        warnings.filterwarnings("ignore", module="gymnasium")
        check_env(env, skip_render_check=True)


def test_an_episode_is_a_session(env):
    first, _ = env.reset(seed=1)
    assert first.shape == (3,)
    session = elevon.Session("torino-rotary", mode="torque", fidelity="low")
    steps, ended = 0, False
    while not ended:
        seen, reward, stopped, ended, info = env.step(np.array([0.4]))
        session.set(command=0.8)
        session.advance("5 ms")
        steps += 1
        assert seen[0] == session["output_position"]
        assert seen[2] == 0.02 * np.sin(6 * info["time"])
        assert reward == pytest.approx(-((seen[0] - seen[2]) ** 2) - 1e-3 * 0.16)
        assert not stopped
    assert steps == 200
    again, _ = env.reset()
    assert np.array_equal(again, first)
