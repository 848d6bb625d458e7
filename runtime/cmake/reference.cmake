# The reference of the headers that install.cmake installs, by Doxygen; without it there is none.
find_program(LSP_DOXYGEN doxygen DOC "Makes the reference of the public headers")
if(NOT LSP_DOXYGEN)
  return()
endif()
set(LSP_REFERENCE_DIR ${PROJECT_BINARY_DIR}/reference)
list(TRANSFORM headers PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ OUTPUT_VARIABLE documented)
list(TRANSFORM documented REPLACE "(.+)" "\"\\1\"")
list(JOIN documented " " LSP_REFERENCE_INPUT)
configure_file(reference/Doxyfile.in ${CMAKE_CURRENT_BINARY_DIR}/Doxyfile @ONLY)
file(MAKE_DIRECTORY ${LSP_REFERENCE_DIR})
add_custom_target(reference COMMAND ${LSP_DOXYGEN} ${CMAKE_CURRENT_BINARY_DIR}/Doxyfile
  COMMENT "Reference of the public headers: ${LSP_REFERENCE_DIR}/html/index.html" VERBATIM)
