// Instances that own their memory: the thin C++ side of lsp_instances.h. Header-only.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "lsp/error.hpp"
#include "lsp/lsp_instances.h"
#include "lsp/view.hpp"

namespace lsp {

// Built from scenes and places, and again as places change; memory is kept from one time to the next. Errors
// are thrown as lsp::Error. Tracing is const and may be done from any number of threads, but not while
// build runs.
class Instances {
 public:
  // No instances: every ray misses.
  Instances() = default;
  // Of these scenes, built at once; as build.
  Instances(std::vector<const lsp_scene*> assets, View<const lsp_instance> instances)
      : assets_(std::move(assets)) {
    build(instances);
  }
  Instances(const Instances&) = delete;  // the view would be of the other's memory
  Instances& operator=(const Instances&) = delete;
  Instances(Instances&&) = default;             // what is left may be destroyed or assigned to
  Instances& operator=(Instances&&) = default;  // as of the other

  // The scenes named by lsp_instance.asset; they must outlive this.
  const std::vector<const lsp_scene*>& assets() const { return assets_; }

  // Puts the instances, all of them, at other places. After a failure there are none.
  void build(View<const lsp_instance> instances) {
    if (instances.size() > LSP_MAX_INSTANCES)
      throw Error(LSP_ERROR_LIMIT, "", std::to_string(instances.size()) + " instances are too many");
    const auto count = static_cast<uint32_t>(instances.size());
    memory_.resize(lsp_instances_bytes(count) / sizeof(Block) + 1);
    lsp_error error;
    throw_unless_ok(
        lsp_instances_build(assets_.data(), static_cast<uint32_t>(assets_.size()), instances.data(), count,
                            memory_.data(), memory_.size() * sizeof(Block), &view_, &error),
        error);
  }

  // `rays` and `hits` are of one size, else LSP_ERROR_LIMIT. Adds to *counts unless it is null.
  void trace(const lsp_trace_options& options, uint32_t mask, View<const LspRay> rays, View<LspHit> hits,
             lsp_trace_counts* counts = nullptr) const {
    require_one_size(rays, hits);
    lsp_error error;
    throw_unless_ok(
        lsp_trace_instances(&view_, &options, mask, rays.data(), hits.data(), rays.size(), counts, &error),
        error);
  }

  const lsp_instances& view() const { return view_; }  // good until the next build
  // An instance as it was given, by its number.
  const lsp_instance& operator[](uint32_t number) const { return view_.records[number].instance; }
  uint32_t size() const { return view_.count; }  // how many there are

 private:
  struct alignas(16) Block {
    unsigned char bytes[16];
  };
  std::vector<const lsp_scene*> assets_;
  std::vector<Block> memory_;
  lsp_instances view_{};
};

}  // namespace lsp
