"""The errors that a user can cause in a scene or on the command line, each with what its message says.

One row is a change to a sound scene, and parts of the answer: the file, the key, the value, and what is allowed. All of
them come before anything is computed.
"""

import sys

import numpy as np
import pytest
import trimesh

from warpdem import SceneError, Simulation, load_scene
from warpdem.app import cli

pytestmark = pytest.mark.filterwarnings("ignore:Cyclopts application invoked without tokens")

SCENE = """
[materials.glass]
density = 2500
young_modulus = "10 MPa"
poisson_ratio = 0.25

[contact]
rolling = "constant"

[[pairs]]
materials = ["glass", "glass"]
restitution = 0.6
friction = 0.5
rolling_friction = 0.1

[[grains]]
material = "glass"
positions = [[0, 0, 0.002], [0.003, 0, 0.002], [0, 0.003, 0.002]]
radius = "1 mm"

[[walls]]
name = "floor"
material = "glass"
plane = { point = [0, 0, 0], normal = [0, 0, 1] }

[[walls]]
name = "tub"
material = "glass"
mesh = "tub.stl"

[time]
end = "1 ms"
step = "5 us"
max_speed = 0.5
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Folder of the scene, with sound and damaged files beside it."""
    folder = tmp_path_factory.mktemp("scene")
    (folder / "bed.toml").write_text(SCENE)
    tub = trimesh.creation.box((0.04, 0.04, 0.04))
    tub.export(folder / "tub.stl")
    tub.update_faces(np.arange(len(tub.faces)) > 0)
    tub.export(folder / "open.stl")
    (folder / "nan.obj").write_text("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n")
    (folder / "empty.stl").write_text("solid nothing\nendsolid nothing\n")
    for name in ("junk.stl", "junk.npz", "junk.usda"):
        (folder / name).write_bytes(b"nonsense")
    np.savez(folder / "none.npz", position=np.zeros((0, 3)), radius=np.zeros(0))
    np.savez(folder / "nan.npz", position=np.array([[0, 0, np.nan]]), radius=np.ones(1))
    np.savez(folder / "short.npz", position=np.zeros((2, 3)), radius=np.ones(3))
    np.savez(folder / "code.npz", position=np.array([print], dtype=object), radius=np.ones(1))
    (folder / "column.csv").write_text("x,y,z,radius,colour\n1,2,3,4,5\n")
    (folder / "text.csv").write_text("x,y,z,radius\n1,2,three,4\n")
    return folder


def fill(text: str) -> str:
    return f"grains=[{{material='glass', fill={{wall='tub', {text}}}}}]"


def stream(text: str, low="[0, 0, 0.01]", high="[0.01, 0.01, 0.02]") -> str:
    return f"streams=[{{material='glass', box={{min={low}, max={high}}}, diameter='2 mm', {text}}}]"


def shape(text: str) -> str:
    return f"walls.0={{name='s', material='glass', {text}}}"


