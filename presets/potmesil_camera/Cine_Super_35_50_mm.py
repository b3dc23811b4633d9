import bpy

camera = getattr(bpy.context, "camera", None) or bpy.context.scene.camera.data
settings = bpy.context.scene.potmesil_camera

camera.lens = 50.0
camera.sensor_fit = "HORIZONTAL"
camera.sensor_width = 24.89
camera.sensor_height = 18.66
camera.dof.aperture_fstop = 2.0
camera.dof.aperture_blades = 9
camera.dof.aperture_rotation = 0.0
camera.dof.aperture_ratio = 1.0
settings.coc_model = "cycles"
