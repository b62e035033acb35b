"""What the user says about a file that the file does not say itself, and the choice of the reader."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from softjaw.study.messages import OTHER_FILE, USAGE, StudyError

ENDINGS = (".csv", ".vtu", ".vtp")
LARGEST_FILE = 100 * 2**20  # bytes
MOST_FACES = 500_000


@dataclass(frozen=True)
class Reading:
    """How a file is read.

    Parameters
    ----------
    unit : str or None
        Unit of lengths and, squared, of areas that carry none: ``m``, ``cm`` or ``mm``.
    pressure_unit : str or None
        Unit of a pressure that carries none: ``pa``, ``kpa`` or ``mpa``.
    pressure_name : str or None
        Name of the column or data array that holds the pressure; by default ``pressure``.
    flip_normals : bool
        Whether all normals are turned to the other side.
    """

    unit: str | None = None
    pressure_unit: str | None = None
    pressure_name: str | None = None
    flip_normals: bool = False

    def unit_of(self, kind: str) -> str | None:
        """Unit of a bare ``length``, ``area``, ``pressure`` or ``number``."""
        if kind == "area" and self.unit:
            return f"{self.unit}2"
        return {"length": self.unit, "pressure": self.pressure_unit, "number": "-"}.get(kind)


def check_count(file: str, count: int) -> None:
    """Refuse more faces than a patch may have, before they are read."""
    if count > MOST_FACES:
        text = f"{file}: found {count} faces, expected at most {MOST_FACES}; export the contact surface alone"
        raise StudyError(USAGE, text)


def read_patch(file: str, reading: Reading):
    """The patch in a file, checked.

    Returns
    -------
    ReadPatch
        Loaded faces in the file's coordinates [m, Pa].

    Raises
    ------
    StudyError
        With code 3 if the file cannot be read as what its ending says, 2 if what it holds is no patch.
    """
    path = Path(file)
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        text = f"{file}: found {f'the ending {path.suffix}' if path.suffix else 'no ending'}, expected one of "
        raise StudyError(USAGE, f"{text}{', '.join(ENDINGS)}; export the patch as CSV, or as VTU or VTP from ParaView")
    try:
        size = path.stat().st_size
        if not path.is_file():  # a device or a pipe may have no end
            raise StudyError(OTHER_FILE, f"{file}: is no regular file; name the file of a patch")
        path.open("rb").close()
        if size > LARGEST_FILE:
            text = f"{file}: has {size >> 20} MiB, more than {LARGEST_FILE >> 20} MiB"
            raise StudyError(USAGE, f"{text}; export the contact surface alone")
    except OSError as error:
        raise StudyError(OTHER_FILE, f"{file}: cannot be read ({error.strerror}); check the path") from error
    from softjaw.study.patch.faces import checked

    if ending == ".csv":
        from softjaw.study.patch.table_file import read_table

        return checked(read_table(path, reading), reading.flip_normals)
    from softjaw.study.patch.vtk_file import read_vtk

    return checked(read_vtk(path, reading), reading.flip_normals)
