import bpy

camera = getattr(bpy.context, "camera", None) or bpy.context.scene.camera.data
settings = bpy.context.scene.potmesil_camera

camera.lens = 55.0
camera.sensor_fit = "AUTO"
camera.sensor_width = 30.0
camera.sensor_height = 30.0
camera.dof.aperture_fstop = 5.6
camera.dof.aperture_blades = 0
camera.dof.aperture_rotation = 0.0
camera.dof.aperture_ratio = 1.0
settings.coc_model = "paper"
