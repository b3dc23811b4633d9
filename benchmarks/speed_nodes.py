"""Time Blender's Defocus and Vector Blur nodes on passes in a file; runs inside Blender, and needs only bpy.

    blender -b --factory-startup --python speed_nodes.py -- JOB

or with Blender as a Python module. The job is a JSON file. A line of JSON is printed for each result.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from pathlib import Path
from typing import Any

import bpy


def compositor(job: dict[str, Any]) -> tuple[bpy.types.Scene, Any, Any, Any]:
    """Make a scene that renders nothing and composites an image.

    Parameters
    ----------
    job : dict
        ``passes``, ``columns``, ``rows``, and the camera's facts.

    Returns
    -------
    tuple
        The scene, its nodes, the node with the passes, and the socket of the finished picture.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    facts = job["facts"]
    data = bpy.data.cameras.new("Camera")
    data.lens = facts["focal_length"] * 1000.0
    data.sensor_fit, data.sensor_width = "HORIZONTAL", facts["sensor_width"] * 1000.0
    data.dof.focus_distance = facts["focus_distance"]
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(scene.camera)
    tree = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    passes = tree.nodes.new("CompositorNodeImage")
    passes.image = bpy.data.images.load(job["passes"])
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = job["columns"], job["rows"], 100
    render.use_compositing = True
    render.compositor_device, render.compositor_precision = "CPU", "FULL"
    scene.compositing_node_group = tree
    return scene, tree, passes, tree.nodes.new("NodeGroupOutput").inputs["Image"]


def add_node(scene: bpy.types.Scene, tree: Any, passes: Any, run: dict[str, Any]) -> Any:
    """Add the node that a run is about, and return the socket of its picture."""
    if run["node"] == "defocus":
        node = tree.nodes.new("CompositorNodeDefocus")
        node.scene, node.use_zbuffer = scene, True
        node.f_stop, node.blur_max, node.bokeh = run["f_stop"], run["max_blur"], "CIRCLE"
        tree.links.new(passes.outputs["Combined"], node.inputs["Image"])
        tree.links.new(passes.outputs["Depth"], node.inputs["Z"])
    else:
        node = tree.nodes.new("CompositorNodeVecBlur")
        node.inputs["Samples"].default_value = run["samples"]
        node.inputs["Shutter"].default_value = run["shutter"]
        for source, socket in (("Combined", "Image"), ("Depth", "Depth"), ("Vector", "Speed")):
            tree.links.new(passes.outputs[source], node.inputs[socket])
    return node.outputs["Image"]


def seconds_of(scene: bpy.types.Scene) -> float:
    """Return the seconds that compositing takes."""
    started = time.perf_counter()
    bpy.ops.render.render(scene=scene.name)
    return time.perf_counter() - started


def main(job: dict[str, Any]) -> None:
    """Time the nodes of a job, each less what the same tree takes without it."""
    scene, tree, passes, output = compositor(job)
    # All passes are read from the file once, and stay.
    tree.links.new(passes.outputs["Combined"], output)
    seconds_of(scene)
    empty = statistics.median(seconds_of(scene) for _ in range(3))
    spent: dict[str, float] = {}
    for run in job["runs"]:
        # A node's time goes with the pixels that it looks at. What would be too long is left out.
        expected = max(
            (spent[key] * run["cost"] / other["cost"] for key, other in _done(job, spent)), default=0
        )
        if expected > job["cap"]:
            say(name=run["name"], left_out=expected, cap=job["cap"])
            continue
        socket = add_node(scene, tree, passes, run)
        tree.links.new(socket, output)
        if not spent:
            # What the first node loads is not its own time.
            _first(scene, socket.node, run)
        times = [seconds_of(scene)]
        while len(times) < job["repeats"] and sum(times) < job["enough"]:
            times.append(seconds_of(scene))
        own = max(statistics.median(times) - empty, 0.0)
        if run["node"] == "defocus":
            spent[run["name"]] = own
        say(name=run["name"], seconds=own, runs=len(times), empty=empty, blender=bpy.app.version_string)
        tree.nodes.remove(socket.node)


def _first(scene: bpy.types.Scene, node: Any, run: dict[str, Any]) -> None:
    if run["node"] == "defocus":
        node.blur_max = 1.0
    seconds_of(scene)
    if run["node"] == "defocus":
        node.blur_max = run["max_blur"]


def _done(job: dict[str, Any], spent: dict[str, float]) -> list[tuple[str, dict[str, Any]]]:
    """Return the runs of the Defocus node that there are times of; the last tells most."""
    return [(run["name"], run) for run in job["runs"] if run["name"] in spent][-1:]


def say(**values: Any) -> None:
    """Print a result."""
    print("RESULT " + json.dumps(values), flush=True)


if __name__ == "__main__":
    path = sys.argv[-1]
    main(json.loads(Path(path).read_text(encoding="utf-8")))
