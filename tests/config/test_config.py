"""Overrides, refusals and what a run's config.yaml brings back."""

from __future__ import annotations

from dataclasses import replace
from functools import reduce

import pytest
from hydra import compose, initialize_config_dir
from hydra import version as hydra_version
from hydra.core.global_hydra import GlobalHydra
from hypothesis import given, settings
from hypothesis import strategies as st
from omegaconf import OmegaConf

from room2dgs.config import conf_dir, dump_config, load_config
from room2dgs.config.composing import composed
from room2dgs.config.keys import leaf_keys, path_keys
from room2dgs.config.overrides import group_choices
from room2dgs.errors import InputError

GIVEN = ["scene.path=room", "out=here"]
PATHS = [key for key in path_keys() if not key.endswith(".card")]  # a card is read at once


def flat(tree, prefix: str = "") -> dict:
    """Dotted name -> value."""
    if not isinstance(tree, dict):
        return {prefix: tree}
    return {
        name: value for key, part in tree.items() for name, value in flat(part, f"{prefix}.{key}".strip(".")).items()
    }


def test_defaults_need_only_scene_and_out():
    config = load_config(GIVEN)
    assert (config.scene.path, config.out, config.resume) == ("room", "here", False)


def test_every_yaml_key_is_in_the_schema_and_the_other_way_round():
    names = {key.name for key in leaf_keys()}
    assert set(flat(OmegaConf.to_container(composed(())))) == names
    for group in group_choices(conf_dir()):
        if group not in ("experiment", "preset"):
            assert any(name.startswith(group.replace("/", ".") + ".") for name in names)


def test_depth_of_a_capture_is_used_by_default_and_left_alone_with_one_word():
    assert load_config(GIVEN).prior.depth.source == "auto"
    photos = load_config([*GIVEN, "prior=room_prior"]).prior
    assert (photos.depth.source, photos.normal.source) == ("room_prior", "room_prior")
    # "auto" has all of the network's settings: where there is no depth it is that prior
    assert replace(load_config(GIVEN).prior.depth, source="room_prior") == photos.depth
    sensor = load_config([*GIVEN, "prior/depth=sensor"]).prior
    assert (sensor.depth.source, sensor.depth.align, sensor.depth.joint) == ("sensor", False, False)
    assert sensor.normal == photos.normal
    with pytest.raises(InputError, match=r"prior\.depth\.source=auto lacks its settings; write prior/depth=auto"):
        load_config([*GIVEN, "prior=none", "prior.depth.source=auto"])


def test_override_reaches_its_field():
    config = load_config([*GIVEN, "train.rates.scale=0.25", "loss.distortion={enabled:true,weight:2,start:5}"])
    assert config.train.rates.scale == 0.25
    assert (config.loss.distortion.enabled, config.loss.distortion.weight) == (True, 2.0)
    levels = load_config([*GIVEN, "train.resolutions=[{fraction:0.5,until:10}]"]).train.resolutions
    assert (levels[0].fraction, levels[0].until) == (0.5, 10)


