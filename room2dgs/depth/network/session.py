"""A network in onnxruntime: loaded, and checked against what its settings name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from room2dgs import cuda_state
from room2dgs.cores import available_cores
from room2dgs.depth.network.card import IN_CARD, NetworkFormat
from room2dgs.errors import InputError, first_line

PROVIDERS = {"cpu": "CPUExecutionProvider", "cuda": "CUDAExecutionProvider"}
FLOATS = {"tensor(float)": np.float32, "tensor(float16)": np.float16, "tensor(double)": np.float64}


class Network(NamedTuple):
    """An open network.

    Attributes:
        path: of its file.
        kind: "depth" or "normal".
        settings: what goes in and comes out.
        session: onnxruntime's.
        image: the photo's input; a session's NodeArg.
        outputs: the names of the map and, if there are such, of its mask and of its expected error.
    """

    path: Path
    kind: str
    settings: NetworkFormat
    session: Any
    image: Any
    outputs: tuple[str, ...]

    def named(self, setting: str) -> str:
        """Where its card has a setting."""
        return in_card(setting, self.kind)


def open_network(
    path: Path, kind: str, settings: NetworkFormat, threads: int | None, provider: str, session: Any = None
) -> Network:
    """Load a network and check that its card names what it has.

    On the CPU the same photo gives the same bits whatever else runs.

    Args:
        path: the .onnx file.
        kind: "depth" or "normal".
        threads: None: all cores that this process may use.
        provider: "cpu", "cuda", or "auto": a GPU where there is one and onnxruntime has CUDA, else the CPU.
        session: of the same file, if it is loaded already.

    Raises:
        InputError: onnxruntime cannot load it, the provider is not there, or a named input or output is not.
    """
    session = session or session_of(path, threads, provider)
    has = described(session)
    inputs, outputs = session.get_inputs(), session.get_outputs()
    extra = [name for name in (settings.intrinsics, settings.tokens) if name]
    for setting in ("input", "intrinsics", "tokens"):
        _known(getattr(settings, setting), inputs, in_card(setting, kind), path, has)
    for setting in ("output", "mask", "error_output"):
        _known(getattr(settings, setting), outputs, in_card(setting, kind), path, has)
    image = _named_or_only(
        settings.input, [arg for arg in inputs if arg.name not in extra], in_card("input", kind), path, has
    )
    unfilled = [arg.name for arg in inputs if arg.name not in (image.name, *extra)]
    if unfilled:
        raise InputError(
            f"{path} wants more than a photo, {', '.join(unfilled)}; name it as input.intrinsics or input.tokens "
            f"in its card if it is that, or export the network without it: it has {has}"
        )
    others = [arg for arg in outputs if arg.name not in (settings.mask, settings.error_output)]
    output = _named_or_only(settings.output, others, in_card("output", kind), path, has)
    if not output.type.startswith("tensor("):
        raise InputError(f"{path} gives no array as {output.name}; it has {has}")
    network = Network(path, kind, settings, session, image, (output.name,))
    _check_image(network, has)
    beside = [name for name in (settings.mask, settings.error_output) if name]
    return network._replace(outputs=(output.name, *beside))


def in_card(setting: str, kind: str) -> str:
    """Where the card of a network has a setting of depth or normals, as "depth.output"."""
    return IN_CARD[setting].format(kind)


def runs_on_gpu(provider: str) -> bool:
    """Whether "cpu", "cuda" or "auto" comes to a GPU here."""
    if provider != "auto":
        return provider == "cuda"
    import onnxruntime as ort

    return PROVIDERS["cuda"] in ort.get_available_providers() and cuda_state.driver().there


def described(session: Any) -> str:
    """Its inputs and outputs with their types and shapes, in words."""

    def each(args: Sequence[Any]) -> str:
        return ", ".join(f"{arg.name} {arg.type.partition('(')[2].rstrip(')')} {shape_in_words(arg)}" for arg in args)

    return f"in: {each(session.get_inputs())}; out: {each(session.get_outputs())}"


def session_of(path: Path, threads: int | None, provider: str) -> Any:
    """onnxruntime's session of a file.

    Args:
        threads, provider: as `open_network`.

    Raises:
        InputError: it cannot be loaded, or the provider is not there.
    """
    import onnxruntime as ort

    present = ort.get_available_providers()
    if provider == "auto":
        provider = "cuda" if runs_on_gpu(provider) else "cpu"
    wanted = PROVIDERS[provider]
    if wanted not in present:
        raise InputError(
            f"prior.provider={provider} cannot be used: onnxruntime {ort.__version__} here has "
            f"{', '.join(present)}; install onnxruntime-gpu or give prior.provider=cpu"
        )
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads or available_cores()
    options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 3
    # Threads that spin while they wait are in each other's way on a machine that does other things too.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        session = ort.InferenceSession(str(path), options, providers=list(dict.fromkeys([wanted, PROVIDERS["cpu"]])))
    except Exception as error:  # onnxruntime has a dozen kinds, all plain exceptions
        raise InputError(
            f"{path} cannot be loaded by onnxruntime {ort.__version__} ({first_line(error)}); get the file again"
        ) from error
    # onnxruntime falls back to the CPU by itself and says so in its log alone.
    if wanted not in session.get_providers():
        raise InputError(
            f"prior.provider={provider} cannot be used: onnxruntime could not start it, its CUDA libraries may be "
            "missing; give prior.provider=cpu"
        )
    return session


def shape_in_words(arg: Any) -> str:
    return "(" + ", ".join(str(side) if isinstance(side, int) else "any" for side in arg.shape) + ")"


def _known(name: str | None, args: Sequence[Any], setting: str, path: Path, has: str) -> None:
    if name and name not in [arg.name for arg in args]:
        raise InputError(f"{setting}={name} in the card is not in {path}; it has {has}")


def _named_or_only(name: str | None, args: Sequence[Any], setting: str, path: Path, has: str) -> Any:
    found = [arg for arg in args if name in (None, arg.name)]
    if len(found) != 1:
        raise InputError(f"{path} needs {setting}=NAME in its card; it has {has}")
    return found[0]


def _check_image(network: Network, has: str) -> None:
    """The photo's input must be of four axes: one photo, three channels, height, width, in the layout's order."""
    image, layout = network.image, network.settings.layout
    if image.type not in FLOATS:
        raise InputError(f"{network.path} takes no photo of floating-point numbers as {image.name}; it has {has}")
    if len(image.shape) != 4:
        raise InputError(f"{network.path} takes no photo as {image.name}, which has {len(image.shape)} axes: {has}")
    batch, *sides = image.shape
    channels, other = (sides[0], sides[2]) if layout == "nchw" else (sides[2], sides[0])
    if isinstance(channels, int) != (channels == 3) or (channels != 3 and other == 3):
        raise InputError(
            f"{network.path} has no three channels where {network.named('layout')}={layout} in its card expects them; "
            f"it has {has}"
        )
    if isinstance(batch, int) and batch != 1:
        raise InputError(f"{network.path} takes {batch} photos at a time; export it for one: it has {has}")
