"""A scene file by itself reads no file outside its folders, runs no code and reaches no network."""

import json
import os
import sys
from contextlib import suppress

import numpy as np
import pytest
import trimesh

from warpdem import Scene, SceneError, Simulation, load_scene
from warpdem.app import cli
from warpdem.core.access import SCENES, Access, access_of_file

SCENE = """
[materials.g]
density = 2500
young_modulus = 5e6
poisson_ratio = 0.3
[contact]
normal = "hooke"
tangential = "none"
[[pairs]]
materials = ["g", "g"]
restitution = 0.6
stiffness = 500
[[grains]]
material = "g"
positions = [[0, 0, 0], [0.0, 0, 0.0021]]
radius = 1e-3
[time]
end = 1e-4
step = 1e-5
max_speed = 1e-3
[output]
formats = []
picture = false
"""
LAW = """
import pathlib
pathlib.Path(__file__).with_name("ran").touch()
from warpdem.kernels.normal.hooke import *
"""


@pytest.fixture
def folder(tmp_path):
    """Folder "home" of a scene, with "beside" next to it, each with a mesh, grains and a law."""
    for name in ("home", "beside", "home/below"):
        (tmp_path / name).mkdir()
        trimesh.creation.box((1, 1, 1)).export(tmp_path / name / "box.stl")
        np.savez(tmp_path / name / "bed.npz", position=np.zeros((1, 3)), radius=np.ones(1))
        (tmp_path / name / "law.py").write_text(LAW)
    return tmp_path


def written(folder, text):
    (folder / "home" / "scene.toml").write_text(SCENE.replace("[contact]", f"{text}\n[contact]"))
    return folder / "home" / "scene.toml"


WALL = '[[walls]]\nname = "w"\nmaterial = "g"\nmesh = "{}"\n'


def with_mesh(folder, mesh):
    return written(folder, WALL.format(mesh))


def refused(path, **arguments) -> str:
    with pytest.raises(SceneError) as error:
        load_scene(path, **arguments)
    return str(error.value)


@pytest.mark.parametrize("mesh", ["box.stl", "below/box.stl", "./below/../box.stl"])
def test_files_in_the_scenes_own_folder_are_read(folder, mesh):
    assert load_scene(with_mesh(folder, mesh)).walls[0].mesh == mesh


@pytest.mark.parametrize("form", ["../beside/box.stl", "{}/beside/box.stl", "below/../../beside/box.stl"])
def test_a_path_outside_is_refused_and_the_remedy_works(folder, form):
    path = with_mesh(folder, form.format(folder))
    text = refused(path)
    for word in (str(path), "walls[0].mesh", str(folder / "beside" / "box.stl"), f"--allow-path {folder / 'beside'}"):
        assert word in text, text
    scene = load_scene(path, allow_paths=[folder / "beside"])
    assert scene.resolve(scene.walls[0].mesh).is_file()
    assert refused(path, allow_paths=[folder / "home" / "below"])


def test_links_count_by_what_they_lead_to(folder):
    (folder / "home" / "link.stl").symlink_to(folder / "beside" / "box.stl")
    (folder / "home" / "door").symlink_to(folder / "beside")
    for mesh in ("link.stl", "door/box.stl"):
        assert "outside the folders" in refused(with_mesh(folder, mesh))
    (folder / "home" / "inside.stl").symlink_to(folder / "home" / "below" / "box.stl")
    assert load_scene(with_mesh(folder, "inside.stl"))


