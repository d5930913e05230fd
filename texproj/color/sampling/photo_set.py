"""The photos of a model: their names and cameras, and what each shows, when it is asked for."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial

from texproj.arrays import Floats
from texproj.camera import Camera
from texproj.color.sampling.depth_images import DepthImages
from texproj.color.sampling.part import Elsewhere, Unusable
from texproj.color.sampling.prepare import view_of
from texproj.color.sampling.sides import seen_from_behind
from texproj.color.sampling.view import PhotoView
from texproj.errors import InputError
from texproj.mesh import Mesh
from texproj.options import ColorOptions
from texproj.photo import Photo
from texproj.render import Renderer, Scene
from texproj.resources.scratch import Scratch
from texproj.resources.threads import ahead


@dataclass(frozen=True, eq=False)
class PhotoSet:
    """Registered photos, each known by its name; nothing of a photo is kept in memory.

    names: one each; cameras: of the full-size photos, in the same order; read: decodes the photo
    of a name, raises InputError for one that cannot be used; depths: what the cameras see of the
    mesh, once it was rendered; elsewhere: who projects them, if not this process.
    """

    names: tuple[str, ...]
    cameras: tuple[Camera, ...]
    read: Callable[[str], Photo]
    depths: DepthImages | None = None
    elsewhere: Elsewhere | None = None

    def __len__(self) -> int:
        return len(self.names)

    def subset(self, names: Collection[str]) -> PhotoSet:
        """Some of the photos, not rendered yet."""
        kept = [n for n, name in enumerate(self.names) if name in names]
        cameras = tuple(self.cameras[n] for n in kept)
        return PhotoSet(tuple(self.names[n] for n in kept), cameras, self.read)

    def rendered(self, scene: Scene, scratch: Scratch) -> PhotoSet:
        """The same with the depth images of all cameras, kept in `scratch`."""
        return replace(self, depths=DepthImages.of(self.cameras, scene, scratch))

    def seen_on(self, mesh: Mesh, renderer: Renderer, scratch: Scratch) -> PhotoSet:
        """The same with the depth images of all cameras: those that are known, or rendered now into
        `scratch`. Nothing of the scene stays in memory. Raises InputError for a mesh that they see
        from behind.
        """
        if self.depths is not None:
            return self
        with renderer.load(mesh) as scene:
            depths = DepthImages.of(self.cameras, scene, scratch)
        return replace(self, depths=replace(depths, behind=seen_from_behind(mesh, depths)))

    @property
    def seen_from_behind(self) -> float:
        """The part of what is seen of the mesh that is the back of its faces."""
        return 0.0 if self.depths is None else self.depths.behind

    def depth_image(self, number: int) -> tuple[Camera, Floats]:
        """The pinhole camera and the (h, w) depth image of a photo. Raises ValueError where nothing
        was rendered, which is an error of the program.
        """
        if self.depths is None:
            raise ValueError("the depth images of the photos have not been rendered")
        return self.depths.read(number)

    def photo(self, number: int) -> Photo | Unusable:
        """The decoded photo."""
        name = self.names[number]
        try:
            return self.read(name)
        except InputError as error:
            return Unusable(name, str(error))

    def view(self, number: int, options: ColorOptions) -> PhotoView | Unusable:
        """A photo, ready to be sampled."""
        photo = self.photo(number)
        if isinstance(photo, Unusable):
            return photo
        return view_of(photo, self.cameras[number], *self.depth_image(number), options)

    def views(self, options: ColorOptions) -> Iterator[PhotoView | Unusable]:
        """All photos in turn, ready to be sampled, one of them ahead of time."""
        return ahead(partial(self.view, options=options), len(self))


def reasons(*failures: Iterable[Unusable]) -> dict[str, str]:
    """Why photos cannot be used, by name; the first reason of each."""
    out: dict[str, str] = {}
    for one in (one for some in failures for one in some):
        out.setdefault(one.name, one.reason)
    return out
