"""Grains of other programs as state files: LAMMPS and LIGGGHTS themselves write some, damaged files are refused."""

import gzip
import shutil
import subprocess

import numpy as np
import pytest

from warpdem import Scene, SceneError, Simulation
from warpdem.app import cli
from warpdem.exchange.lammps_data import read_data
from warpdem.exchange.lammps_dump import read_dump
from warpdem.exchange.state_file import format_of, write_state_file
from warpdem.exchange.text_columns import read_mercury, read_yade
from warpdem.filling.grain_file import read_grain_file

DUMP = """ITEM: TIMESTEP
0
ITEM: NUMBER OF ATOMS
1
ITEM: BOX BOUNDS ff ff ff
0 1
0 1
0 1
ITEM: ATOMS id type x y z radius
7 1 0.1 0.2 0.3 0.01
ITEM: TIMESTEP
50
ITEM: TIME
0.5
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS ff ff ff
0 2
-1 1
0 4
ITEM: ATOMS element id type xs ys zs diameter vx vy vz
Si 9 2 0.5 0.5 0.25 0.02 1 2 3
O 8 1 0.25 0.75 0.5 0.04 4 5 6
"""
DATA = """LAMMPS data file

2 atoms
2 atom types
0 1 xlo xhi
0 1 ylo yhi
0 1 zlo zhi

Masses

1 1.0
2 1.0

Atoms # sphere

5 1 0.02 2500 0.1 0.2 0.3 0 0 0
3 2 0.04 2600 0.4 0.5 0.6 0 0 0

Velocities

3 1 2 3 4 5 6
5 7 8 9 10 11 12
"""
MERCURY = """1 0.0 0 0 0 1 1 1
0.1 0.2 0.3 1 2 3 0.01 0 0 0 4 5 6 0
2 0.5 0 0 0 1 1 1
0.4 0.5 0.6 1 1 1 0.02 0 0 0 2 2 2 0
0.7 0.8 0.9 3 3 3 0.03 0 0 0 5 5 5 1
"""


def written(folder, name, text):
    path = folder / name
    path.write_text(text)
    return path


def test_a_dump_with_scaled_places_diameters_and_words(tmp_path):
    grains = read_dump(written(tmp_path, "a", DUMP))
    np.testing.assert_allclose(grains.position, [[1, 0, 1], [0.5, 0.5, 2]])
    assert grains.radius.tolist() == [0.01, 0.02] and grains.velocity.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert grains.id.tolist() == [9, 8] and grains.type.tolist() == [2, 1] and grains.spin is None
    assert grains.ignored == ("element",) and grains.when == "time step 50"
    assert read_dump(tmp_path / "a", step=0).id.tolist() == [7]
    with gzip.open(tmp_path / "a.gz", "wt") as file:
        file.write(DUMP)
    assert read_dump(tmp_path / "a.gz").id.tolist() == [9, 8]