def test_a_folder_whose_name_begins_alike_is_another_folder(folder):
    (folder / "home2").mkdir()
    (folder / "home2" / "box.stl").write_bytes((folder / "home" / "box.stl").read_bytes())
    assert "outside the folders" in refused(with_mesh(folder, "../home2/box.stl"))


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ('[[grains]]\nmaterial = "g"\nfile = "../beside/bed.npz"\n', "grains[0].file"),
        ('[frame]\nusd = "../beside/a.usda"\nprim = "/A"\n', "frame.usd"),
        (WALL.format("box.stl") + 'motion = { usd = "../beside/a.usda", prim = "/A" }\n', "walls[0].motion.usd"),
    ],
)
def test_every_key_that_names_a_file_is_held_to_the_rule(folder, text, key):
    found = refused(written(folder, text))
    assert key in found and "outside the folders" in found, found


@pytest.mark.parametrize("address", ["http://a.b/box.stl", "https://a.b/box.stl", "ftp://a.b/box.stl", "file:///etc/box.stl"])
def test_nothing_is_read_over_a_network(folder, address):
    for allow in ((), ["/"]):
        assert "is an address" in refused(with_mesh(folder, address), allow_paths=allow)


def test_reading_is_refused_too_where_the_file_appears_later(folder):
    """The readers themselves ask for the path: what changes after loading is held to the rule as well."""
    scene = load_scene(with_mesh(folder, "box.stl"))
    (folder / "home" / "box.stl").unlink()
    (folder / "home" / "box.stl").symlink_to(folder / "beside" / "box.stl")
    with pytest.raises(SceneError, match="outside the folders"):
        Simulation(scene, device="cpu", threads=1)


def test_scenes_of_the_package_are_read_from_anywhere(folder):
    assert (SCENES / "hourglass.toml").is_file()
    assert load_scene(with_mesh(folder, SCENES / "meshes" / "box.stl"))


def test_a_dictionary_of_python_is_trusted(folder):
    data = {**load_scene(written(folder, "")).model_dump(), "base": folder}
    wall = {"name": "w", "material": "g", "mesh": str(folder / "beside" / "box.stl")}
    assert Scene.model_validate(data | {"walls": [wall]}).access == Access()


# --- code ------------------------------------------------------------------------------------------------------------


def with_law(folder, law="law.py"):
    (folder / "home" / "scene.toml").write_text(SCENE.replace("hooke", law))
    return folder / "home" / "scene.toml"


def ran(folder) -> bool:
    return any((folder / name / "ran").exists() for name in ("home", "beside"))


def test_a_scene_file_runs_no_code_by_itself(folder):
    path = with_law(folder)
    text = refused(path)
    law = folder / "home" / "law.py"
    for word in (str(path), 'contact.normal = "law.py"', "may not load by itself", f"--plugin {law}", f'plugins=["{law}"]'):
        assert word in text, text
    assert not ran(folder)


def test_a_plugin_is_loaded_and_no_other(folder):
    path = with_law(folder)
    assert refused(path, plugins=[folder / "beside" / "law.py"])
    assert not ran(folder)
    scene = load_scene(path, plugins=[folder / "home" / "law.py"])
    assert ran(folder) and scene.located(scene.contact.normal) == str(folder / "home" / "law.py")


def test_a_plugin_outside_the_folder_needs_no_other_word(folder):
    """Naming a file is the permission; its folder is not opened by it."""
    path = with_law(folder, "../beside/law.py")
    assert load_scene(path, plugins=[folder / "beside" / "law.py"]).contact.normal == "../beside/law.py"


@pytest.mark.parametrize("table", ["fields", "observers"])
def test_fields_and_observers_are_code_too(folder, table):
    name = 'name = "a"\n' if table == "observers" else ""
    text = refused(written(folder, f'[[{table}]]\n{name}model = "law.py"\n'))
    assert f'{table}[0].model = "law.py"' in text and "--plugin" in text
    assert not ran(folder)


