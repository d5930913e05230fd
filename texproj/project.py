"""The project folder: the only module that knows a file name in it.

Everything is read on demand and written to a temporary name, then renamed.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from texproj.errors import InputError, UsageError, excerpt, nearest_name
from texproj.files import read_json_object, remove_unfinished, staging, write_atomically
from texproj.formats.cameras import CameraFile, cameras_json, read_cameras
from texproj.formats.correspondences import correspondences_csv, read_correspondences
from texproj.formats.meshes import MESH_SUFFIXES
from texproj.formats.photos import PHOTO_SUFFIXES, RAW_SUFFIXES, SAID
from texproj.hashes import UNREADABLE, KnownHashes
from texproj.intake import (
    Found,
    all_of,
    find_crossed,
    find_masks,
    find_photos,
    find_picks,
    folders_of_photos,
    one_of,
    one_per_shot,
    points_nowhere,
    refuse_same_stems,
    shown,
    the_one_mesh,
    unusable_name,
)
from texproj.made import believable
from texproj.mesh import MeshSource
from texproj.options import DevelopOptions
from texproj.photo import Correspondences, Photo, PhotoInfo
from texproj.records import CameraRecord
from texproj.settings import Settings, read_settings

SETTINGS_FILE = "project.toml"
CAMERAS_FILE = "cameras.json"
MASKS_FOLDER, CROSSED_FOLDER, PICKS_FOLDER = "masks", "photos-crossed", "correspondences"
AS_USUAL = DevelopOptions()


@dataclass(frozen=True)
class Project:
    """A project folder and its settings."""

    root: Path
    settings: Settings

    @classmethod
    def open(cls, root: Path) -> Project:
        """The project in folder `root`.

        Raises InputError where there is no such folder, UsageError for settings that cannot be.
        """
        if not root.is_dir():
            raise InputError(f"no project folder at {root}; make one with `texproj new {root} ...`")
        path = root / SETTINGS_FILE
        try:
            text = path.read_text(encoding="utf-8-sig") if path.exists() else ""
        except OSError as error:
            raise InputError(f"{path} cannot be read: {error.strerror}") from None
        except UnicodeDecodeError:
            raise InputError(f"{path} is not a text file in UTF-8; save it as one") from None
        return cls(root, read_settings(text, str(path)))

    def with_settings(self, settings: Settings) -> Project:
        """The same folder with other settings; nothing is written."""
        return replace(self, settings=settings).with_hashes_of(self)

    def with_hashes_of(self, other: Project | None) -> Project:
        """The same project, which need not read again what `other` has read; itself for None."""
        if other is not None:
            vars(self)["_hashes"] = other._hashes
        return self

    # --- what a person puts in

    @cached_property
    def mesh_path(self) -> Path:
        """The mesh file. Raises InputError if there is none, more than one to choose from, or one
        of a name that cannot be written to a text file.
        """
        path = self._mesh_file()
        if why := unusable_name(path.name):
            raise InputError(f"{shown(path)} cannot be used: {why}; rename it")
        return path

    def _mesh_file(self) -> Path:
        if self.settings.mesh is not None:
            path = self.root / self.settings.mesh
            if not path.is_file():
                what = points_nowhere(path) or f"correct `mesh` in {self.root / SETTINGS_FILE}"
                raise InputError(f"no mesh at {path}; {what}")
            return path
        return the_one_mesh(self.root / "mesh", MESH_SUFFIXES, self.root / SETTINGS_FILE)

    @cached_property
    def photo_paths(self) -> dict[str, Path]:
        """The photos by file name, in the order of their names, less those that the settings leave
        out. Raises InputError for none, UsageError where the settings leave out an unknown one.
        """
        found = self._photos
        if not found.paths:
            said = "".join(f" ({note})" for note in found.notes)
            raise InputError(f"no photos in {self.photos}; put some there ({SAID}){said}")
        taken = self._taken.paths
        if not taken:
            raise InputError(f"`exclude` in {self.root / SETTINGS_FILE} leaves out every photo")
        refuse_same_stems(taken.values())
        return dict(taken)

    @cached_property
    def _taken(self) -> Found:
        """The photos less those that the settings leave out, one of each shot."""
        found = self._photos
        left_out = self._excluded(found.paths)
        taken = {name: path for name, path in found.paths.items() if name not in left_out}
        return one_per_shot(taken, RAW_SUFFIXES, self.settings.develop.pair)

    def _excluded(self, present: Collection[str]) -> set[str]:
        """The photos that the settings leave out. Raises UsageError for one that is not there."""
        for name in self.settings.exclude:
            if name not in present:
                raise UsageError(
                    f"{self.root / SETTINGS_FILE}: exclude: no photo {excerpt(name)!r} in"
                    f" {self.photos}{nearest_name(name, present)}"
                )
        return set(self.settings.exclude)

    @property
    def photos(self) -> Path:
        """The folder of the photos."""
        return self.root / self.settings.photos

    @property
    def masks(self) -> Path:
        """The folder of the stencils."""
        return self.root / MASKS_FOLDER

    @property
    def picks(self) -> Path:
        """The folder of the picked points."""
        return self.root / PICKS_FOLDER

    @cached_property
    def _photos(self) -> Found:
        return find_photos(self.photos, PHOTO_SUFFIXES)

    @cached_property
    def _masks(self) -> Found:
        return find_masks(self.masks, self._photos.paths)

    @cached_property
    def crossed(self) -> Found:
        """The partners of photos, taken through crossed polarizers."""
        return find_crossed(self.root / CROSSED_FOLDER, self._photos.paths, PHOTO_SUFFIXES)

    @cached_property
    def _picks(self) -> Found:
        return find_picks(self.picks, self._photos.paths)

    @property
    def notes(self) -> tuple[str, ...]:
        """A sentence for each file that a person put here and that nothing uses."""
        found = self._photos, self._taken, self._masks, self._picks
        return tuple(note for one in found for note in one.notes) + self._folders_passed_over

    @property
    def _folders_passed_over(self) -> tuple[str, ...]:
        """Of photos, inside the folder of the photos."""
        inside = folders_of_photos(self.photos, PHOTO_SUFFIXES)
        return tuple(
            f"photos in {shown(place)} are not used; move them to {self.photos}"
            for place, found in inside.items()
            if found.paths
        )

    @property
    def photo_names(self) -> list[str]:
        return list(self.photo_paths)

    def photo_path(self, name: str) -> Path:
        """The file of photo `name`. Raises UsageError for a name that is not in the project."""
        if name not in self.photo_paths:
            known = nearest_name(name, self.photo_paths)
            raise UsageError(f"no photo {name!r} in {self.photos}{known}")
        return self.photo_paths[name]

    def load_mesh(self) -> MeshSource:
        """The mesh, read and repaired in memory. Raises InputError."""
        from texproj.formats.meshes import read_mesh_file  # noqa: PLC0415 - slow to load
        from texproj.repair import repair  # noqa: PLC0415

        path = self.mesh_path
        file = read_mesh_file(path)
        try:
            source = repair(file.vertices, file.faces, file.layout)
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
        notes = tuple(f"{path}: {note}" for note in (*file.notes, *source.notes))
        return replace(source, notes=notes)

    def photo_info(self, name: str) -> PhotoInfo:
        """What the photo's header says. Raises InputError."""
        from texproj.formats.photos import read_photo_info  # noqa: PLC0415 - slow to load

        return read_photo_info(self.photo_path(name), self.settings.largest_photo_mp)

    def load_photo(self, name: str, longest: int | None = None, cut: bool = False) -> Photo:
        """The upright photo with its mask, its longer side reduced to `longest` if it is larger.
        cut: what stands in front of the piece (`occluder_path`) is masked too.
        """
        from texproj.formats.photos import read_photo  # noqa: PLC0415 - slow to load

        found = self.mask_path(name), self.occluder_path(name) if cut else None
        masks = [mask for mask in found if mask is not None and mask.is_file()]
        path, info = self.photo_path(name), self.photo_info(name)
        largest_mp, develop = self.settings.largest_photo_mp, self.settings.develop
        return read_photo(path, info, masks, longest, largest_mp, develop)

    def load_thumbnail(self, name: str, longest: int) -> Photo:
        """A small picture of the photo for lists: of a RAW file the camera's own if it has one."""
        from texproj.formats.photos import read_thumbnail  # noqa: PLC0415 - slow to load

        path = self.photo_path(name)
        found = None
        if path.suffix.lower() in RAW_SUFFIXES:
            found = read_thumbnail(path, self.photo_info(name), longest)
        return self.load_photo(name, longest) if found is None else found

    def mask_path(self, name: str) -> Path | None:
        """The stencil of photo `name`, None if it has none. Raises InputError where it has two."""
        return one_of(self._masks, name)

    def mask_files(self, name: str) -> tuple[Path, ...]:
        """The files that claim to be the stencil of photo `name`, of which there should be one."""
        return all_of(self._masks, name)

    def picks_files(self, name: str) -> tuple[Path, ...]:
        """The files that claim to be the picks of photo `name`, of which there should be one."""
        return all_of(self._picks, name)

    def correspondences_path(self, name: str) -> Path:
        """Where the picks of photo `name` are, or would be. Raises InputError for two files."""
        usual = self.picks / f"{Path(name).stem}.csv"
        return one_of(self._picks, name) or usual

    def load_correspondences(self, name: str) -> Correspondences | None:
        """The picks of photo `name`, None if there are none. Raises InputError."""
        path = self.correspondences_path(name)
        return read_correspondences(path) if path.is_file() else None

    def save_correspondences(self, name: str, picks: Correspondences) -> None:
        """Write the picks of photo `name`. Raises OutputError."""
        self.photo_path(name)
        write_atomically(self.correspondences_path(name), correspondences_csv(picks))

    # --- cameras

    @property
    def cameras_path(self) -> Path:
        return self.root / CAMERAS_FILE

    def load_cameras(self) -> dict[str, CameraRecord]:
        """The entries of cameras.json by photo name; empty if there is no such file."""
        return {record.file: record for record in self._camera_file.records}

    def save_cameras(self, records: Iterable[CameraRecord]) -> None:
        """Write `records` over the entries of the same photos, keeping all others.

        Raises OutputError.
        """
        old = self._camera_file
        merged = {record.file: record for record in (*old.records, *records)}
        ordered = [merged[name] for name in sorted(merged)]
        write_atomically(self.cameras_path, cameras_json(ordered, old.extra))

    @property
    def _camera_file(self) -> CameraFile:
        """What cameras.json holds, parsed again only where another file stands there now."""
        try:
            stat = self.cameras_path.stat()
        except (FileNotFoundError, NotADirectoryError):
            return CameraFile([], {})
        stamp = (stat.st_ino, stat.st_size, stat.st_mtime_ns)
        if stamp not in self._parsed:
            parsed = read_cameras(self.cameras_path)
            self._parsed.clear()
            self._parsed[stamp] = parsed
        return self._parsed[stamp]

    @cached_property
    def _parsed(self) -> dict[tuple[int, int, int], CameraFile]:
        """The last cameras.json that was read, by what tells it from others."""
        return {}

    def save_registration(
        self, records: Iterable[CameraRecord], stage: str, made: Mapping[str | None, Any]
    ) -> None:
        """Write `records` to cameras.json and `made`, how they came about, by photo, or under None
        for all together: both, or, where one cannot be written, neither. Raises OutputError.
        """
        paths = {self.record_path(stage, name): told for name, told in made.items()}
        with staging(next(iter(paths)).parent) as folder:
            for path, told in paths.items():
                (folder / path.name).write_text(json.dumps(told, indent=1), encoding="utf-8")
            self.save_cameras(records)

    def check_writable(self, *folders: Path) -> None:
        """Raise OutputError where results could not be written to `folders` of the project, before
        any work is spent on them. Makes no folder.
        """
        for folder in (self.root, *folders):
            if folder.exists():
                with staging(folder):
                    pass

    # --- what the machine makes

    @property
    def work(self) -> Path:
        return self.root / "work"

    @property
    def log_folder(self) -> Path:
        return self.work / "log"

    @property
    def out(self) -> Path:
        return self.root / "out"

    def factors_path(self, name: str) -> Path:
        """Where pictures of what a photo counts for are written."""
        return self.out / "factors" / Path(name).stem

    def record_path(self, stage: str, name: str | None = None) -> Path:
        """Where the record of a stage, or of one photo in it, is kept."""
        return self.work / stage / f"{name}.json" if name else self.work / f"{stage}.json"

    def load_record(self, stage: str, name: str | None = None) -> dict[str, Any] | None:
        """What a stage wrote about its last run; None if it never ran or the file is broken."""
        record = read_json_object(self.record_path(stage, name))
        return record if believable(stage, record) else None

    def save_record(self, stage: str, name: str | None, record: dict[str, Any]) -> None:
        """Keep what a stage has to say about its run. Raises OutputError."""
        write_atomically(self.record_path(stage, name), json.dumps(record, indent=1))

    def features_path(self) -> Path:
        """The file in which features and matches of photos are kept from run to run. Raises
        OutputError where there can be none.
        """
        folder = self.work / "block"
        with staging(folder):
            pass
        return folder / "features.db"

    def occluder_path(self, name: str) -> Path:
        """The mask of what stands in front of the piece in a photo, where there is such a thing."""
        return self.occluders / f"{Path(name).stem}.png"

    @property
    def occluders(self) -> Path:
        """The folder of such masks."""
        return self.work / "occluders"

    def array_path(self, key: str) -> Path:
        """The file in which an array is cached."""
        return self.work / "arrays" / f"{key}.npy"

    def load_array(self, key: str) -> NDArray[Any] | None:
        """The array cached under `key`, None if there is none."""
        path = self.array_path(key)
        try:
            return np.load(path, allow_pickle=False) if path.is_file() else None
        except (OSError, ValueError, EOFError):
            return None

    def save_array(self, key: str, array: NDArray[Any]) -> None:
        """Cache an array under `key`. Raises OutputError."""
        path = self.array_path(key)
        with staging(path.parent) as folder:
            np.save(folder / path.name, array, allow_pickle=False)

    def hash_of(self, path: Path | Sequence[Path] | None) -> str | None:
        """Hash of a file's content, None where there is no such file; several that claim the same
        have one too. Of a photo that is no finished picture, with what the settings make of it.
        """
        if isinstance(path, Sequence):
            return "+".join(str(self.hash_of(one)) for one in path) or None
        found = None if path is None else self._hashes.of(path)
        if path is None or found in (None, UNREADABLE):
            return found
        return found + self._reading(path)

    def _reading(self, path: Path) -> str:
        """What the settings make of a photo that is no finished picture; empty for the usual."""
        told = self.settings.develop
        by_kind: dict[str, str] = dict.fromkeys(RAW_SUFFIXES, told.white_balance)
        by_kind |= dict.fromkeys((".tif", ".tiff"), told.float_light)
        how = by_kind.get(path.suffix.lower())
        usual = how in (None, AS_USUAL.white_balance, AS_USUAL.float_light)
        return "" if usual or path.parent != self.photos else f" {how}"

    @cached_property
    def _hashes(self) -> KnownHashes:
        return KnownHashes(read_json_object(self.record_path("hashes")))

    def save_hashes(self) -> None:
        """Keep the hashes for the next run. Raises OutputError."""
        self.save_record("hashes", None, self._hashes.record)

    def remove_unfinished(self) -> None:
        """Delete what an interrupted run left behind."""
        here = (self.root, self.picks, self.masks)
        made = (p for top in (self.work, self.out) for p in (top, *top.rglob("*")) if p.is_dir())
        for folder in (*here, *made):
            remove_unfinished(folder)
