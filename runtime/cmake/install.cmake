# What cmake --install puts where: component `runtime` is the library for engines, `programs` the programs.
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/lsp)

install(TARGETS lsp lsp_vulkan lsp_layout EXPORT lspTargets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT runtime)
install(EXPORT lspTargets NAMESPACE lsp:: DESTINATION ${package_dir} COMPONENT runtime)
install(FILES
  ${CMAKE_SOURCE_DIR}/format-spec/include/lsp/layout.h ${CMAKE_SOURCE_DIR}/format-spec/include/lsp/sections.def
  ${CMAKE_SOURCE_DIR}/format-spec/include/lsp/program.h
  include/lsp/interface.h include/lsp/lsp.h include/lsp/lsp_vulkan.h include/lsp/scene_file.hpp include/lsp/lsp.glsl
  include/lsp/lsp_addresses.glsl include/lsp/lsp_descriptors.glsl include/lsp/cells.h
  include/lsp/traverse.h include/lsp/empty_margin.h include/lsp/parts.h include/lsp/bvh.h include/lsp/ntree.h
  DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/lsp COMPONENT runtime)

configure_package_config_file(cmake/lspConfig.cmake.in ${CMAKE_CURRENT_BINARY_DIR}/lspConfig.cmake
  INSTALL_DESTINATION ${package_dir} PATH_VARS CMAKE_INSTALL_INCLUDEDIR)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/lspConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/lspConfig.cmake ${CMAKE_CURRENT_BINARY_DIR}/lspConfigVersion.cmake
  DESTINATION ${package_dir} COMPONENT runtime)

# The prefix is known only when installing (cmake --install --prefix), so the file is written then.
configure_file(cmake/lsp.pc.in ${CMAKE_CURRENT_BINARY_DIR}/lsp.pc.in @ONLY)
install(CODE "
  file(READ \"${CMAKE_CURRENT_BINARY_DIR}/lsp.pc.in\" text)
  string(REGEX REPLACE \"^prefix=[^\\n]*\" \"prefix=\${CMAKE_INSTALL_PREFIX}\" text \"\${text}\")
  file(WRITE \"\$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_LIBDIR}/pkgconfig/lsp.pc\" \"\${text}\")
  message(STATUS \"Installing: \$ENV{DESTDIR}\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_LIBDIR}/pkgconfig/lsp.pc\")
" COMPONENT runtime)

# The programs are made in folders that come later.
function(lsp_install_programs)
  foreach(program lsp-bake lsp-validate lsp-info lsp-trace lsp-render lsp-compare lsp-bench)
    if(TARGET ${program})
      install(TARGETS ${program} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT programs)
    endif()
  endforeach()
endfunction()
cmake_language(DEFER DIRECTORY ${CMAKE_SOURCE_DIR} CALL lsp_install_programs)
