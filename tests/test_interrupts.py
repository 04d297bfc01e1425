"""What ends a command early: SIGTERM, and a reader of the output that goes away."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from room2dgs import cli
from room2dgs.interrupts import Terminated, signals_raise, sigterm_kept

SLOWLY = [
    "points.source=file",
    "prior=none",
    "strategy=fixed",  # and neither loss nor photo size with a share of the run, so that it may be given another length
    "loss.multiview_photometric.enabled=false",
    "seeds.init=sfm",
    "seeds.voxel_m=0.1",
    "train.tensorboard=false",
    "train.resolutions=[]",
    "train.opacity_floor.until=0",
    "train.checkpoint_every=5",
    "train.log_every=5",
    "render.threads=1",
]


def room2dgs(*argv: str, **pipes: int) -> subprocess.Popen[str]:
    return subprocess.Popen([sys.executable, "-m", "room2dgs.cli", *argv], text=True, **pipes)


def test_sigterm_ends_a_run_as_ctrl_c_does_and_it_can_be_gone_on_with(wall: Path, tmp_path: Path):
    out = tmp_path / "run"
    given = [f"scene.path={wall}", f"out={out}", f"points.file={wall / 'points.ply'}", *SLOWLY]
    with room2dgs("train", *given, "train.iterations=100000", stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as run:
        while not list(out.glob("checkpoints/*.safetensors")):
            assert run.poll() is None
            time.sleep(0.05)
        run.terminate()
        said = run.communicate(timeout=60)[1]
    assert run.returncode == cli.TERMINATED == 143
    on = f"go on with: room2dgs train out={out} resume=true"
    assert said.split("\n") == ["", f"room2dgs: interrupted; what was finished is kept, {on}", ""]
    reached = max(int(path.stem.split("_")[1]) for path in out.glob("checkpoints/*.safetensors"))
    assert cli.main(["train", f"out={out}", "resume=true", f"train.iterations={reached + 1}"]) == 0
    assert (out / "surfels.safetensors").exists()


def test_sigterm_is_still_ours_after_pycolmap_was_imported():
    code = (
        "import os, signal\n"
        "from room2dgs.interrupts import Terminated, signals_raise\n"
        "with signals_raise():\n"
        "    from room2dgs.colmap import pycolmap\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGTERM)\n"
        "        signal.pause()\n"
        "    except Terminated:\n"
        "        print('ours', pycolmap.__name__)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (0, "ours pycolmap\n", "")


class Deaf:
    """Code that is called from where an exception is lost, interrupted while it runs."""

    def __init__(self, signum: int) -> None:
        self.signum, self.went_on = signum, False

    def __dlpack__(self, **given: object) -> None:
        os.kill(os.getpid(), self.signum)
        time.sleep(0.05)
        self.went_on = True

    def asked_as_by_nanobind(self) -> None:
        try:
            self.__dlpack__(max_version=(1, 0))
        except BaseException:
            self.went_on = False


@pytest.mark.parametrize(("signum", "raised"), [(signal.SIGTERM, Terminated), (signal.SIGINT, KeyboardInterrupt)])
def test_a_signal_is_not_lost_while_a_tensor_is_asked_for_its_memory(signum, raised):
    deaf = Deaf(signum)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job starts with it ignored
    try:
        with signals_raise(), pytest.raises(KeyboardInterrupt) as stop:
            deaf.asked_as_by_nanobind()
            time.sleep(5)
    finally:
        signal.signal(signal.SIGINT, before)
    assert stop.type is raised
    assert deaf.went_on


def test_a_signal_is_not_lost_in_a_destructor():
    class Dying:
        def __del__(self) -> None:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.02)

    with signals_raise(), pytest.raises(Terminated):
        Dying()
        time.sleep(5)


def test_the_handler_of_before_comes_back_and_other_threads_are_left_alone():
    before = signal.getsignal(signal.SIGTERM)
    with signals_raise():
        with pytest.raises(Terminated):
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)
        ours = signal.getsignal(signal.SIGTERM)
        with sigterm_kept():
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        assert signal.getsignal(signal.SIGTERM) is ours
    assert signal.getsignal(signal.SIGTERM) is before
    codes: list[int] = []
    thread = threading.Thread(target=lambda: codes.append(cli.main(["--version"])))
    thread.start()
    thread.join()
    assert codes == [0]


@pytest.mark.parametrize("argv", [["run", "--help"], ["--version"]])
def test_output_that_nobody_reads_is_no_fault(argv):
    read, write = os.pipe()
    os.close(read)
    with room2dgs(*argv, stdout=write, stderr=subprocess.PIPE) as run:
        os.close(write)
        said = run.communicate(timeout=60)[1]
    assert (run.returncode, said) == (cli.UNREAD, "")


def test_a_run_whose_log_nobody_reads_ends_quietly(wall: Path, tmp_path: Path):
    out = tmp_path / "run"
    given = [f"scene.path={wall}", f"out={out}", f"points.file={wall / 'points.ply'}", *SLOWLY]
    with room2dgs("train", *given, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as run:
        assert run.stdout.readline()
        run.stdout.close()
        said = run.stderr.read()
        assert (run.wait(120), said) == (cli.UNREAD, "")
    assert (out / "log.txt").read_text()


DEAF = """
import signal, sys, time, room2dgs.commands.doctor
signal.signal(signal.SIGINT, signal.default_int_handler)  # background jobs ignore it
from room2dgs import cli
def deaf(_):
    print("at work", flush=True)
    while True:
        try:
            time.sleep(600)
        except KeyboardInterrupt:
            pass  # as a library's function that looks at no signals
room2dgs.commands.doctor.main = deaf
sys.argv[1:] = ["doctor", "a b"]
sys.exit(cli.main())
"""


@pytest.mark.parametrize(("signum", "code"), [(signal.SIGINT, cli.INTERRUPTED), (signal.SIGTERM, cli.TERMINATED)])
def test_a_command_that_hears_of_no_signal_ends_all_the_same_and_says_how_to_go_on(signum, code):
    with subprocess.Popen(
        [sys.executable, "-c", DEAF], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout and process.stdout.readline() == "at work\n"
        process.send_signal(signum)
        said = process.communicate(timeout=120)[1]
    assert process.returncode == code
    assert said == "\nroom2dgs: interrupted; what was finished is kept, go on with: room2dgs doctor 'a b'\n"


def test_threads_at_work_do_not_hold_up_the_end():
    code = DEAF.replace(
        "def deaf(_):",
        "def deaf(_):\n    import threading\n    threading.Thread(target=time.sleep, args=(600,)).start()",
    )
    code = code.replace("pass  #", "raise  #")
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as one:
        assert one.stdout and one.stdout.readline() == "at work\n"
        one.send_signal(signal.SIGINT)
        assert "interrupted" in one.communicate(timeout=120)[1]
    assert one.returncode == cli.INTERRUPTED
