"""Meshes: files as they are written, mass properties in more digits, and what is refused."""

import struct

import mpmath as mp
import numpy as np
import pytest

from dropspin.scenarios import SceneError, load, truth_for
from dropspin.scenarios.bodies.mesh import is_closed
from dropspin.scenarios.bodies.mesh_files import read_mesh
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.state import UP

TETRAHEDRON = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.5]]
OUTWARD = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
FALL = {"start": {"position": [0.0, 1.0, 0.0], "angular_velocity": [1.0, 2.0, 3.0]}, "gravity": {"acceleration": [0.0, -9.8, 0.0]}}


def body(points, faces, **keys):
    return load({"duration": 0.5, "body": {"shape": "mesh", "points": points, "faces": faces, "mass": 2.0, **keys}}).body


def obj(points, faces):
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
    return "\n".join(lines) + "\n"


def binary_stl(points, faces, header=b""):
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *(number for corner in face for number in points[corner]), 0) for face in faces)
    return header.ljust(80) + struct.pack("<I", len(faces)) + rows


def ascii_stl(points, faces):
    facets = "".join(
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {points[c][0]!r} {points[c][1]!r} {points[c][2]!r}\n" for c in face)
        + " endloop\nendfacet\n"
        for face in faces
    )
    return f"solid part\n{facets}endsolid part\n"


def exact_moments(points, faces):
    """Volume, centre and tensor per volume about it, of the tetrahedra of all faces with the origin, in 40 digits."""
    with mp.workdps(40):
        volume, first, second = mp.mpf(0), mp.zeros(3, 1), mp.zeros(3, 3)
        for face in faces:
            corners = [mp.matrix([mp.mpf(float(value)) for value in points[corner]]) for corner in face]
            part = mp.det(mp.matrix([list(corner) for corner in corners])) / 6
            total = corners[0] + corners[1] + corners[2]
            volume += part
            first += part * total / 4
            second += part / 20 * (sum((corner * corner.T for corner in corners), mp.zeros(3, 3)) + total * total.T)
        centre = first / volume
        second = second / volume - centre * centre.T
        trace = second[0, 0] + second[1, 1] + second[2, 2]
        tensor = [[float((trace if i == j else 0) - second[i, j]) for j in range(3)] for i in range(3)]
        return float(volume), [float(value) for value in centre], tensor


