# Copies of sources of the runtime with one fault each, made when CMake configures, compiled like the source itself.
# A fault whose text is not in its file any more fails the test Mutations.EveryFaultHasItsPlace, which says which:
# the suite must not lose a check unseen.
set(mutants_dir ${CMAKE_CURRENT_BINARY_DIR}/variants)
set(variant_sources)
set(variants_inc "")

# Writes `output`: runtime/`file` with `to` in place of `from`.
function(lsp_put_fault name file from to output)
  set(source ${PROJECT_SOURCE_DIR}/runtime/${file})
  file(READ ${source} text)
  string(REPLACE "${from}" "${to}" changed "${text}")
  if(changed STREQUAL text)
    set_property(DIRECTORY APPEND_STRING PROPERTY mutants_lost "${name}: not in runtime/${file}: ${from}\n")
  endif()
  file(CONFIGURE OUTPUT ${output} CONTENT "${changed}" @ONLY)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${source})
endfunction()

# The tracer's text, compiled in a namespace `name` (variants.h).
function(lsp_variant name)
  set(dir ${mutants_dir}/${name})
  file(CONFIGURE OUTPUT ${dir}/${name}.cpp CONTENT "#define VARIANT ${name}\n#include \"variant.inc\"\n" @ONLY)
  # What a fault leaves out is then unused.
  set_source_files_properties(${dir}/${name}.cpp PROPERTIES INCLUDE_DIRECTORIES ${dir}
    COMPILE_OPTIONS "-Wno-unused-but-set-variable;-Wno-unused-variable;-Wno-unused-function")
  set(variant_sources ${variant_sources} ${dir}/${name}.cpp PARENT_SCOPE)
endfunction()

# The same with a fault in include/lsp/`file`.
macro(lsp_mutant name file from to)
  if(NOT "${file}" STREQUAL traverse.h)
    # The text that includes the faulty one has to lie beside it, or the include would find the sound one.
    configure_file(${PROJECT_SOURCE_DIR}/runtime/include/lsp/traverse.h ${mutants_dir}/${name}/lsp/traverse.h COPYONLY)
  endif()
  lsp_put_fault(${name} include/lsp/${file} "${from}" "${to}" ${mutants_dir}/${name}/lsp/${file})
  lsp_variant(${name})
  string(APPEND variants_inc "LSP_VARIANT(${name})\n")
endmacro()

lsp_variant(sound)
lsp_mutant(no_box_margin traverse.h
  "r * 9.5367432e-7f + a * 2.3841858e-7f" "0.0f * r * a")
lsp_mutant(edges_are_outside traverse.h
  "(g.u < 0.0f || g.v < 0.0f || g.w < 0.0f) && (g.u > 0.0f || g.v > 0.0f || g.w > 0.0f)"
  "!(g.u > 0.0f && g.v > 0.0f && g.w > 0.0f) && !(g.u < 0.0f && g.v < 0.0f && g.w < 0.0f)")
lsp_mutant(farther_wins traverse.h
  "if (t > s.tmin && nearer) {" "if (t > s.tmin && (nearer || best.triangle != LSP_NONE)) {")
lsp_mutant(tmin_ignored traverse.h
  "if (t > s.tmin && nearer) {" "if (nearer) {")
lsp_mutant(near_child_only bvh.h
  "if (lsp_stack_t[next.top] <= best_t) next.ref = lsp_stack_ref[next.top];"
  "if (lsp_stack_t[next.top] > best_t) next.ref = lsp_stack_ref[next.top];")
lsp_mutant(no_patch_clamp traverse.h
  "u = u < top ? u : top" "u = u < 2.0f * top ? u : top")
lsp_mutant(no_depth_clamp traverse.h
  "t = lsp_max(range.x, t);\n  return lsp_min(range.y, t);" "return t;")
lsp_mutant(hit_beside traverse.h
  "if (lsp_all_beside(g.x) || lsp_all_beside(g.y)) return best;" "")
lsp_mutant(plane_alone traverse.h
  "if (across < LSP_EDGE_ON && across > -LSP_EDGE_ON) {" "if (false) {")
lsp_mutant(slab_flipped traverse.h
  "lsp_max(lsp_min(a.z, b.z), s.tmin)" "lsp_max(lsp_max(a.z, b.z), s.tmin)")
lsp_mutant(infinite_origin traverse.h
  "if (!lsp_all_finite(o) || !lsp_all_finite(d)) return s;" "")
lsp_mutant(cell_skipped ntree.h
  "vec3 plane = lsp_ntree_lo(scene, cell + ahead, size);"
  "vec3 plane = lsp_ntree_lo(scene, cell + ivec3(ahead.x, 1 - ahead.y, ahead.z), size);")
file(CONFIGURE OUTPUT ${mutants_dir}/variants.inc CONTENT "${variants_inc}" @ONLY)

# Buffers whose memory is never freed, for the soak.
lsp_put_fault(leaking vulkan/device.cpp
  "  device_->vk.vkFreeMemory(device_->handle, memory_, nullptr);\n" "" ${mutants_dir}/leaking/device.cpp)

get_property(mutants_lost DIRECTORY PROPERTY mutants_lost)
file(CONFIGURE OUTPUT ${mutants_dir}/mutants_lost.inc CONTENT "R\"lost(${mutants_lost})lost\"" @ONLY)
