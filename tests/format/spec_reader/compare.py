#!/usr/bin/env python3
"""A reader written from SPEC.md alone (spec_reader.py) gives the hits of lsp-trace.

    compare.py SPEC.md BIN_DIR

Bakes two scenes, one with masked leaves, as cells and traces the same rays exactly and at every quality.
Exit: 0 all agree, 1 something differs, 77 skipped: numpy is missing.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

try:
    import numpy as np
except ImportError:
    print("SKIPPED: numpy is not installed (package python3-numpy)")
    sys.exit(77)

from spec_reader import Cells, File, Ray, trace_wide

# The reader is in double precision: a ray that passes a border by less than a rounding may take another way.
kRays, kMayDiffer = 600, 1
HITS = np.dtype([("t", "<f4"), ("primitive", "<u4"), ("uv", "<f4", 2), ("normal", "<f4", 3), ("flags", "<u4")])


def rays_of(f):
    """Rays from surfaces into all directions, every fourth from outside; float32, as lsp-trace takes them."""
    random, size = np.random.default_rng(1), float(np.linalg.norm(f.h["bounds_max"] - f.h["bounds_min"]))
    rays = np.zeros((kRays, 8), "<f4")
    for i in range(kRays):
        k, d = random.integers(len(f.v0)), random.normal(size=3)
        normal, middle = np.cross(f.e1[k], f.e2[k]), f.v0[k] + (f.e1[k] + f.e2[k]) / 3
        d = d if d @ normal > 0 or i % 4 == 0 else -d
        o = middle - d * size if i % 4 == 3 else middle + 1e-4 * size * normal / np.linalg.norm(normal)
        rays[i] = [*o, 1e-3 * size if i % 3 == 0 else 0, *d, size * random.random() if i % 5 == 0 else np.inf]
    return rays


def compare(what, mine, theirs):
    def same(a, b):
        if a is None:
            return np.isinf(b["t"])
        return abs(a.t - b["t"]) <= 2e-4 * a.t + 2e-6 and a.primitive == b["primitive"]
    differ = [i for i, (a, b) in enumerate(zip(mine, theirs)) if not same(a, b)]
    hits = sum(a is not None for a in mine)
    print(f"{what}: {hits} of {kRays} rays hit, {len(differ)} differ from lsp-trace: {differ[:9]}")
    return len(differ) <= kMayDiffer


def main(spec, programs):
    good = True
    with tempfile.TemporaryDirectory() as folder:
        def run(program, *arguments):
            command = [Path(programs) / program, *arguments]
            return subprocess.run(command, cwd=folder, check=True, stdout=subprocess.PIPE).stdout
        for scene, triangles in (("spheres", "1300"), ("grove", "1000")):
            run("lsp-sample-scene", "scene.glb", "--scene", scene, "--triangles", triangles)
            run("lsp-bake", "scene.glb", "-o", "scene.lsp", "--base", "cells", "--cells", "6")
            f = File(Path(folder) / "scene.lsp", spec)
            numbers = rays_of(f)
            numbers.tofile(Path(folder) / "rays.bin")
            rays = [Ray(x[:3].astype(float), x[4:7].astype(float), float(x[3]), float(x[7]),
                        np.delete(x, [3, 7]).view("<u4").tolist()) for x in numbers]

            def theirs(*arguments):
                report = run("lsp-trace", "scene.lsp", "--rays", "rays.bin", "--hits", "hits.bin", "--json", *arguments)
                return np.fromfile(Path(folder) / "hits.bin", HITS), json.loads(report)
            good &= compare(f"{scene}, exact", [trace_wide(f, r) for r in rays], theirs("--mode", "exact")[0])
            for i, quality in enumerate(("balanced", "fast", "accurate")):
                cells = Cells(f, f.h["quality"][i], f.h["quality_part"][i])
                hits, report = theirs("--mode", "approximate", "--quality", quality)
                good &= compare(f"{scene}, {quality}", [cells.trace(r) for r in rays], hits)
                steps = abs(cells.steps / kRays - report["steps_per_ray"])
                good &= bool(steps <= 0.02) or print(f"{scene}, {quality}: steps differ by {steps} a ray") or False
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]).read_text(), sys.argv[2]))