def prism(sides, random):
    """A closed mesh of many faces: a prism, turned at random."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.zeros(sides), np.sin(angles)], axis=1)
    points = np.concatenate([ring - 0.7 * UP, ring + 0.7 * UP, [-0.7 * UP, 0.7 * UP]]) * [0.3, 0.2, 0.1]
    faces = []
    for one in range(sides):
        other = (one + 1) % sides
        faces += [[2 * sides, one, other], [2 * sides + 1, sides + other, sides + one]]
        faces += [[one, sides + one, other], [other, sides + one, sides + other]]
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    return points @ (turn * np.sign(np.linalg.det(turn))), np.array(faces)


@pytest.mark.sample(2)
@pytest.mark.parametrize("offset", [0.0, 1e3, 1e6])
@pytest.mark.parametrize("inside_out", [False, True])
def test_solids_of_any_place_have_the_moments_of_forty_digits(offset, inside_out):
    """Far from the origin the given numbers have fewer digits, but no further ones are lost; also inside out, and of two components."""
    points, faces = prism(40, np.random.default_rng(0))
    points = np.concatenate([points, points + UP]) + offset
    faces = np.concatenate([faces, faces + len(points) // 2])
    if inside_out:
        faces = faces[:, ::-1]
    _, centre, tensor = exact_moments(points, faces)
    found = body(points, faces)
    np.testing.assert_allclose(found.centre, centre, rtol=4e-16 * 8, atol=1e-16)
    np.testing.assert_allclose(found.inertia_tensor, 2.0 * np.array(tensor), rtol=0, atol=1e-14 * np.max(np.abs(tensor)))


def test_a_box_as_a_mesh_is_the_box():
    """Moments of solid, surface and vertices; centre; the height at which it rests; a shell without its lid as a surface."""
    corners = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [[a, b, c] for a, b, c, _ in quads] + [[a, c, d] for a, _, c, d in quads]
    for inertia in ("solid", "surface", "vertices", "note"):
        expected = load({"duration": 1.0, "body": {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 2.0, "inertia": inertia}}).body
        found = body(corners + 5.0, faces, inertia=inertia)
        np.testing.assert_allclose(found.inertia_tensor, expected.inertia_tensor, atol=1e-15 if inertia != "note" else 1e-14)
        np.testing.assert_allclose(found.centre, [5.0, 5.0, 5.0], rtol=1e-15)
        assert found.resting_height == pytest.approx(0.1, rel=1e-13)
    assert is_closed(corners, np.array(faces))
    assert not is_closed(corners, np.array(faces[:-1]))
    assert body(corners, faces[:-1], inertia="surface").centre.any()


def test_a_part_inside_out_is_a_cavity_within_another_part_and_refused_beside_it():
    """A cavity takes a mass away, of a density that counts for the rest; a part beside the others would too."""
    large, small = 4.0 * np.array(TETRAHEDRON), np.array(TETRAHEDRON)
    inverted = [[a + 4, c + 4, b + 4] for a, b, c in OUTWARD]

    def both(offset):
        return np.vstack([large, small + offset]).tolist()

    hollow = body(both(0.3), [*OUTWARD, *inverted])
    assert hollow.content == pytest.approx(63.0 * abs(body(small.tolist(), OUTWARD).content))
    with pytest.raises(SceneError, match="has triangles that are inside out beside others"):
        body(both(30.0), [*OUTWARD, *inverted])
    with pytest.raises(SceneError, match="has triangles that are inside out beside others"):
        body(both(30.0), [[a, c, b] for a, b, c in OUTWARD] + [[a + 4, b + 4, c + 4] for a, b, c in OUTWARD])


@pytest.mark.parametrize("kind", ["obj", "binary", "ascii"])
def test_files_of_each_kind_are_the_same_body(tmp_path, kind):
    """A tetrahedron from a file beside the scene's file, scaled from millimetres, is that of its points; so is its exact motion."""
    in_millimetres = (1000.0 * np.array(TETRAHEDRON)).tolist()
    name = "part.obj" if kind == "obj" else "part.STL"
    data = {"obj": obj(in_millimetres, OUTWARD).encode(), "binary": binary_stl(in_millimetres, OUTWARD, b"solid but binary"),
            "ascii": ascii_stl(in_millimetres, OUTWARD).encode()}[kind]  # fmt: skip
    (tmp_path / name).write_bytes(data)
    scene = tmp_path / "scene.toml"
    scene.write_text(f'duration = 0.5\n[body]\nshape = "mesh"\nfile = "{name}"\nscale = 0.001\nmass = 2.0\n')
    found, expected = load(scene).body, body(TETRAHEDRON, OUTWARD)
    np.testing.assert_allclose(sorted(found.points.tolist()), sorted(TETRAHEDRON), rtol=1e-7)
    np.testing.assert_allclose(found.inertia_tensor, expected.inertia_tensor, rtol=1e-6)
    again = load({"duration": 0.5, "name": "scene", "body": found.model_dump()})
    assert again.body == found
    assert again.digest == load(scene).digest


