"""No argument of a binding crashes it: what does not fit is refused by name, before anything is read or written."""

from __future__ import annotations

import numpy as np
import pytest
from binding_calls import CALLS, Array, arguments, run
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from room2dgs import _C

SIZES = st.fixed_dictionaries(
    {"h": st.integers(1, 40), "w": st.integers(1, 40), "n": st.integers(0, 30), "k": st.sampled_from([1, 4, 9, 16])}
)
ARRAYS = [(name, array) for name, call in CALLS.items() for array in call.arrays()]
NUMBERS = [(name, argument) for name, call in CALLS.items() for argument in call.arguments if isinstance(argument, str)]
WILD = [np.nan, np.inf, -np.inf, 3e38, -3e38, 1e30, 1e-45, 0.0, -1.0, 1e10]
WILD_INTEGERS = [-(2**31), -7, -1, 0, 3, 2**24, 2**31 - 1]
EXAMPLES = settings(max_examples=25, deadline=None)


def test_the_table_of_calls_is_complete():
    functions = {name for name in dir(_C) if not name.startswith("_")}
    methods = {name for name in dir(_C.RasterFrame) if not name.startswith("_")} - {"visible", "entries"}
    measuring = {name for name in dir(_C.bench) if not name.startswith("_")}
    plain = {name for name, call in CALLS.items() if not call.method and not call.bench}
    # dense stereo, fusion, colouring, Adam and the kernels for CUDA stand with their own tests
    others = {"RasterFrame", "GaussianFrame", "bench", "isa", "threads", "set_threads"}
    others |= {"StereoPhoto", "PatchMatch", "agree", "touched_blocks", "fuse_depth", "adam", "device"}
    others |= {"draw_faces", "look_up", "blend_views", "regularise"}
    assert plain | others == functions
    assert {name for name, call in CALLS.items() if call.bench} == measuring - {"operations"}  # it takes no frame
    assert {name for name, call in CALLS.items() if call.method} == methods


@pytest.mark.parametrize("name", CALLS)
@EXAMPLES
@given(sizes=SIZES, seed=st.integers(0, 99), left_out=st.booleans())
def test_arguments_that_fit_are_taken_and_every_output_is_filled(name, sizes, seed, left_out):
    call = CALLS[name]
    values = arguments(call, sizes, seed)
    if left_out:
        values |= {array.name: None for array in call.arrays() if array.optional}
    run(call, values, sizes, seed)
    for array in call.arrays():
        if array.written and values[array.name] is not None and name != "bare_loop":  # that draws some tiles only
            assert np.isfinite(values[array.name]).all(), array.name


def other_shape(draw, value: np.ndarray) -> np.ndarray:
    kind = draw(st.sampled_from(["longer", "shorter", "axis more", "axis less", "empty", "scalar", "flat"]))
    axis = draw(st.integers(0, value.ndim - 1))
    if kind == "longer":
        return np.concatenate([value, np.zeros_like(np.take(value, [0], axis))], axis) if value.size else value[None]
    if kind == "shorter":
        return np.ascontiguousarray(np.delete(value, 0, axis)) if value.shape[axis] else value[None]
    if kind == "axis more":
        return value[None] if draw(st.booleans()) else value[..., None]
    if kind == "axis less":
        return value.reshape(-1, *value.shape[2:]) if value.ndim > 1 else np.array(0.0, value.dtype)
    if kind == "empty":
        return np.zeros(0, value.dtype)
    return np.array(0.0, value.dtype) if kind == "scalar" else value.reshape(-1)


def spread(draw, value: np.ndarray) -> np.ndarray:
    """The same values, not contiguous."""
    kind = draw(st.sampled_from(["transposed", "every other", "reversed", "repeated"]))
    if kind == "transposed":
        return np.asfortranarray(value)
    if kind == "every other":
        return np.repeat(value, 2, axis=0)[::2]
    return value[::-1] if kind == "reversed" else np.broadcast_to(value[:1], value.shape)


def others(call, values: dict) -> dict[str, bytes]:
    """What the other outputs hold."""
    return {a.name: values[a.name].tobytes() for a in call.arrays() if a.written and values[a.name] is not None}


