"""What `import rig` gives, for type checkers; see `rig.library`."""

from rig.library import Prediction as Prediction
from rig.library import compare as compare
from rig.library import declared as declared
from rig.library import diagnose as diagnose
from rig.library import effects as effects
from rig.library import fit as fit
from rig.library import held_out as held_out
from rig.library import plot as plot
from rig.library import predict as predict
from rig.library import read as read
from rig.library import save as save
from rig.library import simulate as simulate
from rig.library import to_pandas as to_pandas
from rig.library import to_polars as to_polars
from rig.library import to_xarray as to_xarray

__version__: str
