"""The errors of a model file."""

from estimation.errors import UnknownNameError
from estimation.model import ModelError


class ModelFileError(ModelError):
    """A model file cannot be read; the message names the file and the key."""


class NoModelError(ModelFileError, UnknownNameError):
    """There is no model of that name, and no such file."""
