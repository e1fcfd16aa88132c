"""A kernel's two editions: one that other kernels take in, as code not yet optimised, and one that Python calls.

Numba, left alone, optimises each function, makes machine code and an entry for Python of it, and does all of that again wherever
the function is called. Of the 140 functions of a step a dozen are called by Python: here only these are optimised and made
machine code, once, with all that they call. Dispatchers, passes and code libraries derive from Numba's.
"""

from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, cast

import llvmlite.binding as llvm
from numba import types
from numba.core import ir, typed_passes, untyped_passes
from numba.core.caching import FunctionCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, CompileResult, compile_result
from numba.core.compiler_machinery import FunctionPass, PassManager, register_pass
from numba.core.environment import lookup_environment
from numba.core.errors import LoweringError
from numba.core.ir_utils import get_definition, guard
from numba.core.registry import CPUDispatcher

from physics_prior.dynamics.kernel_cache import KernelCache, is_own

ALLOCATES = "NRT_MemInfo_alloc"
CONSTANT_FIELDS: dict[types.Record, dict[str, int]] = {}
"""By type of a record: fields that it lacks, and what kernels take in their place."""


class _InnerLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Code for other kernels: with what it calls, to be linked into theirs. Never finalized: that is what makes machine code."""

    _shared_module: Any

    def _ensure_finalized(self) -> None:
        """Nothing is to be done before others link it."""

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            for function in self._final_module.functions:  # its own; the same one may come to a caller by several ways
                if not function.is_declaration and function.linkage == llvm.Linkage.external:
                    function.linkage = "linkonce_odr"
            for library in dict.fromkeys(self._linking_libraries):
                self._final_module.link_in(library._get_module_for_linking(), preserve=True)
            self._shared_module = self._final_module
        return self._shared_module


class _EntryLibrary(JITCodeLibrary):  # type: ignore[misc]
    """Machine code for Python."""

    def _optimize_final_module(self) -> None:
        # what nobody else calls may lose arguments that it does not use, and be taken in where it is called but once
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.linkonce_odr:
                function.linkage = llvm.Linkage.internal
        # Numba runs a cheap optimisation first, which brings counts of references together: kernels count none
        passes, builder = self._codegen._module_pass_manager()
        passes.run(self._final_module, builder)


class _Remembering:
    """Numba's typing context, which else goes through all that an operator may mean wherever one occurs."""

    _known: ClassVar[dict[Any, Any]] = {}

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def resolve_function_type(self, function: Any, args: tuple[Any, ...], kws: dict[str, Any]) -> Any:
        if isinstance(function, types.Dispatcher):  # a kernel: its overloads remember
            return self._context.resolve_function_type(function, args, kws)
        key = function, tuple(args), tuple(kws.items())
        if key not in self._known:
            self._known[key] = self._context.resolve_function_type(function, args, kws)
        return self._known[key]


@register_pass(mutates_CFG=False, analysis_only=False)
class _ConstantFields(FunctionPass):  # type: ignore[misc]
    """Puts constants in place of fields that the records of an argument lack, before dead branches are pruned."""

    _name = "constant_fields"

    def __init__(self) -> None:
        super().__init__()

    def run_pass(self, state: Any) -> bool:
        known: dict[int | None, dict[str, int]]
        known = {index: constants for index, constants in enumerate(map(_constants, state.args)) if constants}
        if not known:
            return False
        code = state.func_ir
        for each in [each for block in code.blocks.values() for each in block.find_insts(ir.Assign)]:
            if isinstance(each.value, ir.Expr) and each.value.op == "getattr":
                constants = known.get(_argument(code, each.value.value), {})
                if each.value.attr in constants:
                    definitions = code._definitions[each.target.name]
                    constant = ir.Const(constants[each.value.attr], each.loc)
                    definitions[definitions.index(each.value)] = each.value = constant
        return True


def _constants(kind: Any) -> dict[str, int]:
    """What fields that records of an argument lack are taken as."""
    return CONSTANT_FIELDS.get(kind.dtype if isinstance(kind, types.Array) else kind, {})


def _argument(code: Any, variable: ir.Var) -> int | None:
    """Which argument a variable is, or is an element of; None where it is neither."""
    origin = guard(get_definition, code, variable)
    while isinstance(origin, ir.Expr) and origin.op in ("getitem", "static_getitem"):
        origin = guard(get_definition, code, origin.value)
    return origin.index if isinstance(origin, ir.Arg) else None


@register_pass(mutates_CFG=True, analysis_only=False)
class _TypeInference(typed_passes.NopythonTypeInference):  # type: ignore[misc]
    _name = "kernel_type_inference"

    def run_pass(self, state: Any) -> bool:
        context, state.typingctx = state.typingctx, _Remembering(state.typingctx)
        try:
            return cast(bool, super().run_pass(state))
        finally:
            state.typingctx = context


class _Lowering(typed_passes.NativeLowering):  # type: ignore[misc]
    """Lowering without counts of references, a quarter of the code: kernels allocate nothing, Python holds their arguments."""

    def run_pass(self, state: Any) -> bool:
        if is_own(Path(state.func_id.filename)):
            _count_from_the_front(state)
        state.targetctx = state.targetctx.subtarget(enable_nrt=False)
        return cast(bool, super().run_pass(state))


def _count_from_the_front(state: Any) -> None:
    """Have variable indices, none of which is negative, taken as they are: to count from the end costs three instructions."""
    for statement in [each for block in state.func_ir.blocks.values() for each in block.body]:
        access = statement.value if isinstance(statement, ir.Assign) else statement
        if isinstance(access, ir.SetItem) or (isinstance(access, ir.Expr) and access.op == "getitem"):
            signature = state.calltypes.pop(access)
            array, index, *value = signature.args
            if isinstance(array, types.Array):
                index = _from_the_front(state.typemap[access.index.name])
            state.calltypes[access] = signature.replace(args=(array, index, *value))


