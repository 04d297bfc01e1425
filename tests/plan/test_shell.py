"""The room without furniture as a closed mesh, its quantities, and its plan as IFC."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from room2dgs.errors import InputError
from room2dgs.lengths.length import Length
from room2dgs.lengths.plane_sigma import Faces
from room2dgs.lengths.scale import ScaleTrust
from room2dgs.lengths.surface import MeasuredMesh
from room2dgs.plan.floor_plan import FloorPlan
from room2dgs.plan.opening import Opening
from room2dgs.plan.outline import Outline, Side
from room2dgs.plan.planes import Plane
from room2dgs.plan.quantities import clearances, quantities
from room2dgs.plan.shell import WALL_M, shell
from room2dgs.plan.sigmas import with_sigmas

L_SHAPE = [(0, 0), (5, 0), (5, 2), (3, 2), (3, 4), (0, 4)]
AREA, AROUND, HEIGHT = 16.0, 18.0, 2.5
EXACT = ScaleTrust(True, 0.0, "")


def opening(kind: str, side: int, start: float, end: float, low: float, high: float, depth=None) -> Opening:
    width, height = (Length(value, 0.0, 0.02, 0.0, "") for value in (end - start, high - low))
    return Opening(kind, False, 0, side, start, end, low, high, depth, 0.9, width, height)


def plan_of(corners=L_SHAPE, openings=(), ceiling: bool = True) -> FloorPlan:
    points = np.array(corners, float)
    sides, walls = [], []
    for number, (start, end) in enumerate(zip(points, np.roll(points, -1, axis=0), strict=True)):
        along = (end - start) / np.linalg.norm(end - start)
        normal = np.array([-along[1], along[0], 0])
        walls.append(Plane(f"wall_{number + 1}", normal, float(normal[:2] @ start), 5.0, 0.002, 0.0, HEIGHT))
        sides.append(Side(start, end, number))
    floor = Plane("floor", np.array([0, 0, 1.0]), 0.0, AREA, 0.002, 0.0, 0.0)
    top = Plane("ceiling", np.array([0, 0, -1.0]), -HEIGHT, AREA, 0.002, HEIGHT, HEIGHT) if ceiling else None
    return FloorPlan(np.eye(3), floor, top, tuple(walls), (Outline(tuple(sides), (), AREA),), openings=tuple(openings))


HOLES = (
    opening("door", 0, 1.0, 1.9, 0.0, 2.0),
    opening("window", 4, 1.0, 2.0, 0.9, 2.1),
    opening("niche", 5, 1, 2, 1, 1.5, 0.08),
)


def solid_volume(holes=(), ceiling: bool = True) -> float:
    outside = AREA + AROUND * WALL_M + 4 * WALL_M**2  # mitred: five corners of the L stand out, one in
    walls = (outside - AREA) * HEIGHT
    slabs = outside * WALL_M * (2 if ceiling else 1)
    gone = [(one.depth_m or WALL_M) * one.width.value * one.height.value for one in holes]
    return walls + slabs - sum(gone)


@pytest.mark.parametrize("ceiling", [True, False])
@pytest.mark.parametrize("holes", [(), HOLES])
def test_it_is_closed_and_has_the_volume_of_walls_without_their_openings(holes, ceiling):
    made = shell(plan_of(openings=holes, ceiling=ceiling))
    assert made.is_watertight and made.is_winding_consistent
    assert made.volume == pytest.approx(solid_volume(holes, ceiling), rel=1e-5)
    assert made.area_faces.min() > 1e-9


def test_one_walks_out_through_the_door_alone():
    made = shell(plan_of(openings=HOLES))
    surface = MeasuredMesh(made, np.zeros(len(made.faces)), 0.01)
    south, east = np.array([0, -1.0, 0]), np.array([1.0, 0, 0])
    with pytest.raises(InputError, match="no surface"):
        surface.hit(np.array([1.45, 1.0, 1.0]), south, "through the door")
    assert surface.hit(np.array([1.45, 1.0, 2.2]), south, "over it").point[1] == pytest.approx(0, abs=1e-6)
    wall = surface.hit(np.array([4.0, 1.0, 1.0]), east, "a wall")
    assert wall.point[0] == pytest.approx(5, abs=1e-6) and wall.normal[0] == pytest.approx(-1)


def test_a_program_that_knows_nothing_of_us_reads_it(tmp_path):
    import open3d as o3d

    from room2dgs.mesh.ply_bytes import ply_bytes

    (tmp_path / "shell.ply").write_bytes(ply_bytes(shell(plan_of(openings=HOLES))))
    read = o3d.io.read_triangle_mesh(str(tmp_path / "shell.ply"))
    assert read.is_watertight() and read.get_volume() == pytest.approx(solid_volume(HOLES), rel=1e-4)


def measured(holes=HOLES) -> FloorPlan:
    """All planes are good to 4 mm."""
    step = 0.1
    parts = []
    plan = plan_of()
    for side, wall in zip(plan.rooms[0].sides, plan.walls, strict=True):
        along = (side.end - side.start) / side.length_m
        u, z = np.meshgrid(np.arange(step / 2, side.length_m, step), np.arange(step / 2, HEIGHT, step))
        places = np.column_stack([side.start + u.reshape(-1, 1) * along, z.ravel()])
        parts.append((places, np.tile(wall.normal, (len(places), 1))))
    x, y = (values.ravel() for values in np.meshgrid(np.arange(0.05, 3, step), np.arange(0.05, 4, step)))
    for z, up in ((0.0, 1.0), (HEIGHT, -1.0)):
        parts.append((np.column_stack([x, y, np.full(len(x), z)]), np.tile([0, 0, up], (len(x), 1))))
    middle, normal = (np.concatenate(part) for part in zip(*parts, strict=True))
    faces = Faces(middle, normal, np.full(len(middle), step**2), np.full(len(middle), 0.004))
    return with_sigmas(plan_of(openings=holes), faces, EXACT)


def test_quantities_are_those_of_the_room():
    found = quantities(measured(), EXACT)["rooms"][0]
    assert found["floor"]["value"] == AREA and 0.01 < found["floor"]["sigma"] < 0.1
    assert found["walls"]["value"] == pytest.approx(AROUND * HEIGHT)
    assert found["walls_net"]["value"] == pytest.approx(AROUND * HEIGHT - 0.9 * 2.0 - 1.0 * 1.2)
    assert found["volume"]["value"] == pytest.approx(AREA * HEIGHT)
    assert found["volume"]["sigma"] > HEIGHT * found["floor"]["sigma"] * 0.99
    unsure = ScaleTrust(True, 0.01, "")
    scaled = quantities(measured(), unsure)["rooms"][0]
    assert scaled["volume"]["sigma"] == pytest.approx(0.03 * AREA * HEIGHT, rel=0.05)
    unseen = quantities(replace(measured(), height=None), EXACT)["rooms"][0]
    assert unseen["volume"] is None and unseen["floor"]["value"] == AREA
    (door,) = clearances(measured())
    assert door["what"] == "door 1, wall_1" and door["width"]["value"] == pytest.approx(0.9)


def test_ifc_has_walls_with_real_holes():
    """Read again, and its solids made by IfcOpenShell's geometry kernel, which none of our code is in."""
    ifcopenshell = pytest.importorskip("ifcopenshell")
    geom = pytest.importorskip("ifcopenshell.geom")
    from room2dgs.plan.ifc import ifc

    file = ifcopenshell.file.from_string(ifc(measured(), "a room"))
    assert file.schema == "IFC4"
    counts = {kind: len(file.by_type(kind)) for kind in ("IfcWall", "IfcDoor", "IfcWindow", "IfcSpace", "IfcSlab")}
    assert counts == {"IfcWall": 6, "IfcDoor": 1, "IfcWindow": 1, "IfcSpace": 1, "IfcSlab": 1}
    assert file.by_type("IfcDoor")[0].OverallWidth == pytest.approx(0.9)
    settings = geom.settings()

    def volume(entity) -> float:
        made = geom.create_shape(settings, entity).geometry
        vertices, faces = np.reshape(made.verts, (-1, 3)), np.reshape(made.faces, (-1, 3))
        return float(trimesh.Trimesh(vertices, faces).volume)

    walls = {wall.Name: volume(wall) for wall in file.by_type("IfcWall")}
    assert walls["wall_2"] == pytest.approx(2 * HEIGHT * WALL_M, rel=1e-4)
    assert walls["wall_1"] == pytest.approx((5 * HEIGHT - 0.9 * 2.0) * WALL_M, rel=1e-4)
    assert walls["wall_5"] == pytest.approx((3 * HEIGHT - 1.0 * 1.2) * WALL_M, rel=1e-4)
    assert walls["wall_6"] == pytest.approx(4 * HEIGHT * WALL_M - 0.5 * 0.08, rel=1e-4)
    assert volume(file.by_type("IfcSpace")[0]) == pytest.approx(AREA * HEIGHT, rel=1e-4)
