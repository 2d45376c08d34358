"""Small robots of our own in the conventions of others, as texts."""

HALF_TURN = 3.141592653589793


def urdf(
    *,
    axis="0 -1 0",
    right_axis=None,
    up=1.0,
    hip_rpy="0 0 0",
    knee_rpy="0 0 0",
    com_x=0.0,
    right_mass=3.2,
    kind="revolute",
    limit='<limit effort="{effort}" velocity="100" lower="-6.3" upper="6.3"/>',
    dynamics='<dynamics damping="{damping}" friction="0"/>',
    more="",
    base="",
    names=("left_hip", "left_knee", "right_hip", "right_knee"),
    feet=True,
    torso_y=0.0,
    legs_y=0.0,
    extra="",
):
    """RABBIT's numbers in another convention."""

    def mass(m, z, iyy, y=0.0):
        inertia = f'<inertia ixx="{iyy}" iyy="{iyy}" izz="{0.1 * iyy}" ixy="0" ixz="0" iyz="0"/>'
        return f'<inertial><origin xyz="{com_x} {y} {z}"/><mass value="{m}"/>{inertia}</inertial>'

    def joint(name, parent, child, place, rpy, turn, effort, damping):
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="{place}" rpy="{rpy}"/>'
        rest = limit.format(effort=effort) + dynamics.format(damping=damping)
        return f'<joint name="{name}" type="{kind}">{ends}<axis xyz="{turn}"/>{rest}{more}</joint>'

    text = f'<robot name="x">{base}<link name="torso">{mass(12, 0.24, 1.33, torso_y)}</link>'
    for side, hip, knee in (("left", *names[:2]), ("right", *names[2:])):
        turn = axis if side == "left" or right_axis is None else right_axis
        y = legs_y if side == "left" else -legs_y
        shank = 3.2 if side == "left" else right_mass
        text += f'<link name="{side}_thigh">{mass(6.8, up * 0.11, 0.47)}</link>'
        text += f'<link name="{side}_shin">{mass(shank, up * 0.24, 0.2)}</link>'
        text += joint(hip, "torso", f"{side}_thigh", f"0 {y} 0", hip_rpy, turn, 75, 10)
        text += joint(knee, f"{side}_thigh", f"{side}_shin", f"0 0 {up * 0.4}", knee_rpy, turn, 50, 5)
        if feet:
            tip = f'<parent link="{side}_shin"/><child link="{side}_foot"/><origin xyz="0 0 {up * 0.4}"/>'
            text += f'<link name="{side}_foot"/><joint name="{side}_tip" type="fixed">{tip}</joint>'
    return text + extra + "</robot>"


MOTORS = "".join(
    f'<transmission name="{j}"><joint name="{j}"/><actuator name="{j}"/><mechanicalReduction>50</mechanicalReduction>'
    "<motorInertia>0.000332</motorInertia></transmission>"
    for j in ("q1_left", "q2_left", "q1_right", "q2_right")
)
OPTIMISER = {
    "axis": "0 1 0",
    "kind": "continuous",
    "limit": "",
    "dynamics": "",
    "names": ("q1_left", "q2_left", "q1_right", "q2_right"),
    "extra": MOTORS,
}
"""A gait optimiser's: axes the other way, no limits, rotors in transmissions."""

SLIDES = (
    '<link name="base"/><link name="base_x"/><link name="base_xz"/>'
    '<joint name="planar_x" type="prismatic"><parent link="base"/><child link="base_x"/><axis xyz="1 0 0"/></joint>'
    '<joint name="planar_z" type="prismatic"><parent link="base_x"/><child link="base_xz"/><axis xyz="0 0 1"/></joint>'
    '<joint name="planar_roty" type="continuous"><parent link="base_xz"/><child link="torso"/>'
    '<axis xyz="0 1 0"/></joint>'
)
WORLD = '<link name="world"/><joint name="root" type="{}"><parent link="world"/><child link="torso"/>{}</joint>'

MJCF = """
<mujoco model="x">
  <compiler angle="degree" autolimits="true"/>
  <option timestep="0.002"/>
  <default>
    <joint armature="0.01" damping="0.1"/>
    <geom contype="1" conaffinity="0" density="1000"/>
    <default class="leg"><joint axis="0 1 0" frictionloss="0.5"/><geom type="capsule" size="0.05"/></default>
  </default>
  <worldbody>
    <geom type="plane" size="10 10 1" conaffinity="1"/>
    <body name="torso" pos="0 0 1.3" childclass="leg">
      <joint name="rootx" type="slide" axis="1 0 0" armature="0" damping="0" frictionloss="0"/>
      <joint name="rootz" type="slide" axis="0 0 1" ref="1.3" armature="0" damping="0" frictionloss="0"/>
      <joint name="rooty" axis="0 1 0" armature="0" damping="0" frictionloss="0"/>
      <geom fromto="0 0 0 0.02 0 0.5"/>
      {legs}
    </body>
  </worldbody>
  <actuator>
    <motor joint="hip" ctrlrange="-1 1" gear="90"/><motor joint="knee" ctrlrange="-1 1" gear="60"/>
    <motor joint="hip_left" ctrlrange="-1 1" gear="90"/><motor joint="knee_left" ctrlrange="-1 1" gear="60"/>
  </actuator>
</mujoco>
"""
LEG = """
      <body name="thigh{0}" pos="0 {1} -0.05">
        <joint name="hip{0}" range="-120 60"/>
        <geom fromto="0 0 0 0.01 0 -0.45"/>
        <body name="shin{0}" pos="0.01 0 -0.45">
          <joint name="knee{0}" pos="0 0 0.02" range="0 140" stiffness="3" springref="20"/>
          <geom name="shin{0}" fromto="0 0 0 0 0 -0.4" size="0.03"/>
        </body>
      </body>
"""


def mjcf():
    """A walker of a learning toolbox: slides and a hinge, classes, degrees, gears, springs, a knee off its frame."""
    return MJCF.format(legs=LEG.format("", -0.1) + LEG.format("_left", 0.1))


XACRO = """<?xml version="1.0"?>
<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <xacro:property name="L" value="0.4"/>
  <xacro:leg side="left"/>
  <xacro:leg side="right"/>
  <link name="torso"><inertial><origin xyz="0 0 ${0.6 * L}"/><mass value="12"/>
    <inertia ixx="0" iyy="1.33" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <xacro:macro name="leg" params="side">
    <link name="${side}_thigh"><inertial><origin xyz="0 0 -0.11"/><mass value="6.8"/>
      <inertia ixx="0" iyy="0.47" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>
    <link name="${side}_shin"><inertial><origin xyz="0 0 ${-0.6 * L}"/><mass value="3.2"/>
      <inertia ixx="0" iyy="0.2" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>
      <visual><origin xyz="0 0 ${-L / 2}"/><geometry><cylinder radius="0.02" length="${L}"/></geometry></visual></link>
    <joint name="${side}_hip" type="continuous"><parent link="torso"/><child link="${side}_thigh"/>
      <axis xyz="0 1 0"/><limit effort="75" velocity="9"/></joint>
    <joint name="${side}_knee" type="continuous"><parent link="${side}_thigh"/><child link="${side}_shin"/>
      <origin xyz="0 0 ${-L}"/><axis xyz="0 1 0"/><limit effort="50" velocity="9"/></joint>
  </xacro:macro>
</robot>
"""
