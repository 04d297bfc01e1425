"""`room2dgs VERB ...`: finds the verb, turns what went wrong into a sentence and an exit code."""

from __future__ import annotations

import difflib
import importlib
import os
import shlex
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path

from room2dgs import __version__
from room2dgs.blame import error_sentence
from room2dgs.commands.examples import examples
from room2dgs.commands.verbs import VERBS
from room2dgs.errors import InputError, RunFailed
from room2dgs.freed_memory import one_arena
from room2dgs.interrupts import Terminated, ends_soon, reader_is_gone, signals_raise, unread
from room2dgs.texts import shown
from room2dgs.thread_limit import check_threads

DONE, OUR_FAULT, BAD_INPUT = 0, 1, 2
UTF8_MODE = "PYTHONUTF8"
RESUMABLE = ("run", "train", "depth")
INTERRUPTED, UNREAD, TERMINATED = 130, 141, 143  # 128 + SIGINT, SIGPIPE, SIGTERM, as shells have it
NO_HOME = "Could not determine home directory"  # what pathlib says of ~name
NOBODY = "a path begins with ~ and a name that no user has; write ./~... for a folder that is called so"


def main(argv: list[str] | None = None) -> int:
    """Run one command.

    Returns:
        0 done, 1 our fault, 2 bad input, 3 a run with strict=true whose verdict is "failed", 130 interrupted by
        Ctrl-C, 143 by SIGTERM, 141 when nobody reads the output any more; of a study or a sweep with failed runs, that
        of the first one's cause.
    """
    if argv is None:
        _with_any_names()
    one_arena()
    words = sys.argv[1:] if argv is None else list(argv)
    with signals_raise(), ends_soon(partial(_end, words)):
        try:
            code = _run_command(words)
        except BrokenPipeError:
            if not reader_is_gone():
                raise
            return UNREAD
    if argv is None and code in (INTERRUPTED, TERMINATED):
        _leave(code)  # without waiting for what works in other threads
    return UNREAD if unread() else code


def _end(words: list[str], signum: int) -> None:
    """What a stopped command says and returns where it does not hear of the stop itself."""
    verb, *rest = words or [""]
    _say_interrupted(verb, rest)
    _leave(TERMINATED if signum == signal.SIGTERM else INTERRUPTED)


def _leave(code: int) -> None:
    with suppress(OSError, ValueError):
        sys.stdout.flush()
        sys.stderr.flush()
    os._exit(code)


def _run_command(argv: list[str]) -> int:
    if not argv or argv[0] in ("-h", "--help", "help"):
        print(overview())
        return DONE if argv else BAD_INPUT
    if argv[0] == "--version":
        print(f"room2dgs {__version__}")
        return DONE
    return _run_verb(argv[0], argv[1:])


def _with_any_names() -> None:
    """Starts again in Python's UTF-8 mode where the locale knows ASCII alone: files may be called anything."""
    if sys.getfilesystemencoding() == "ascii" and os.environ.get(UTF8_MODE) != "1" and sys.orig_argv:
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], {**os.environ, UTF8_MODE: "1"})


def _check_names(words: list[str]) -> None:
    """Raises InputError for what is no text: settings and reports, which are UTF-8, could not name it."""
    for word in words:
        try:
            word.encode("utf-8")
        except UnicodeEncodeError:
            raise InputError(f"{word} is not written in UTF-8; give the file or folder another name") from None


def _no_command(verb: str) -> str:
    near = difflib.get_close_matches(verb, VERBS, n=1)
    if near:
        return f"{verb!r} is no command; did you mean {near[0]}?"
    if Path(verb).is_dir():
        return f"{verb!r} is a folder and no command; of a capture type: room2dgs run {shlex.quote(verb)} out=DIR"
    return f"{verb!r} is no command; choose from {', '.join(VERBS)}"


