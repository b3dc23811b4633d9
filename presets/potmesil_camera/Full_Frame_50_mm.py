import bpy

camera = getattr(bpy.context, "camera", None) or bpy.context.scene.camera.data
settings = bpy.context.scene.potmesil_camera

camera.lens = 50.0
camera.sensor_fit = "HORIZONTAL"
camera.sensor_width = 36.0
camera.sensor_height = 24.0
camera.dof.aperture_fstop = 1.8
camera.dof.aperture_blades = 7
camera.dof.aperture_rotation = 0.0
camera.dof.aperture_ratio = 1.0
settings.coc_model = "cycles"