@pytest.mark.parametrize(
    ("override", "said"),
    [
        ("train.iteration=3", "did you mean train.iterations"),
        ("train.iterations=many", "train.iterations wants a whole number"),
        ("train.iterations=2.5", "train.iterations wants a whole number"),
        ("train.iterations=null", "train.iterations wants a whole number"),
        ("train.iterations=0", "a value of 1 or more"),
        ("eval.protocols=area", "eval.protocols wants a list such as [a,b]"),
        ("eval.protocols=[]", "choose from area, neuris, manhattan"),
        ("eval.protocols=[chamfer]", "choose from area, neuris, manhattan"),
        ("mesh.depth=mean", "choose from smooth, median, expected"),
        ("mesh.source=network", "choose from surfels, depth, stereo, points"),
        ("mesh.voxel_m=nan", "mesh.voxel_m=nan is impossible"),
        ("eval.threshold_m=inf", "eval.threshold_m=inf is impossible"),
        ("render.background=[0,0]", "three numbers from 0 to 1"),
        ("train.rates.center=-1", "train.rates.center=-1"),
        ("train.resolutions=[{fraction:0.5,until:9},{fraction:1,until:9}]", "rising `until`"),
        ("train.resolutions=[{fraction:0.5}]", "until is not given"),
        ("points.source=file", "points.file=PATH"),
        ("sfm.refine_poses=maybe", "refine_poses=maybe is not known; give auto, true or false"),
        ("sfm.refine_poses=1", "refine_poses=1 is not known; give auto, true or false"),
        ("sfm.refine_poses=null", "refine_poses=null is not known; give auto, true or false"),
        ("loss=none_such", "loss wants settings of its own"),
        ("mesh=none_such", "choose from bounded, unbounded"),
        ("scene.image_width=null", "image_width=null is not known; give auto, full or a whole number from 16 to 8192"),
        ("scene.image_width=8", "image_width=8 is impossible; give auto, full or a whole number from 16 to 8192"),
        (
            "scene.layout=polycan",
            "scene.layout=polycan is not known (did you mean polycam?); choose from auto, sens, ros",
        ),
        (
            "export.after_run=[obj]",
            "export.after_run[0]=obj is not known; choose from splats, splats_2dgs, splat, spz, glb",
        ),
        ("experiment=none_such", "experiment=none_such is not known"),
        ("scene.path=", "scene.path is empty"),
        ("+train.extra=1", "+train.extra is no setting"),
        ("~loss", "settings are written KEY=VALUE"),
        ("hydra.run.dir=x", "hydra.run.dir is no setting"),
        ("prior.depth.source=lidar", "choose from none, files, onnx, onnx_multiview, room_prior, sensor, auto"),
        ("prior.normal.source=sensor", "choose from none, files, onnx, room_prior"),
        ("prior.depth.source=sensor", "write prior/depth=sensor, without prior.depth.align=true"),
        ("prior.depth.sensor.max_m=0.1", "prior.depth.sensor.min_m=0.2 leaves no depth"),
        ("prior.depth.sensor.error_m=0", "prior.depth.sensor.error_m=0 is impossible"),
        ("prior.depth.meaning=relative_depth", "prior.depth.source=auto means metres"),
        ("prior.depth.square=false", "prior.depth.square is now prior.depth.manhattan"),
        ("prior.depth.max_misfit=1", "prior.depth.max_misfit is gone: depth is trusted pixel by pixel"),
        ("prior.depth.max_residual=1", "prior.depth.max_residual is gone"),
        ("mesh.min_confidence=0.3", "mesh.min_confidence is gone: mesh.max_expected_m says in metres"),
        ("stereo.best=3", "stereo.best is now stereo.top_k"),
        ("report.discs=3", "report.discs is now report.max_surfels"),
        ("prior.depth.second_look=false", "prior.depth.second_look is now prior.depth.second_pass"),
        ("prior.depth.relief=true", "prior.depth.relief is gone: planes do not bend"),
        ("prior.depth.onnx.model=a.onnx", "prior.depth.onnx.model is now prior.depth.model"),
        ("prior.normal.onnx.white=255", "prior.normal.onnx.white is gone: the card beside the model says it"),
        ("loss.normal_doubt.start=0.5", "loss.normal_doubt.start is now loss.normal_reweighting.start"),
    ],
)
def test_wrong_override_is_one_sentence_that_names_it(override, said):
    with pytest.raises(InputError) as caught:
        load_config([*GIVEN, override])
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_mesh_of_stereo_without_stereo_is_refused():
    with pytest.raises(InputError, match=r"mesh\.source=stereo is nothing without stereo; give stereo\.enabled=true"):
        load_config([*GIVEN, "mesh.source=stereo", "stereo.enabled=false"])


@pytest.mark.parametrize("key", ["loss.distortion.end", "loss.normal_reweighting.start", "strategy.stop"])
@pytest.mark.parametrize(
    ("typed", "meant"), [("1", 1), ("1.0", 1.0), ("1e0", 1.0), ("0.5", 0.5), ("0", 0), ("0.0", 0), ("7000", 7000)]
)
def test_an_int_stays_an_iteration_and_a_float_a_share_also_through_a_file(tmp_path, key, typed, meant):
    config = load_config([*GIVEN, f"{key}={typed}"])
    path = tmp_path / "config.yaml"
    path.write_text(dump_config(config))
    for one in (config, load_config((), path)):
        found = reduce(getattr, key.split("."), one)
        assert (found, type(found)) == (meant, type(meant))


