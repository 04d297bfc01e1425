"""`room2dgs completion SHELL`: what completes commands and settings in a shell."""

from __future__ import annotations

from room2dgs.commands.settings_help import asked_for_help, filled
from room2dgs.errors import InputError

USAGE = "room2dgs completion bash|zsh|fish"
PLACES = """
    bash: ~/.local/share/bash-completion/completions/room2dgs, or a file that ~/.bashrc sources
    zsh: _room2dgs in a folder of $fpath, before compinit runs
    fish: ~/.config/fish/completions/room2dgs.fish
    """


def main(argv: list[str]) -> int:
    """Print what completes commands, settings and their values by TAB; it goes to a file where the shell looks:"""
    from room2dgs.commands.completion_scripts import SCRIPTS
    from room2dgs.commands.completion_words import found_words

    if asked_for_help(argv):
        print(f"{USAGE}\n\n{filled(main.__doc__ or '')}\n\n{PLACES}")
        return 0
    if len(argv) != 1 or argv[0] not in SCRIPTS:
        raise InputError(f"say which shell: {USAGE}")
    print(SCRIPTS[argv[0]](found_words()))
    return 0
