import bpy

effects = bpy.context.scene.potmesil_camera.effects

effects.diffraction.use = False
effects.diffraction.strength = 1.0
effects.diffraction.f_stop = 0.0
effects.diffraction.spectral = True
effects.star.use = False
effects.star.lines = 2
effects.star.rotation = 0.0
effects.star.strength = 0.1
effects.star.groove_width = 20.0
effects.image_filter.use = False
effects.image_filter.image = ""
effects.image_filter.strength = 0.1
effects.image_filter.size = 0.25
effects.image_filter.rotation = 0.0
effects.exposure.use = True
effects.exposure.sensitivity = 6400.0
effects.exposure.normal_ev = 2.6
effects.exposure.density = 0.0
effects.exposure.tint = (1.0, 1.0, 1.0)
effects.grain.use = False
effects.grain.granularity = 10.0
effects.grain.size = 10.0
effects.grain.color = 0.5
effects.grain.seed = 0
effects.noise.use = True
effects.noise.full_well = 50000.0
effects.noise.read_noise = 3.0
effects.noise.seed = 0
