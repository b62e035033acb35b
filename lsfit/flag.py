"""What can be wrong with a fit."""

from __future__ import annotations

from enum import IntFlag


class FitError(ArithmeticError):
    """A fit, or a measure of a fitted body, that could not be completed."""


class OpenBodyError(FitError):
    """A level set that is not closed: it has no volume, and no support in some direction."""


class UndecidedError(FitError):
    """A question that rounding would answer: the value that decides is too small to be told from zero."""


class FitFlag(IntFlag):
    """What the reader of a fitted limit surface should know; flags add up."""

    CLEAN = 0
    RANK_DEFICIENT = 1  # the samples lie in a subspace: the body is flat and carries no load out of it
    UNDERDETERMINED = (
        2  # fewer independent data than coefficients: of all equally good fits, the nearest to an ellipsoid
    )
    BOUNDED = 4  # the data alone would give an endless body: its reach was limited to a multiple of the data's
    THIN = 8  # the samples are a thousand times shorter along one direction: rho does not suit the contact