def test_all_refused_code_is_told_at_once_with_what_to_say(folder):
    """Law, field, observer and what a phase brings: once allowed as told, none is refused any more."""
    for name in ("drag", "speed", "later"):
        (folder / "home" / f"{name}.py").write_text("from warpdem.kernels.field.drag import *\n")
    (folder / "home" / "speed.py").write_text("from warpdem.kernels.observer.speed import *\n")
    text = '[[fields]]\nmodel = "drag.py"\nparameters = { coefficient = 1e-6 }\n[[observers]]\nname = "v"\nmodel = "speed.py"\n'
    text += '[[phases]]\nname = "a"\n[[phases.fields]]\nmodel = "later.py"\nparameters = { coefficient = 1e-6 }\n'
    path = written(folder, text)
    path.write_text(path.read_text().replace("hooke", "law.py"))
    told = refused(path)
    for word in ("3 problems", 'contact.normal = "law.py"', 'fields[0].model = "drag.py"', 'observers[0].model = "speed.py"'):
        assert word in told, told
    last = told.splitlines()[-1]
    assert last.startswith("if you trust all 4 files: --plugin ")
    files = last.split("--plugin ")[1].split(", or ")[0].split()
    assert [os.path.basename(file) for file in files] == ["law.py", "drag.py", "speed.py", "later.py"]
    assert load_scene(path, plugins=files).phases
    assert "if you trust all" not in refused(path, plugins=files[:3])


def test_bad_permissions_are_named(folder):
    path = written(folder, "")
    assert "--plugin no.py: must be an existing file" in refused(path, plugins=["no.py"])
    assert "ends in .py" in refused(path, plugins=[folder / "home" / "box.stl"])
    assert "--allow-path nowhere: no such folder" in refused(path, allow_paths=["nowhere"])


def test_a_checkpoint_runs_no_code_by_itself(folder):
    law = folder / "home" / "law.py"
    sim = Simulation(load_scene(with_law(folder), plugins=[law]), device="cpu", threads=1)
    sim.step(3)
    sim.save_checkpoint(folder / "a.h5")
    with pytest.raises(SceneError, match="--plugin"):
        Simulation.from_checkpoint(folder / "a.h5", device="cpu")
    again = Simulation.from_checkpoint(folder / "a.h5", device="cpu", plugins=[law])
    assert again.state_hash() == sim.state_hash()


def test_the_command_takes_both(folder, monkeypatch, capfd):
    path = written(folder, WALL.format("../beside/box.stl"))
    path.write_text(path.read_text().replace("hooke", "law.py"))

    def check(*arguments):
        monkeypatch.setattr(sys, "argv", ["warpdem", "check", str(path), "--json", "--no-probe", "--device", "cpu", *arguments])
        try:
            cli.main()
        except SystemExit as stop:
            return stop.code or 0, capfd.readouterr()
        return 0, capfd.readouterr()

    code, said = check()
    assert code == 2 and "--plugin" in said.err
    code, said = check("--plugin", str(folder / "home" / "law.py"))
    assert code == 2 and "--allow-path" in said.err
    box = ("--set", "walls.0.open=true")  # the grains are not asked to be inside
    code, said = check("--plugin", str(folder / "home" / "law.py"), "--allow-path", str(folder / "beside"), *box)
    assert code == 0, said.err
    assert json.loads(said.out)["grains"] == 2


@pytest.mark.parametrize("form", ["{0} {1} {2}", "{0} {1} {0} {2}"])
def test_the_command_takes_several_after_one_word_or_each_after_its_own(folder, monkeypatch, capfd, form):
    wall = WALL.format("../beside/box.stl") + "open = true\n"
    path = written(folder, wall + '[[observers]]\nname = "v"\nmodel = "speed.py"\n')
    path.write_text(path.read_text().replace("hooke", "law.py"))
    (folder / "home" / "speed.py").write_text("from warpdem.kernels.observer.speed import *\n")
    monkeypatch.chdir(folder)
    files = form.format("--plugin", "home/law.py", "home/speed.py")
    folders = form.format("--allow-path", "home/below", "beside")
    command = f"warpdem check {path} {files} {folders} --json --no-probe --device cpu --threads 1"
    monkeypatch.setattr(sys, "argv", command.split())
    with suppress(SystemExit):
        cli.main()
    assert json.loads(capfd.readouterr().out)["grains"] == 2


