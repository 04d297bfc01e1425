"""What people type, command by command: the end of each command's help."""

from __future__ import annotations

from collections.abc import Sequence

COLUMNS = 100
# verb, or "bench NAME" -> what follows it, and what that does
EXAMPLES: dict[str, tuple[tuple[str, str], ...]] = {
    "demo": (("room", "then: room2dgs run scene.path=room out=runs/room"),),
    "app": (("out=runs", "then drop photos or a video on the page"),),
    "prepare": (
        ("video=walk.mp4 out=room", "then: room2dgs run scene.path=room out=runs/room"),
        ("images=photos out=room prepare.length=[height,1.5]", "the camera was held 1.5 m above the floor"),
    ),
    "run": (
        ("scene.path=room out=runs/room", "a capture with poses, in any layout"),
        ("video=walk.mp4 out=runs/room", "a video: its poses first"),
        ("scene.path=room out=runs/fast experiment=quick", "a first look"),
        ("out=runs/room resume=true", "go on with a run that was stopped"),
        ("-m scene.path=room,hall out=runs/both hydra/launcher=joblib", "several captures at a time"),
    ),
    "train": (
        ("scene.path=room out=runs/room train.iterations=1000", "then: room2dgs mesh out=runs/room"),
        ("scene.path=room out=runs/room train.viewer=true", "watch it in a browser"),
    ),
    "depth": (("scene.path=room out=depth scene.image_width=640", "depth maps, dense.ply, mesh.ply"),),
    "mesh": (
        ("out=runs/room mesh.voxel_m=0.02", "coarser"),
        ("out=runs/room mesh=unbounded", "with what lies outside, behind windows"),
        ("out=runs/room mesh.fill=watertight", "closed, for printing and simulation"),
    ),
    "eval": (
        ("out=runs/room eval.gt=laser.ply", "against a scan in the same world"),
        ("out=runs/room eval.gt=laser.ply eval.align=icp", "against one in another"),
        ("pred=any.ply gt=laser.ply scene=room", "any mesh, seen by this capture's cameras"),
    ),
    "render": (
        ("run=runs/room views=all", "each photo beside its rendering"),
        ("run=runs/room path=smooth frames=600 width=1280 save=video", "a walk through the room"),
        ("run=runs/room path=cameras.json save=color,depth", "what the cameras of a file see"),
    ),
    "view": (("run=runs/room", "then open http://127.0.0.1:8080"),),
    "open": (("runs/room", "the page with the room, pictures and scores"),),
    "report": (("run=runs/room report.views=12", "with more photos"),),
    "compare": (("runs/room runs/fine to=compare.html", "then open compare.html"),),
    "export": (
        ("run=runs/room to=splats,spz,glb max_error_m=0.01", "splats, and a mesh simplified within 1 cm"),
        ("run=runs/room to=textured,textured_obj", "few faces with a picture, for the web"),
        ("run=runs/room to=colmap out=hand_over", "the prepared capture for another trainer"),
    ),
    "table": (("runs/a runs/b meshes=others out=table", "other methods' meshes beside the runs"),),
    "plan": (
        ("run=runs/room up=z", "plan.svg, plan.dxf, plan.json"),
        ("run=runs/room to=shell,ifc", "and the room without furniture, and IFC4 for architects"),
    ),
    "measure": (
        ("run=runs/room", "the dimensions of all rooms"),
        ("run=runs/room wall_1 wall_3", "between two walls of the plan"),
        ("run=runs/room 1.2,0.4,0.8 1.9,0.4,0.8", "between two points of the mesh"),
        ("run=runs/room floor plane@000012:210,145", "the height of a table top that photo 000012 shows there"),
    ),
    "scale": (
        ("run=runs/room wall_1 wall_3 length=4.12+-0.003", "by what you measured between two walls"),
        ("run=runs/room 000012:210,145 000012:388,150 length=0.8", "by an edge that photo 000012 shows"),
    ),
    "ablate": (("scene.path=room out=study train.seed=0,1,2", "each part left out, three times"),),
    "doctor": (("", "the first thing to type when something does not work"),),
    "completion": (
        ("bash > ~/.local/share/bash-completion/completions/room2dgs", "TAB from the next shell on"),
        ("zsh > ~/.zfunc/_room2dgs", "a folder of $fpath"),
        ("fish > ~/.config/fish/completions/room2dgs.fish", ""),
    ),
    "bench": (("raster --quick", "is the rasterizer as fast here as it should be?"),),
    "bench raster": (("--quick", "a minute"),),
    "bench prior": (("room hall out=prior scene.frames=20", "the shipped network on two captures with depth"),),
    "bench calibration": (("runs/a runs/b to=calibration.json", "expected errors of meshes against the true ones"),),
    "bench lengths": (("runs/a runs/b to=lengths.json", "errors of lengths in made rooms, and how often ± holds"),),
    "bench plan": (("runs/a runs/b to=plans.json", "walls, doors and windows that were found"),),
    "bench suite": (
        ("room hall out=suite experiment=quick", "two captures, one table"),
        ("scenes=scannet_paper root=/data/scannet out=suite", "the scenes of the paper"),
    ),
}


def examples(verb: str, rest: Sequence[str]) -> str:
    """Lines for the end of a command's help; empty without an example.

    Args:
        rest: what follows the verb: `bench` has commands of its own.
    """
    inner = next((f"{verb} {word}" for word in rest if f"{verb} {word}" in EXAMPLES), verb)
    lines = [f"  room2dgs {inner} {typed}".rstrip() for typed, _ in EXAMPLES.get(inner, ())]
    if not lines:
        return ""
    comments = [comment for _, comment in EXAMPLES[inner]]
    widths = [
        len(line) for line, comment in zip(lines, comments, strict=True) if len(line) + len(comment) + 2 <= COLUMNS
    ]
    width = max(widths, default=0)
    commented = (_commented(line, comment, width) for line, comment in zip(lines, comments, strict=True))
    return "\n".join(["", "Examples:", *commented])


def _commented(line: str, comment: str, width: int) -> str:
    """The comment behind the line, or below it where both are longer than a terminal is wide."""
    if len(line) <= width and width + len(comment) + 2 <= COLUMNS:
        return f"{line:<{width}}  {comment}".rstrip()
    return f"{line}\n      {comment}".rstrip()