TABLE = {
    # types and ranges
    "density=0": ("materials.glass.density=0", ["materials.glass.density = 0", "> 0", "[kg/m3]"]),
    "density=nan": ("materials.glass.density=nan", ["materials.glass.density = NaN", "finite", "[kg/m3]"]),
    "density=inf": ("materials.glass.density=inf", ["materials.glass.density = Infinity", "finite"]),
    "density=true": ("materials.glass.density=true", ["materials.glass.density = true", "a density", "[kg/m3]"]),
    "poisson": ("materials.glass.poisson_ratio=0.7", ["materials.glass.poisson_ratio = 0.7", "> -1 and <= 0.5"]),
    "restitution": ("pairs.0.restitution=0", ["pairs[0].restitution = 0", "> 0 and <= 1"]),
    "friction": ("pairs.0.friction=-0.1", ["pairs[0].friction = -0.1", ">= 0"]),
    "gravity length": ("gravity=[0, 0]", ["gravity = [0, 0]", "list of 3 numbers in [m/s2]"]),
    "gravity inf": ("gravity=[0, 0, inf]", ["gravity[2] = Infinity", "finite", "[m/s2]"]),
    "table as number": ("time=3", ["time = 3", "must be a table, such as [time]"]),
    "list as table": ("grains={}", ["grains", "must be a list of tables: write [[grains]]"]),
    "flag": ("output.picture=maybe", ['output.picture = "maybe"', "true or false"]),
    "overlap share": ("engine.max_overlap=0", ["engine.max_overlap = 0", "> 0 and <= 1"]),
    "end": ("time.end=0", ["time.end = 0", "> 0 [s]"]),
    "max_speed": ("time.max_speed=0", ["time.max_speed = 0", "> 0 [m/s]"]),
    "interval": ("output.interval=-1", ["output.interval = -1", "> 0 [s]"]),
    "no materials": ("materials={}", ["materials", "needs 1 or more entries, has 0"]),
    # units
    "other dimension": (
        "materials.glass.young_modulus='50 kg'",
        ['young_modulus = "50 kg"', "[Pa]", '"50 MPa"', "not a pressure or a modulus"],
    ),
    "no such unit": ("materials.glass.density='2500 kgm3'", ["density", '"kgm3" is no known unit', '"2.6 g/cm^3"']),
    "number in quotes": ("time.end='1'", ['time.end = "1"', "without quotes"]),
    "rpm as frequency": ("frame={amplitude=[0, 0, 1e-3], frequency='50 rpm'}", ["frame.frequency", '"50 Hz"', '"rpm" is not']),
    "Hz as rate": ("frame={axis=[0, 0, 1], rate='30 Hz'}", ["frame.rate", "rpm or rad/s"]),
    "mass rate": (stream("mass_rate='1 kg'"), ["streams[0].mass_rate", "[kg/s]", '"kg" is not a mass rate']),
    "angle": ("walls.1.rotate={axis=[0, 0, 1], angle='90 mm'}", ["walls[1].rotate.angle", '"90 deg"', '"mm" is not an angle']),
    # unknown keys and choices
    "misspelt key": ("pairs.0.fricton=0.3", ["pairs[0].fricton", "unknown key", 'did you mean "friction"?']),
    "misspelt table": ("walla=[]", ["walla", "unknown key", 'did you mean "walls"?']),
    "key of another table": ("interval=1", ["interval = 1", "exists as output.interval"]),
    "nothing alike": (
        "materials.glass.color=red",
        ["materials.glass.color", "known here: density, young_modulus, poisson_ratio"],
    ),
    "two kinds of motion": ("frame={axis=[0, 0, 1], rate=1, velocity=[0, 0, 1]}", ["frame.velocity", "another kind of table"]),
    "misspelt law": ("contact.normal=hertzz", ['contact.normal = "hertzz"', '"hertz", ', 'did you mean "hertz"?']),
    "integrator": ("engine.integrator=verlet", ["engine.integrator", '"exact_drift"', '"velocity_verlet"', '"lobatto"']),
    "precision": ("engine.precision=single", ['engine.precision = "single"', '"double" or "mixed"']),
    "format": ("output.formats=['vtk', 'xyz']", ['output.formats[1] = "xyz"', '"vtk"', '"usd"']),
    "fixed_to": ("walls.0.fixed_to=lab", ['walls[0].fixed_to = "lab"', '"frame" or "laboratory"']),
    "border kind": ("borders={x={kind='closed', min=-1}}", ['borders.x.kind = "closed"', '"periodic", "open" or "stop"']),
    "reduction": ("observers=[{name='a', model='speed', reduce=['median']}]", ["observers[0].reduce[0]", '"mean"']),
    "observer": ("observers=[{name='a', model='sped'}]", ["observers[0].model", 'did you mean "speed"?']),
    # names
    "no such material": ("walls.1.material=steel", ['walls[1].material = "steel"', 'the scene has "glass"']),
    "wall twice": ("walls.1.name=floor", ["walls[1].name", "walls[0] has this name too"]),
    "outlet twice": (
        "outlets=[{name='o', box={min=[8, 8, 8], max=[9, 9, 9]}}, {name='o', box={min=[8, 8, 8], max=[9, 9, 9]}}]",
        ["outlets[1].name", "outlets[0] has this name too"],
    ),
    "observer twice": (
        "observers=[{name='a', model='speed'}, {name='a', model='speed'}]",
        ["observers[1].name", "observers[0] has this name too"],
    ),
    "name with a blank": ("walls.0.name='the floor'", ["walls[0].name", "letters, digits, _ and -"]),
    "id twice": ("grains.0.ids=[1, 1, 2]", ["grains[0].ids = [1, 1, 2]", "unique; 1 is given 2 times"]),
    "point of a box": (
        "grains=[{material='glass', fill={box={min=[0, 0, 0], max=[1, 1, 1]}, point=[0, 0, 0], count=1, diameter='2 mm'}}]",
        ["grains[0].fill.point", "a region is filled completely"],
    ),
    "stream behind a wall": (
        stream("mass_rate=1", low="[0, 0, -0.02]", high="[0.01, 0.01, -0.01]"),
        ["streams[0].box", "clear of the wall 'floor'", "move the box off it"],
    ),
    "tile with a diameter": (
        "grains=[{material='glass', fill={tile='bed.h5', diameter='2 mm'}}]",
        ["grains[0].fill.diameter", "belongs to a packing"],
    ),
    "copies of nothing": (
        "grains=[{material='glass', fill={wall='tub', count=1, diameter='2 mm', copies=[2, 1, 1]}}]",
        ["grains[0].fill.copies", "belongs to a tile"],
    ),
    "no copies": (
        "grains=[{material='glass', fill={tile='bed.h5', copies=[2, 0, 1]}}]",
        ["grains[0].fill.copies[1]", "must be >= 1"],
    ),
    "missing tile": (
        "grains=[{material='glass', fill={tile='bed.h5'}}]",
        ["grains[0].fill.tile", "no such file", "bed.h5"],
    ),
    "tile of another kind": (
        "grains=[{material='glass', fill={tile='bed.stl'}}]",
        ["grains[0].fill.tile", "must be a file ending in .h5"],
    ),
    "fill without wall": (
        "grains=[{material='glass', fill={wall='cup', count=1, diameter='2 mm'}}]",
        ["grains[0].fill.wall", "no such wall", '"tub"'],
    ),
    # contradictory choices
    "no rate": ("frame={axis=[0, 0, 1]}", ["frame", "exactly one of rate, schedule, sinusoid, table; found none"]),
    "two shapes": (
        shape("sphere={centre=[0, 0, 0], radius=1}, plane={point=[0, 0, 0], normal=[0, 0, 1]}"),
        ["walls[0]", "exactly one of mesh, plane", "found plane and sphere"],
    ),
    "two sizes": ("grains.0.radii=[1e-3, 1e-3, 1e-3]", ["grains[0]", "exactly one of radius, radii", "radius and radii"]),
    "columns of two lengths": ("grains.0.ids=[1, 2]", ["grains[0].ids", "as many entries as positions (3), has 2"]),
    "hooke without stiffness": ("contact.normal=hooke", ["pairs[0].stiffness", "hooke", "[N/m]"]),
    "adhesion without its energy": ("contact.normal=dmt", ["pairs[0].surface_energy", "needs a surface energy [J/m2], >= 0"]),
    "negative surface energy": ("pairs.0.surface_energy=-0.1", ["pairs[0].surface_energy = -0.1", ">= 0 [J/m2]"]),
    "key of another law": ("pairs.0.tail_length='1 um'", ["pairs[0].tail_length", 'contact.normal = "dmt"; it is "hertz"']),
    "cohesion in another unit": (
        "pairs.0.cohesion_energy_density='1 J/m^2'",
        ["pairs[0].cohesion_energy_density", "must be an energy density", "[J/m3]"],
    ),
    "cohesion without its law": ("pairs.0.cohesion_energy_density=5", ['only for contact.normal = "sjkr"; it is "hertz"']),
    "luding without its stiffness": (
        "contact.normal=luding",
        ["needs a stiffness [N/m]", "pairs[0].unloading_stiffness", "needs an unloading stiffness [N/m], > 0"],
    ),
    "jkr without its energy": ("contact.normal=jkr", ["pairs[0].surface_energy", '"jkr" needs a surface energy [J/m2], >= 0']),
    "surface energy in another unit": ("pairs.0.surface_energy='1 mN'", ["pairs[0].surface_energy", "a surface energy"]),
    "tensile exponent between the halves": (
        "pairs.0={materials=['glass', 'glass'], restitution=0.5, surface_energy=0.1, tensile_exponent=1.7}",
        ["pairs[0].tensile_exponent", '"edinburgh"'],
    ),
    "friction without law": ("contact.tangential=none", ["pairs[0].friction = 0.5", "set friction = 0"]),
    "rolling without law": ("contact.rolling=none", ["pairs[0].rolling_friction = 0.1", "set rolling_friction = 0"]),
    "pose of a plane": ("walls.0.translate=[0, 0, 1]", ["walls[0].translate", "only for a mesh"]),
    "step over end": ("time.step=3", ["time.step = 3", "time.end = 0.001 s"]),
    "pair missing": ("pairs=[]", ["pairs", 'materials = ["glass", "glass"]']),
    "contacts in no format": ("output={contacts=true, formats=['usd']}", ["output.contacts", '"vtk"']),
    "field without its number": (
        "fields=[{model='harmonic'}]",
        ["fields[0].parameters.stiffness", "missing: 1 number in [N/m]"],
    ),
    "field's misspelt number": (
        "fields=[{model='drag', parameters={coeficient=1}}]",
        ["fields[0].parameters.coeficient", 'did you mean "coefficient"?'],
    ),
    "start beside grains": ("start={checkpoint='no.h5'}", ["grains", "cannot be given together with start"]),
    "budget of another scheme": (
        "measures={energy=true} ;; engine.integrator=rk4",
        ["measures.energy = true", 'engine.integrator = "exact_drift"; it is "rk4"'],
    ),
    "misspelt measure": ("measures={energ=true}", ["measures.energ", 'did you mean "energy"?']),
    # phases
    "phase twice": ("phases=[{name='a'}, {name='a'}]", ["phases[1].name", "phases[0] has this name too"]),
    "phase's unknown key": ("phases=[{name='a', tme={end=1}}]", ["phases[0].tme", 'did you mean "time"?']),
    "phase's wrong value": ("phases=[{name='a', time={end=-1}}]", ["phases[0].time.end = -1", "> 0 [s]"]),
    "phase's misspelt key": (
        "phases=[{name='a', time={end=1, stp=1}}]",
        ["phases[0].time.stp", 'did you mean "step"?'],
    ),
    "phase's half a wall": (
        "phases=[{name='a', walls=[{name='lid', motion={axis=[0, 0, 1], rate=1}}]}]",
        ["phases[0].walls[0].material", "missing: Name of the material"],
    ),
    "phase changes grains": ("phases=[{name='a', start={checkpoint='a.h5'}}]", ["phases[0].start", "cannot change this"]),
    "phase takes nothing away": ("phases=[{name='a', without=['lid']}]", ["phases[0].without", "lid"]),
    # streams, outlets, borders, frames
    "stream without rate": (stream("start=0"), ["streams[0]", "exactly one of mass_rate, count_rate; found none"]),
    "stream ends before it starts": (stream("mass_rate=1, start=2, until=1"), ["streams[0].until", "later than start = 2 s"]),
    "stream too narrow": (
        stream("mass_rate=1", high="[0.001, 0.01, 0.02]"),
        ["streams[0].box", "shortest side of 0.001 m", "largest grain, 0.002 m"],
    ),
    "stream into an outlet": (
        stream("mass_rate=1") + " ;; outlets=[{name='o', box={min=[0, 0, 0.015], max=[1, 1, 1]}}]",
        ["streams[0].box", 'overlaps the box of the outlet "o"'],
    ),
    "stream beyond a border": (
        stream("mass_rate=1") + " ;; borders={x={kind='open', min=0.005}}",
        ["streams[0].box.min[0] = 0.0", "below borders.x.min = 0.005 m"],
    ),
    "box without inside": ("outlets=[{name='o', box={min=[0, 0, 0], max=[0, 0, 1]}}]", ["outlets[0].box.max", "above min"]),
    "grain in an outlet": (
        "outlets=[{name='o', box={min=[-1, -1, -1], max=[1, 1, 1]}}]",
        ["grain 0", "starts in the outlet o", "3 of 3 grains"],
    ),
    "grain beyond a border": ("borders={z={kind='open', min=0.0025}}", ["grain 0", "starts beyond the border z min"]),
    "half a periodic axis": ("borders={x={kind='periodic', min=-1}}", ["borders.x.kind", "needs min and max"]),
    "short periodic axis": ("borders={x={kind='periodic', min=-0.001, max=0.001}}", ["borders.x", "0.002 m", "2.05 diameters"]),
    "periodic across the turn": (
        "frame={axis=[0, 0, 1], rate=1} ;; borders={x={kind='periodic', min=-0.1, max=0.1}}",
        ["borders.x", "the frame turns about another axis"],
    ),
    "falling schedule": (
        "frame={axis=[0, 0, 1], schedule=[{until=2, rate=1}, {until=1, rate=2}]}",
        ["frame.schedule[1].until = 1", "later than 2 s"],
    ),
    "table that stands": ("frame={axis=[0, 0, 1], table=[[0, 1], [0, 2]]}", ["frame.table[1][0]", "later than 0 s"]),
    "zero axis": ("frame={axis=[0, 0, 0], rate=1}", ["frame.axis", "must not be the zero vector"]),
    # files
    "no mesh": ("walls.1.mesh=tob.stl", ['walls[1].mesh = "tob.stl"', "no such file", "similar files there: tub.stl"]),
    "mesh outside": ("walls.1.mesh=../tub.stl", ['walls[1].mesh = "../tub.stl"', "outside the folders", "--allow-path"]),
    "mesh from the net": ("walls.1.mesh=https://a.b/tub.stl", ["walls[1].mesh", "nothing is read over a network"]),
    "mesh of another kind": ("walls.1.mesh=tub.iges", ["walls[1].mesh", ".stl, .obj, .ply"]),
    "open mesh": (
        "walls.1.mesh=open.stl",
        ["walls[1].mesh", "open.stl", "3 open edges", "; if it is open on purpose, add open = true to this wall"],
    ),
    "filling of an open mesh": (
        "walls.1.mesh=open.stl ;; walls.1.open=true ;; " + fill("count=10, diameter='2 mm'"),
        ["grains[0].fill", "open.stl", "would run out at about (-0.0", "0.0197 m wide", "close it with a wall (a gate)"],
    ),
    "empty mesh": ("walls.1.mesh=empty.stl", ["walls[1].mesh", "empty.stl", "0 triangles"]),
    "damaged mesh": ("walls.1.mesh=junk.stl", ["walls[1].mesh", "junk.stl (8 bytes)", "cannot be read as a mesh"]),
    "mesh with nan": ("walls.1.mesh=nan.obj", ["walls[1].mesh", "nan.obj", "not a finite number"]),
    "mesh too small": (
        "walls.1.scale=1e-4",
        ["walls[1].mesh", "tub.stl", "0.002 diameters", "check the scale", "and the unit of the grains' diameters"],
    ),
    "diameters without unit": ("grains.0.radius=1", ["walls[1].mesh", "0.02 diameters", "scale = 1000", 'as in "2 mm"']),
    "code": ("contact.normal=law.py", ['contact.normal = "law.py"', "may not load by itself", "--plugin"]),
    "USD of another kind": ("frame={usd='tub.stl', prim='/A'}", ["frame.usd", "ending in .usd, .usda, .usdc, .usdz"]),
    "damaged USD": ("frame={usd='junk.usda', prim='/A'}", ["frame", "junk.usda", "cannot be read"]),
    "no checkpoint": ("start={checkpoint='no.h5'} ;; grains=[]", ["start.checkpoint", "no such file"]),
    "foreign checkpoint": ("start={checkpoint='junk.npz'} ;; grains=[]", ["junk.npz", "not a checkpoint"]),
    "checkpoint outside": ("start={checkpoint='../a.h5'} ;; grains=[]", ["start.checkpoint", "outside the folders"]),
    "no USD": ("walls.1.motion={usd='no.usda', prim='/A'}", ["walls[1].motion.usd", "no such file"]),
    "no grains in the file": (
        "grains=[{material='glass', file='none.npz'}]",
        ["grains[0].file", "none.npz", "holds no grains"],
    ),
    "nan in the file": (
        "grains=[{material='glass', file='nan.npz'}]",
        ["grains[0].file", "nan.npz: row 1: position", "finite"],
    ),
    "shapes in the file": ("grains=[{material='glass', file='short.npz'}]", ["grains[0].file", "(2, 3), must be (3, 3)"]),
    "damaged state": ("grains=[{material='glass', file='junk.npz'}]", ["grains[0].file", "junk.npz", "cannot be read as .npz"]),
    "objects in the file": (
        "grains=[{material='glass', file='code.npz'}]",
        ["grains[0].file", "no archive of plain arrays"],
    ),
    "unknown column": (
        "grains=[{material='glass', file='column.csv'}]",
        ["column.csv", "'colour'", "allowed: x, y, z, radius"],
    ),
    "text in a column": ("grains=[{material='glass', file='text.csv'}]", ["text.csv", "'three'", "row 0, column 3"]),
    # the start
    "overlap": (
        "grains.0.positions=[[0, 0, 0.002], [0.0015, 0, 0.002], [0, 0.003, 0.002]]",
        ["grain 0 at (0, 0, 0.002) m and grain 1", "0.5 of the smaller radius", "allowed at the start is 0.1"],
    ),
    "two in one place": (
        "grains.0.positions=[[0, 0, 0.002], [0, 0, 0.002], [0, 0.003, 0.002]]",
        ["grain 0 at (0, 0, 0.002) m and grain 1", "coincide"],
    ),
    "nan in a position": (
        "grains.0.positions=[[0, 0, nan], [0, 0, 0.01], [0, 0, 0.02]]",
        ["grains[0].positions", "entry [0][2] = nan: must be finite"],
    ),
    "behind a plane": (
        "grains.0.positions=[[0, 0, -0.002], [0.003, 0, 0.002], [0, 0.003, 0.002]]",
        ["walls[0].plane", "grain 0", "0.002 m behind the plane 'floor'", "1 of 3"],
    ),
    "outside the mesh": (
        "grains.0.positions=[[0, 0, 0.002], [0.003, 0, 0.002], [0, 0.03, 0.002]]",
        ["grains[0].positions[2] (0, 0.03, 0.002) m is outside the closed mesh 'tub' (walls[1].mesh)", "2 grains are inside"],
    ),
    "in the mesh, most outside": (
        "grains.0.positions=[[0, 0, 0.002], [0, 0.04, 0.002], [0, 0.03, 0.002]]",
        ["grains[0].positions[0] (0, 0, 0.002) m is inside the closed mesh 'tub' (walls[1].mesh)", "2 grains are outside"],
    ),
    "into a plane": (
        "grains.0.positions=[[0, 0, 0.0005], [0.003, 0, 0.002], [0, 0.003, 0.002]]",
        ["walls[0]", "grain 0 at (0, 0, 0.0005) m", "0.0005 m into the wall 'floor'", "0.5 of its radius", "is 0.1", "1 of 3"],
    ),
    "into a closed mesh": (
        "grains.0.positions=[[0, 0, 0.002], [0.003, 0, 0.002], [0, 0.0198, 0.002]]",
        ["walls[1]", "grain 2", "0.0008 m into the wall 'tub'", "0.8 of its radius"],
    ),
    "into an open mesh": (
        "walls.1={name='tub', material='glass', mesh='open.stl', open=true} ;; "
        "grains.0.positions=[[0, 0, 0.002], [0.003, 0, 0.002], [0, 0.0202, 0.002]]",
        ["walls[1]", "grain 2", "0.0008 m into the wall 'tub'", "0.8 of its radius"],
    ),
    "into an open cylinder": (
        shape("cylinder={point=[0.0025, 0, -0.1], axis=[0, 0, 1], radius='2 mm', length=0.3}"),
        ["walls[0]", "grain 0", "0.0005 m into the wall 's'", "1 of 3 grains"],
    ),
    "does not fit in": (
        shape("cylinder={point=[0, 0, -0.1], axis=[0, 0, 1], radius='0.5 mm', inside=true}"),
        ["walls[0].cylinder", "grain 0", "does not fit into 's'", "radius there is 0.0005 m"],
    ),
    "more than fits": (fill("count=100000, diameter='2 mm'"), ["grains[0].fill", "solid fraction of 13.1", "at most 0.74"]),
    "solid fraction": (fill("solid_fraction=0.9, diameter='2 mm'"), ["grains[0].fill.solid_fraction = 0.9", "<= 0.74"]),
    "sizes upside down": (
        fill("count=10, diameter={uniform=['2 mm', '1 mm']}"),
        ["grains[0].fill.diameter.uniform", "must not be above the second"],
    ),
    "short row of a sieve curve": (
        fill("count=10, diameter={cumulative=[['1 mm'], ['2 mm', 1]]}"),
        ["grains[0].fill.diameter.cumulative[0]", "an entry is missing", "Rows [diameter [m]"],
    ),
    "orientation of a filling": (
        fill("count=10, orientation='upwards'"),
        ["grains[0].fill.orientation = \"upwards\"", 'must be "random" or "aligned"'],
    ),
    "prim that is no path": ("frame={usd='plant.usda', prim='Arm'}", ["frame.prim", 'a prim, such as "/World/Drum"']),
    "region beside": (
        fill("count=10, diameter='2 mm', region={min=[1, 1, 1], max=[2, 2, 2]}"),
        ["grains[0].fill", "does not meet the mesh tub.stl"],
    ),
    # the time step
    "step over the limit": ("time.step='0.2 ms'", ["time.step = 0.0002 s", "stability limit", "'auto' would take"]),
    "step as a word": ("time.step=fast", ['time.step = "fast"', '"20 ms", or "auto"']),
}


