"""Headless Chromium, driven by its DevTools protocol over a pipe: JSON and a zero byte, on descriptors 3 and 4."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
    "--no-first-run", "--disable-extensions", "--remote-debugging-pipe",
)  # fmt: skip


class Tab:
    """One page. `said` has what it logged as errors and warnings, and exceptions that nothing caught."""

    def __init__(self, to: int, back: int) -> None:
        self._to, self._back, self._rest, self._sent, self._session = to, back, b"", 0, None
        self.said: list[str] = []
        self.asked_for: list[str] = []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **params: Any) -> dict:
        self._sent += 1
        message = {"id": self._sent, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._read()
            if answer.get("id") == self._sent:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer.get("method"), answer.get("params", {}))

    def run(self, code: str) -> Any:
        """The value of an expression; of a promise, once it is there."""
        result = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in result, result
        return result["result"].get("value")

    def until(self, condition: str, seconds: float = 60) -> None:
        """Waits for an expression to be true: a page acts on an event after the call that caused it has returned."""
        late = time.monotonic() + seconds
        while not self.run(condition):
            assert time.monotonic() < late, f"not after {seconds} s: {condition}"
            time.sleep(0.05)

    def _note(self, event: str | None, params: dict) -> None:
        if event == "Runtime.exceptionThrown":
            self.said.append(json.dumps(params["exceptionDetails"]))
        elif event == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning", "assert"):
            self.said.append(" ".join(str(one.get("value")) for one in params["args"]))
        elif event == "Log.entryAdded" and params["entry"]["level"] in ("error", "warning"):
            self.said.append(params["entry"]["text"])
        elif event == "Network.requestWillBeSent":
            self.asked_for.append(params["request"]["url"])

    def _read(self) -> dict:
        while b"\0" not in self._rest:
            part = os.read(self._back, 1 << 20)
            assert part, "Chromium is gone"
            self._rest += part
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)


@contextmanager
def tab(profile: Path, width: int = 900, height: int = 1200) -> Iterator[Tab]:
    """A page in a browser of its own, which ends with the block."""
    theirs_in, to = os.pipe()
    back, theirs_out = os.pipe()
    options = " ".join([*OPTIONS, f"--user-data-dir='{profile}'", f"--window-size={width},{height}"])
    command = f"exec {CHROMIUM} {options} 3<&{theirs_in} 4>&{theirs_out}"
    with open(os.devnull, "w") as nowhere:
        process = subprocess.Popen(
            ["bash", "-c", command], pass_fds=(theirs_in, theirs_out), stdout=nowhere, stderr=nowhere
        )
    os.close(theirs_in)
    os.close(theirs_out)
    try:
        yield Tab(to, back)
    finally:
        os.close(to)  # a browser whose pipe is closed ends
        os.close(back)
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
