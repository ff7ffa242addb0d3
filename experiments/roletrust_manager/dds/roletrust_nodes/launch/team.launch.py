"""A team of cameras, raters and a manager: `ros2 launch roletrust_nodes team.launch.py keys:=keys
raters:=sr_0,sr_1`.

The nodes are those of `roletrust live`, so the command `roletrust` must be in the path.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import LaunchConfiguration

PARAMETERS = {
    "scenario": ("paper-3x3", "Name or file of a scenario"),
    "keys": ("", "Folder with keys; without it, nothing is signed"),
    "journal": ("team.journal", "Journal file of the manager; empty for no manager"),
    "model": ("role-trust", "Trust model of the manager"),
    "cameras": ("sp_0,sp_1,sp_2", "Names of the cameras, with commas"),
    "raters": ("sr_0,sr_1,sr_2", "Names of the raters, with commas"),
    "speed": ("1.0", "Speed relative to the scenario's clock"),
    "rounds": ("", "Rounds until the cameras and raters end; empty for no end"),
    "network": ("false", "Whether to communicate with other machines"),
}
"""Parameters of the launch: default value and description."""


def generate_launch_description():
    """Return the description of the launch."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        for name, (value, text) in PARAMETERS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=nodes)])


def nodes(context):
    """Return the processes of the nodes."""
    given = {name: LaunchConfiguration(name).perform(context) for name in PARAMETERS}
    shared = ["--scenario", given["scenario"], "--speed", given["speed"]]
    shared += ["--keys", given["keys"]] if given["keys"] else []
    shared += ["--network"] if given["network"] == "true" else []
    commands = (
        [["manager", given["journal"], "--model", given["model"]]] if given["journal"] else []
    )
    end = ["--rounds", given["rounds"]] if given["rounds"] else []
    commands += [
        ["agent", name, "--role", "provider", *end] for name in given["cameras"].split(",") if name
    ]
    commands += [
        ["agent", name, "--role", "rater", *end] for name in given["raters"].split(",") if name
    ]
    return [
        ExecuteProcess(
            cmd=["roletrust", "live", *command, *shared],
            name=command[1].replace("/", "_"),
            output="screen",
        )
        for command in commands
    ]
