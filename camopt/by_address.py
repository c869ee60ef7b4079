"""Records of many arrays that compiled functions take by their address.

numba hands a named tuple on by value, each of its arrays as seven numbers or more, so that a function of train and
tables has some four hundred arguments; copying them from call to call was most of what was compiled. A record that is
`by_address` is laid out once, where Python calls compiled code, and handed on as one pointer that is good for that
call. Compiled functions read its fields; they can neither make nor return such a record.
"""

from typing import Any, TypeVar

from numba.core import cgutils, imputils, types
from numba.core.datamodel.models import PrimitiveModel
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    register_model,
    typeof_impl,
    unbox,
)

T = TypeVar("T")


class ByAddress(types.Type):
    """The type of a pointer to a named tuple of type `held`."""

    def __init__(self, held: types.NamedTuple) -> None:
        self.held = held
        super().__init__(f"ByAddress({held})")

    @property
    def key(self) -> types.NamedTuple:
        """What tells two of these types apart."""
        return self.held


def by_address(record: type[T]) -> type[T]:
    """Marks a class of named tuples: compiled functions take its instances by their address."""

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
