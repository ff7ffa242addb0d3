"""A team of cameras, raters and a manager: `ros2 launch roletrust_nodes team.launch.py keys:=keys
raters:=sr_0,sr_1`.

The nodes are those of `roletrust robots`, so the command `roletrust` must be in the path.
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
    shared = [f"--set={name}={given[name]}" for name in ("scenario", "speed", "network")]
    shared += ["--keys", given["keys"]] if given["keys"] else []
    commands = (
        [["manager", given["journal"], "--model", given["model"]]] if given["journal"] else []
    )
    for role, names in (("provider", given["cameras"]), ("rater", given["raters"])):
        commands += [["agent", name, "--role", role] for name in names.split(",") if name]
    return [
        ExecuteProcess(
            cmd=["roletrust", "robots", *command, *shared],
            name=command[1].replace("/", "_"),
            output="screen",
        )
        for command in commands
    ]
