"""The page's server: this machine alone, behind a token (`viewer.door`)."""

from __future__ import annotations

import json
import mimetypes
import secrets
import shutil
from collections.abc import Callable
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, unquote

from room2dgs.app.job import Job
from room2dgs.app.sources import capture_in, free_name, source_settings, uploaded
from room2dgs.errors import InputError
from room2dgs.report.page import page
from room2dgs.runs.folder import CONFIG, REPORT
from room2dgs.texts import shown
from room2dgs.viewer.door import FORBIDDEN, LOOPBACK, SEE_OTHER, Door

PRESETS = {
    "sketch": "a first shape, in a minute or two",
    "draft": "a first look",
    "quick": "trained, short",
    "default": "trained in full",
    "fine": "trained in full size all the way",
}
UPLOADS, CAPTURES = ".uploads", "captures"  # in the folder of runs: what is on its way, what runs were made of
SERVED = (REPORT, "mesh.glb", "mesh.ply", "metrics.json", "export/splats.ply", "export/splats.spz", "log.txt")
MOST_JSON = 1 << 16  # bytes of a question
CHUNK = 1 << 20
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; connect-src 'self'; img-src data:"
HEADERS = {"Referrer-Policy": "no-referrer", "Cache-Control": "no-store", "X-Content-Type-Options": "nosniff"}


class App:
    """Runs in a folder, at most one at work, and who may ask for them.

    Attributes:
        out: the folder in which each run gets its own.
        url: the page's address, with the token.
    """

    def __init__(self, out: Path, port: int) -> None:
        self.out = out
        self.door = Door()
        self.job: Job | None = None
        self._http = _Server((LOOPBACK, port), self)
        self.url = f"http://{LOOPBACK}:{self._http.server_port}/{self.door.token}/"

    def serve(self) -> None:
        """Until `close`."""
        self._http.serve_forever()

    def close(self) -> None:
        """Ends the run at work and the server."""
        if self.job is not None:
            self.job.stop()
        self._http.shutdown()
        self._http.server_close()

    def runs(self) -> list[str]:
        """Names of the runs that have a page, the newest first."""
        found = [folder for folder in self.out.glob("*") if (folder / CONFIG).is_file() and (folder / REPORT).is_file()]
        return [one.name for one in sorted(found, key=lambda one: -(one / REPORT).stat().st_mtime)]

    def start(self, asked: dict[str, Any]) -> dict[str, Any]:
        """A new run of a path of this machine, or of an upload.

        Raises:
            InputError: another is at work, or what was asked for cannot be.
        """
        if self.job is not None and self.job.running:
            raise InputError(f"{self.job.name} is still at work; stop it first")
        preset, path = asked.get("preset", "default"), str(asked.get("path") or "").strip()
        if preset not in PRESETS:
            raise InputError(f"preset={preset} is not known; choose from {', '.join(PRESETS)}")
        folder = None if path else self.upload_folder(asked.get("upload"))
        source = Path(path).expanduser().absolute() if folder is None else capture_in(folder)
        source_settings(source)  # refused now if it is none
        name = free_name(self.out, source.stem if source.is_file() else source.name)
        if folder is not None:  # what a run was made of stays beside it
            kept = self.out / CAPTURES / name
            kept.parent.mkdir(exist_ok=True)
            shutil.move(folder, kept)
            source = capture_in(kept)
        self.job = Job(name, self.out / name, [*source_settings(source), f"preset={preset}"])
        return self.job.state()

    def new_upload(self) -> dict[str, Any]:
        """A folder for files; what was uploaded before and never run is deleted."""
        shutil.rmtree(self.out / UPLOADS, ignore_errors=True)
        name = secrets.token_hex(8)
        (self.out / UPLOADS / name).mkdir(parents=True)
        return {"upload": name}

    def upload_folder(self, name: Any) -> Path:
        """Of an upload that was begun.

        Raises:
            InputError: there is none of that name.
        """
        folder = self.out / UPLOADS / str(name)
        if not isinstance(name, str) or not name.isalnum() or not folder.is_dir():
            raise InputError("drop a folder or a video, or give a path")
        return folder

    def state(self) -> dict[str, Any]:
        """All that the page shows."""
        return {"job": self.job.state() if self.job else None, "runs": self.runs()}

    def stop(self) -> dict[str, Any]:
        """Stops the run at work."""
        if self.job is not None:
            self.job.stop()
        return self.state()

    def file_of_run(self, path: str) -> Path | None:
        """A file that a run shows; None: there is none that may be had."""
        name, _, file = path.partition("/")
        found = self.out / name / file
        known = file in SERVED and name and "/" not in name and name not in (".", "..", UPLOADS)
        return found if known and not found.is_symlink() and found.is_file() else None


