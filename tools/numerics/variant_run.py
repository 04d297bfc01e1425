"""One variant of the extension in a process of its own: times of a rendering both ways, its images and gradients.

`python -m room2dgs.tools.numerics.variant_run LIBRARY OUT.pt REPEATS`; the last line says the seconds.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

SIZE, COUNT = (320, 240), 20_000  # pixels, surfels


def use(library: Path) -> None:
    """Let this library be the package's extension; before anything of the package that needs it is imported."""
    import room2dgs

    spec = importlib.util.spec_from_file_location("room2dgs._C", library)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    sys.modules["room2dgs._C"] = room2dgs._C = module


def main(argv: list[str]) -> int:
    """Draw, differentiate, save."""
    library, out, repeats = Path(argv[0]), Path(argv[1]), int(argv[2])
    use(library)

    import torch

    from room2dgs import _C, splat
    from room2dgs.bench.raster import Case

    assert Path(_C.__file__) == library
    torch.set_num_threads(1)
    splat.set_threads(1)
    case = Case(*SIZE, COUNT)

    def draw() -> Any:
        return case.draw(surfels=case.leaves, with_distortion=False)

    def fastest(run: Callable[[Any], Any], given: Callable[[], Any]) -> float:
        times = []
        for _ in range(repeats):
            value = given()
            start = time.process_time()  # of this process: others use the machine too
            run(value)
            times.append(time.process_time() - start)
        return min(times)

    forward, backward = fastest(lambda _: draw(), lambda: None), fastest(case.back, draw)
    images = draw()
    torch.save({"images": [x.detach() for x in images], "gradients": list(case.back(images))}, out)
    print(json.dumps({"forward": forward, "backward": backward, "isa": _C.isa()}))
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
