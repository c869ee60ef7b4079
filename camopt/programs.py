"""Programs compiled by numba, cached in the user's cache folder for exactly the sources that they were made from.

By default numba compares a cached program only with the file of its own function, although it compiles into it what
that function calls from other files, the types that these define, and the constants that they read. Here the programs
of each folder of `TOGETHER` are stored in a folder named by the digest of all their sources. After any change they are
therefore compiled again, an older installation finds its own programs again, and copies of one version share theirs.
"""

import shutil
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import SimpleNamespace
from typing import Any, TypeVar

import numba
from numba.core import cgutils, config, imputils, types
from numba.core.caching import FunctionCache, _CacheLocator
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.datamodel.models import PrimitiveModel
from numba.core.environment import lookup_environment
from numba.core.typing.templates import AttributeTemplate
from numba.extending import NativeValue, infer_getattr, lower_getattr_generic, register_model, typeof_impl, unbox

from camopt.cache import cache_folder

T = TypeVar("T")
PACKAGE = Path(__file__).parent
TOGETHER = ("exact", "verifier/methods")
"""Folders within which functions call each other; a compiled file elsewhere depends on itself and CONSTANTS only."""
CONSTANTS = (PACKAGE / "scene/units.py", PACKAGE / "scene/settled.py", PACKAGE / "programs.py")
"""Files outside these folders whose constants, rules and types are compiled into the programs."""
OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""Options of every compilation: divisions follow NumPy (their infinities end in a refused motion); no entry for C."""
KEPT_DAYS = 60
"""Days after which the programs of other versions are deleted."""


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """Compiles a function by numba without the interpreter's lock and caches it on disk; `options` are those of
    `numba.njit`. Without a cache folder the program is compiled in each process."""
    if function is None:
        return lambda f: compiled(f, **options)
    options = OPTIONS | {"pipeline_class": ProgramCompiler} | options
    if _folder(Path(function.__code__.co_filename)) is None:
        return numba.njit(**options)(function)
    settings: Any = config  # its declared type lacks the attributes used here
    before = settings.CACHE_LOCATOR_CLASSES
    settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{ProgramFolder.__name__}"
    try:
        program: Any = numba.njit(**options)(function)
        if program is not function:  # else numba is set to compile nothing
            program._cache = CachedPrograms(function)  # `cache=True` does the same with numba's own class
        return program
    finally:
        settings.CACHE_LOCATOR_CLASSES = before


def inner(function: Callable | None = None, **options: Any) -> Any:
    """`compiled` for a function that only compiled functions call: it becomes part of their programs and is not cached
    by itself.

    It has no entry point for Python, which often takes as long to compile as the function; a call from Python would
    crash the process (tests/test_programs.py checks that there is none).
    """
    if function is None:
        return lambda f: inner(f, **options)
    options = OPTIONS | {"pipeline_class": InnerCompiler, "no_cpython_wrapper": True} | options
    return numba.njit(**options)(function)


def njit_no_refcount(function: Callable | None = None, **options: Any) -> Any:
    """`inner` without reference counting, for a function that neither creates nor returns an array.

    By default numba counts the references of every array in every tuple passed to a function, with two locked
    instructions each, which dominates the time of a small function: 340 ns against 8 ns per call with 24 arrays. numba
    refuses such a function if it creates an array; it does not detect one that returns an array.
    """
    return inner(function, _nrt=False, **options)


class InnerCode(JITCodeLibrary):
    """The code of an `inner` function. numba would let LLVM optimise it and generate machine code for it alone, which
    dominated the compile time; here that is done once in each program that contains it."""

    def finalize(self) -> None:
        """Leaves the function unoptimised, and what it calls to the program that will contain both."""
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """A stand-in for the code generator, for the step in which numba gives machine code its environment."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class ProgramCode(JITCodeLibrary):
    """The code of a `compiled` function: a program that contains everything that the function calls."""

    def finalize(self) -> None:
        """Adds the libraries that the linked libraries need, optimises the whole and generates machine code."""
        libraries = self._linking_libraries  # the loop appends to this list
        for library in libraries:
            if isinstance(library, InnerCode):
                libraries.extend(needed for needed in library._linking_libraries if needed not in libraries)
        super().finalize()

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        codegen: Any = self._codegen
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                codegen.set_env(variable.name, environment)


class ProgramCompiler(Compiler):
    """The compiler pipeline of a `compiled` function."""

    library: type[JITCodeLibrary] = ProgramCode

    def _compile_core(self) -> Any:
        codegen = self.state.targetctx.codegen()
        self.state.library = self.library(codegen, self.state.func_id.func_qualname)
        self.state.library.enable_object_caching()
        return super()._compile_core()


class InnerCompiler(ProgramCompiler):
    """The compiler pipeline of an `inner` function."""

    library = InnerCode


class CachedPrograms(FunctionCache):
    """The programs of one function on disk. numba fails on files that are damaged or cannot be written; here the
    program is compiled again, and stored if possible."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The program for a signature; None where there is none, or where its files are damaged: these are deleted."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # reading a damaged pickle may raise anything
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Stores a program, unless the disk is full or its folder is missing or not writable."""
        with suppress(Exception):  # a damaged index may still exist
            super().save_overload(sig, data)


