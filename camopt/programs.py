"""Programs that numba compiles, kept in the user's cache folder for exactly the sources that they were made from.

numba by itself compares a kept program with the file of its own function only, although it compiles into it what that
function calls from other files, the types that these define, and the constants that they read. Here the programs of
`TOGETHER` stand in a folder that is named by the digest of all their sources, so that after any change they are
compiled anew, an older installation finds its own again, and copies of one version share theirs.
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
"""Folders whose functions call each other; a compiled file elsewhere stands alone."""
CONSTANTS = (PACKAGE / "scene/units.py", PACKAGE / "scene/settled.py", PACKAGE / "programs.py")
"""Files elsewhere whose numbers, rules and types are compiled into the programs."""
OPTIONS = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
"""How everything is compiled: divisions as NumPy's, whose infinities end in a refused motion, and no entry for C."""
KEPT_DAYS = 60
"""Programs of other versions go when they were not compiled for so long."""


def compiled(function: Callable | None = None, **options: Any) -> Any:
    """A function compiled by numba without the interpreter's lock, kept on disk; `options` are those of `numba.njit`.

    Where there is no cache folder the program is compiled in each process.
    """
    if function is None:
        return lambda f: compiled(f, **options)
    options = OPTIONS | {"pipeline_class": ProgramCompiler} | options
    if _folder(Path(function.__code__.co_filename)) is None:
        return numba.njit(**options)(function)
    settings: Any = config  # whose type does not list what it holds
    before = settings.CACHE_LOCATOR_CLASSES
    settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{ProgramFolder.__name__}"
    try:
        program: Any = numba.njit(**options)(function)
        if program is not function:  # numba was told to compile nothing
            program._cache = KeptPrograms(function)  # what `cache=True` does, with numba's own
        return program
    finally:
        settings.CACHE_LOCATOR_CLASSES = before


def inner(function: Callable | None = None, **options: Any) -> Any:
    """`compiled` for a function that only compiled functions call: it is part of their programs and not kept by itself.

    It has no entry for Python, which takes as long to compile as many a function itself; a call from Python would end
    the process (tests/test_programs.py looks).
    """
    if function is None:
        return lambda f: inner(f, **options)
    options = OPTIONS | {"pipeline_class": InnerCompiler, "no_cpython_wrapper": True} | options
    return numba.njit(**options)(function)


def njit_no_refcount(function: Callable | None = None, **options: Any) -> Any:
    """`inner` without reference counting, for a function that makes no array and returns none.

    numba by itself counts the references of every array of every tuple that a function is given, with two locked
    instructions each, which is most of the time of a small function: 340 ns against 8 ns a call with 24 arrays. numba
    refuses such a function where it makes an array; one that returns an array must not be declared so.
    """
    return inner(function, _nrt=False, **options)


class InnerCode(JITCodeLibrary):
    """What numba makes of an `inner` function. LLVM neither optimises it nor turns it into machine code by itself, as
    numba would have it do: that is done to what each program contains of it, and was most of what compiling took."""

    def finalize(self) -> None:
        """Leaves the function as it is, and what it calls to the program that will contain both."""
        self._finalized = True

    @property
    def codegen(self) -> Any:
        """Takes the place of the code generator where numba would give the machine code its environment."""
        return SimpleNamespace(set_env=lambda name, environment: None)


class ProgramCode(JITCodeLibrary):
    """What numba makes of a `compiled` function: a program with everything that the function calls in it."""

    def finalize(self) -> None:
        """Adds the parts of the parts, optimises all of it and turns it into machine code."""
        libraries = self._linking_libraries  # which grows on the way
        for library in libraries:
            if isinstance(library, InnerCode):
                libraries.extend(one for one in library._linking_libraries if one not in libraries)
        super().finalize()

    def _finalize_specific(self) -> None:
        super()._finalize_specific()
        codegen: Any = self._codegen
        for variable in self._final_module.global_variables:
            environment = lookup_environment(variable.name)
            if environment is not None:
                codegen.set_env(variable.name, environment)


class ProgramCompiler(Compiler):
    """numba's compiler of a `compiled` function."""

    library: type[JITCodeLibrary] = ProgramCode

    def _compile_core(self) -> Any:
        codegen = self.state.targetctx.codegen()
        self.state.library = self.library(codegen, self.state.func_id.func_qualname)
        self.state.library.enable_object_caching()
        return super()._compile_core()