@pytest.mark.parametrize("name, array", ARRAYS, ids=lambda x: x.name if isinstance(x, Array) else x)
@EXAMPLES
@given(data=st.data(), sizes=SIZES)
def test_an_array_that_does_not_fit_is_refused_and_nothing_is_written(name, array, data, sizes):
    call = CALLS[name]
    values = arguments(call, sizes)
    good = values[array.name]
    damage = data.draw(st.sampled_from(["shape", "dtype", "order", "none", "list", "text"]))
    if damage == "shape":
        values[array.name] = other_shape(data.draw, good)
        assume(values[array.name].shape != good.shape)
        assume(array.name != "draws" or values["draws"].shape[:-1] != good.shape[:-1])  # as many as one likes
        # the array that gives the sizes is believed, and the next one is refused
        wanted, words = ValueError, ""
    elif damage == "dtype":
        types = [np.float16, np.float32, np.float64, np.int32, np.uint8, np.bool_, np.complex64]
        dtype = data.draw(st.sampled_from([t for t in types if t != array.dtype]))
        values[array.name] = np.zeros(good.shape, dtype)
        wanted, words = TypeError, f"{array.name} has another dtype"
    elif damage == "order":
        values[array.name] = spread(data.draw, good)
        assume(not values[array.name].flags.c_contiguous)
        # what is read only is refused by its kind, where it is to be written
        wanted, words = TypeError, "contiguous" if values[array.name].flags.writeable else ""
    else:
        values[array.name] = {"none": None, "list": good.tolist(), "text": "surfels"}[damage]
        assume(not (damage == "none" and array.optional))
        wanted, words = TypeError, ""
    before = others(call, {**values, array.name: None})
    with pytest.raises(wanted, match=words or None):
        run(call, values, sizes)
    assert others(call, {**values, array.name: None}) == before


@pytest.mark.parametrize("name, array", [(n, a) for n, a in ARRAYS if a.written], ids=lambda x: getattr(x, "name", x))
def test_outputs_are_never_read_only_nor_shared(name, array):
    sizes = {"h": 9, "w": 7, "n": 5, "k": 4}
    call = CALLS[name]
    values = arguments(call, sizes)
    values[array.name].setflags(write=False)
    with pytest.raises(TypeError):
        run(call, values, sizes)
    for other in call.arrays():
        values = arguments(call, sizes)
        if other.name == array.name or other.dtype != array.dtype:
            continue
        small, large = sorted((values[array.name], values[other.name]), key=lambda x: x.size)
        part = large.reshape(-1)[-small.size :].reshape(small.shape)
        values[array.name], values[other.name] = (part, large) if small is values[array.name] else (large, part)
        with pytest.raises(ValueError, match="shares memory with"):
            run(call, values, sizes)


@pytest.mark.parametrize("name, argument", NUMBERS)
@EXAMPLES
@given(value=st.one_of(st.sampled_from([*WILD, None, "1", 2**31, 2**63, -(2**70), 16385]), st.floats(), st.integers()))
def test_no_number_crashes(name, argument, value):
    sizes = {"h": 9, "w": 7, "n": 5, "k": 4}
    values = arguments(CALLS[name], sizes) | {argument: value}
    try:
        run(CALLS[name], values, sizes)
    except (ValueError, TypeError) as error:
        assert str(error)


@pytest.mark.parametrize("name", CALLS)
@settings(max_examples=60, deadline=None)
@given(data=st.data(), sizes=SIZES, seed=st.integers(0, 999))
def test_no_value_of_an_array_crashes(name, data, sizes, seed):
    call = CALLS[name]
    random = np.random.default_rng(seed)
    values = arguments(call, sizes, seed)
    read = [array.name for array in call.arrays() if not array.written and values[array.name].size]
    for victim in data.draw(st.lists(st.sampled_from(read), max_size=4) if read else st.just([])):
        flat = values[victim].reshape(-1)
        with np.errstate(over="ignore", invalid="ignore"):
            places = random.random(flat.size) < data.draw(st.sampled_from([0.05, 0.5, 1.0]))
            wild = WILD_INTEGERS if flat.dtype.kind == "i" else WILD
            flat[places] = random.choice(data.draw(st.lists(st.sampled_from(wild), min_size=1)), places.sum())
    try:
        run(call, values, sizes, seed)
    except ValueError as error:  # a K that is none, draws of what there is not, sizes of other images
        assert any(
            words in str(error) for words in ("K has", "not there", "images are not", "pixels, the views", "first ")
        )