def test_a_data_file_with_velocities_in_another_order(tmp_path):
    grains = read_data(written(tmp_path, "a", DATA))
    np.testing.assert_allclose(grains.position, [[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    assert grains.radius.tolist() == [0.01, 0.02] and grains.id.tolist() == [5, 3]
    assert grains.velocity.tolist() == [[7, 8, 9], [1, 2, 3]] and grains.spin.tolist() == [[10, 11, 12], [4, 5, 6]]


def test_text_of_yade_and_mercury(tmp_path):
    grains = read_yade(written(tmp_path, "y", "#format x_y_z_r_attrs\n#x y z r m\n0.1 0.2 0.3 0.01 5\n1 2 3 0.02 6\n"))
    assert grains.position.tolist() == [[0.1, 0.2, 0.3], [1, 2, 3]] and grains.radius.tolist() == [0.01, 0.02]
    grains = read_mercury(written(tmp_path, "m", MERCURY))
    assert grains.radius.tolist() == [0.02, 0.03] and grains.spin.tolist() == [[2, 2, 2], [5, 5, 5]]
    assert grains.type.tolist() == [0, 1] and grains.when == "time 0.5"
    assert read_mercury(tmp_path / "m", step=0).position.tolist() == [[0.1, 0.2, 0.3]]


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [("a.dump.gz", DUMP, "lammps-dump"), ("a.lmp", DATA, "lammps-data"), ("a.txt", DUMP, "lammps-dump"),
     ("a", DATA, "lammps-data"),
     ("a.data", MERCURY, "mercury"), ("a.txt", "#format x_y_z_r\n1 2 3 4\n", "yade"), ("a.txt", "1 2 3 4\n", "yade")],
)  # fmt: skip
def test_the_format_is_told_by_name_or_first_lines(tmp_path, name, text, kind):
    assert format_of(written(tmp_path, name, text)) == kind


def test_a_format_that_is_not_known_is_told(tmp_path):
    with pytest.raises(SceneError, match="give --format lammps-dump | lammps-data"):
        format_of(written(tmp_path, "a", "hello\n"))


@pytest.mark.parametrize(
    ("text", "said"),
    [(DUMP.replace("\nO 8 1 0.25 0.75 0.5 0.04 4 5 6", ""), "time step 50: 1 of 2 grains are there: the file is cut off"),
     (DUMP.replace("diameter", "size"), "has no radius and no diameter; its columns are element id"),
     (DUMP.replace("xs ys zs", "a b c"), "has no positions x y z"), (DUMP.replace("0.02", "small"), "its rows are no numbers"),
     ("x" + DUMP, "'xITEM: TIMESTEP' stands where an ITEM must"),
     (DUMP.replace("ITEM: ATOMS", "ITEM: ENTRIES"), "dump of contacts"),
     (DUMP.replace("\n50\n", "\nfifty\n"), "lacks its TIMESTEP"), ("", "has no time step : it has none"),
     (DUMP.replace("2\n-1 1", "2 0\n-1 1 0").replace("BOX BOUNDS ff ff ff\n0 2", "BOX BOUNDS xy xz yz ff ff ff\n0 2"),
      "scaled positions of a box that is no cuboid"),
     (DUMP.replace("0 2\n-1 1", "0 2\nwide"), "time step 50: scaled positions need BOX BOUNDS, three lines of two numbers"),
     (DUMP.replace("ATOMS\n2\n", f"ATOMS\n{10**30}\n"), f"2 of {10**30} grains are there")],
)  # fmt: skip
def test_damaged_dumps_are_told(tmp_path, text, said):
    path = written(tmp_path, "a.dump", text)
    with pytest.raises(SceneError, match=said) as error:
        read_dump(path)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize(
    ("text", "said"),
    [(DATA.replace("2 atoms", "3 atoms"), "says 3 atoms, and its section Atoms has 2"),
     (DATA.replace("Atoms", "Bodies"), "is missing"),
     (DATA.replace("sphere", "bond"), "of the style 'bond'; read are sphere and granular"),
     (DATA.replace("0.3 0 0 0", "0.3").replace("0.6 0 0 0", "0.6").replace("2500 ", "").replace("2600 ", ""), "have 6 columns"),
     (DATA.replace("3 1 2 3 4 5 6", "4 1 2 3 4 5 6"), "section Velocities"),
     (DATA.replace("2500", "heavy"), "no table of numbers")],
)  # fmt: skip
def test_damaged_data_files_are_told(tmp_path, text, said):
    with pytest.raises(SceneError, match=said):
        read_data(written(tmp_path, "a.lmp", text))


@pytest.mark.parametrize(
    ("text", "said"),
    [(MERCURY[:-5], "must have 14|number of columns"), (MERCURY.replace("2 0.5 0", "9 0.5 0"), "2 of 9 grains are there"),
     ("1 0 0\n", "is no 'N time'"), ("", "it has 0 times")],
)  # fmt: skip
def test_damaged_files_of_mercury_are_told(tmp_path, text, said):
    with pytest.raises(SceneError, match=said):
        read_mercury(written(tmp_path, "a.data", text))


def test_bytes_that_are_no_text_and_gzip_that_is_none_are_told(tmp_path):
    (tmp_path / "a.dump").write_bytes(b"ITEM: TIMESTEP\n\xff\xfe\n")
    (tmp_path / "b.dump.gz").write_bytes(b"ITEM: TIMESTEP\n")
    (tmp_path / "c.dump.gz").write_bytes(gzip.compress(DUMP.encode())[:-20])
    for name in ("a.dump", "b.dump.gz", "c.dump.gz"):
        with pytest.raises(SceneError, match="cannot be read as a dump"):
            read_dump(tmp_path / name)


@pytest.mark.parametrize("suffix", [".npz", ".csv"])
def test_a_state_file_is_what_a_scene_reads(tmp_path, suffix):
    notes = write_state_file(written(tmp_path, "a.lmp", DATA), tmp_path / f"g{suffix}", unit="mm")
    fields = read_grain_file(tmp_path / f"g{suffix}", "k")
    np.testing.assert_allclose(fields["position"], np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]) * 1e-3)
    np.testing.assert_allclose(fields["velocity"], np.array([[7, 8, 9], [1, 2, 3]]) * 1e-3)
    np.testing.assert_allclose(fields["spin"], [[10, 11, 12], [4, 5, 6]])
    assert fields["radius"].tolist() == pytest.approx([1e-5, 2e-5]) and fields["id"].tolist() == [5, 3]
    assert notes[0].startswith("2 grains of a data file") and "types 1, 2 are all in it" in notes[1] and "density" in notes[2]
    write_state_file(tmp_path / "a.lmp", tmp_path / f"t{suffix}", only_type=2)
    assert read_grain_file(tmp_path / f"t{suffix}", "k")["id"].tolist() == [3]