@pytest.mark.parametrize("typed", ["1.5", "3000.0", "-1", "-0.5", "nan", "inf", "true", "soon", "[1]"])
def test_other_times_are_refused_and_told_what_a_time_is(typed):
    with pytest.raises(InputError, match=r"^strategy\.stop.* a whole number of iterations or a share of train\.iter"):
        load_config([*GIVEN, f"strategy.stop={typed}"])


@pytest.mark.parametrize(("given_key", "missing"), [("scene.path=room", "out"), ("out=here", "scene.path")])
def test_what_is_not_given_is_named(given_key, missing):
    with pytest.raises(InputError, match=f"^{missing} is not given; add {missing}=DIR$"):
        load_config([given_key])


# "null" is no text
FOLDER_NAMES = st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), min_size=1).filter(
    lambda name: name.strip() == name and name.lower() != "null" and name[0] not in "'\""
)


@settings(max_examples=12, deadline=None)
@given(name=FOLDER_NAMES, key=st.sampled_from(PATHS))
def test_any_folder_name_arrives_as_it_was_typed(name, key):
    config = load_config([*GIVEN, f"{key}={name}"])
    assert reduce(getattr, key.split("."), config) == name


def test_dump_is_read_back_equal(tmp_path):
    config = load_config([*GIVEN, "train.resolutions=[{fraction:0.5,until:10}]", "scene.frames=7"])
    (tmp_path / "config.yaml").write_text(dump_config(config))
    assert load_config([], tmp_path / "config.yaml") == config


def test_only_named_keys_change_on_top_of_an_earlier_run(tmp_path):
    earlier = load_config([*GIVEN, "train.iterations=42", "mesh.voxel_m=0.5", "mesh.min_alpha=0.25"])
    (tmp_path / "config.yaml").write_text(dump_config(earlier))
    config = load_config(["mesh.voxel_m=0.03", "out=there"], tmp_path / "config.yaml")
    assert config == replace(earlier, out="there", mesh=replace(earlier.mesh, voxel_m=0.03))
    whole_group = load_config(["mesh=bounded"], tmp_path / "config.yaml")
    assert whole_group == replace(earlier, mesh=load_config(GIVEN).mesh)


@pytest.mark.parametrize("text", ["a: [", "colour: red", "train: 3", "\x00", "- a"])
def test_a_damaged_config_file_is_named(tmp_path, text):
    path = tmp_path / "config.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"config\.yaml is not the configuration of a run"):
        load_config([], path)


def test_the_config_file_of_an_earlier_version_is_refused_with_the_new_name(tmp_path):
    path = tmp_path / "config.yaml"
    path.write_text(dump_config(load_config(GIVEN)).replace("manhattan:", "square:"))
    with pytest.raises(InputError, match=r"prior\.depth\.square is now prior\.depth\.manhattan; rename it there$"):
        load_config([], path)


def test_settings_of_an_earlier_run_that_are_gone_are_passed_over(tmp_path):
    earlier = load_config([*GIVEN, "mesh.min_alpha=0.25"])
    text = dump_config(earlier).replace("  min_alpha:", "  min_confidence: 0.3\n  min_alpha:")
    (tmp_path / "config.yaml").write_text(text)
    assert "min_confidence" in text and load_config([], tmp_path / "config.yaml") == earlier


def test_settings_are_loaded_inside_another_hydra_application_and_its_state_stays():
    before = load_config(GIVEN)
    with initialize_config_dir(str(conf_dir().resolve()), version_base="1.2", job_name="theirs"):
        theirs, base = GlobalHydra.instance().hydra, hydra_version.getbase()
        assert load_config(GIVEN) == before
        assert GlobalHydra.instance().hydra is theirs and hydra_version.getbase() == base
        assert compose("config", overrides=["out=theirs"]).out == "theirs"
    assert not GlobalHydra.instance().is_initialized()
    with pytest.raises(InputError):
        load_config(["no.such=1"])
    assert load_config(GIVEN) == before
