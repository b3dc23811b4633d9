import bpy

effects = bpy.context.scene.potmesil_camera.effects

effects.pupil.use = True
effects.pupil.blade_curvature = 0.0
effects.pupil.obstruction = 0.0
effects.pupil.apodisation = 0.0
effects.pupil.spherical_aberration = -10.0
effects.pupil.image = ""
effects.focal_surface.use = True
effects.focal_surface.tilt = 0.0
effects.focal_surface.swing = 0.0
effects.focal_surface.curvature = 13.0
effects.chromatic.use = True
effects.chromatic.focus_red = 0.3
effects.chromatic.focus_blue = -0.5
effects.chromatic.size_red = 0.002
effects.chromatic.size_blue = -0.002
effects.vignetting.use = True
effects.vignetting.natural = 1.0
effects.vignetting.mechanical = 0.0
effects.vignetting.fastest_f_stop = 0.0
effects.distortion.use = True
effects.distortion.model = "brown"
effects.distortion.k1 = -0.05
effects.distortion.k2 = 0.0
effects.distortion.k3 = 0.0
effects.distortion.k4 = 0.0
effects.distortion.p1 = 0.0
effects.distortion.p2 = 0.0
