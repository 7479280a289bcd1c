"""Compiled functions by address: what is called through one is compiled once, not again into each of its callers.

Numba copies the code of every callee into its caller and optimises it there again, so that a chain of large functions
costs its compile time many times over. A function passed as a value of `by_address` is called where it lies.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from fem_biobot.compile_cache import ensure_cache_folder

ensure_cache_folder()

from numba import typeof, types  # noqa: E402  (numba looks for its cache folder when it loads)


class _Address(types.WrapperAddressProtocol):
    """A kernel compiled for one signature."""

    def __init__(self, compiled: Any) -> None:
        self.compiled = compiled
        self.address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)

    def __wrapper_address__(self) -> int:
        return self.address

    def signature(self) -> Any:
        return self.compiled.signature


_addresses: dict[Any, _Address] = {}


def _compiled(kernel: Any, signature: tuple[Any, ...]) -> Any:
    if signature not in kernel.overloads:
        kernel.compile(signature)
    return kernel.overloads[signature]


def by_address(kernel: Callable[..., Any], *arguments: Any) -> Any:
    """The kernel compiled for arguments such as these, to be passed to other kernels; itself where it is not compiled.

    The kernel must not raise. It is compiled, or fetched from numba's cache, at the first call.
    """
    if not hasattr(kernel, "compile"):
        return kernel
    signature = tuple(typeof(a) for a in arguments)
    if (kernel, signature) not in _addresses:
        _addresses[kernel, signature] = _Address(_compiled(kernel, signature))
    return _addresses[kernel, signature]


def entry(kernel: Callable[..., Any], *arguments: Any) -> Callable[..., Any]:
    """The kernel compiled for arguments of just these types, without looking at the types again in every call."""
    if not hasattr(kernel, "compile"):
        return kernel
    return _compiled(kernel, tuple(typeof(a) for a in arguments)).entry_point