class _Server(ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, address: tuple[str, int], app: App) -> None:
        self.app = app
        super().__init__(address, _Handler)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        path = self._inside()
        if path is None:
            return
        if path == "/":
            self._answer(200, start_page().encode(), "text/html; charset=utf-8", {"Content-Security-Policy": POLICY})
        elif path == "/state":
            self._json(200, self.server.app.state())
        elif path.startswith("/runs/") and (file := self.server.app.file_of_run(unquote(path[len("/runs/") :]))):
            self._file(file)
        else:
            self._json(404, {"why": "there is nothing here"})

    def do_POST(self) -> None:
        path = self._inside()
        if path is None:
            return
        app = self.server.app
        asks: dict[str, Callable[[dict[str, Any]], dict[str, Any]]] = {
            "/start": app.start, "/stop": lambda _: app.stop(), "/new": lambda _: app.new_upload(),
        }  # fmt: skip
        if path not in asks:
            self._json(404, {"why": "there is nothing here"}, close=True)
            return
        try:
            self._json(200, asks[path](self._question()))
        except InputError as error:
            self._json(400, {"why": shown(str(error))}, close=True)

    def do_PUT(self) -> None:
        path = self._inside()
        if path is None:
            return
        try:
            if path != "/upload":
                raise InputError("there is nothing here")
            asked = {key: values[0] for key, values in parse_qs(self.path.partition("?")[2]).items()}
            target = uploaded(self.server.app.upload_folder(asked.get("upload")), asked.get("name", ""))
            self._keep(target)
            self._json(200, {})
        except InputError as error:
            self._json(400, {"why": shown(str(error))}, close=True)
        except OSError as error:
            self._json(507, {"why": f"the file cannot be kept ({error.strerror})"}, close=True)

    def log_message(self, format: str, *args: Any) -> None:
        """Nothing: addresses hold the token."""

    def _inside(self) -> str | None:
        """The path behind the token; None: the request was turned away."""
        hosts, origins = (self.headers.get_all(name, []) for name in ("Host", "Origin"))
        verdict = self.server.app.door.decide(self.path, hosts, origins, self.connection.getsockname()[0])
        if verdict.status in (FORBIDDEN, SEE_OTHER):
            more = {"Location": verdict.text} if verdict.status == SEE_OTHER else {}
            self._answer(verdict.status, verdict.text.encode(), "text/plain; charset=utf-8", more, close=True)
            return None
        return verdict.text

    def _length(self) -> int:
        text = self.headers.get("Content-Length", "")
        if not text.isascii() or not text.isdigit():
            raise InputError("how long it is was not said")
        return int(text)

    def _question(self) -> dict[str, Any]:
        length = self._length()
        if length > MOST_JSON:
            raise InputError("that is too much")
        try:
            asked = json.loads(self.rfile.read(length) or b"{}")
        except ValueError:
            raise InputError("that is no question") from None
        if not isinstance(asked, dict):
            raise InputError("that is no question")
        return asked

    def _keep(self, target: Path) -> None:
        left = self._length()
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            with target.open("xb") as file:
                while left:
                    part = self.rfile.read(min(left, CHUNK))
                    if not part:
                        raise InputError("the upload broke off")
                    file.write(part)
                    left -= len(part)
        except FileExistsError:
            raise InputError(f"{target.name} was uploaded twice") from None
        except BaseException:
            target.unlink(missing_ok=True)
            raise

    def _file(self, path: Path) -> None:
        kind = mimetypes.guess_type(path.name)[0] or "application/octet-stream"
        self._answer(200, path.read_bytes(), f"{kind}; charset=utf-8" if kind.startswith("text/") else kind, {})

    def _json(self, status: int, value: dict[str, Any], close: bool = False) -> None:
        self._answer(status, json.dumps(value).encode(), "application/json", {}, close)

    def _answer(self, status: int, body: bytes, kind: str, more: dict[str, str], close: bool = False) -> None:
        self.send_response(status)
        for name, value in {**HEADERS, "Content-Type": kind, "Content-Length": str(len(body)), **more}.items():
            self.send_header(name, value)
        if close:  # what was sent may not have been read
            self.send_header("Connection", "close")
            self.close_connection = True
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)


@cache
def start_page() -> str:
    """The page."""
    from markupsafe import Markup

    code = files("room2dgs.report").joinpath("web", "app.js").read_text(encoding="utf-8")
    return page("app.html.j2", title="room2dgs", presets=PRESETS, chosen="default", script=Markup(code))
