"""Save the animation that the cluster renders: python shot.py FILE.blend LAST_FRAME."""

from __future__ import annotations

import sys

import bpy


def build(path: str, last: int) -> None:
    """Save a cube that crosses the view before two others, tiny and quick to render.

    Parameters
    ----------
    path : str
        The .blend file.
    last : int
        The animation's last frame; its first is 1.
    """
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, last
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 4
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 48, 27
    scene.render.resolution_percentage = 100
    for place, color in (
        ((-1.0, 3.0, 0.0), (1, 0.2, 0.1)),
        ((0.0, 6.0, 0.3), (0.1, 1, 0.2)),
        ((1.5, 9.0, 0), (0.2, 0.2, 1)),
    ):
        bpy.ops.mesh.primitive_cube_add(size=1.2, location=place)
        material = bpy.data.materials.new("Glow")
        material.use_nodes = True
        nodes = material.node_tree.nodes
        nodes.clear()
        glow = nodes.new("ShaderNodeEmission")
        glow.inputs["Color"].default_value = (*color, 1)
        material.node_tree.links.new(glow.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs[0])
        bpy.context.object.data.materials.append(material)
    near = scene.objects[0]
    for frame, x in ((1, -2.0), (last, 2.0)):
        near.location.x = x
        near.keyframe_insert("location", frame=frame)
    bpy.ops.object.camera_add(rotation=(1.5707963, 0, 0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 35
    scene.camera.data.dof.use_dof = True
    scene.camera.data.dof.focus_distance = 6.0
    scene.camera.data.dof.aperture_fstop = 0.1
    bpy.ops.wm.save_as_mainfile(filepath=path)


if __name__ == "__main__":
    build(sys.argv[1], int(sys.argv[2]))