def _from_the_front(index: Any) -> Any:
    """The type of an index that knows no sign; of constants it is kept."""
    if isinstance(index, types.BaseTuple):
        return types.BaseTuple.from_types([_from_the_front(each) for each in index])
    return types.uintp if index == types.intp else index


@register_pass(mutates_CFG=True, analysis_only=False)
class _InnerLowering(_Lowering):
    _name = "inner_lowering"

    def run_pass(self, state: Any) -> bool:
        state.flags.no_compile = True  # no machine code
        state.library = _InnerLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        super().run_pass(state)
        # callers find the function by the entry that it has not: anything of its own will do
        state.cr = state.cr._replace(cfunc=object())
        state.targetctx.insert_user_function(state.cr.cfunc, state.cr.fndesc, [state.library])
        return True


@register_pass(mutates_CFG=True, analysis_only=False)
class _EntryLowering(_Lowering):
    _name = "entry_lowering"

    def run_pass(self, state: Any) -> bool:
        name = state.func_id.func_qualname
        if isinstance(state.return_type, types.Array):
            raise LoweringError(f"kernel '{name}' returns an array to Python: have it write into one that it is given")
        state.library = _EntryLibrary(state.targetctx.codegen(), name)
        state.library.enable_object_caching()
        super().run_pass(state)
        if any(function.name.startswith(ALLOCATES) for function in state.library._final_module.functions):
            raise LoweringError(f"kernel '{name}' allocates memory: have it write into an array that it is given")
        # what taken-in kernels print stands in environments of theirs
        names = [variable.name for variable in state.library._final_module.global_variables]
        for environment in filter(None, map(lookup_environment, names)):
            state.library.codegen.set_env(environment.env_name, environment)
        return True


class _Pipeline(CompilerBase):  # type: ignore[misc]
    """Numba's passes less those that kernels have no use for: closures and comprehensions, parallel loops, array expressions."""

    lowering: type

    def define_pipelines(self) -> list[PassManager]:
        passes = PassManager("kernel")
        for each in (
            untyped_passes.TranslateByteCode,
            untyped_passes.FixupArgs,
            untyped_passes.IRProcessing,
            _ConstantFields,
            untyped_passes.RewriteSemanticConstants,
            untyped_passes.DeadBranchPrune,  # what a scene has not: `if CONSTRAINED`
            untyped_passes.GenericRewrites,
            untyped_passes.ReconstructSSA,
            _TypeInference,
            typed_passes.PreLowerStripPhis,
            typed_passes.NoPythonSupportedFeatureValidation,
            typed_passes.IRLegalization,
            typed_passes.AnnotateTypes,
            self.lowering,
            typed_passes.NoPythonBackend,
        ):
            passes.add_pass(each, each.__name__)
        passes.finalize()
        return [passes]


class _InnerPipeline(_Pipeline):
    lowering = _InnerLowering


class _EntryPipeline(_Pipeline):
    lowering = _EntryLowering


class _InnerResult(KernelCache):
    """How an inner edition is kept on disk: its code with what it calls, and its types."""

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        return f"inner.{super().get_filename_base(fullname, abiflags)}"

    def reduce(self, result: CompileResult) -> tuple[Any, ...]:
        description = result.fndesc
        description.typemap = description.calltypes = None  # what lowering alone needed
        code = result.library._get_module_for_linking().as_bitcode()
        return result.library.name, code, description, result.environment, result.signature

    def rebuild(self, target_context: Any, payload: tuple[Any, ...]) -> CompileResult:
        name, code, description, environment, signature = payload
        library = _InnerLibrary(target_context.codegen(), name)
        library._final_module = library._shared_module = llvm.parse_bitcode(code)
        return compile_result(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            entry_point=object(),
            fndesc=description,
            environment=environment,
            signature=signature,
            objectmode=False,
        )


class _EntryCache(FunctionCache):  # type: ignore[misc]
    _impl_class = KernelCache


class _InnerCache(FunctionCache):  # type: ignore[misc]
    _impl_class = _InnerResult


class _Inner(CPUDispatcher):  # type: ignore[misc]
    """The edition for other kernels."""

    def __init__(self, function: Callable[..., Any], **settings: Any) -> None:
        super().__init__(function, **settings)
        self._cache = _InnerCache(function)

    def add_overload(self, result: CompileResult) -> None:
        # but not with the dispatcher in C, which serves calls from Python
        self.overloads[tuple(result.signature.args)] = result


class Kernel(CPUDispatcher):  # type: ignore[misc]
    """A compiled function that Python calls, and that other kernels call in its inner edition."""

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        options = {"nopython": True, "no_cfunc_wrapper": True, **options}  # nobody calls a kernel through C
        super().__init__(function, targetoptions=options, pipeline_class=_EntryPipeline)
        self._cache = _EntryCache(function)

    @cached_property
    def inner(self) -> _Inner:
        """Made when a kernel that calls this one is compiled."""
        options = {**self.targetoptions, "no_cpython_wrapper": True}
        return _Inner(self.py_func, targetoptions=options, pipeline_class=_InnerPipeline)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What the type inference of a kernel that calls this one asks. Only what is inlined is compiled for constants."""
        if not self.targetoptions["forceinline"]:
            args = tuple(map(types.unliteral, args))
        return self.inner.get_call_template(args, kws)

    def get_overload(self, signature: Any) -> Any:
        """What the lowering of a kernel that calls this one asks."""
        return self.inner.get_overload(signature)
