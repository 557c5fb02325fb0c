"""STEP files: a cylinder written by hand is divided within the tolerance, and what is said of a missing library or part."""

import math

import numpy as np
import pytest

from warpdem import SceneError, load_scene
from warpdem.mesh import step_file
from warpdem.mesh.triangle_mesh import load_mesh

RADIUS, LENGTH = 0.01, 0.04
HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
"""
BODY = """#1=APPLICATION_CONTEXT('');
#2=PRODUCT_CONTEXT('',#1,'mechanical');
#3=PRODUCT('drum','drum','',(#2));
#4=PRODUCT_DEFINITION_FORMATION('','',#3);
#5=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#6=PRODUCT_DEFINITION('design','',#4,#5);
#7=PRODUCT_DEFINITION_SHAPE('','',#6);
#8=SHAPE_DEFINITION_REPRESENTATION(#7,#20);
#10=(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT((#11,#12,#13))REPRESENTATION_CONTEXT('',''));
#11=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT({unit},.METRE.));
#12=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));
#13=(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT());
#20=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#24,#30),#10);
#21=CARTESIAN_POINT('',(0.,0.,0.));
#22=DIRECTION('',(0.,0.,1.));
#23=DIRECTION('',(1.,0.,0.));
#24=AXIS2_PLACEMENT_3D('',#21,#22,#23);
#25=CARTESIAN_POINT('',(0.,0.,{length:.17g}));
#26=AXIS2_PLACEMENT_3D('',#25,#22,#23);
#30=MANIFOLD_SOLID_BREP('',#31);
#31=CLOSED_SHELL('',(#40,#50,#60));
#32=CARTESIAN_POINT('',({radius:.17g},0.,0.));
#33=CARTESIAN_POINT('',({radius:.17g},0.,{length:.17g}));
#34=VERTEX_POINT('',#32);
#35=VERTEX_POINT('',#33);
#36=CIRCLE('',#24,{radius:.17g});
#37=CIRCLE('',#26,{radius:.17g});
#38=VECTOR('',#22,1.);
#39=LINE('',#32,#38);
#40=ADVANCED_FACE('',(#41),#47,.T.);
#41=FACE_BOUND('',#42,.T.);
#42=EDGE_LOOP('',(#43,#44,#45,#46));
#43=ORIENTED_EDGE('',*,*,#70,.T.);
#44=ORIENTED_EDGE('',*,*,#72,.T.);
#45=ORIENTED_EDGE('',*,*,#71,.F.);
#46=ORIENTED_EDGE('',*,*,#72,.F.);
#47=CYLINDRICAL_SURFACE('',#24,{radius:.17g});
#50=ADVANCED_FACE('',(#51),#54,.F.);
#51=FACE_BOUND('',#52,.F.);
#52=EDGE_LOOP('',(#53));
#53=ORIENTED_EDGE('',*,*,#70,.T.);
#54=PLANE('',#24);
#60=ADVANCED_FACE('',(#61),#64,.T.);
#61=FACE_BOUND('',#62,.T.);
#62=EDGE_LOOP('',(#63));
#63=ORIENTED_EDGE('',*,*,#71,.T.);
#64=PLANE('',#26);
#70=EDGE_CURVE('',#34,#34,#36,.T.);
#71=EDGE_CURVE('',#35,#35,#37,.T.);
#72=EDGE_CURVE('',#34,#35,#39,.T.);
ENDSEC;
END-ISO-10303-21;
"""


def cylinder(path, unit="$", factor=1.0):
    """A solid cylinder around z, its foot at the origin, in metres or another unit."""
    path.write_text(HEAD + BODY.format(unit=unit, radius=factor * RADIUS, length=factor * LENGTH), encoding="ascii")
    return path


@pytest.mark.parametrize(("unit", "factor", "tolerance"), [("$", 1.0, 1e-4), (".MILLI.", 1000.0, 1e-5)])
def test_a_cylinder_is_a_prism_within_the_tolerance(tmp_path, unit, factor, tolerance):
    """All corners on the cylinder: n of them have a sagitta of R (1 - cos(pi/n)); the note says that it was measured."""
    pytest.importorskip("cascadio")
    mesh = load_mesh(cylinder(tmp_path / "drum.step", unit, factor), tolerance=tolerance)
    around = np.hypot(*mesh.vertices[:, :2].T)
    np.testing.assert_allclose(around, RADIUS, rtol=1e-6)
    assert mesh.open_edges == 0 and set(np.round(mesh.vertices[:, 2], 7)) == {0.0, LENGTH}
    angles = np.unique(np.round(np.arctan2(*mesh.vertices[:, 1::-1].T), 5))
    sagitta = RADIUS * (1.0 - math.cos(np.diff(angles).max() / 2))
    assert 0.2 * tolerance < sagitta < tolerance
    (note,) = [note for note in mesh.notes if "tolerance" in note]
    assert f"{len(mesh.triangles)} triangles within {tolerance:.3g} m" in note
    assert float(note.split("(tolerance), ")[1].split(" m")[0]) == pytest.approx(sagitta, rel=0.1)


def test_a_part_is_taken_by_its_name_and_a_damaged_file_is_refused(tmp_path):
    pytest.importorskip("cascadio")
    file = cylinder(tmp_path / "drum.stp")
    assert load_mesh(file, part="drum").open_edges == 0
    with pytest.raises(SceneError, match=r"walls\[0\].mesh: drum.stp: part = 'lid': no such part; there are drum"):
        load_mesh(file, part="lid", key="walls[0].mesh")
    file.write_text("ISO-10303-21;\nno more\n")
    with pytest.raises(SceneError, match="OpenCASCADE finds no surfaces in it"):
        load_mesh(file)


def test_without_the_library_the_message_names_what_to_install(tmp_path, monkeypatch):
    (tmp_path / "cascadio.py").write_text("raise ImportError\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(SceneError, match=r'drum.step: STEP files need the library cascadio: pip install "warpdem\[cad\]"'):
        step_file.read_triangles(cylinder(tmp_path / "drum.step"), "walls[0].mesh", "", None)
    with pytest.raises(SceneError, match="no such mesh file"):
        step_file.read_triangles(tmp_path / "other.step", "walls[0].mesh", "", None)


def test_a_tolerance_is_for_surfaces(tmp_path):
    (tmp_path / "a.toml").write_text("""
materials.g = { density = 2500, young_modulus = 5e6, poisson_ratio = 0.3 }
pairs = [{ materials = ["g", "g"], restitution = 0.5 }]
walls = [{ name = "a", material = "g", mesh = "a.stl", tolerance = "0.1 mm" }]
time = { end = 1, step = 1e-5 }
""")
    with pytest.raises(SceneError, match=r"walls\[0\].tolerance = 0.0001\n +only for a mesh from STEP"):
        load_scene(tmp_path / "a.toml")
