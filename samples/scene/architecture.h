// The stone parts of the atrium, in metres, each standing on y = 0 at the origin unless stated otherwise.
#pragma once

#include "scene.h"

namespace lsp::sample {

// A fluted shaft with entasis between heights `from` and `to`; `radius` at the foot.
Surface fluted_shaft(const Detail& detail, float radius, float from, float to);
// A plain shaft with entasis.
Surface smooth_shaft(const Detail& detail, float radius, float from, float to);
// Plinth, torus, scotia, torus: an attic base of the given height.
Surface attic_base(const Detail& detail, float radius, float height);
// Bell and abacus; its foot has `radius`. The leaves are a part of their own.
Surface capital(const Detail& detail, float radius, float height);
Surface capital_leaves(const Detail& detail, float radius, float height);

// Soffit and mouldings of a round arch that springs from y = 0 and spans the x axis; its wall is centred on
// z = 0 with the given thickness.
Surface archivolt(const Detail& detail, float radius, float thickness);
// The ceiling of a square bay under four round arches of radius side / 2 springing from y = 0: a groin vault.
Surface groin_vault(const Detail& detail, float side);
// A flat transverse rib under a vault.
Surface vault_rib(const Detail& detail, float radius, float width, float depth);

// `per_side`^2 stepped coffers in a square ceiling that faces down at y = 0, centred on the origin.
Surface coffers(float side, int per_side);
// The bottoms of those coffers with a raised rosette each.
Surface coffer_rosettes(const Detail& detail, float side, int per_side);

Surface baluster(const Detail& detail, float height);

// A straight moulding along x of the given length whose profile (z outward, y up) is extruded.
Surface moulding(const std::vector<glm::vec2>& profile, float length);

// A square paving slab, bevelled, its top at y = 0.
Surface plain_tile(float side);
// The same with an eight-petalled relief.
Surface relief_tile(const Detail& detail, float side);

// A quarter sphere (the half dome over a niche) that opens towards -x, seen from inside, radius `radius`.
Surface half_dome(const Detail& detail, float radius);
// The half cylinder below it.
Surface niche_wall(const Detail& detail, float radius, float height);

}  // namespace lsp::sample
