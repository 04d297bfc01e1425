"""What `doctor` says of CUDA, on machines that are not at hand."""

from __future__ import annotations

import ctypes
import importlib.machinery
import subprocess
import sys
import types

import pytest

from room2dgs import cuda_state, doctor
from room2dgs.cuda_extension import BUILD, cuda_extension


@pytest.fixture(autouse=True)
def _asked_anew():
    yield
    cuda_extension.cache_clear()


class Driver:
    """As libcuda.so.1 answers."""

    def __init__(self, error=0, count=1):
        self.error, self.count = error, count

    def cuInit(self, _):
        return self.error

    def cuDriverGetVersion(self, version):
        version._obj.value = 13000

    def cuDeviceGetCount(self, count):
        count._obj.value = self.count

    def cuDeviceGet(self, device, k):
        device._obj.value = k

    def cuDeviceGetName(self, name, length, _):
        name.value = b"Test GPU"

    def cuDeviceGetAttribute(self, value, attribute, _):
        value._obj.value = {75: 9, 76: 0}[attribute]


@pytest.mark.parametrize(
    "library, there, said",
    [
        (Driver(), True, "for CUDA 13.0: Test GPU (sm_90)"),
        (Driver(error=100), False, "cuInit gives 100"),
        (Driver(count=0), False, "CUDA_VISIBLE_DEVICES"),
        (OSError("no such file"), False, "no libcuda.so.1"),
    ],
)
def test_the_driver_is_asked_itself(library, there, said, monkeypatch):
    def load(name):
        assert name == "libcuda.so.1"
        if isinstance(library, OSError):
            raise library
        return library

    monkeypatch.setattr(ctypes, "CDLL", load)
    found = cuda_state.driver()
    assert found.there is there and said in found.text


def test_kernels_that_are_not_built_say_how_to_build_them(monkeypatch):
    monkeypatch.setitem(sys.modules, "room2dgs._cuda", None)
    cuda_extension.cache_clear()
    assert cuda_state.kernels() == (False, f"not built ({BUILD})")
    assert "was built without CUDA" in cuda_extension().missing
    monkeypatch.setitem(sys.modules, "room2dgs._cuda", types.ModuleType("room2dgs._cuda"))
    cuda_extension.cache_clear()
    assert cuda_state.kernels().there and cuda_extension().missing is None


def test_kernels_that_cannot_be_loaded_say_why_wherever_they_are_asked_for(tmp_path):
    """Not that they were not built: that would send the user to build again what a missing library keeps from loading.

    In a process of its own, since a backend looks for them once.
    """
    suffix = importlib.machinery.EXTENSION_SUFFIXES[0]
    (tmp_path / f"_cuda{suffix}").write_bytes(b"no library")
    program = (
        "import sys, room2dgs\n"
        "room2dgs.__path__.insert(0, sys.argv[1])\n"
        "from room2dgs import cuda_extension, cuda_state\n"
        "from room2dgs.kernels import builds\n"
        "assert builds.CUDA is None\n"
        "print(cuda_state.kernels().text)\n"
        "print(cuda_extension.cuda_extension().missing)\n"
    )
    ran = subprocess.run([sys.executable, "-c", program, str(tmp_path)], capture_output=True, text=True, check=True)
    doctors, backends = ran.stdout.splitlines()
    for said in (doctors, backends):
        assert "cannot be loaded (" in said and f"_cuda{suffix}" in said and "without CUDA" not in said


def test_doctor_names_all_that_is_missing_and_is_content(monkeypatch):
    monkeypatch.setattr(cuda_state, "driver", lambda: cuda_state.Part(True, "a driver"))
    monkeypatch.setattr(cuda_state, "kernels", lambda: cuda_state.Part(False, "not built"))
    monkeypatch.setattr(cuda_state, "in_torch", lambda: cuda_state.Part(False, "a CPU build"))
    text = "\n".join(doctor.examine()[0])
    assert "no, it lacks the extension's CUDA kernels, torch with CUDA" in text and "Nothing is missing" in text
    monkeypatch.setattr(cuda_state, "missing", lambda: [])
    assert "can be tried: make gpu-check" in "\n".join(doctor.examine()[0])