class InnerCompiler(ProgramCompiler):
    """numba's compiler of an `inner` function."""

    library = InnerCode


class KeptPrograms(FunctionCache):
    """The programs of one function on disk. numba stops at files that are torn or cannot be written; here the program
    is compiled anew, and kept if it can be."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The program for a signature; None where there is none, or where its files are torn: these go."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # whatever reading a torn pickle raises
            with suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keeps a program, unless the disk is full or its folder is gone or not ours to write to."""
        with suppress(Exception):  # a torn index may still be there
            super().save_overload(sig, data)


class ProgramFolder(_CacheLocator):
    """Where numba finds the programs of one function, and what tells those of another version apart."""

    def __init__(self, function: Callable, file: str) -> None:
        self._py_file, self._line = file, function.__code__.co_firstlineno  # numba reads the former in its warnings

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
        """File and line, since one folder holds the programs of many files."""
        return f"{Path(self._py_file).parent.name}-{self._line}"


def sources(file: Path) -> list[Path]:
    """The files that the programs of `file` are made from."""
    for folder in TOGETHER:
        if (PACKAGE / folder) in file.parents:
            return [*sorted((PACKAGE / folder).rglob("*.py")), *CONSTANTS]
    return [file, *CONSTANTS]


def kept(folder: str) -> bool | None:
    """Whether any program of a folder of `TOGETHER` is kept for its sources; None where there is no cache folder."""
    kept_in = _folder(PACKAGE / folder / "__init__.py")
    return None if kept_in is None else any(kept_in.glob("*.nbi"))


@cache
def digest(file: Path) -> str:
    """SHA-256 of the sources of a file's programs, of their names, and of how they are compiled."""
    hashed = sha256(repr(OPTIONS).encode())
    for path in sources(file):
        hashed.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return hashed.hexdigest()


@cache
def _folder(file: Path) -> Path | None:
    """The folder of a file's programs, None where nothing can be kept; those of other versions go when they are old."""
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
        except OSError:  # no room
            return None
    return folder


class ByAddress(types.Type):
    """The type of a pointer to a named tuple of type `held`."""

    def __init__(self, held: types.NamedTuple) -> None:
        self.held = held
        super().__init__(f"ByAddress({held})")

    @property
    def key(self) -> types.NamedTuple:
        """What tells two of these types apart."""
        return self.held


def pass_by_pointer(record: type[T]) -> type[T]:
    """Marks a class of named tuples: compiled functions take its instances by pointer.

    numba passes a named tuple by value, each of its arrays as seven numbers or more, so that a function of train and
    tables had some four hundred arguments; copying them from call to call was most of what was compiled. A marked
    record is laid out once, where Python calls compiled code, and its address is valid for that call. Compiled
    functions read its fields; they can neither make nor return such a record.
    """

    @typeof_impl.register(record)
    def of_record(value: Any, context: Any) -> ByAddress:
        fields = [typeof_impl(field, context) for field in value]
        return ByAddress(types.BaseTuple.from_types(fields, record))

    return record


@register_model(ByAddress)
class _Pointer(PrimitiveModel):
    def __init__(self, models: Any, pointer: ByAddress) -> None:
        super().__init__(models, pointer, models.lookup(pointer.held).get_value_type().as_pointer())


@infer_getattr
class _Fields(AttributeTemplate):
    key = ByAddress

    def generic_resolve(self, pointer: ByAddress, name: str) -> types.Type | None:
        """The type of a field; None where there is no such field."""
        fields = pointer.held.fields
        return pointer.held[fields.index(name)] if name in fields else None


@lower_getattr_generic(ByAddress)
def _field(context: Any, builder: Any, pointer: ByAddress, value: Any, name: str) -> Any:
    at = pointer.held.fields.index(name)
    found = builder.load(cgutils.gep_inbounds(builder, value, 0, at))
    return imputils.impl_ret_borrowed(context, builder, pointer.held[at], found)


@unbox(ByAddress)
def _laid_out(pointer: ByAddress, record: Any, c: Any) -> NativeValue:
    by_value = c.unbox(pointer.held, record)
    address = cgutils.alloca_once_value(c.builder, by_value.value)

    def cleanup() -> None:  # what numba does for a tuple by value, and not for a pointer
        if by_value.cleanup is not None:
            by_value.cleanup()
        if c.context.enable_nrt:
            c.context.nrt.decref(c.builder, pointer.held, c.builder.load(address))

    return NativeValue(address, cleanup=cleanup, is_error=by_value.is_error)