@settings(max_examples=60, deadline=None)
@given(data=st.data(), sizes=SIZES, seed=st.integers(0, 999))
def test_wild_surfels_are_drawn_and_differentiated(data, sizes, seed):
    """Forward and backward of the same surfels: what the first lists, the second reads."""
    random = np.random.default_rng(seed)
    forward = CALLS["forward"]
    drawn = arguments(forward, sizes, seed)
    for victim in data.draw(st.lists(st.sampled_from([a.name for a in forward.arrays()[:6]]), min_size=1)):
        flat = drawn[victim].reshape(-1)
        places = random.random(flat.size) < data.draw(st.sampled_from([0.1, 0.7]))
        flat[places] = random.choice(data.draw(st.lists(st.sampled_from(WILD), min_size=1)), places.sum())
    drawn["near"] = data.draw(st.sampled_from([1e-300, 1e-6, 0.05, 100.0, 1e300]))
    frame = _C.RasterFrame()
    view = frame.forward(**drawn)
    back = arguments(CALLS["backward"], sizes, seed)
    back |= {name: value for name, value in drawn.items() if name in back}
    back["g_median"][:] = data.draw(st.sampled_from(WILD))
    frame.backward(**(back | {"view": view}))
    assert 0 <= frame.visible <= sizes["n"] and frame.visible <= frame.entries


def test_the_order_of_calls_on_a_frame():
    sizes = {"h": 9, "w": 7, "n": 5, "k": 4}
    back = arguments(CALLS["backward"], sizes)
    frame = _C.RasterFrame()
    for call in CALLS.values():
        if call.after_forward():
            values = arguments(call, sizes)
            with pytest.raises(ValueError, match="forward comes first"):
                call.of(frame)(**(values | {"view": 0} if "view" in values else values))
    drawn = arguments(CALLS["forward"], sizes)
    first = frame.forward(**drawn)
    second = frame.forward(**drawn)
    with pytest.raises(ValueError, match="another view"):
        frame.backward(**(back | {"view": first}))
    for count in (0, 4, 6):
        fewer = arguments(CALLS["backward"], sizes | {"n": count})
        with pytest.raises(ValueError, match=f"{count} surfels come back, 5 were drawn"):
            frame.backward(**(fewer | {"view": second}))
    frame.backward(**(back | {"view": second}))
    lean = frame.forward(**(drawn | {"normal": None, "distortion": None}))
    for name in ("g_normal", "g_distortion"):
        nothing = {f"g_{k}": None for k in ("color", "alpha", "depth", "median", "normal", "distortion")}
        with pytest.raises(ValueError, match="not drawn"):
            frame.backward(**(back | nothing | {"to_background": None, "view": lean, name: back[name]}))
    with pytest.raises(ValueError, match="normal is None"):
        frame.forward(**(drawn | {"normal": None}))


def test_a_refused_forward_pass_leaves_the_view_before():
    sizes = {"h": 9, "w": 7, "n": 5, "k": 4}
    drawn, back = arguments(CALLS["forward"], sizes), arguments(CALLS["backward"], sizes)
    frame = _C.RasterFrame()
    view = frame.forward(**drawn)
    with pytest.raises(ValueError, match="image size"):
        frame.forward(**(drawn | {"width": 0}))
    frame.backward(**(back | {"view": view}))


@pytest.mark.parametrize("name", ["visible", "entries"])
def test_a_frame_without_its_constructor_is_refused(name):
    with pytest.raises(TypeError), pytest.warns(RuntimeWarning, match="uninitialized"):
        getattr(_C.RasterFrame.__new__(_C.RasterFrame), name)


@pytest.mark.parametrize("count", [0, -1, 1025, 2**31, 2**40])
def test_counts_of_threads_that_make_no_sense_are_refused(count):
    with pytest.raises(ValueError, match=r"1\.\.1024"):
        _C.set_threads(count)
