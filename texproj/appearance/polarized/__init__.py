"""Paint and mirror told apart by two photos of each view, polarizers crossed and not.

Light through a polarizer keeps its polarization where a surface mirrors it and loses it where paint
scatters it (Ma et al., "Rapid acquisition of specular and diffuse normal maps from polarized
spherical gradient illumination", EGSR 2007): crossed filters show paint alone.
"""
