"""Kernels for a GPU: one run per thread, from the loops and formulas of :mod:`nearharmonic.core.kernel`, as PTX text.

A thread has the bits of a lane. Additions, products, quotients, square roots and fused products are rounded correctly
on a GPU, and LLVM's NVPTX target keeps them apart: it writes each with its rounding, which the assembler of the driver
must not fuse. Functions come from :mod:`nearharmonic.core.functions`; no library of the GPU is called.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

from llvmlite import binding, ir

from nearharmonic.core.emission import kinds_of
from nearharmonic.core.kernel import form_of, formulas_of, joined_code, written
from nearharmonic.core.layout import MEMBER
from nearharmonic.core.native import NativeFunction, loaded, object_code, optimised
from nearharmonic.core.tracing import Physics, Rules
from nearharmonic.core.values import PREFIX
from nearharmonic.errors import CompiledCodeError

#: Least generation of a GPU and version of PTX: a driver of that version compiles the text for any later GPU.
GENERATION, PTX = 70, 64
TRIPLE = "nvptx64-nvidia-cuda"

_ONE_THREAD = f"""define i64 @"{PREFIX}thread"() alwaysinline {{
  ret i64 0
}}
"""
_THREADS = f"""
declare i32 @llvm.nvvm.read.ptx.sreg.tid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
declare i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
define i64 @"{PREFIX}thread"() alwaysinline {{
  %tid = call i32 @llvm.nvvm.read.ptx.sreg.tid.x()
  %block = call i32 @llvm.nvvm.read.ptx.sreg.ctaid.x()
  %size = call i32 @llvm.nvvm.read.ptx.sreg.ntid.x()
  %before = mul i32 %block, %size
  %place = add i32 %before, %tid
  %wide = zext i32 %place to i64
  ret i64 %wide
}}
"""


@dataclass(frozen=True)
class MemberKernel:
    """The function of :data:`nearharmonic.core.layout.MEMBER` for one system and one choice of arithmetic.

    ``ptx`` is its text for a GPU. ``native()`` is the same function for this processor and one thread, for tests.
    """

    rules: Rules
    energy: str

    @cached_property
    def ptx(self) -> str:
        """The text for a GPU; a CompiledCodeError says what cannot be compiled for one."""
        module = self._module()
        module.triple = TRIPLE
        entry = module.globals["member"]
        entry.calling_convention = "ptx_kernel"
        for argument in entry.args:
            if isinstance(argument.type, ir.PointerType):
                argument.add_attribute("noalias")  # what is only read goes through the cache for constants
        machine = _machine()
        text: str = machine.emit_assembly(optimised(self._joined(module, _THREADS), machine))
        return text

    def native(self) -> NativeFunction:
        """The function compiled for this processor; ``first`` is the run that it advances."""
        return loaded("member", object_code(self._joined(self._module(), _ONE_THREAD)), MEMBER)

    def _module(self) -> ir.Module:
        return written("member", MEMBER, kinds_of(self.rules, 1), form=form_of(self.rules, self.energy))

    def _joined(self, module: ir.Module, thread: str) -> Any:
        formulas = formulas_of(module, self.rules, kinds_of(self.rules, 1), self.energy)
        return joined_code(module, str(formulas), thread)


def build_member(physics: Physics, *, extended: bool, compensated: bool, energy: str = "every") -> MemberKernel:
    """Return the kernel of a run a thread; a CompiledCodeError names a form that a GPU does not compute."""
    for holds, form in (
        (physics.loops is not None, "many coordinates, whose states are in memory"),
        (physics.stages is not None, "an implicit method"),
        (physics.turning is not None, "an oscillator that is solved exactly"),
        (physics.numba is not None, "a potential that numba compiles"),
        (physics.measured is not None, "a regularised system"),
    ):
        if holds:
            raise CompiledCodeError(f"no kernel for a GPU of {form}")
    return MemberKernel(Rules(physics, extended, compensated), energy)


def _machine() -> Any:
    binding.initialize_all_targets()
    binding.initialize_all_asmprinters()
    try:
        target = binding.Target.from_triple(TRIPLE)
    except RuntimeError as error:
        raise CompiledCodeError("the installed llvmlite has no target NVPTX, which writes kernels for a GPU") from error
    return target.create_target_machine(cpu=f"sm_{GENERATION}", features=f"+ptx{PTX}", opt=3)
