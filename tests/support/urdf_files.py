"""URDF files for tests of `dropspin diagnose`, and their bodies as PyBullet has them."""

from dropspin.comparisons.diagnosis.pybullet_body import PyBulletModel

BOX, BALL = '<box size=".15 .05 .03"/>', '<sphere radius=".5"/>'


def link(geometry, mass="1", moments=(0.1, 0.1, 0.1), name="a", at="", extra="", on=""):
    """A link with a collision geometry; `at` and `on` are the origins of its inertia and of its geometry."""
    xx, yy, zz = moments
    inertial = f'<inertial>{at}<mass value="{mass}"/><inertia ixx="{xx}" ixy="0" ixz="0" iyy="{yy}" iyz="0" izz="{zz}"/></inertial>'
    return f'<link name="{name}">{extra}{inertial}<collision>{on}<geometry>{geometry}</geometry></collision></link>'


def joint(kind, parent="a", child="b", origin=""):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{parent}{child}" type="{kind}">{ends}{origin}<axis xyz="0 0 1"/></joint>'


def model(folder, *elements):
    path = folder / "model.urdf"
    path.write_text(f'<robot name="model">{"".join(elements)}</robot>', encoding="utf-8")
    return PyBulletModel(path, "model.urdf")


def body(folder, *elements, name="a"):
    return model(folder, *elements).body(name, None)


def two_links(folder):
    """A box and a ball that is fixed to it, with turned and shifted inertial frames."""
    box = link('<box size=".1 .2 .3"/>', "2", at='<origin xyz=".02 .01 0" rpy=".3 .2 .1"/>')
    ball = link('<sphere radius=".1"/>', name="b", at='<origin xyz="0 .05 0" rpy="0 .2 .1"/>')
    return body(folder, box, ball, joint("fixed", origin='<origin xyz=".3 0 .1" rpy=".1 .5 .2"/>'))
