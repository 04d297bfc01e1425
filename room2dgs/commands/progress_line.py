"""One line on a terminal for a whole run; what is more lies in the run's log."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, ProgressColumn, Task
from rich.progress import Progress as Line
from rich.table import Column
from rich.text import Text

from room2dgs.pipeline.progress import Progress
from room2dgs.texts import shown

WARNING = "WARNING"
PER_SECOND = 2


class TimeLeft(ProgressColumn):
    """Minutes and seconds left, worked out anew for each picture of the line."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(Column(no_wrap=True, min_width=10))
        self._progress = progress

    def render(self, task: Task) -> Text:
        """Such as "3:05 left"."""
        return Text(time_left(self._progress.left_s()))


class Share(ProgressColumn):
    """Per cent of the whole; keeps the bar up to date, too."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(Column(no_wrap=True, min_width=4))
        self._progress = progress

    def render(self, task: Task) -> Text:
        """Such as " 42%"."""
        share = self._progress.share()
        task.completed = share
        return Text(f"{share:4.0%}")


class What(ProgressColumn):
    """What is being done, in the room that is left."""

    def __init__(self, progress: Progress) -> None:
        super().__init__(Column(ratio=1, no_wrap=True, overflow="ellipsis"))
        self._progress = progress

    def render(self, task: Task) -> Text:
        """In words."""
        return Text(self._progress.what)


class ProgressLine:
    """Shows a run on one line while a block runs; `log` takes the run's lines in place of the terminal.

    Warnings stand above the line. `say` prints what is left there at the end.
    """

    def __init__(self, progress: Progress, console: Console | None = None) -> None:
        self.progress = progress
        self._console = console or Console()
        bar = BarColumn(20, table_column=Column(no_wrap=True, min_width=20))
        columns = Share(progress), bar, TimeLeft(progress), What(progress)
        self._line = Line(*columns, console=self._console, refresh_per_second=PER_SECOND, transient=True, expand=True)
        self._line.add_task("", total=1.0)

    def __enter__(self) -> ProgressLine:
        self._line.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._line.stop()

    def log(self, line: str) -> None:
        """A line of the log: a warning is printed, others are only heard."""
        self.progress.tell(line)
        if line.upper().startswith(WARNING):
            self.say(line)

    def say(self, line: str) -> None:
        """Print above the line, as it is."""
        self._console.print(Text(shown(line)), soft_wrap=True)


def time_left(seconds: float | None) -> str:
    """Minutes and seconds, from an hour on hours and minutes."""
    if seconds is None:
        return "-:-- left"
    whole = round(seconds)
    if whole >= 3600:
        return f"{whole // 3600}h{whole % 3600 // 60:02d} left"
    return f"{whole // 60}:{whole % 60:02d} left"
