# What cmake --install puts where. Components: `development` is what an engine builds with, `runtime` the shared
# libraries that it then runs with (none where they are static), `programs` the programs.
include(CMakePackageConfigHelpers)
set(LSP_CONFIG_NEEDS_ZSTD OFF)
if(LSP_PACKED AND NOT BUILD_SHARED_LIBS)
  set(LSP_CONFIG_NEEDS_ZSTD ON)
endif()
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/lsp)

set(libraries lsp lsp_layout)
set(headers interface.h export.h lsp.h lsp_instances.h lsp.hpp error.hpp view.hpp scene_file.hpp instances.hpp)
if(LSP_VULKAN)
  list(APPEND libraries lsp_vulkan)
  list(APPEND headers lsp_vulkan.h parts.h)
endif()
set(shader_include lsp.glsl lsp_instances.glsl lsp_sections.glsl parts.h arithmetic.h traverse.h
  bvh.h ntree.h cells.h wide.h instance_walk.h)
list(TRANSFORM headers PREPEND include/lsp/)
list(TRANSFORM shader_include PREPEND include/lsp/)

install(TARGETS ${libraries} EXPORT lspTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT development
  LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT runtime NAMELINK_COMPONENT development)
install(EXPORT lspTargets NAMESPACE lsp:: DESTINATION ${package_dir} COMPONENT development)
install(FILES
  ${PROJECT_SOURCE_DIR}/format-spec/include/lsp/layout.h ${PROJECT_SOURCE_DIR}/format-spec/include/lsp/sections.def
  ${PROJECT_SOURCE_DIR}/format-spec/include/lsp/version.h
  ${headers} ${shader_include}
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/lsp COMPONENT development)

configure_package_config_file(cmake/lspConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/lspConfig.cmake
  INSTALL_DESTINATION ${package_dir} PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/lspConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/lspConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/lspConfigVersion.cmake
  cmake/lspAddAsset.cmake
  DESTINATION ${package_dir} COMPONENT development)

set(LSP_PC_CFLAGS "")
if(NOT BUILD_SHARED_LIBS)
  set(LSP_PC_CFLAGS " -DLSP_STATIC")
  set(LSP_PC_SYSTEM_LIBS " -lstdc++ -lm")
endif()
if(LSP_VULKAN)
  set(LSP_PC_VULKAN "-llsp_vulkan ")
endif()
if(LSP_PACKED AND NOT BUILD_SHARED_LIBS)
  set(LSP_PC_REQUIRES "libzstd")
endif()
# By its own place the file knows the prefix, which may be moved.
file(RELATIVE_PATH up ${CMAKE_INSTALL_FULL_LIBDIR}/pkgconfig ${CMAKE_INSTALL_PREFIX})
string(REGEX REPLACE "/$" "" LSP_PC_PREFIX "\${pcfiledir}/${up}")
configure_file(cmake/lsp.pc.in ${CMAKE_CURRENT_BINARY_DIR}/lsp.pc @ONLY)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/lsp.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig COMPONENT development)

# Manual pages are what --help says, where help2man is there to make them.
find_program(LSP_HELP2MAN help2man DOC "Makes manual pages of --help; without it there are none")
function(lsp_install_manual program does)
  set(page ${PROJECT_BINARY_DIR}/man/${program}.1)
  add_custom_command(OUTPUT ${page} VERBATIM
    COMMAND ${LSP_HELP2MAN} --no-info --name ${does} --source "lsp ${PROJECT_VERSION}" --manual lsp --output ${page}
            $<TARGET_FILE:${program}>
    DEPENDS ${program})
  add_custom_target(${program}-manual ALL DEPENDS ${page})
  install(FILES ${page} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT programs)
endfunction()

# The programs are made in folders that come later. Their targets are a file of their own, for lspConfig.cmake to find
# where they are installed.
function(lsp_install_programs)
  set(does_lsp-bake "turn meshes into .lsp files")
  set(does_lsp-merge "join the parts of a bake")
  set(does_lsp-validate "check .lsp files")
  set(does_lsp-info "show what an .lsp file holds")
  set(does_lsp-trace "trace rays in an .lsp file")
  set(does_lsp-render "render an .lsp file or a scene of instances")
  set(does_lsp-view "fly through an .lsp file or a scene of instances")
  set(does_lsp-sample-scene "write a procedural scene to bake")
  set(does_lsp-compare "compare two pictures")
  set(does_lsp-bench "measure run time against error")
  set(programs)
  foreach(program ${LSP_PROGRAM_TARGETS})
    if(TARGET ${program})
      list(APPEND programs ${program})
      if(LSP_HELP2MAN AND NOT CMAKE_CROSSCOMPILING)
        lsp_install_manual(${program} ${does_${program}})
      endif()
      # bash-completion looks for a file of the command's name.
      install(FILES ${PROJECT_SOURCE_DIR}/runtime/cmake/completion.bash RENAME ${program}
        DESTINATION ${CMAKE_INSTALL_DATAROOTDIR}/bash-completion/completions COMPONENT programs)
    endif()
  endforeach()
  if(programs)
    install(TARGETS ${programs} EXPORT lspPrograms RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
    install(EXPORT lspPrograms NAMESPACE lsp:: DESTINATION ${CMAKE_INSTALL_LIBDIR}/cmake/lsp COMPONENT programs)
  endif()
endfunction()
cmake_language(DEFER DIRECTORY ${PROJECT_SOURCE_DIR} CALL lsp_install_programs)
