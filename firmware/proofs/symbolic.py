"""Decide one theorem of `symbolic.cpp` by symbolic execution of its machine code.

    python symbolic.py PROGRAM THEOREM

Prints a line of JSON: `paths` that were followed to their end, `broken` claims and undefined
behaviour that can be reached, `seconds`. Needs angr.
"""

import json
import logging
import sys
import time

logging.disable(logging.CRITICAL)

import angr  # noqa: E402
import claripy  # noqa: E402

MOST_PATHS = 20_000
REPLIES = ("_ZN3rig5FrameC", "FrameTransmitterILm8EE4send")
"""Functions that encode and queue what a board answers."""


def _low_byte(value):
    return value[7:0]


class AnyBytes(angr.SimProcedure):
    """Bytes without a value."""

    def run(self, at, size):
        """Store a fresh symbol."""
        count = self.state.solver.eval_one(size)
        self.state.memory.store(at, claripy.BVS("any", 8 * count))


class Assume(angr.SimProcedure):
    """Leave out the cases in which something does not hold."""

    def run(self, holds):
        """Add it as a constraint."""
        self.state.solver.add(_low_byte(holds) != 0)


class Claim(angr.SimProcedure):
    """Ask whether any case breaks a claim, and go on with those that keep it."""

    def run(self, holds, what):
        """Look for a case that breaks it."""
        fails = _low_byte(holds) == 0
        if self.state.solver.satisfiable(extra_constraints=[fails]):
            text = self.state.mem[what].string.concrete.decode()
            self.state.globals["broken"] = (*self.state.globals.get("broken", ()), text)
        self.state.solver.add(_low_byte(holds) != 0)


class Pick(angr.SimProcedure):
    """Follow each number by itself."""

    def run(self, count):
        """Return once for every number."""
        back = self.state.memory.load(self.state.regs.rsp, 8, endness="Iend_LE")
        self.state.regs.rsp += 8
        for k in range(self.state.solver.eval_one(count)):
            one = self.state.copy()
            one.regs.rax = k
            self.successors.add_successor(one, back, claripy.true(), "Ijk_Ret")
        self.returns, self.inhibit_autoret = False, True


class Nothing(angr.SimProcedure):
    """What a reply looks like does not matter."""

    def run(self):
        """Return at once."""
        return None


class Failed(angr.SimProcedure):
    """An assertion of the standard library."""

    NO_RET = True

    def run(self):
        """End this path as broken."""
        broken = self.state.globals.get("broken", ())
        self.state.globals["broken"] = (*broken, "index out of range")
        self.exit(1)


def _function_at(project, address):
    places = [s for s in project.loader.main_object.symbols if s.is_function]
    inside = [s for s in places if s.rebased_addr <= address < s.rebased_addr + max(s.size, 1)]
    return inside[0].name if inside else hex(address)


def decide(program, theorem):
    """Return the paths, the broken claims and the time of one theorem."""
    began = time.monotonic()
    project = angr.Project(program, auto_load_libs=False)
    named = {"any_bytes": AnyBytes, "assume": Assume, "claim": Claim, "pick": Pick}
    for symbol in project.loader.main_object.symbols:
        if symbol.name in named:
            project.hook(symbol.rebased_addr, named[symbol.name]())
        elif any(part in symbol.name for part in REPLIES):
            project.hook(symbol.rebased_addr, Nothing())
    for name in ("abort", "_ZSt21__glibcxx_assert_failPKciS0_S0_"):
        project.hook_symbol(name, Failed())
    zero = {
        angr.options.ZERO_FILL_UNCONSTRAINED_MEMORY,
        angr.options.ZERO_FILL_UNCONSTRAINED_REGISTERS,
    }
    place = project.loader.find_symbol(f"prove_{theorem}").rebased_addr
    paths = project.factory.simulation_manager(project.factory.call_state(place, add_options=zero))
    paths.use_technique(angr.exploration_techniques.DFS())
    while paths.active:
        paths.step()
        if len(paths.deadended) > MOST_PATHS:
            raise SystemExit(f"{theorem}: more than {MOST_PATHS} paths")
    broken = {what for s in paths.deadended for what in s.globals.get("broken", ())}
    broken |= {
        f"undefined behaviour in {_function_at(project, e.state.addr)}" for e in paths.errored
    }
    if paths.unconstrained:
        broken.add("a jump to anywhere")
    return {
        "theorem": theorem,
        "paths": len(paths.deadended),
        "broken": sorted(broken),
        "seconds": round(time.monotonic() - began, 1),
    }


if __name__ == "__main__":
    sys.stdout.write(json.dumps(decide(*sys.argv[1:3])) + "\n")
