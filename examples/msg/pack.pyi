# Made by `ril topic generate` from Pack.msg: do not edit.
from typing import Any, Generic, Iterator, Type, TypeVar

_T = TypeVar("_T")
_S = TypeVar("_S", bound="_Struct")

class _Array(Generic[_T]):
    def __getitem__(self, index: int) -> _T: ...
    def __setitem__(self, index: int, value: _T) -> None: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[_T]: ...
    def __buffer__(self, flags: int) -> memoryview: ...

class _Struct:
    @classmethod
    def from_buffer_copy(cls: Type[_S], source: Any, offset: int = ...) -> _S: ...
    @staticmethod
    def type_name() -> str: ...
    def __buffer__(self, flags: int) -> memoryview: ...

class Cell(_Struct):
    """One cell."""
    voltage_v: float
    """Under load. [V]"""
    temperature_c: float
    """At its surface. [deg C]"""
    def __init__(self, voltage_v: float = ..., temperature_c: float = ...) -> None: ...

class Pack(_Struct):
    """The flight battery, cell by cell."""
    sequence: int
    """Counts the samples of this publisher from 1."""
    epoch_ns: int
    """When the publisher began, host monotonic ns. [ns]"""
    charge: float
    """Charge that is left, 0 to 1."""
    cells: _Array[Cell]
    """From the negative pole."""
    def __init__(self, sequence: int = ..., epoch_ns: int = ..., charge: float = ..., cells: Any = ...) -> None: ...