@pytest.mark.parametrize("row", TABLE)
def test_error_names_file_key_value_and_what_is_allowed(folder, row):
    change, words = TABLE[row]
    with pytest.raises(SceneError) as error:
        Simulation(load_scene(folder / "bed.toml", change.split(" ;; ")), device="cpu", threads=1)
    text = str(error.value)
    assert error.value.exit_code == 2
    for word in [str(folder / "bed.toml"), *words]:
        assert word in text, text
    for noise in ("pydantic", "Input should", "union", "Value error", "~", "literal[", "Traceback"):
        assert noise not in text, text


def test_the_scene_of_the_table_is_sound(folder):
    assert len(Simulation(load_scene(folder / "bed.toml"), device="cpu", threads=1).state) == 3


def test_all_errors_of_a_file_come_at_once(folder):
    changes = ["materials.glass.density=0", "pairs.0.fricton=1", "time.end='1 m'", "walls.1.mesh=tub.iges"]
    with pytest.raises(SceneError, match="4 problems"):
        load_scene(folder / "bed.toml", changes)


COMMANDS = {
    "no scene": (("check", "bad.toml"), ["bad.toml", "no such file", "similar files there: bed.toml"]),
    "a folder": (("check", "."), ["is a folder", "similar files there: bed.toml"]),
    "no TOML": (("check", "junk.npz"), ["junk.npz", "not valid TOML"]),
    "bad --set": (("check", "bed.toml", "--set", "time.end"), ["time.end", "KEY=VALUE"]),
    "--set of no key": (("check", "bed.toml", "--set", "time.ned=1"), ["time.ned", 'did you mean "end"?']),
    "--set beyond a list": (("check", "bed.toml", "--set", "walls.7.scale=1"), ["walls is a list of 2", "0 to 1"]),
    "no device": (("check", "bed.toml", "--device", "cuda:9"), ["device = 'cuda:9'", "there is cpu"]),
    "no threads": (("check", "bed.toml", "--device", "cpu", "--threads", "0"), ["threads = 0", "at least 1"]),
    "threads as a word": (("check", "bed.toml", "--threads", "two"), ["--threads", "two"]),
    "no plugin": (("check", "bed.toml", "--plugin", "law.py"), ["--plugin law.py", "must be an existing file"]),
    "no folder": (("check", "bed.toml", "--allow-path", "nowhere"), ["--allow-path nowhere", "no such folder"]),
    "no checkpoint": (("run", "bed.toml", "--out", "new", "--resume"), ["checkpoint.h5", "no checkpoint there"]),
    "unknown option": (("run", "bed.toml", "--treads", "2"), ["--treads"]),
}


@pytest.mark.parametrize("row", COMMANDS)
def test_wrong_command_is_answered_by_what_is_wrong(folder, monkeypatch, capfd, row):
    arguments, words = COMMANDS[row]
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr(sys, "argv", ["warpdem", *arguments])
    with pytest.raises(SystemExit) as stop:
        cli.main()
    out, error = capfd.readouterr()
    assert stop.value.code == 2
    for word in words:
        assert word in out + error, out + error
    assert "Traceback" not in out + error
