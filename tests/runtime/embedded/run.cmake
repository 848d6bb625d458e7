# cmake -DLINKAGE=static|shared ... -P run.cmake (tests/runtime/CMakeLists.txt names the rest)
# Builds a project that holds lsp, with everything hidden that the runtime has no need of; installs from there, and
# builds the same project from what was installed. Static: by add_subdirectory and the least of it. Shared: by
# FetchContent, with packed files and Vulkan.
file(REMOVE_RECURSE ${WORK_DIR})
function(step)
  execute_process(COMMAND ${ARGN} COMMAND_ERROR_IS_FATAL ANY)
endfunction()

set(hidden CLI11 nlohmann_json TBB draco meshoptimizer embree GTest PNG Threads)
if(LINKAGE STREQUAL "static")
  set(how -DLSP_BY=subdirectory -DLSP_SOURCE_DIR=${SOURCE_DIR} -DLSP_SIMD=OFF)
  set(can_unpack no)
  list(APPEND hidden PkgConfig Vulkan)
else()
  set(how -DLSP_BY=fetch -DFETCHCONTENT_SOURCE_DIR_LSP=${SOURCE_DIR} -DBUILD_SHARED_LIBS=ON -DLSP_PACKED=ON
    -DLSP_VULKAN=ON)
  set(can_unpack yes)
endif()
list(TRANSFORM hidden REPLACE "(.+)" "-DCMAKE_DISABLE_FIND_PACKAGE_\\1=ON")
set(options -G Ninja -DCMAKE_BUILD_TYPE=Debug -DCMAKE_C_COMPILER=${C_COMPILER} -DCMAKE_CXX_COMPILER=${CXX_COMPILER}
  -DCMAKE_CXX_COMPILER_LAUNCHER=${LAUNCHER} -DCMAKE_INSTALL_LIBDIR=${LIBDIR} ${hidden})
set(corpus ${SOURCE_DIR}/format-spec/corpus/2.0/valid)

function(run dir)
  step(${dir}/embedded_c ${corpus}/full.lsp)
  step(${dir}/embedded_plain ${corpus}/full.lsp)
  step(${dir}/embedded_cpp ${corpus}/full.lsp ${corpus}/packed.lsp ${can_unpack})
  if(LINKAGE STREQUAL "shared")
    step(${dir}/embedded_vulkan)
  endif()
endfunction()

step(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/build ${options} ${how} -DLSP_INSTALL=ON)
step(${CMAKE_COMMAND} --build ${WORK_DIR}/build)
run(${WORK_DIR}/build)

set(prefix ${WORK_DIR}/prefix)
foreach(component runtime development)
  step(${CMAKE_COMMAND} --install ${WORK_DIR}/build --component ${component} --prefix ${prefix})
endforeach()
step(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/package ${options} -DLSP_BY=package -DCMAKE_PREFIX_PATH=${prefix})
step(${CMAKE_COMMAND} --build ${WORK_DIR}/package)
run(${WORK_DIR}/package)

set(ENV{PKG_CONFIG_PATH} ${prefix}/${LIBDIR}/pkgconfig)
set(ENV{LD_LIBRARY_PATH} ${prefix}/${LIBDIR})
execute_process(COMMAND pkg-config --cflags --libs lsp OUTPUT_VARIABLE flags COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags UNIX_COMMAND "${flags}")
step(${C_COMPILER} -std=c11 ${CONSUMER_DIR}/main.c -o ${WORK_DIR}/by_pkg_config ${flags})
step(${WORK_DIR}/by_pkg_config ${corpus}/full.lsp)

# All of it can be had there, too.
if(LINKAGE STREQUAL "static")
  step(${CMAKE_COMMAND} -S ${CONSUMER_DIR} -B ${WORK_DIR}/all -G Ninja -DCMAKE_C_COMPILER=${C_COMPILER}
    -DCMAKE_CXX_COMPILER=${CXX_COMPILER} -DLSP_BY=subdirectory -DLSP_SOURCE_DIR=${SOURCE_DIR} -DLSP_PROGRAMS=ON -DLSP_TESTS=ON)
  execute_process(COMMAND ninja -C ${WORK_DIR}/all -t query corner.lsp OUTPUT_VARIABLE inputs COMMAND_ERROR_IS_FATAL ANY)
  if(NOT inputs MATCHES "/lsp-bake\n")
    message(FATAL_ERROR "an asset does not wait for lsp-bake:\n${inputs}")
  endif()
endif()

# What the headers mark, and nothing else, is what the shared libraries give out.
if(LINKAGE STREQUAL "shared")
  foreach(library lsp lsp_vulkan)
    file(STRINGS ${prefix}/include/lsp/${library}.h declared REGEX "^LSP_API ")
    if(library STREQUAL "lsp")
      file(STRINGS ${prefix}/include/lsp/lsp_instances.h more REGEX "^LSP_API ")
      list(APPEND declared ${more})
    endif()
    list(TRANSFORM declared REPLACE "^LSP_API [^(]*(lsp_[a-z_]+)\\(.*" "\\1")
    execute_process(COMMAND ${NM} -D --defined-only --format=posix ${prefix}/${LIBDIR}/lib${library}.so
      OUTPUT_VARIABLE text COMMAND_ERROR_IS_FATAL ANY)
    string(REGEX MATCHALL "[^\n]+" exported "${text}")
    list(TRANSFORM exported REPLACE " .*" "")
    list(SORT declared)
    list(SORT exported)
    if(NOT declared OR NOT declared STREQUAL exported)
      message(FATAL_ERROR "${library}.h declares ${declared}\nit exports ${exported}")
    endif()
  endforeach()
endif()
