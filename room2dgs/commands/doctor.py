"""`room2dgs doctor`: what is here and what will run."""

from __future__ import annotations

from room2dgs.errors import InputError


def main(argv: list[str]) -> int:
    """Returns 0 when everything that a run needs works, 1 otherwise."""
    if argv and argv[0] not in ("-h", "--help"):
        raise InputError(f"doctor takes no argument, {argv[0]!r} was given")
    if argv:
        print("room2dgs doctor\n\nPrints versions, threads, instruction set and CUDA; 1 if a run cannot work.")
        return 0
    from room2dgs.doctor import examine

    lines, healthy = examine()
    print("\n".join(lines))
    return 0 if healthy else 1