def test_home_is_outside_unless_it_is_given(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path / "me"))
    assert "outside" in access_of_file(tmp_path / "job").refusal("~/box.stl", tmp_path / "job")
    os.makedirs(tmp_path / "me")
    assert access_of_file(tmp_path / "job", ["~"]).refusal("~/box.stl", tmp_path / "job") is None


# --- phases and USD stages -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("phase", "words"),
    [
        ('[phases.contact]\nnormal = "law.py"', ["phases[0].contact.normal", "--plugin"]),
        ('[[phases.fields]]\nmodel = "law.py"', ["phases[0].fields[0].model", "--plugin"]),
        (
            '[[phases.walls]]\nname = "w"\nmaterial = "g"\nmesh = "../beside/box.stl"',
            ['phases[0].walls[0].mesh = "../beside/box.stl"', "outside the folders"],
        ),
        ('[[phases.walls]]\nname = "w"\nmaterial = "g"\nmesh = "no.stl"', ["phases[0].walls[0].mesh", "no such file"]),
    ],
)
def test_a_phase_is_held_to_the_rule(folder, phase, words):
    path = written(folder, f'[[phases]]\nname = "a"\n{phase}\n')
    text = refused(path)
    for word in words:
        assert word in text, text
    assert not ran(folder)


def test_a_phase_keeps_what_the_scene_may_reach(folder):
    scene = load_scene(written(folder, '[[phases]]\nname = "a"\n'), plugins=[folder / "home" / "law.py"])
    assert scene.phase(0).access == scene.access != Access()


STAGE = """#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
{sublayers})
def Xform "World"
{{
    def Xform "Box" {reference}
    {{
    }}
{inside}}}
"""
BOX = '    def Cube "Cube"\n    {\n        double size = 1\n    }\n'


@pytest.mark.parametrize("way", ["sublayer", "reference", "payload"])
def test_a_stage_follows_no_layer_outside(folder, way):
    """A mesh stage whose box lies in a file beside the scene's folder: refused, and read with --allow-path."""
    held = f'def Xform "Box"\n{{\n{BOX}}}\n'
    held = 'over "World"\n{\n' + held.replace("def Xform", "over") + "}\n" if way == "sublayer" else held
    head = '#usda 1.0\n(\n    defaultPrim = "Box"\n    metersPerUnit = 1\n    upAxis = "Z"\n)\n'
    (folder / "beside" / "box.usda").write_text(head + held)
    sublayers = "    subLayers = [@../beside/box.usda@]\n" if way == "sublayer" else ""
    far = "@../beside/box.usda@"
    arcs = {"sublayer": "", "reference": f"(prepend references = {far})", "payload": f"(prepend payload = {far})"}
    stage = folder / "home" / "stage.usda"
    stage.write_text(STAGE.format(sublayers=sublayers, reference=arcs[way], inside=""))
    path = with_mesh(folder, "stage.usda")
    with pytest.raises(SceneError) as error:
        Simulation(load_scene(path), device="cpu", threads=1)
    for word in ("walls[0].mesh", "stage.usda", "box.usda"):
        assert word in str(error.value), str(error.value)
    assert "outside" in str(error.value)
    opened = load_scene(path, allow_paths=[folder / "beside"])
    assert Simulation(opened, device="cpu", threads=1).meshes["w"].is_closed


def test_a_stage_reaches_no_network(folder):
    stage = folder / "home" / "stage.usda"
    stage.write_text(STAGE.format(sublayers="", reference="(prepend references = @http://a.b/box.usda@)", inside=BOX))
    with pytest.raises(SceneError) as error:
        Simulation(load_scene(with_mesh(folder, "stage.usda")), device="cpu", threads=1)
    assert "http://a.b/box.usda" in str(error.value)