class ProgramFolder(_CacheLocator):
    """The folder in which numba finds the programs of one function, and the stamp that identifies their version."""

    def __init__(self, function: Callable, file: str) -> None:
        self._py_file, self._line = file, function.__code__.co_firstlineno  # numba prints the file in its warnings

    @classmethod
    def from_function(cls, py_func: Callable, py_file: str) -> "ProgramFolder":
        """The interface of numba's locators."""
        return cls(py_func, py_file)

    def get_cache_path(self) -> str:
        """The folder of the function's programs."""
        return str(_folder(Path(self._py_file)))

    def get_source_stamp(self) -> str:
        """The digest of all sources that the program depends on."""
        return digest(Path(self._py_file))

    def get_disambiguator(self) -> str:
        """Folder and line of the function, because one cache folder holds the programs of many files."""
        return f"{Path(self._py_file).parent.name}-{self._line}"


def sources(file: Path) -> list[Path]:
    """The files that the programs of `file` depend on."""
    for folder in TOGETHER:
        if (PACKAGE / folder) in file.parents:
            return [*sorted((PACKAGE / folder).rglob("*.py")), *CONSTANTS]
    return [file, *CONSTANTS]


def kept(folder: str) -> bool | None:
    """Whether any program of a folder of `TOGETHER` is cached for its sources; None where there is no cache folder."""
    programs = _folder(PACKAGE / folder / "__init__.py")
    return None if programs is None else any(programs.glob("*.nbi"))


@cache
def digest(file: Path) -> str:
    """SHA-256 of the sources of a file's programs, of their names, and of the compiler options."""
    hashed = sha256(repr(OPTIONS).encode())
    for path in sources(file):
        hashed.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return hashed.hexdigest()


@cache
def _folder(file: Path) -> Path | None:
    """The folder of a file's programs, None where nothing can be cached. Old folders of other versions are deleted."""
    kind = next((folder.replace("/", "-") for folder in TOGETHER if (PACKAGE / folder) in file.parents), file.stem)
    above = cache_folder(f"numba-{numba.__version__}")
    if above is None:
        return None
    folder = above / f"{kind}-{digest(file)[:16]}"
    if not folder.is_dir():
        for old in above.glob(f"{kind}-*"):
            if time.time() - old.stat().st_mtime > KEPT_DAYS * 86400:
                shutil.rmtree(old, ignore_errors=True)
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
        except OSError:  # the disk is full
            return None
    return folder


class ByAddress(types.Type):
    """The type of a pointer to a named tuple of type `record`."""

    def __init__(self, record: types.NamedTuple) -> None:
        self.record = record
        super().__init__(f"ByAddress({record})")

    @property
    def key(self) -> types.NamedTuple:
        """The type of the tuple, which identifies this type."""
        return self.record


def pass_by_pointer(record: type[T]) -> type[T]:
    """Marks a class of named tuples: compiled functions take its instances by pointer.

    numba passes a named tuple by value, each of its arrays as seven numbers or more, so that a function of train and
    tables had about four hundred arguments, and copying them from call to call dominated the compile time. A marked
    record is laid out in memory once, where Python calls compiled code, and its address is valid for that call.
    Compiled functions read its fields; they can neither create nor return such a record.
    """

    @typeof_impl.register(record)
    def of_record(value: Any, context: Any) -> ByAddress:
        fields = [typeof_impl(field, context) for field in value]
        return ByAddress(types.BaseTuple.from_types(fields, record))

    return record


@register_model(ByAddress)
class _Pointer(PrimitiveModel):
    def __init__(self, models: Any, pointer: ByAddress) -> None:
        super().__init__(models, pointer, models.lookup(pointer.record).get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = ByAddress

    def generic_resolve(self, pointer: ByAddress, name: str) -> types.Type | None:
        """The type of a field; None where there is no such field."""
        fields = pointer.record.fields
        return pointer.record[fields.index(name)] if name in fields else None


@lower_getattr_generic(ByAddress)
def _load_field(context: Any, builder: Any, pointer: ByAddress, value: Any, name: str) -> Any:
    at = pointer.record.fields.index(name)
    loaded = builder.load(cgutils.gep_inbounds(builder, value, 0, at))
    return imputils.impl_ret_borrowed(context, builder, pointer.record[at], loaded)


@unbox(ByAddress)
def _unbox_by_address(pointer: ByAddress, record: Any, c: Any) -> NativeValue:
    by_value = c.unbox(pointer.record, record)
    address = cgutils.alloca_once_value(c.builder, by_value.value)

    def cleanup() -> None:  # numba does this for a tuple by value, but not for a pointer
        if by_value.cleanup is not None:
            by_value.cleanup()
        if c.context.enable_nrt:
            c.context.nrt.decref(c.builder, pointer.record, c.builder.load(address))

    return NativeValue(address, cleanup=cleanup, is_error=by_value.is_error)
