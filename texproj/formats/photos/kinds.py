"""The kinds of photos that are read, and the endings of their names."""

RAW_SUFFIXES = (
    ".dng", ".cr2", ".cr3", ".crw", ".nef", ".nrw", ".arw", ".sr2", ".srf", ".raf", ".orf", ".rw2",
    ".pef", ".srw", ".3fr", ".fff", ".iiq", ".mrw", ".rwl", ".erf", ".mef", ".mos", ".kdc", ".dcr",
    ".x3f",
)  # fmt: skip
"""As cameras write them; LibRaw tells by the content which it is."""

KINDS: dict[str, tuple[str, ...]] = {
    "JPEG": (".jpg", ".jpeg"),
    "PNG": (".png",),
    "TIFF": (".tif", ".tiff"),
    "RAW": RAW_SUFFIXES,
    "HEIC": (".heic", ".heif", ".hif"),
    "AVIF": (".avif",),
    "OpenEXR": (".exr",),
}
"""Endings of each kind, in small letters."""

PIXELS = {
    "JPEG": ("8 bits; grey, RGB, CMYK", "OpenCV, imagecodecs"),
    "PNG": ("8, 16 bits; grey, RGB, alpha", "imagecodecs"),
    "TIFF": ("8, 16 bits, floating point; grey, RGB, CMYK, alpha", "tifffile, imagecodecs"),
    "RAW": ("linear light of the sensor", "LibRaw"),
    "HEIC": ("8 to 12 bits", "pillow-heif, if installed"),
    "AVIF": ("8 to 12 bits", "Pillow, imagecodecs"),
    "OpenEXR": ("linear light, half and float", "OpenEXR"),
}
"""By kind, what such a file holds and the library that reads it."""

PHOTO_SUFFIXES = tuple(suffix for suffixes in KINDS.values() for suffix in suffixes)
SAID = "jpg, png, tif, heic, avif, exr, or a camera's RAW"
"""What a person is told that photos may be."""
