"""Kernels called from several Python threads while others change the number of workers."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np
import pytest
from binding_calls import CALLS, arguments, run
from hypothesis import given, settings
from hypothesis import strategies as st

from room2dgs import _C

SIZES = {"h": 150, "w": 60, "n": 3000, "k": 4}


def together(*tasks: Callable[[], None]) -> None:
    """Runs them at once, and raises what one of them raised."""
    failures: list[BaseException] = []

    def guarded(task: Callable[[], None]) -> None:
        try:
            task()
        except BaseException as failure:
            failures.append(failure)

    threads = [threading.Thread(target=guarded, args=(task,)) for task in tasks]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]


def results(name: str, sizes: dict[str, int] = SIZES) -> list[bytes]:
    """The bits of everything that a call writes."""
    call = CALLS[name]
    values = arguments(call, sizes)
    run(call, values, sizes)
    return [values[array.name].tobytes() for array in call.arrays() if array.written]


@pytest.mark.parametrize(
    "name",
    [
        "rgb_loss",
        "depth_normals",
        "normal_consistency",
        "depth_prior",
        "normal_prior",
        "joint_gradient",
        "complete",
        "forward",
        "backward",
    ],
)
def test_same_bits_from_several_threads_while_the_pool_is_resized(name):
    _C.set_threads(1)
    wanted = results(name)
    done = threading.Event()

    def call() -> None:
        for _ in range(6):
            assert results(name) == wanted

    def resize() -> None:
        count = 0
        while not done.is_set():
            count = count % 5 + 1
            assert _C.set_threads(count) == count
            assert 1 <= _C.threads() <= 5
            done.wait(0.001)

    resizer = threading.Thread(target=resize)
    resizer.start()
    try:
        together(call, call, call)
    finally:
        done.set()
        resizer.join()


@settings(max_examples=15, deadline=None)
@given(
    sizes=st.fixed_dictionaries(
        {"h": st.integers(1, 70), "w": st.integers(1, 70), "n": st.integers(0, 3000), "k": st.sampled_from([1, 16])}
    ),
    workers=st.integers(1, 6),
)
def test_different_kernels_at_once_on_any_number_of_workers(sizes, workers):
    names = ["rgb_loss", "depth_normals", "normal_consistency", "depth_prior", "normal_prior", "joint_gradient"]
    names += ["complete", "backward"]
    _C.set_threads(1)
    wanted = {name: results(name, sizes) for name in names}
    _C.set_threads(workers)

    def same(name: str) -> Callable[[], None]:
        def check() -> None:
            assert results(name, sizes) == wanted[name]

        return check

    together(*map(same, names))


def test_a_frame_serves_one_thread_at_a_time():
    """Whoever comes second is told, and the first one's view is right."""
    _C.set_threads(2)
    call = CALLS["forward"]
    wanted = results("forward")
    frame = _C.RasterFrame()
    drawn, refused = [], []

    def draw() -> None:
        for _ in range(5):
            values = arguments(call, SIZES)
            try:
                frame.forward(**values)
            except RuntimeError as error:
                assert "another thread" in str(error)
                refused.append(error)
            else:
                drawn.append([values[array.name].tobytes() for array in call.arrays() if array.written])

    together(draw, draw, draw)
    assert len(drawn) + len(refused) == 15
    assert drawn and all(result == wanted for result in drawn)


def test_workers_that_write_to_different_maps_do_not_meet():
    """One photo compared with many renderings at once: inputs are shared, outputs are not."""
    target = np.random.default_rng(0).random((90, 40, 3), np.float32)
    outputs = [np.empty_like(target) for _ in range(4)]
    _C.set_threads(3)

    def loss(out: np.ndarray) -> Callable[[], None]:
        return lambda: [_C.rgb_loss(target * 0.9, target, 0.2, out) for _ in range(5)] and None

    together(*map(loss, outputs))
    assert all(out.tobytes() == outputs[0].tobytes() for out in outputs)
