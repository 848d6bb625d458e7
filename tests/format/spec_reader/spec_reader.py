"""Reads files of cells by what SPEC.md says and by nothing else, and traces rays through them.

Elements come from the tables of SPEC.md; numbers in brackets are its sections. Raw files only; hashes (9) are not
computed. Arithmetic is in double precision. Broken files end in an AssertionError or IndexError: no validator.
"""
import re
from collections import namedtuple
from pathlib import Path

import numpy as np

kNone = 0xFFFFFFFF
kRounding = 1e-5  # boxes are grown by it, for what double and single precision differ by
Hit = namedtuple("Hit", "t primitive")
Ray = namedtuple("Ray", "o d tmin tmax words")


def elements_of(spec):
    """The tables "### LspName (N bytes)" as dtypes, and the elements of the sections (5)."""
    elements = {"u32": np.dtype("<u4"), "character": np.dtype("u1")}
    kinds = {"u32": "<u4", "u64": "<u8", "f32": "<f4", "vec3": "3<f4"}
    for name, size, table in re.findall(r"^### (Lsp\w+) \((\d+) bytes\)\n\n((?:\|.*\n)+)", spec, re.M):
        rows = [[c.strip() for c in row.strip("|").split("|")] for row in table.splitlines()[2:]]
        formats = [kinds.get(r[2]) or re.sub(r"u32\[(\d+)\]", r"\1<u4", r[2]) for r in rows]
        elements[name] = np.dtype({"names": [r[3] for r in rows], "formats": formats,
                                   "offsets": [int(r[0]) for r in rows], "itemsize": int(size)})
    sections = re.findall(r"^\| ([A-Z]{4}) \| (\w+) \| (\d+) \| (?:set|either|clear) \|", spec, re.M)
    return elements, {s[0]: s[1] for s in sections}


class File:
    """A raw file: its header `h`, and by name its sections, arrays of their elements."""

    def __init__(self, path, spec):
        elements, sections = elements_of(spec)
        data = Path(path).read_bytes()
        self.h = h = np.frombuffer(data, elements["LspHeader"], 1)[0]
        assert data[:8] == bytes.fromhex("894C53500D0A1A0A") and h["version_major"] == 2
        assert h["file_bytes"] == len(data)
        self.sections, end = {}, 384 + 64 * int(h["section_count"])
        order = list(sections)
        for s in np.frombuffer(data, elements["LspSection"], int(h["section_count"]), 384):
            name = int(s["type"]).to_bytes(4, "little").decode()
            assert order.index(name) >= len(self.sections) and s["codec"] == 0, name
            start = -(-end // int(h["alignment"])) * int(h["alignment"])
            assert s["offset"] == start and not any(data[end:start]), name
            end = start + int(s["bytes"])
            self.sections[name] = np.frombuffer(data[start:end], elements[sections[name]])
            assert len(self.sections[name]) == s["element_count"], name
        t = self["TRIA"]
        self.primitive, self.gaps = t["primitive"].astype(int), (t["flags"] >> 16).astype(int)
        self.v0 = t["v0"].astype(float)
        self.e1, self.e2 = t["v1"] - self.v0, t["v2"] - self.v0

    def __getitem__(self, name):
        return self.sections.get(name, [])


def passes(f, record, ray):
    """Whether the ray passes a triangle with gaps (5, gaps)."""
    rot = lambda x, k: (x << k | x >> 32 - k) & kNone
    h = 0
    for w in [*ray.words, int(f.primitive[record])]:
        h = (rot(h ^ rot(w * 0xCC9E2D51 & kNone, 15) * 0x1B873593 & kNone, 13) * 5 + 0xE6546B64) & kNone
    h = (h ^ h >> 16) * 0x85EBCA6B & kNone
    h = (h ^ h >> 13) * 0xC2B2AE35 & kNone
    return (h ^ h >> 16) >> 16 < f.gaps[record]


def closest(f, records, ray, tmin, tmax, best):
    """The closest hit of these triangles or `best`; of several at one t that of the lowest primitive (6, ties)."""
    e1, e2, w = f.e1[records], f.e2[records], ray.o - f.v0[records]
    p, q = np.cross(ray.d, e2), np.cross(w, e1)
    with np.errstate(all="ignore"):
        scale = 1 / np.sum(e1 * p, 1)
        u, v, t = np.sum(w * p, 1) * scale, q @ ray.d * scale, np.sum(e2 * q, 1) * scale
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > tmin) & (t < tmax)
    for i in np.nonzero(met)[0]:
        if f.gaps[records[i]] == 0 or not passes(f, records[i], ray):
            hit = Hit(t[i], f.primitive[records[i]])
            best = hit if best is None or hit < best else best
    return best


