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

PHOTO_SUFFIXES = tuple(suffix for suffixes in KINDS.values() for suffix in suffixes)
SAID = "jpg, png, tif, heic, avif, exr, or a camera's RAW"
"""What a person is told that photos may be."""
