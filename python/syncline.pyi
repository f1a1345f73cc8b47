"""Plans, checks and validates CNC programs on a machine of simulated CANopen drives."""

from collections.abc import Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypeAlias, TypedDict, final

from typing_extensions import NotRequired

Path: TypeAlias = str | PathLike[str]
# A value of a key of the machine file.
Value: TypeAlias = bool | int | float | str | Sequence[Value]

__version__: str

class SynclineError(Exception):
    """Bad input, with the message of `syncline check`."""

@final
class Column:
    """A column of numbers, which `numpy.asarray` and `pyarrow.array` look at where it is."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str:
        """`mm`, `mm/s`, `s`; empty where there is none."""
    def __len__(self) -> int: ...
    def __getitem__(self, at: int) -> int | float:
        """One of its values; slices are NumPy's affair."""
    @property
    def __array_interface__(self) -> dict[str, Any]: ...
    def __arrow_c_array__(self, requested_schema: object | None = None) -> tuple[object, object]: ...
    def __arrow_c_schema__(self) -> object: ...

@final
class Columns:
    """Columns of equal length, which `pyarrow.table` looks at where they are."""

    def keys(self) -> list[str]: ...
    @property
    def rows(self) -> int: ...
    @property
    def units(self) -> dict[str, str]: ...
    def __len__(self) -> int: ...
    def __contains__(self, name: str) -> bool: ...
    def __iter__(self) -> Iterator[str]: ...
    def __getitem__(self, name: str) -> Column: ...
    def __arrow_c_stream__(self, requested_schema: object | None = None) -> object: ...
    def __arrow_c_schema__(self) -> object: ...

@final
class Axis:
    """One axis of a move: from `p0`, `v0`, `a0` to `pf`, `vf`, `af` (length, per s, per s²) within limits."""

    def __init__(
        self,
        p0: float,
        pf: float | None = None,
        *,
        vmax: float,
        amax: float,
        jmax: float,
        v0: float = 0.0,
        a0: float = 0.0,
        vf: float = 0.0,
        af: float = 0.0,
        vmin: float | None = None,
        amin: float | None = None,
        jmin: float | None = None,
        pmin: float | None = None,
        pmax: float | None = None,
    ) -> None: ...

@final
class Plan:
    """A certified move."""

    @property
    def duration(self) -> float:
        """s"""
    def segments(self) -> list[Columns]:
        """Of each axis: `duration_s` (s) and `jerk` (length/s³)."""
    def sample(self, period: float) -> Columns:
        """Every `period` s: `t_s` and of each axis `p_0`, `v_0`, `a_0`, `j_0`."""

def plan(
    axes: Sequence[Axis], *, sync: Literal["line", "time", "none"] = "time", min_duration: float = 0.0
) -> Plan:
    """Plans a move of one or more axes as fast as their limits allow; `min_duration` in s."""

class Bus(TypedDict):
    name: str
    bit_rate: int
    cycle_s: float
    demand_s: float

class Program(TypedDict):
    blocks: int
    length_mm: float
    turned_deg: float
    capped_moves: int
    arc_deviation_mm: float
    known_to_line: int | None

class Checked(TypedDict):
    machine: str
    axes: list[str]
    bus: list[Bus]
    program: NotRequired[Program]

def check(machine: Path, program: Path | None = None, *, set: Mapping[str, Value] | None = None) -> Checked:
    """Checks a machine file, and a program for it, and moves nothing."""

@final
class Validation:
    """The result of a validation; `str(it)` is what `syncline validate` prints."""

    @property
    def verdict(self) -> Literal["pass", "fail", "interrupted"]: ...
    @property
    def summary(self) -> dict[str, Any]:
        """What `syncline validate --json` writes."""
    @property
    def trace(self) -> Columns | None:
        """What was in every cycle; see docs/python.md for the columns."""

def validate(
    machine: Path,
    program: Path,
    *,
    set: Mapping[str, Value] | None = None,
    tables: Path | None = None,
    seed: int = 0,
    trace: bool = True,
) -> Validation:
    """Runs a program on simulated drives in virtual time and judges it."""