def sides(ray, lo, hi):
    """t at which the ray enters and leaves the slab of every axis."""
    with np.errstate(all="ignore"):
        a, b = (lo - ray.o) / ray.d, (hi - ray.o) / ray.d
    within = (ray.o >= lo) & (ray.o <= hi)
    near = np.where(ray.d == 0, np.where(within, -np.inf, np.inf), np.minimum(a, b))
    return near, np.where(ray.d == 0, np.where(within, np.inf, -np.inf), np.maximum(a, b))


def meets(ray, lo, hi, tmin, tmax):
    near, far = sides(ray, lo - kRounding, hi + kRounding)
    return max(near.max(), tmin) <= min(far.min(), tmax)


def trace_wide(f, ray):
    """Exactly, by wide nodes (6.4)."""
    best, stack = None, [0]
    while stack:
        node = f["WNOD"][stack.pop()]
        planes = node["planes"].view("u1").reshape(6, 8).astype(float)
        for k, child in enumerate(node["children"].view("<u2").astype(int)):
            lo, hi = node["lo"] + planes[:3, k] * node["step"], node["lo"] + planes[3:, k] * node["step"]
            if child == 0xFFFF or not meets(ray, lo, hi, ray.tmin, ray.tmax):
                continue
            if child >> 15:
                stack.append(int(node["node_first"]) + (child & 0x7FFF))
            else:
                first = int(node["triangle_first"]) + (child & 0x7FF)
                best = closest(f, np.arange(first, first + (child >> 11) + 1), ray, ray.tmin, ray.tmax, best)
    return best


def trace_tree(f, cell, corner, ray, t_in, t_out):
    """Exactly, through the tree of a cell (6a, LspCellNode; Quality)."""
    best, stack, base = None, [int(cell["root"])], corner - f.h["cells.margin"]
    while stack:
        child = stack.pop()
        if child == 0xFFFF:
            continue
        if child >> 15:
            first = int(cell["reference_first"]) + (child & 0x1FFF)
            records = f["CREF"][first:first + (child >> 13 & 3) + 1].astype(int)
            best = closest(f, records, ray, max(ray.tmin, t_in), min(ray.tmax, t_out), best)
            continue
        node = f["CNOD"][int(cell["node_first"]) + child]
        planes = np.array([node["box_0"], node["box_1"], node["box_2"]]).view("u1").reshape(2, 2, 3)
        for k, (lo, hi) in enumerate(base + planes * float(f.h["cells.box_step"])):
            if meets(ray, lo, hi, t_in, t_out):
                stack.append(int(node["children"]) >> 16 * k & 0xFFFF)
    return best