def _run_verb(verb: str, rest: list[str]) -> int:
    try:
        _check_names([verb, *rest])
        if verb not in VERBS:
            raise InputError(_no_command(verb))
        check_threads()
        from room2dgs.commands.first_word import with_first_word

        rest = rest if {"-h", "--help"} & set(rest) else with_first_word(verb, rest)
        command = importlib.import_module(f"room2dgs.commands.{verb}").main
        return _with_examples(command, verb, rest) if {"-h", "--help"} & set(rest) else command(rest)
    except KeyboardInterrupt as stop:
        _say_interrupted(verb, rest)
        return TERMINATED if isinstance(stop, Terminated) else INTERRUPTED
    except Exception as error:
        if isinstance(error, BrokenPipeError) and reader_is_gone():
            return UNREAD
        sentence, code = _sentence(error, _command_to_go_on(verb, rest))
        print(sentence, file=sys.stderr)
        return code


def _say_interrupted(verb: str, rest: list[str]) -> None:
    again = _command_to_go_on(verb, rest) or shlex.join(["room2dgs", verb, *rest])
    print(f"\nroom2dgs: interrupted; what was finished is kept, go on with: {shown(again)}", file=sys.stderr)


def _with_examples(command: Callable[[list[str]], int], verb: str, rest: list[str]) -> int:
    """The command's own help, and examples behind it."""
    try:
        return command(rest)
    finally:  # argparse ends by an exception
        if text := examples(verb, rest):
            print(text)


def _sentence(error: Exception, again: str) -> tuple[str, int]:
    """What is said of an error, and the exit code."""
    if isinstance(error, RunFailed):
        return f"room2dgs: a run failed: {error}", error.code
    cause = NOBODY if isinstance(error, RuntimeError) and NO_HOME in str(error) else error_sentence(error, again)
    return (_our_fault(error), OUR_FAULT) if cause is None else (f"room2dgs: {shown(cause)}", BAD_INPUT)


def _command_to_go_on(verb: str, rest: list[str]) -> str:
    """The command that goes on with the run that was begun; empty where there is none."""
    from room2dgs.runs.folder import CONFIG, last_value

    try:
        out = last_value(rest, "out")
        begun = verb in RESUMABLE and out and (Path(out).expanduser() / CONFIG).is_file()
    except (InputError, OSError, ValueError):
        return ""
    if not begun:
        return ""
    # `depth` has an argument that is no setting, so that it is not saved
    given = [text for text in rest if not text.startswith("resume=")] if verb == "depth" else [f"out={out}"]
    return shlex.join(["room2dgs", verb, *given, "resume=true"])


def overview() -> str:
    """The verbs with one line each."""
    lines = ["room2dgs: posed photos of a room to a metric triangle mesh", ""]
    lines += [f"  room2dgs {verb:<10} {summary}" for verb, summary in VERBS.items()]
    lines += [
        "",
        "The main one:  room2dgs run scene.path=DIR out=DIR",
        "Settings follow the verb as KEY=VALUE; `room2dgs run --help` lists them.",
    ]
    return "\n".join(lines)


def _our_fault(error: Exception) -> str:
    """Keeps the traceback in the run's log, or else in a file of its own, and says where."""
    from room2dgs.logs import append, open_log

    name = type(error).__name__
    reason = shown(next(iter(str(error).splitlines()), ""))
    text = "".join(traceback.format_exception(error))
    path = open_log()
    try:
        if path is None:
            with tempfile.NamedTemporaryFile(
                "w", prefix="room2dgs_", suffix=".log", delete=False, encoding="utf-8"
            ) as file:
                file.write(text)
            path = Path(file.name)
        else:
            append(path, text)
    except (OSError, InputError):  # a full disk, perhaps what went wrong in the first place
        return f"{text}room2dgs: {name}: {reason}; this is not your fault"
    return f"room2dgs: {name}: {reason}; this is not your fault, the traceback is in {path}"


if __name__ == "__main__":
    sys.exit(main())
