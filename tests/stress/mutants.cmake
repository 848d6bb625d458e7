# Copies of the tracer's text with one fault each, made when CMake configures, compiled like the text itself.
# A fault whose place is not found any more fails a test: the suite must not lose a check unseen.
set(mutants_dir ${CMAKE_CURRENT_BINARY_DIR}/variants)
set(tracer_dir ${PROJECT_SOURCE_DIR}/runtime/include/lsp)
set(variant_sources)
set(variants_inc "")
set(mutants_lost "")

function(lsp_variant name file from to)
  set(dir ${mutants_dir}/${name})
  if(NOT from STREQUAL "")
    file(READ ${tracer_dir}/${file} text)
    string(REPLACE "${from}" "${to}" changed "${text}")
    if(changed STREQUAL text)
      set(mutants_lost "${mutants_lost} ${name} (${file})" PARENT_SCOPE)
    endif()
    file(CONFIGURE OUTPUT ${dir}/lsp/${file} CONTENT "${changed}" @ONLY)
    if(NOT file STREQUAL "traverse.h")
      # The including text has to lie beside it, or the include would find the sound one.
      file(READ ${tracer_dir}/traverse.h text)
      file(CONFIGURE OUTPUT ${dir}/lsp/traverse.h CONTENT "${text}" @ONLY)
    endif()
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${tracer_dir}/${file} ${tracer_dir}/traverse.h)
  file(CONFIGURE OUTPUT ${dir}/${name}.cpp CONTENT "#define VARIANT ${name}\n#include \"variant.inc\"\n" @ONLY)
  # What a fault leaves out is then unused.
  set_source_files_properties(${dir}/${name}.cpp PROPERTIES INCLUDE_DIRECTORIES ${dir}
    COMPILE_OPTIONS "-Wno-unused-but-set-variable;-Wno-unused-variable;-Wno-unused-function")
  set(variant_sources ${variant_sources} ${dir}/${name}.cpp PARENT_SCOPE)
  if(NOT name STREQUAL "sound")
    set(variants_inc "${variants_inc}LSP_VARIANT(${name})\n" PARENT_SCOPE)
  endif()
endfunction()

lsp_variant(sound traverse.h "" "")
lsp_variant(no_box_margin traverse.h
  "r * 9.5367432e-7f + a * 2.3841858e-7f" "0.0f * r * a")
lsp_variant(edges_are_outside traverse.h
  "(u < 0.0f || v < 0.0f || w < 0.0f) && (u > 0.0f || v > 0.0f || w > 0.0f)"
  "!(u > 0.0f && v > 0.0f && w > 0.0f) && !(u < 0.0f && v < 0.0f && w < 0.0f)")
lsp_variant(farther_wins traverse.h
  "if (t > s.tmin && nearer) {" "if (t > s.tmin && (nearer || best.triangle != LSP_NONE)) {")
lsp_variant(tmin_ignored traverse.h
  "if (t > s.tmin && nearer) {" "if (nearer) {")
lsp_variant(near_child_only bvh.h
  "if (lsp_stack_t[next.top] <= best_t) next.ref = lsp_stack_ref[next.top];"
  "if (lsp_stack_t[next.top] > best_t) next.ref = lsp_stack_ref[next.top];")
lsp_variant(no_patch_clamp traverse.h
  "u = u < top ? u : top" "u = u < 2.0f * top ? u : top")
lsp_variant(no_depth_clamp traverse.h
  "t = lsp_max(lsp_min(lsp_min(z.x, z.y), z.z), t);\n  return lsp_min(lsp_max(lsp_max(z.x, z.y), z.z), t);"
  "return t;")
lsp_variant(slab_flipped traverse.h
  "lsp_max(lsp_min(a.z, b.z), s.tmin)" "lsp_max(lsp_max(a.z, b.z), s.tmin)")
lsp_variant(infinite_origin traverse.h
  "if (!lsp_all_finite(o) || !lsp_all_finite(d)) return s;" "")
lsp_variant(cell_skipped ntree.h
  "vec3 plane = lsp_ntree_lo(scene, cell + ahead, size);"
  "vec3 plane = lsp_ntree_lo(scene, cell + ivec3(ahead.x, 1 - ahead.y, ahead.z), size);")
file(CONFIGURE OUTPUT ${mutants_dir}/variants.inc CONTENT "${variants_inc}" @ONLY)