def test_vertices_of_an_obj_are_kept_as_written(tmp_path):
    """In number and order, whatever their textures and normals; polygons are fans; indices below 0 count back; no other file is opened."""
    path = tmp_path / "part.obj"
    path.write_text(
        "# a comment\nmtllib no-such-file.mtl\no part\nv 0 0 0\nv 1 0 0 # corner\nv 1 1 0\nv 0 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\n"
        "g side\ns 1\nusemtl none\nf 1/1/1 2/1/1 3//1 \\\n 4/1\nf -5 -3 -2\n"
    )
    points, faces = read_mesh(path, "part.obj")
    np.testing.assert_array_equal(points, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 1, 0]])
    np.testing.assert_array_equal(faces, [[0, 1, 2], [0, 2, 3], [0, 2, 3]])


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("empty.obj", b"", "has no faces"),
        ("points.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "has no faces"),
        ("nan.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a vertex that is not finite"),
        ("missing.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "a vertex that does not exist; there are 3"),
        ("back.obj", b"v 0 0 0\nv 1 0 0\nf -1 -2 -3\n", "a vertex that does not exist; there are 2"),
        ("zero.obj", b"v 0 0 0\nf 0 1 1\n", "line 2 is no face"),
        ("short.obj", b"v 0 0\n", "line 1 has a vertex of 2 numbers"),
        ("words.obj", b"v a b c\n", "could not convert string to float"),
        ("commands.obj", b"csh rm -rf /\n", "the statement 'csh' is not read"),
        ("calls.obj", b"v 0 0 0\ncall other.obj\n", "line 2: the statement 'call' is not read"),
        ("zip.obj", b"PK\x03\x04" + bytes(range(256)), "is not read"),
        ("empty.stl", b"", "no STL"),
        ("short.stl", b"\0" * 80 + struct.pack("<I", 4_000_000_000), "another length than its header says"),
        ("none.stl", b"\0" * 80 + struct.pack("<I", 0), "has no faces"),
        ("text.stl", b"solid\nendsolid\n", "has no faces"),
        ("nan.stl", binary_stl([[0, 0, float("nan")], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "a vertex that is not finite"),
        ("part.ply", b"ply\n", "a mesh is a file .obj or .stl"),
        ("absent.obj", None, "No such file"),
    ],
)
def test_damaged_files_are_refused_in_one_line(tmp_path, name, content, message):
    """With the path, and what is wrong."""
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(SceneError, match=message) as caught:
        load({"duration": 1.0, "body": {"shape": "mesh", "file": str(tmp_path / name), "mass": 1.0}})
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)


def test_a_large_file_is_refused_by_its_size(tmp_path, monkeypatch):
    """Before it is read into memory."""
    monkeypatch.setattr("dropspin.scenarios.bodies.mesh_files.LARGEST_FILE", 10)
    (tmp_path / "part.obj").write_text(obj(TETRAHEDRON, OUTWARD))
    with pytest.raises(DropspinError, match="larger than 10 bytes"):
        read_mesh(tmp_path / "part.obj", "part.obj")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"faces": OUTWARD[:3]}, "the mesh is not closed, so that nothing is inside; give inertia = 'surface'"),
        (
            {"faces": [*OUTWARD[:3], OUTWARD[3][::-1]]},
            "the mesh has triangles that are inside out beside others",
        ),
        ({"faces": [[0, 1, 9]]}, "an index outside of the 4 points"),
        ({"points": [[0.0, 0.0]]}, "rows of three numbers of up to 1e\\+50"),
        ({"points": [[0.0, 0.0, float("inf")]]}, "rows of three numbers of up to 1e\\+50"),
        ({"points": (1e300 * np.array(TETRAHEDRON)).tolist()}, "rows of three numbers of up to 1e\\+50"),
        ({"faces": [OUTWARD[0], OUTWARD[0][::-1]]}, "the mesh has no volume"),
        ({"points": [[0.1, 0.2, 0.3]] * 4, "inertia": "surface"}, "the mesh has no area"),
        ({"file": 3}, "must be the path of a file"),
        ({"file": "part.obj"}, "give either these or file"),
        ({"scale": 2.0}, "unknown key"),
        ({"center_of_mass": [0.0, 0.0, 0.1]}, "give inertia as numbers"),
    ],
)
def test_impossible_meshes_are_refused(keys, message):
    """In one line."""
    with pytest.raises(SceneError, match=message):
        load({"duration": 1.0, "body": {"shape": "mesh", "points": TETRAHEDRON, "faces": OUTWARD, "mass": 1.0} | keys})


def test_the_exact_motion_of_a_mesh_is_that_of_its_corners():
    """A tetrahedron with a fifth vertex inside strikes the floor as the set of its corners does, with the same moments."""
    points = [*TETRAHEDRON, [0.05, 0.05, 0.05]]
    own = body(points, OUTWARD)
    floor = {"restitution": 0.5, "friction": "infinite"}
    moments = {"inertia": own.inertia_tensor.tolist(), "center_of_mass": own.centre.tolist(), "mass": 2.0}
    corners = {"shape": "vertices", "points": TETRAHEDRON, **moments}
    found, expected = (truth_for(load({"duration": 1.0, "body": one, "floor": floor, **FALL})) for one in (own.model_dump(), corners))
    assert found.events
    assert found.events[0].time == pytest.approx(expected.events[0].time, rel=1e-14)
    np.testing.assert_allclose(found.events[0].after, expected.events[0].after, rtol=1e-12, atol=1e-13)
