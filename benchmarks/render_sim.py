"""Rendering frames of the Sim dataset: seconds of one core and peak memory, by step; rays beside Embree's.

    python benchmarks/render_sim.py [--out FILE] [--viewpoints N] [--samples 1,2,3] [--size 896x768]

Every figure is processor time of one thread (`clock` is beside it: on a busy machine it is longer). ``plan`` places
everything, once per viewpoint; ``world`` poses what moves and builds the tree for rays, once per frame; ``textures``
is what the first frame of a process draws; ``label`` finds boxes and visible fractions. ``rays``: the tree of
`pipeline.scenes.ray_tree` beside Embree (`embreex`), which is not the same bytes on every processor, on a ray through
every pixel and one from where each meets the scene towards the sun.
"""

from __future__ import annotations

import argparse
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks import common  # noqa: E402

common.one_thread()

import numpy as np  # noqa: E402

from pipeline.scenes import dataset, labels, render  # noqa: E402
from pipeline.scenes.layout.plan import Plan  # noqa: E402
from pipeline.scenes.ray_tree import RayTree  # noqa: E402
from pipeline.scenes.world import World  # noqa: E402

Result = TypeVar("Result")


def timed(call: Callable[[], Result]) -> tuple[Result, dict[str, float]]:
    """A call's result, and its seconds of processor and clock."""
    worked, clock = time.process_time(), time.perf_counter()
    result = call()
    return result, {
        "processor_s": round(time.process_time() - worked, 3),
        "clock_s": round(time.perf_counter() - clock, 3),
    }


def peak_gb() -> float:
    """Largest memory this process has held, GB."""
    unit = 1.0 if sys.platform == "darwin" else 1024.0
    return round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9, 3)


def rays(plan: Plan, world: World, width_px: int, height_px: int) -> dict[str, Any]:
    """Seconds of processor of the tree and of Embree: to build, to find first hits, to find any hit; and ratios."""
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    triangles = [one.corners() for one in world.placed]

    def embree() -> EmbreeScene:
        scene = EmbreeScene()
        for one in triangles:
            TriangleMesh(scene, one)
        scene.run(origin[:1], direction[:1])  # Embree builds its tree at the first ray
        return scene

    pose = plan.camera.pose(0.0, width_px, height_px)
    direction = pose.rays(np.arange(width_px) + 0.5, np.arange(height_px) + 0.5)
    origin = np.tile(np.asarray(pose.position_m, np.float32), (len(direction), 1))
    joined = np.concatenate(triangles)
    RayTree(joined[:10]).first(origin[:1], direction[:1])  # compiles
    tree, built = timed(lambda: RayTree(joined))
    peer, peer_built = timed(embree)
    (row, _, _, distance), first = timed(lambda: tree.first(origin, direction))
    answer, peer_first = timed(lambda: peer.run(origin, direction, output=1))
    hit = row >= 0
    start = (origin[hit] + direction[hit] * (distance[hit, None] * (1 - 1e-3))).astype(np.float32)
    sun = np.tile(plan.light.towards_sun.astype(np.float32), (len(start), 1))
    blocked, met = timed(lambda: tree.any(start, sun))
    peer_blocked, peer_met = timed(lambda: peer.run(start, sun, query="OCCLUDED") >= 0)
    object_of = np.repeat(np.arange(len(triangles)), list(map(len, triangles)))
    names = ("build", "first", "any")
    ours, embrees = (built, first, met), (peer_built, peer_first, peer_met)
    return {
        "first_rays": len(direction),
        "any_rays": len(start),
        "ours_processor_s": {name: one["processor_s"] for name, one in zip(names, ours, strict=True)},
        "embree_processor_s": {name: one["processor_s"] for name, one in zip(names, embrees, strict=True)},
        "times_embree": {
            name: round(one["processor_s"] / max(other["processor_s"], 1e-3), 2)
            for name, one, other in zip(names, ours, embrees, strict=True)
        },
        "rays_at_another_object": int((np.where(hit, object_of[row], -1) != answer["geomID"]).sum()),
        "rays_otherwise_blocked": int((blocked != peer_blocked).sum()),
    }


def measure(number: int, samples: list[int], width_px: int, height_px: int) -> dict[str, Any]:
    """Times of one viewpoint's first frame."""
    viewpoint = dataset.Viewpoint("evaluation", number)
    plan, planned = timed(lambda: dataset.plan(viewpoint, 0))
    world, built = timed(lambda: plan.world(0.0))
    pose = plan.camera.pose(0.0, width_px, height_px)

    def picture(count: int) -> render.Picture:
        return render.render(world, plan.light, pose, plan.tone, samples=count)

    _, first = timed(lambda: picture(1))
    record: dict[str, Any] = {
        "name": viewpoint.name(0),
        "scene": viewpoint.scene,
        "triangles": sum(len(one.thing.mesh) for one in world.placed),
        "plan": planned,
        "world": built,
        "first_render_1x1": first,
    }
    for count in samples:
        taken, times = timed(lambda count=count: picture(count))  # type: ignore[misc]
        record[f"render_{count}x{count}"] = times
        result, times = timed(lambda taken=taken: labels.boxes(world, pose, taken))  # type: ignore[misc]
        record["label"] = times
        record["boxes"] = len(result)
    record["rays"] = rays(plan, world, width_px, height_px)
    return record


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, help="JSON file, by default benchmarks/results/render_sim.json")
    parser.add_argument("--viewpoints", type=int, default=4)
    parser.add_argument("--samples", default="1,2,3", help="samples along an axis of a pixel")
    parser.add_argument("--size", default="896x768", help="width x height, pixels")
    arguments = parser.parse_args()
    common.hold_loaded_libraries()
    width, height = map(int, arguments.size.split("x"))
    samples = [int(value) for value in arguments.samples.split(",")]
    frames = []
    for number in range(arguments.viewpoints):
        record = measure(number, samples, width, height)
        last = f"render_{samples[-1]}x{samples[-1]}"
        total = sum(record[step]["processor_s"] for step in ("plan", "world", last, "label"))
        record["frame_processor_s"] = round(total, 3)
        record["peak_gb"] = peak_gb()
        frames.append(record)
        print(
            f"{record['name']}  {record['triangles']} triangles  {total:.1f} s  {record['peak_gb']} GB  rays: "
            f"{record['rays']['times_embree']} of Embree's time",
            flush=True,
        )
    about = common.machine("embreex", "numba", "opencv-python-headless")
    common.write("render_sim", {"machine": about, "size": arguments.size, "frames": frames}, arguments.out)


if __name__ == "__main__":
    common.run(main)