@pytest.mark.parametrize(
    ("keys", "said"),
    [({"only_type": 5}, "--type 5: .* has the types 1, 2"),
     ({"unit": "lj"}, "--units lj: is unknown; allowed are si"),
     ({"kind": "edem"}, "--format edem: is unknown"),
     ({"step": 3}, "--step 3: a file of the format lammps-data holds one time only")],
)  # fmt: skip
def test_wrong_choices_are_told(tmp_path, keys, said):
    with pytest.raises(SceneError, match=said):
        write_state_file(written(tmp_path, "a.lmp", DATA), tmp_path / "g.npz", **keys)
    assert not (tmp_path / "g.npz").exists()


def test_the_command_and_names_that_cannot_be(tmp_path, capsys):
    path = written(tmp_path, "a.dump", DUMP)
    cli.app(["grains", str(path), str(tmp_path / "g.npz"), "--step", "0"], result_action="return_value")
    assert "1 grains of time step 0" in capsys.readouterr().out
    for target, said in (("g.npz", "is there already"), ("g.txt", r"ends in .npz or .csv")):
        with pytest.raises(SceneError, match=said):
            cli.app(["grains", str(path), str(tmp_path / target)], result_action="return_value")
    with pytest.raises(SceneError, match="no such file"):
        cli.app(["grains", str(tmp_path / "none"), str(tmp_path / "h.npz")], result_action="return_value")


CODE = """units si
atom_style {style}
boundary f f f
newton off
region b block -0.1 0.1 -0.1 0.1 -0.1 0.1
create_box 1 b
create_atoms 1 single 0.01 0.02 0.03
create_atoms 1 single -0.01 0.02 0.05
set group all diameter 0.004
set group all density 2500
velocity all set 0.1 0.2 -0.3
{more}
dump d all custom 1 a.dump id type x y z vx vy vz omegax omegay omegaz radius
run 0
write_data a.lmp
"""


@pytest.mark.parametrize(
    ("program", "style", "more"),
    [("lmp", "sphere", "pair_style none\ncomm_modify cutoff 0.01"),
     ("liggghts", "granular", "communicate single vel yes\natom_modify sort 0 0\npair_style none")],
)  # fmt: skip
def test_what_the_programs_write_is_read(program, style, more, tmp_path):
    if shutil.which(program) is None:  # no extra of this package installs it
        pytest.skip(f"{program} is not installed")
    written(tmp_path, "in.x", CODE.format(style=style, more=more))
    done = subprocess.run([program, "-in", "in.x", "-log", "none"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-1000:]
    for read in (read_dump, read_data):
        grains = read(tmp_path / ("a.dump" if read is read_dump else "a.lmp"))
        order = np.argsort(grains.position[:, 0])
        np.testing.assert_allclose(grains.position[order], [[-0.01, 0.02, 0.05], [0.01, 0.02, 0.03]], rtol=1e-5)
        np.testing.assert_allclose(grains.velocity, [[0.1, 0.2, -0.3]] * 2, rtol=1e-5)
        np.testing.assert_allclose(grains.radius, 0.002)
    write_state_file(tmp_path / "a.dump", tmp_path / "g.npz")
    scene = {
        "base": tmp_path,
        "materials": {"g": {"density": 2500.0, "young_modulus": 5e6, "poisson_ratio": 0.3}},
        "contact": {"tangential": "none"},
        "pairs": [{"materials": ["g", "g"], "restitution": 0.5}],
        "grains": [{"material": "g", "file": "g.npz"}],
        "time": {"end": 0.01, "step": 1e-5, "max_speed": 0.5},
    }
    sim = Simulation(Scene.model_validate(scene), device="cpu", threads=1)
    np.testing.assert_allclose(sim.particles.velocity, [[0.1, 0.2, -0.3]] * 2, rtol=1e-5)
