"""The kernels that depend on a scene's shapes, made once per set of shapes and compiled when first called."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from .broad_phase.system import make_box_kernel
from .ccd.search_bounds import make_sweep_kernel
from .ccd.time_of_impact import make_first_touch
from .contacts.resting import make_resting_kernels
from .impacts.find import make_impact_kernel
from .narrow_phase.system import make_narrow_kernel
from .shapes.dispatch import ShapeCode


class SceneKernels:
    """What the collision phases call; ``sweeping_impacts`` in place of ``resolve_impacts`` where bodies are swept."""

    def __init__(self, code: ShapeCode) -> None:
        self.box_motion: Any = make_box_kernel(code.shape_bounds, code.write_world)
        self.find_contacts: Any = make_narrow_kernel(code.evaluate)
        self.resolve_impacts: Any = make_impact_kernel(code.evaluate, code.corner, code.mix)
        first_touch = make_first_touch(code.evaluate, code.corner, code.swept, code.convex, code.dented)
        self.find_swept: Any = make_sweep_kernel(first_touch)
        self.sweeping_impacts: Any = make_impact_kernel(code.evaluate, code.corner, code.mix, first_touch)
        self.find_resting: Any
        self.linearise: Any
        self.find_touching: Any
        self.find_resting, self.linearise, self.find_touching = make_resting_kernels(
            code.evaluate, code.corner, code.mix
        )


@lru_cache(maxsize=64)
def kernels_for(code: ShapeCode) -> SceneKernels:
    return SceneKernels(code)
