#include "import/ears.h"

#include <algorithm>
#include <cmath>

namespace lsp {
namespace {

constexpr uint32_t kNone = 0xFFFFFFFFu;

}  // namespace

EarCut EarClipper::cut(std::span<const glm::dvec2> corners, std::vector<glm::uvec3>& out, uint64_t& work) {
  at_ = corners;
  out_ = &out;
  work_ = &work;
  start();
  const size_t first_triangle = out.size();
  uint32_t any = 0;
  while (left_ > 3 && work > 0) {
    const uint32_t v = head_ < queue_.size() ? queue_[head_++] : kNone;
    if (v == kNone) {  // no ear is left: it crosses itself, or what is left is a line
      const uint32_t worst = least_bad(any);
      any = next_[worst];
      clip(worst);
      continue;
    }
    queued_[v] = 0;
    if (!alive_[v]) continue;
    any = next_[v];
    if (is_spike(v)) {
      clip(v);
    } else if (is_convex(v)) {
      bool touching = false;
      const uint32_t blocker = find_blocker(v, touching);
      if (blocker == kNone) {
        clip(v);
      } else {
        touching_[v] = touching;
        waits_for_[v] = blocker;
        waiting_.push_back({v, first_waiting_[blocker]});
        first_waiting_[blocker] = uint32_t(waiting_.size() - 1);
      }
    }
  }
  while (!alive_[any]) any = next_[any];
  const uint32_t first = any;
  for (uint32_t v = next_[first]; left_ > 2; v = next_[v], --left_) out.push_back({first, v, next_[v]});
  if (work == 0) return EarCut::kGaveUp;
  double sizes = 0, outline = 0;
  for (size_t i = first_triangle; i < out.size(); ++i)
    sizes += std::abs(area2(corners[out[i].x], corners[out[i].y], corners[out[i].z]));
  for (size_t i = 2; i < corners.size(); ++i) outline += area2(corners[0], corners[i - 1], corners[i]);
  constexpr double kRounding = 1e-6;
  return sizes > outline * (1 + kRounding) ? EarCut::kCrossed : EarCut::kRight;
}

void EarClipper::start() {
  const size_t n = at_.size();
  left_ = n;
  next_.resize(n);
  prev_.resize(n);
  for (uint32_t v = 0; v < n; ++v) {
    next_[v] = uint32_t((v + 1) % n);
    prev_[v] = uint32_t((v + n - 1) % n);
  }
  alive_.assign(n, 1);
  queued_.assign(n, 1);
  touching_.assign(n, 0);
  obstacles_.build(at_);
  for (uint32_t v = 0; v < n; ++v) obstacles_.set(v, !is_convex(v));
  first_waiting_.assign(n, kNone);
  waits_for_.assign(n, kNone);
  waiting_.clear();
  queue_.resize(n);
  for (uint32_t v = 0; v < n; ++v) queue_[v] = v;
  head_ = 0;
}

bool EarClipper::is_convex(uint32_t v) const { return area2(at_[prev_[v]], at_[v], at_[next_[v]]) > 0; }

// A corner that repeats its neighbour, or the tip of a line there and back: cutting it takes nothing away.
bool EarClipper::is_spike(uint32_t v) const {
  return at_[prev_[v]] == at_[v] || at_[v] == at_[next_[v]] || at_[prev_[v]] == at_[next_[v]];
}

// Whether an edge of corner `p`, which lies at `from`, leads strictly between the directions to `right` and
// `left`.
bool EarClipper::goes_into(uint32_t p, const glm::dvec2& from, const glm::dvec2& right,
                           const glm::dvec2& left) const {
  for (const uint32_t q : {next_[p], prev_[p]}) {
    if (area2(from, right, at_[q]) > 0 && area2(from, left, at_[q]) < 0) return true;
  }
  return false;
}

// Whether corner `p` keeps the corner `ear` from being cut. `touching`: only by where its edges lead.
bool EarClipper::blocks(uint32_t ear, uint32_t p, bool& touching) const {
  const glm::dvec2 a = at_[prev_[ear]], b = at_[ear], c = at_[next_[ear]], x = at_[p];
  const double ab = area2(a, b, x), bc = area2(b, c, x), ca = area2(c, a, x);
  if (ab < 0 || bc < 0 || ca < 0) return false;
  touching = true;
  if (x == a) return goes_into(p, a, b, c);
  if (x == b) return goes_into(p, b, c, a);
  if (x == c) return goes_into(p, c, a, b);
  if (ca != 0 && ab == 0) return goes_into(p, x, b, a);
  if (ca != 0 && bc == 0) return goes_into(p, x, c, b);
  touching = false;
  return true;
}

uint32_t EarClipper::find_blocker(uint32_t ear, bool& touching) {
  const uint32_t before = prev_[ear], after = next_[ear];
  const glm::dvec2 corners[3] = {at_[before], at_[ear], at_[after]};
  return obstacles_.find(corners, kNone, *work_,
                         [&](uint32_t p) { return p != before && p != after && blocks(ear, p, touching); });
}

void EarClipper::clip(uint32_t v) {
  const uint32_t before = prev_[v], after = next_[v];
  out_->push_back({before, v, after});
  next_[before] = after;
  prev_[after] = before;
  alive_[v] = 0;
  obstacles_.set(v, false);
  --left_;
  release(v, false);
  neighbour_changed(before);
  neighbour_changed(after);
}

void EarClipper::neighbour_changed(uint32_t v) {
  const bool obstacle = !is_convex(v);
  obstacles_.set(v, obstacle);
  release(v, obstacle);
  enqueue(v);
}

// Lets those that wait for `blocker` try again.
void EarClipper::release(uint32_t blocker, bool touching_only) {
  uint32_t kept = kNone;
  for (uint32_t i = first_waiting_[blocker], following; i != kNone; i = following) {
    following = waiting_[i].next;
    const uint32_t v = waiting_[i].corner;
    if (waits_for_[v] != blocker) continue;  // it was tried again since
    if (touching_only && !touching_[v]) {
      waiting_[i].next = kept;
      kept = i;
    } else {
      enqueue(v);
    }
  }
  first_waiting_[blocker] = kept;
}

void EarClipper::enqueue(uint32_t v) {
  if (queued_[v] || !alive_[v]) return;
  queued_[v] = 1;
  waits_for_[v] = kNone;
  queue_.push_back(v);
}

// What to cut where there is no ear: a corner without area, else the convex one of least area among the next.
uint32_t EarClipper::least_bad(uint32_t from) {
  constexpr size_t kMostLooked = 256;
  while (!alive_[from]) from = next_[from];
  uint32_t best = from;
  double least = INFINITY;
  size_t looked = 0;
  for (uint32_t v = from; looked < std::min(left_, kMostLooked) && least > 0; ++looked, v = next_[v]) {
    const double area = area2(at_[prev_[v]], at_[v], at_[next_[v]]);
    if (area >= 0 && area < least) best = v, least = area;
  }
  *work_ -= std::min<uint64_t>(*work_, looked);
  return best;
}

}  // namespace lsp
