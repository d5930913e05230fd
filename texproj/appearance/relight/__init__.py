"""Pictures of a recovered surface in another light: sky, sun, lamps; exposure and tone."""

from texproj.appearance.relight.environment import Environment, overcast
from texproj.appearance.relight.illumination import Illumination, Lamp, Sun
from texproj.appearance.relight.lit_surface import LitSurface
from texproj.appearance.relight.pictures import relit_pictures
from texproj.appearance.relight.radiosity import Radiosity
from texproj.appearance.relight.thin_lens import Lens, pictures_through
from texproj.appearance.relight.tone import TONES, Development, ToneName, exposure_of_ev
from texproj.appearance.relight.traced import check_tracer, traced_pictures

__all__ = [
    "TONES",
    "Development",
    "Environment",
    "Illumination",
    "Lamp",
    "Lens",
    "LitSurface",
    "Radiosity",
    "Sun",
    "ToneName",
    "check_tracer",
    "exposure_of_ev",
    "overcast",
    "pictures_through",
    "relit_pictures",
    "traced_pictures",
]
