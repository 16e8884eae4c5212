"""Robots that others wrote, and where they are installed: `pip install -e '.[models]'` brings all of them."""

import importlib.util
import sys
from pathlib import Path

PYBULLET = (
    "franka_panda/panda.urdf",
    "kuka_iiwa/model.urdf",
    "r2d2.urdf",
    "a1/a1.urdf",
    "quadruped/minitaur.urdf",
    "racecar/racecar.urdf",
    "pr2_gripper.urdf",
    "pendulum5.urdf",
    "mjcf/humanoid.xml",
    "aliengo/aliengo.urdf",
    "laikago/laikago_toes_zup.urdf",
    "mini_cheetah/mini_cheetah.urdf",  # refused: an inertia that no body has
    "mjcf/hopper.xml",  # refused: global coordinates
)
GYMNASIUM = (*("ant.xml", "half_cheetah.xml", "walker2d.xml", "hopper.xml", "pusher.xml"), "humanoid.xml")
DM_CONTROL = (
    *(
        "humanoid.xml",
        "humanoid_CMU.xml",
        "finger.xml",
        "acrobot.xml",
        "walker.xml",
        "cheetah.xml",
        "hopper.xml",
    ),
    "quadruped.xml",  # refused: too fine a height field
)
ROBOT_DATA = (
    "panda_description/urdf/panda.urdf",
    "ur_description/urdf/ur5_robot.urdf",
    "ur_description/urdf/ur10_joint_limited_robot.urdf",
    "talos_data/robots/talos_reduced.urdf",
    "talos_data/robots/talos_left_arm.urdf",
    "solo_description/robots/solo12.urdf",
    "bolt_description/robots/bolt.urdf",
    "go2_description/urdf/go2.urdf",
    "simple_humanoid_description/urdf/simple_humanoid_classical.urdf",
    "z1_description/urdf/z1.urdf",
    "xarm_description/urdf/xarm7.urdf",
    "double_pendulum_description/urdf/double_pendulum.urdf",
    "a1_description/urdf/a1.urdf",
    "laikago_description/urdf/laikago.urdf",
    "g1_description/urdf/g1_29dof_rev_1_0.urdf",
    "kinova_description/robots/kinova.urdf",
    "so_arm_description/urdf/so100.urdf",
    "solo_description/robots/solo.urdf",
    "borinot_description/urdf/borinot_flying_arm_2.urdf",
    "iris_description/robots/iris.urdf",
    "allegro_hand_description/urdf/allegro_right_hand.urdf",
    "romeo_description/urdf/romeo.urdf",  # refused: fingers without mass
)


def folders() -> dict[str, Path | None]:
    """Folder of each collection; None if it is not installed."""
    prefix = Path("cmeel.prefix/share/example-robot-data/robots")
    homes = [Path(entry) / prefix for entry in sys.path if (Path(entry) / prefix).is_dir()]
    return {
        "pybullet": _inside("pybullet_data", ""),
        "gymnasium": _inside("gymnasium", "envs/mujoco/assets"),
        "dm_control": _inside("dm_control", "suite"),
        "robot_data": homes[0] if homes else None,
    }


def _inside(package: str, folder: str) -> Path | None:
    spec = importlib.util.find_spec(package)
    return Path(spec.origin).parent / folder if spec is not None and spec.origin else None


def models() -> list[Path]:
    """Paths of all models of the collections that are installed."""
    names = {"pybullet": PYBULLET, "gymnasium": GYMNASIUM, "dm_control": DM_CONTROL, "robot_data": ROBOT_DATA}
    return [home / name for key, home in folders().items() if home for name in names[key]]
