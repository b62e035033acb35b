"""HDF5 files for reading: known paths alone, never another file, and one clear error for what is damaged."""

import os
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study.messages import IN_USE, OTHER_FILE, StudyError, printable, why

# what h5py raises for damage: its own errors have no class of their own
BROKEN = (RuntimeError, OSError, KeyError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)


class StoredFile:
    """Reads known paths of a file of unknown origin: never another file, never more than the file holds."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path, self._file, self._bytes = path, file, path.stat().st_size
        self._nodes: dict[str, Any] = {"": file}
        self.early: dict[str, Any] = {}  # values of datasets as they were read first

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def damaged(self, what: str, cure: str = "restore it from a copy") -> StudyError:
        """The error for a file that is not as it was written."""
        return StudyError(OTHER_FILE, f"{self.path}: damaged ({what}); {cure}")

    def attributes(self, path: str = "") -> dict[str, Any]:
        """Attributes of a group or dataset: texts, and lists as arrays."""
        with self._damage(path or "/"):
            values = dict(self._node(path).attrs.items())
            return {key: text_of(value) if np.ndim(value) == 0 else np.asarray(value) for key, value in values.items()}

    def checked(self, path: str, shape: tuple[int, ...], dtype: np.dtype) -> h5py.Dataset:
        """A dataset that has the expected shape and type."""
        dataset = self.plain(path)
        if dataset.shape != shape or dataset.dtype != dtype:
            raise self.damaged(f"{path} has shape {dataset.shape} of {dataset.dtype}, expected {shape} of {dtype}")
        return dataset

    def plain(self, path: str) -> h5py.Dataset:
        """A dataset whose data stand in this very file."""
        with self._damage(path):
            dataset = self._node(path)
            if not isinstance(dataset, h5py.Dataset):
                raise self.damaged(f"{path} is not a dataset")
            plist = dataset.id.get_create_plist()
            virtual = plist.get_layout() == h5py.h5d.VIRTUAL
            nbytes = dataset.size * max(dataset.dtype.itemsize, 1) if dataset.shape is not None else 0
            # A header can claim any size, and a reader allocates it before it misses the data.
            # times that data in a file may be smaller than what is read from it
            too_large = nbytes > self._bytes * (1000 if dataset.chunks else 1)
            if virtual or plist.get_external_count() or too_large:
                raise StudyError(OTHER_FILE, f"{self.path}: {path} is not stored in this file; do not trust it")
            return dataset

    def texts(self, path: str) -> list[str]:
        """A list of texts of any length."""
        if (dataset := self.plain(path)).ndim != 1 or not h5py.check_string_dtype(dataset.dtype):
            raise self.damaged(f"{path} is not a list of texts")
        return [text_of(text) for text in self.values(path).tolist()]

    def values(
        self, path: str, shape: tuple[int, ...] | None = None, dtype: np.dtype | None = None, index: Any = (),
        *, anew: bool = False,
    ) -> Any:  # fmt: skip
        """Values of a dataset, all or those of an index; with ``shape`` and ``dtype`` those of a `checked` one.

        ``anew``: as they stand in the file now; HDF5 buffers small datasets as long as they are open.
        """
        if anew:
            self._nodes.pop(path, None)
        dataset = self.plain(path) if shape is None or dtype is None else self.checked(path, shape, dtype)
        with self._damage(path):
            return dataset[index]

    def _node(self, path: str) -> Any:
        path = path.rstrip("/")
        if path not in self._nodes:
            # Link by link: HDF5 by itself would follow soft and external links out of the file.
            parent, _, name = path.rpartition("/")
            group = self._node(parent)
            link = group.get(name, getlink=True) if isinstance(group, h5py.Group) else None
            if not isinstance(link, h5py.HardLink):
                raise StudyError(OTHER_FILE, f"{self.path}: {path} is missing or in another file; do not trust it")
            self._nodes[path] = group[name]
        return self._nodes[path]

    @contextmanager
    def _damage(self, path: str) -> Iterator[None]:
        """Turn whatever HDF5 says of damage into one sentence."""
        try:
            yield
        except BROKEN as error:
            raise self.damaged(f"{path}: {why(error)}") from error


@contextmanager
def opened(path: Path, kind: str, make: Callable[[StoredFile], Any]) -> Iterator[Any]:
    """What ``make`` makes of a file, which is open within the ``with``.

    `StudyError` if the file cannot be read as a file of this ``kind``, or another program holds it.
    """
    # Opening a pipe or a device could block for ever.
    if path.exists() and not path.is_file():
        raise StudyError(OTHER_FILE, f"{path}: is not a regular file; name a {kind}")
    try:
        file = StoredFile(path, h5py.File(path, "r"))
    except FileNotFoundError as error:
        raise StudyError(OTHER_FILE, f"{path}: no such file") from error
    except BROKEN as error:
        # h5py has no class for this: only the text tells a lock from damage.
        if "unable to lock file" in str(error):
            raise StudyError(IN_USE, f"{path}: another program holds it open for writing; close it there") from error
        raise StudyError(OTHER_FILE, f"{path}: {_why_not(path, kind, error)}") from error
    with closing(file):
        try:
            made = make(file)
        except BROKEN as error:
            text = f"{path}: not a {kind} of softjaw ({why(error)}); choose another file"
            raise StudyError(OTHER_FILE, text) from error
        yield made


def _why_not(path: Path, kind: str, error: Exception) -> str:
    """What to say of a file that HDF5 does not open."""
    if not os.access(path, os.R_OK):
        return "permission denied; ask its owner to let you read it"
    if path.suffix == ".toml":
        return f"is a scene, not a {kind}; 'softjaw run {path}' solves it"
    return f"not a readable {kind} ({why(error)}); move it away or restore it"


def text_of(value: Any) -> str:
    """Text of an attribute or a fixed-length string, with nothing in it that a terminal would obey."""
    return printable(value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value))
