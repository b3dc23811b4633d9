import bpy

render = bpy.context.scene.render
settings = bpy.context.scene.potmesil_camera

render.motion_blur_shutter = 1.0
render.motion_blur_position = "CENTER"
settings.exposure_count = 1
settings.exposure_duration = 0.2
settings.exposure_spacing = 0.4
settings.shutter_kind = "whole"
settings.slit_edge = "top"
settings.slit_width = 0.1
settings.blade_time = 0.2
settings.gate_angle = 0.5235987755982988
settings.use_flash = False
settings.flash_curtain = "second"
settings.flash_share = 0.5
settings.flash_duration = 0.01
settings.flash_count = 1