class Cells:
    """Rays through the tables of a file of cells (6a) by a quality of the header."""

    def __init__(self, f, quality, part):
        self.f, self.heeded = f, [(int(quality) >> at & 255) + (int(part) >> at & 255) / 16 for at in (0, 8)]
        self.tables_alone = self.heeded == [8, 8]
        self.size, self.entries = float(f.h["cells.size"]), f["CENT"].view("<u2")
        self.count = np.array([int(f.h["cells.cells_" + a]) for a in "xyz"])
        self.n, self.m, self.sub = (int(f.h["cells." + x]) for x in ("far_patches", "origin_patches", "sub_cells"))
        self.steps = 0

    def trace(self, ray, again=False):
        lo = self.f.h["cells.lo"].astype(float)
        near, far = sides(ray, lo, lo + self.count * self.size)
        t = max(near.max(), ray.tmin)
        if t > min(far.min(), ray.tmax):
            return None
        at = np.clip(((ray.o + t * ray.d - lo) // self.size).astype(int), 0, self.count - 1)
        begins, closed = t <= ray.tmin, False
        while t < ray.tmax and (at >= 0).all() and (at < self.count).all():
            corner = lo + at * self.size
            near, far = sides(ray, corner, corner + self.size)
            axis = int(far.argmin())
            word = int(self.f["CGRD"][at @ [1, self.count[0], self.count[0] * self.count[1]]])
            self.steps += 1
            if word >> 31:
                hit, over, way = self.answer(ray, word & 0x7FFFFFFF, corner, near, far, begins, again)
                closed = closed or way
                if over:
                    return hit
            t, begins = far[axis], False
            at[axis] += 1 if ray.d[axis] > 0 else -1
        return self.trace(ray, True) if closed and not again and t < ray.tmax else None

    def patch(self, point, axis, n):
        """The patch of a point of a face, and its place in it, -1 to 1."""
        uv = np.delete(point, axis) / self.size * n
        i = np.clip(np.floor(uv), 0, n - 1)
        return int(i[0] + n * i[1]), list(2 * (uv - i) - 1), i

    def answer(self, ray, number, corner, near, far, begins, again):
        """A hit, whether the ray is over, whether it begins here and leaves by a closed way."""
        f, cell = self.f, self.f["CELT"][number]
        axis_in, axis_out = int(near.argmax()), int(far.argmin())
        t_in, t_out = (ray.tmin if begins else near[axis_in]), far[axis_out]
        face_out = 2 * axis_out + int(ray.d[axis_out] > 0)
        leave = ray.o + t_out * ray.d - corner
        index, loss, closed = None, None, False
        if begins:
            where = (ray.o + ray.tmin * ray.d - corner) / self.size * self.sub
            xyz = np.clip(np.floor(where), 0, self.sub - 1)
            bit = int(xyz @ [1, self.sub, self.sub**2])
            mask = int(cell["sub_mask_lo"]) | int(cell["sub_mask_hi"]) << 32
            patch, place, uv = self.patch(leave, axis_out, self.m)
            way = 4 * face_out + int(2 * uv[0] >= self.m) + 2 * int(2 * uv[1] >= self.m)
            closed = bool(int(cell["closed"]) >> way & 1) and not self.tables_alone
            places = [*(2 * (where - xyz) - 1), *place]
            if mask >> bit & 1:
                table = int(cell["sub_first"]) + bin(mask & (1 << bit) - 1).count("1")
                index = int(f.h["cells.origin_entry_first"]) + (table * 6 + face_out) * self.m**2 + patch
            else:
                loss = 7
        if index is None:
            face_in = 2 * axis_in + int(ray.d[axis_in] < 0)
            patch_in, place_in, _ = self.patch(ray.o + near[axis_in] * ray.d - corner, axis_in, self.n)
            patch_out, place_out, _ = self.patch(leave, axis_out, self.n)
            pair = face_in * 5 + face_out - int(face_out > face_in)
            index = ((number * 30 + pair) * self.n**2 + patch_in) * self.n**2 + patch_out
            places = place_in + place_out
        entry = int(self.entries[index])
        loss, answer = entry >> 13 if loss is None else loss, entry & 0x1FFF
        heeded = self.heeded[0 if begins else 1]

        def lossy(place):
            counts = (-1, 2, 3, 3, 4, 5, 6, 99) if begins else (-7, 1, 1, 2, 3, 5, 7, 99)
            return again or heeded == 0 or heeded < 8 and counts[loss] + place >= heeded

        def exactly():
            hit = trace_tree(f, cell, corner, ray, t_in, t_out)
            return hit, hit is not None, closed

        risk = 0
        if answer >= 0x1FFE:
            if lossy(-2 if begins else 1):
                return exactly()
            return None, answer == 0x1FFE and not closed, closed
        if answer >= cell["plane_count"]:
            split = f["CSPL"][int(cell["split_first"]) + answer - int(cell["plane_count"])]
            weight = lambda word, at: (int(word) >> at & 63 ^ 32) - 32  # 6-bit two's complement
            form = sum(weight(split["weights"], 6 * i) * x for i, x in enumerate(places))
            form += weight(split["answers"], 24)
            answer = int(split["answers"]) >> (0 if form > 0 else 12) & 0xFFF
            form = abs(form)
            if answer == 0xFFF:
                risk = max(-3, 4 - form / 8) if begins else max(-5, 7 - form / 2)
                return exactly() if lossy(risk) else (None, False, closed)
            risk = max(0, 2 - form / 16) if begins else max(-2, 2 - form / 8)
        plane = int(cell["plane_first"]) + answer
        normal, record = f["CPLN"][plane]["normal"].astype(float), int(f["CPRC"][plane])
        with np.errstate(all="ignore"):
            t = f["CPLN"][plane]["distance"] * self.size - normal @ (ray.o - corner - self.size / 2)
            t /= normal @ ray.d
        slack = (t_out - t_in) / 20
        if begins:
            ahead = t > max(ray.tmin, t_in)
            risk += -1 if not ahead else 6 if t < t_in + 2 * slack else 2 if t <= t_out else 8 if t <= t_out + slack else 1
        elif max(ray.tmin, t_in - slack) < t <= t_out + slack:
            risk += 4 if t < t_in else 0 if t <= t_out else 8
        if lossy(risk):
            return exactly()
        if not max(ray.tmin, t_in if begins else t_in - slack) < t <= t_out + slack:
            return None, False, closed
        t = min(max(t, t_in), t_out)
        if not ray.tmin < t < ray.tmax:
            return None, False, closed
        if f.gaps[record] and not self.tables_alone:
            return exactly()
        over = not f.gaps[record] or not passes(f, record, ray)
        return Hit(t, f.primitive[record]) if over else None, over, closed
