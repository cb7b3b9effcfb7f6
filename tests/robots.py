"""A made-up robot as URDF text: z up, a massless root link, hip axes that do not meet, arms of four joints, a mesh,
names of its own.
"""

LINK = (
    '<link name="{name}"><inertial><origin xyz="{com}" rpy="0.1 0 0.2"/><mass value="{mass}"/>'
    '<inertia ixx="{i}" ixy="0" ixz="0" iyy="{i}" iyz="0" izz="{i}"/></inertial>{shape}</link>'
)
BOX = '<collision><origin xyz="{place}" rpy="0 0 0"/><geometry><box size="{size}"/></geometry></collision>'
JOINT = (
    '<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/><origin xyz="{xyz}" rpy="0 '
    '0 0"/>'
    '<axis xyz="{axis}"/><limit lower="{low}" upper="{high}" velocity="3" effort="{effort}"/></joint>'
)


def link(name: str, mass: float, *, com: str = "0 0 0", place: str = "0 0 0", size: str = "") -> str:
    """Return a link with an inertia of 0.001 kg·m² per kilogram and, given a size, a box."""
    return LINK.format(
        name=name, mass=mass, com=com, i=0.001 * mass, shape=BOX.format(place=place, size=size) if size else ""
    )


def joint(
    name: str, parent: str, child: str, xyz: str, axis: str, low: float = -1.5, high: float = 1.5, effort: float = 120.0
) -> str:
    """Return a joint that turns."""
    return JOINT.format(name=name, parent=parent, child=child, xyz=xyz, axis=axis, low=low, high=high, effort=effort)


def leg(side: str, sign: int, hip_offset: float) -> str:
    """Yaw, roll and pitch of the hip ``hip_offset`` m apart, knee, pitch and roll of the ankle; the shanks' box is a
    mesh.
    """
    parts = [
        joint(f"{side}_yaw", "pelvis", f"{side}_hip1", f"0 {sign * 0.09} -0.05", "0 0 1"),
        link(f"{side}_hip1", 0.4),
        joint(f"{side}_roll", f"{side}_hip1", f"{side}_hip2", f"{hip_offset} 0 -0.02", "1 0 0", -0.6, 0.6),
        link(f"{side}_hip2", 0.4),
        joint(f"{side}_pitch", f"{side}_hip2", f"{side}_femur", f"0 {sign * 0.01} {-hip_offset}", "0 1 0", -2.0, 1.0),
        link(f"{side}_femur", 3.0, com="0 0 -0.15", place="0 0 -0.15", size="0.08 0.08 0.28"),
        joint(f"{side}_knee", f"{side}_femur", f"{side}_tibia", "0 0 -0.3", "0 1 0", 0.0, 2.3),
        link(f"{side}_tibia", 2.0, com="0 0 -0.15", place="0 0 -0.15", size="0.07 0.07 0.25"),
        joint(f"{side}_ankle_pitch", f"{side}_tibia", f"{side}_ankle", "0 0 -0.3", "0 1 0", -1.2, 1.2),
        f'<link name="{side}_ankle"/>',
        joint(f"{side}_ankle_roll", f"{side}_ankle", f"{side}_pad", "0 0 0", "1 0 0", -0.6, 0.6),
        link(f"{side}_pad", 1.0, com="0.02 0 -0.04"),
        f'<joint name="{side}_sole_joint" type="fixed"><parent link="{side}_pad"/><child link="{side}_sole"/>',
        '<origin xyz="0.03 0 -0.06"/></joint>',
        f'<link name="{side}_sole">{BOX.format(place="0 0 0.01", size="0.22 0.1 0.02")}</link>',
    ]
    return "".join(parts)


def arm(side: str, sign: int) -> str:
    """Return an arm of four joints in two pairs."""
    parts = [
        joint(f"{side}_shoulder1", "chest", f"{side}_clavicle", f"0 {sign * 0.17} 0.25", "0 1 0", -2.5, 2.5, 40.0),
        link(f"{side}_clavicle", 0.3),
        joint(
            f"{side}_shoulder2",
            f"{side}_clavicle",
            f"{side}_humerus",
            f"0 {sign * 0.04} 0",
            "1 0 0",
            -0.1 if sign > 0 else -2,
            2 if sign > 0 else 0.1,
            40.0,
        ),
        link(f"{side}_humerus", 1.2, com="0 0 -0.1", place="0 0 -0.1", size="0.06 0.06 0.2"),
        joint(f"{side}_elbow1", f"{side}_humerus", f"{side}_turn", "0 0 -0.22", "0 0 1", -1.5, 1.5, 40.0),
        f'<link name="{side}_turn"><visual><geometry><mesh filename="turn.stl"/></geometry></visual></link>',
        joint(f"{side}_elbow2", f"{side}_turn", f"{side}_ulna", "0 0 0", "0 1 0", -2.0, 0.0, 40.0),
        link(f"{side}_ulna", 0.8, com="0 0 -0.1", place="0 0 -0.11", size="0.05 0.05 0.22"),
    ]
    return "".join(parts)


def biped(*, hip_offset: float = 0.03) -> str:
    """Return the URDF of a robot of 1.1 m and 27 kg."""
    parts = [
        '<robot name="made up"><link name="base"/>',
        '<joint name="base_joint" type="fixed"><parent link="base"/><child link="pelvis"/><origin xyz="0 0 0.02" '
        'rpy="0 0 0"/></joint>',
        link("pelvis", 4.0, com="0.01 0 0.02", size="0.16 0.2 0.1"),
        joint("waist", "pelvis", "chest", "0 0 0.08", "0 1 0", -0.3, 1.2),
        link("chest", 6.0, com="0.01 0 0.15", place="0 0 0.17", size="0.16 0.26 0.3"),
        leg("r", -1, hip_offset),
        leg("l", 1, hip_offset),
        arm("r", -1),
        arm("l", 1),
        "</robot>",
    ]
    return "".join(parts)
