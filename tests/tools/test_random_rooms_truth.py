"""What is written of a made room's plan is what rays meet in it."""

from __future__ import annotations

import json

import numpy as np

from room2dgs.bench.plan_truth import PLAN_TRUTH, read_plan_truth
from room2dgs.demo_room.geometry import triangulated
from room2dgs.demo_room.light import cast
from room2dgs.demo_room.render import ray_scene
from room2dgs.tools.random_rooms.layout import random_room
from room2dgs.tools.random_rooms.truth import plan_truth

SEEDS = range(14)
BACK_M = 0.09  # before a wall: nothing that is fixed on one stands out farther


def test_holes_are_open_what_is_mounted_stands_out_and_walls_are_where_they_are(tmp_path):
    holes = mounted = tops = 0
    for seed in SEEDS:
        room = random_room(np.random.default_rng([65, seed]))
        if room.storm:
            continue
        (tmp_path / PLAN_TRUTH).write_text(json.dumps(plan_truth(room)))
        truth = read_plan_truth(tmp_path)
        scene = ray_scene(triangulated(room.patches))
        for one in truth.openings:
            if one.wall.room or one.kind == "niche":
                continue
            z = np.linspace(one.low_m, one.high_m, 9)[1:-1]
            along = np.linspace(one.start_m, one.end_m, 9)[1:-1]
            x, height = (values.ravel() for values in np.meshgrid(along, z))
            places = one.wall.start + x[:, None] * one.wall.along + BACK_M * one.wall.normal
            origins = np.column_stack([places, height])
            away = cast(scene, origins, np.tile(np.append(-one.wall.normal, 0), (len(origins), 1)))["t_hit"]
            if one.cut:  # bars and leaves stand in holes, but most of one is open
                holes += 1
                assert np.median(away) > BACK_M + 0.02, (seed, one)
            else:
                mounted += 1
                assert np.median(away) < BACK_M - 0.004, (seed, one)
        for _, corners in truth.tops:
            tops += 1
            above = corners.mean(axis=0) + np.array([0, 0, 1e-3])
            below = cast(scene, above[None], np.array([[0, 0, -1.0]]))["t_hit"][0]
            assert below < 0.01
    assert holes > 5 and mounted > 3 and tops > 2
