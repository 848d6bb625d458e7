# lsp_add_asset(TARGET OUT.lsp|OUT.json SOURCES MESH... [OPTIONS OPTION...])
#
# Bakes the MESHes into OUT.lsp, or into a scene of instances OUT.json with its assets OUT.MESH.lsp beside it (lsp-bake
# --instances), as a part of building TARGET, with lsp-bake's OPTIONs: again when a file changed that
# the bake read (textures and .mtl files too), when the OPTIONs or lsp-bake changed, and at no other time. TARGET is
# one of the project's, or a name that is not taken: then it becomes a target that holds assets alone and is built by
# default. A relative OUT lies in CMAKE_CURRENT_BINARY_DIR, relative MESHes in CMAKE_CURRENT_SOURCE_DIR.
#
# Bakes with the target lsp::lsp-bake where the programs are installed with the package or built with the project
# (LSP_PROGRAMS), else with the program that the variable LSP_BAKE names or that is found in PATH.
cmake_policy(VERSION 3.20)  # depfiles: relative to the folder that asks, for Ninja and Make

function(lsp_add_asset target output)
  cmake_parse_arguments(PARSE_ARGV 2 ARG "" "" "SOURCES;OPTIONS")
  if(NOT ARG_SOURCES OR ARG_UNPARSED_ARGUMENTS OR NOT output MATCHES "\\.(lsp|json)$")
    message(FATAL_ERROR "use lsp_add_asset(TARGET OUT.lsp|OUT.json SOURCES MESH... [OPTIONS OPTION...])")
  endif()
  set(bake lsp::lsp-bake)
  if(NOT TARGET ${bake})
    find_program(LSP_BAKE lsp-bake DOC "The program that bakes for lsp_add_asset")
    if(NOT LSP_BAKE)
      message(FATAL_ERROR "lsp_add_asset needs lsp-bake: install lsp's programs, build them with LSP_PROGRAMS=ON or "
        "set LSP_BAKE to one that runs here")
    endif()
    set(bake ${LSP_BAKE})
  endif()

  cmake_path(ABSOLUTE_PATH output BASE_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR} NORMALIZE)
  set(sources)
  foreach(source IN LISTS ARG_SOURCES)
    cmake_path(ABSOLUTE_PATH source BASE_DIRECTORY ${CMAKE_CURRENT_SOURCE_DIR} NORMALIZE)
    list(APPEND sources ${source})
  endforeach()
  cmake_path(GET output PARENT_PATH folder)
  file(MAKE_DIRECTORY ${folder})
  set(instances)
  if(output MATCHES "\\.json$")
    set(instances --instances)
  endif()
  file(RELATIVE_PATH name ${CMAKE_BINARY_DIR} ${output})
  if(name MATCHES "^\\.\\./")
    set(name ${output})
  endif()
  if(CMAKE_GENERATOR MATCHES "Ninja")
    # Ninja reads the depfile as it is, with the output as Ninja calls it: CMake would write it anew and leave # and $
    # in names as they are, which Ninja reads as something else.
    cmake_policy(SET CMP0116 OLD)
  endif()
  add_custom_command(OUTPUT ${output}
    COMMAND ${bake} ${sources} -o ${name} ${instances} --depfile ${output}.d --quiet ${ARG_OPTIONS}
    DEPENDS ${bake} ${sources} DEPFILE ${output}.d WORKING_DIRECTORY ${CMAKE_BINARY_DIR}
    COMMENT "Baking ${name}" VERBATIM COMMAND_EXPAND_LISTS)

  # A target of the asset's own, so that one asset is baked once even where several targets want it.
  string(MD5 hash ${output})
  string(SUBSTRING ${hash} 0 8 hash)
  cmake_path(GET output STEM LAST_ONLY stem)
  string(MAKE_C_IDENTIFIER lsp_asset_${stem}_${hash} asset)
  add_custom_target(${asset} DEPENDS ${output})
  if(NOT TARGET ${target})
    add_custom_target(${target} ALL)
  endif()
  add_dependencies(${target} ${asset})
endfunction()
