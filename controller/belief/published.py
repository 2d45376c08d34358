"""A URDF as published, by Pinocchio and free in space: what a conversion of it is held against."""

import xml.etree.ElementTree as ET
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from controller.belief.urdf import bare, silent
from controller.common.errors import UserError
from controller.common.records import Vector


class Published:
    """A file's robot from one link on, whatever carries that link in the file taken off."""

    def __init__(self, text: str, root: str, where: str) -> None:
        """Read.

        Args:
            text: The URDF.
            root: Link to begin with.
            where: The file, for messages.

        Raises:
            UserError: Pinocchio cannot read it.
        """
        robot = ET.fromstring(text)
        for element in robot.iter():
            if isinstance(element.tag, str):
                element.tag = element.tag.rpartition("}")[2]
        kept, grows = {root}, True
        while grows:
            before = len(kept)
            for joint in robot.findall("joint"):
                if _end(joint, "parent") in kept:
                    kept.add(_end(joint, "child"))
            grows = len(kept) > before
        for item in list(robot):
            name = item.get("name", "") if item.tag == "link" else _end(item, "parent") if item.tag == "joint" else ""
            if item.tag in ("link", "joint") and name not in kept:
                robot.remove(item)
        try:
            with silent():
                self.model = pin.buildModelFromXML(bare(robot), pin.JointModelFreeFlyer())
        except (ValueError, RuntimeError, IndexError) as error:
            lines = str(error).strip().splitlines() or ["unreadable"]
            raise UserError(f"{where}: not a URDF Pinocchio can read ({lines[0]})") from error
        self.data = self.model.createData()

    def at(
        self, rotation: Vector, place: Vector, rates: Vector, joints: Mapping[str, tuple[float, float]]
    ) -> tuple[Vector, Vector, list[int]]:
        """Mass matrix and bias of the robot free in space.

        Args:
            rotation: Of the root link, (3, 3).
            place: Of its origin in [m], (3,).
            rates: Its linear velocity in the world and its angular velocity in its own frame, (6,).
            joints: Coordinate and rate of each joint.

        Returns:
            Mass matrix without rotors and bias, by those six rates and the joints' in the file's order, and where
            each of them is.
        """
        model, data = self.model, self.data
        q, v = pin.neutral(model), np.zeros(model.nv)
        q[:3], q[3:7] = place, pin.Quaternion(rotation).normalized().coeffs()
        v[:3], v[3:6] = rotation.T @ rates[:3], rates[3:]
        index = []
        for name, (angle, rate) in joints.items():
            joint = model.joints[model.getJointId(name)]
            q[joint.idx_q], v[joint.idx_v] = angle, rate
            index.append(int(joint.idx_v))
        D = pin.crba(model, data, q)
        D = np.triu(D) + np.triu(D, 1).T
        h = pin.nonLinearEffects(model, data, q, v).copy()
        pin.framesForwardKinematics(model, data, q)
        # Pinocchio's linear velocity is in the link's frame: v = T w, and dT/dt w = -R' (omega x w).
        T = np.eye(model.nv)
        T[:3, :3] = rotation.T
        drift = np.zeros(model.nv)
        drift[:3] = -rotation.T @ np.cross(rotation @ rates[3:], rates[:3])
        return T.T @ D @ T, T.T @ (h + D @ drift), [*range(6), *index]

    def point(self, link: str, point: Vector) -> Vector:
        """A point of a link in the world, after `at`, (3,)."""
        frame = self.data.oMf[self.model.getFrameId(link, pin.FrameType.BODY)]
        seen: Vector = frame.rotation @ point + frame.translation
        return seen


def _end(joint: ET.Element, which: str) -> str:
    found = joint.find(which)
    return "" if found is None else found.get("link", "")
