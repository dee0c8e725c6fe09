"""Ctrl-C during a solve is Ctrl-C, not a solve that did not converge."""

import os
import signal
import threading
import time

import casadi as ca
import pytest

from gmr_traj.interrupts import passed_on

PATIENCE = 20.0  # [s] far beyond what an interrupted test takes


@pytest.fixture
def ctrl_c_soon():
    timer = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    yield
    timer.cancel()


def solve_for_long() -> str:
    """Ipopt on something it cannot finish; its word for how it ended."""
    x = ca.MX.sym("x", 400)
    f = ca.sumsqr(ca.sin(x[1:]) * x[:-1] - 1) + ca.sumsqr(ca.cos(x * x))
    ipopt = {"print_level": 0, "sb": "yes", "max_iter": 10**6, "tol": 1e-300, "hessian_approximation": "limited-memory"}
    solver = ca.nlpsol("s", "ipopt", {"x": x, "f": f}, {"ipopt": ipopt, "print_time": False, "error_on_fail": False})
    deadline, word = time.monotonic() + PATIENCE, ""
    while time.monotonic() < deadline and word != "NonIpopt_Exception_Thrown":
        solver(x0=[0.3 * i % 7 for i in range(400)])
        word = solver.stats()["return_status"]
    return word


def test_an_interrupted_solve_is_interrupted(ctrl_c_soon):
    before = signal.getsignal(signal.SIGINT)
    started = time.monotonic()
    with pytest.raises(KeyboardInterrupt), passed_on():
        solve_for_long()
    assert time.monotonic() - started < PATIENCE / 2
    assert signal.getsignal(signal.SIGINT) is before


def test_an_interrupt_of_python_code_passes(ctrl_c_soon):
    with pytest.raises(KeyboardInterrupt), passed_on():
        time.sleep(PATIENCE)


def test_nothing_happens_without_ctrl_c_nor_in_other_threads():
    done = []

    def work() -> None:
        with passed_on():
            done.append(threading.current_thread().name)

    work()
    thread = threading.Thread(target=work, name="another")
    thread.start()
    thread.join()
    assert done == ["MainThread", "another"]
