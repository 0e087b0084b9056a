# rtpm_generate(TARGET name SCHEMAS a.fbs … [INCLUDE dirs…] [LINK targets…] [CONFORM dir] [PYTHON dir]
#   [JAVA dir] [TYPESCRIPT dir])
#
# Builds the static library <name> from schemas. For each a.fbs, rtpmc generates the stubs and
# skeletons of its rpc_services (a.rtpm.hpp, a.rtpm.functions.hpp, a.rtpm.cpp) and its events
# (a.rtpm.events.hpp, for users of rtpm::events), and flatc the data types (a_generated.h). Users link
# <name> and include <a.rtpm.hpp>. A dependency file tracks included schemas.
#
#   INCLUDE  further folders for `include` in schemas, besides RTPM's own folder of schemas
#   LINK     libraries with included schemas that are not in SCHEMAS; rtpm::idl is always linked
#   CONFORM  a folder with older versions of the schemas, by file name; the build stops where a schema
#            does not conform
#   PYTHON   a folder that becomes a Python package with a module a_rtpm for each a.fbs; relative to
#            the current folder of the build
#   JAVA, TYPESCRIPT   folders for Java's packages, and for modules a.rtpm.ts; relative likewise. What a
#            schema has no more stays there
#
# When cross-compiling, RTPM_HOST_RTPMC names an rtpmc that runs on the building machine.
if(RTPM_INSTALLED_IDL_DIR)
  set(RTPM_IDL_DIR "${RTPM_INSTALLED_IDL_DIR}" CACHE INTERNAL "RTPM's own schemas")
else()
  cmake_path(SET rtpm_idl_dir NORMALIZE "${CMAKE_CURRENT_LIST_DIR}/../schema/idl")
  set(RTPM_IDL_DIR "${rtpm_idl_dir}" CACHE INTERNAL "RTPM's own schemas")
  unset(rtpm_idl_dir)
endif()

# The command that runs rtpmc, and the dependency of a rule that uses it.
function(rtpm_find_rtpmc command dependency)
  if(RTPM_HOST_RTPMC)
    if(NOT EXISTS "${RTPM_HOST_RTPMC}")
      message(FATAL_ERROR "RTPM_HOST_RTPMC is \"${RTPM_HOST_RTPMC}\", and there is no such file. "
                          "Remedy: name the rtpmc of a build for this machine.")
    endif()
    set(${command} "${RTPM_HOST_RTPMC}" PARENT_SCOPE)
    set(${dependency} "${RTPM_HOST_RTPMC}" PARENT_SCOPE)
  elseif(CMAKE_CROSSCOMPILING)
    message(FATAL_ERROR "Cross-compiling needs an rtpmc that runs on this machine. Remedy: build RTPM "
                        "for this machine first, and set -DRTPM_HOST_RTPMC=<its folder>/bin/rtpmc.")
  else()
    set(${command} rtpm::rtpmc PARENT_SCOPE)
    set(${dependency} rtpm::rtpmc PARENT_SCOPE)
  endif()
endfunction()

function(rtpm_generate)
  cmake_parse_arguments(PARSE_ARGV 0 A "" "TARGET;CONFORM;PYTHON;JAVA;TYPESCRIPT" "SCHEMAS;INCLUDE;LINK")
  if(A_UNPARSED_ARGUMENTS OR NOT A_TARGET OR NOT A_SCHEMAS)
    message(FATAL_ERROR "rtpm_generate: TARGET and SCHEMAS are required and nothing unknown is taken; got '${ARGV}'")
  endif()
  rtpm_find_rtpmc(rtpmc rtpmc_dependency)
  set(out "${CMAKE_CURRENT_BINARY_DIR}/${A_TARGET}.rtpm")
  file(MAKE_DIRECTORY "${out}")
  set(include_flags -I "${RTPM_IDL_DIR}")
  foreach(directory IN LISTS A_INCLUDE)
    cmake_path(ABSOLUTE_PATH directory BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    list(APPEND include_flags -I "${directory}")
  endforeach()
  if(A_PYTHON)
    cmake_path(ABSOLUTE_PATH A_PYTHON BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE)
    file(MAKE_DIRECTORY "${A_PYTHON}")
    file(TOUCH "${A_PYTHON}/__init__.py" "${A_PYTHON}/py.typed")
  endif()
  foreach(folder A_JAVA A_TYPESCRIPT)
    if(${folder})
      cmake_path(ABSOLUTE_PATH ${folder} BASE_DIRECTORY "${CMAKE_CURRENT_BINARY_DIR}" NORMALIZE)
    endif()
  endforeach()
  set(generated "")
  foreach(schema IN LISTS A_SCHEMAS)
    cmake_path(ABSOLUTE_PATH schema BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    cmake_path(GET schema STEM LAST_ONLY stem)
    set(conform "")
    if(A_CONFORM)
      cmake_path(ABSOLUTE_PATH A_CONFORM BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}" OUTPUT_VARIABLE older)
      if(EXISTS "${older}/${stem}.fbs")
        set(conform --conform "${older}/${stem}.fbs")
      endif()
    endif()
    set(files "${out}/${stem}.rtpm.hpp" "${out}/${stem}.rtpm.functions.hpp" "${out}/${stem}.rtpm.events.hpp"
      "${out}/${stem}.rtpm.cpp" "${out}/${stem}_generated.h" "${out}/${stem}_generated.cpp")
    set(python "")
    if(A_PYTHON)
      string(MAKE_C_IDENTIFIER "${stem}" module)
      list(APPEND files "${A_PYTHON}/${module}_rtpm.py" "${A_PYTHON}/${module}_rtpm.pyi")
      set(python COMMAND "${rtpmc}" ${include_flags} --emit python -o "${A_PYTHON}" "${schema}")
    endif()
    set(others "")
    if(A_JAVA)  # Its files' names depend on the schema's content.
      list(APPEND others COMMAND "${rtpmc}" ${include_flags} --emit java -o "${A_JAVA}" "${schema}")
    endif()
    if(A_TYPESCRIPT)
      list(APPEND files "${A_TYPESCRIPT}/${stem}.rtpm.ts")
      list(APPEND others COMMAND "${rtpmc}" ${include_flags} --emit typescript -o "${A_TYPESCRIPT}" "${schema}")
    endif()
    # rtpmc comes first because its errors are better. flatc writes no file for a schema without types
    # of its own: the touch creates the promised output. The last command moves the part of flatc's
    # header that is slow to compile and rarely used to a source file.
    add_custom_command(
      OUTPUT ${files}
      COMMAND "${rtpmc}" ${include_flags} --cpp ${conform} --depfile "${out}/${stem}.d" -o "${out}" "${schema}"
      ${python}
      ${others}
      COMMAND "${RTPM_FLATC}" --cpp --cpp-std c++17 --scoped-enums --gen-object-api ${include_flags} -o "${out}" "${schema}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${out}/${stem}_generated.h"
      COMMAND "${rtpmc}" split-objects "${out}/${stem}_generated.h" "${out}/${stem}_generated.cpp"
      DEPENDS "${schema}" ${rtpmc_dependency}
      DEPFILE "${out}/${stem}.d"
      COMMENT "rtpmc ${stem}.fbs"
      COMMAND_EXPAND_LISTS VERBATIM)
    # flatc's code has warnings.
    set_source_files_properties("${out}/${stem}_generated.cpp" PROPERTIES COMPILE_OPTIONS -w)
    list(APPEND generated ${files})
  endforeach()
  add_library(${A_TARGET} STATIC ${generated})
  target_include_directories(${A_TARGET} SYSTEM PUBLIC
    "$<BUILD_INTERFACE:${out}>" "$<INSTALL_INTERFACE:include/rtpm/idl>")
  target_link_libraries(${A_TARGET} PUBLIC rtpm::rpc ${A_LINK})
  if(NOT A_TARGET STREQUAL "rtpm_idl")
    target_link_libraries(${A_TARGET} PUBLIC rtpm::idl)
  endif()
  set_target_properties(${A_TARGET} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
  # RTPM's own libraries are installed with it.
  if(A_TARGET MATCHES "^rtpm_(.*idl)$" AND COMMAND rtpm_install_library)
    set_target_properties(${A_TARGET} PROPERTIES EXPORT_NAME "${CMAKE_MATCH_1}")
    add_library(rtpm::${CMAKE_MATCH_1} ALIAS ${A_TARGET})
    set(headers ${generated})
    list(FILTER headers EXCLUDE REGEX "\\.(cpp|pyi?|ts)$")
    set(needs rtpm::rpc ${A_LINK})
    if(NOT A_TARGET STREQUAL "rtpm_idl")
      list(APPEND needs rtpm_idl)
    endif()
    rtpm_install_library(${A_TARGET} HEADERS ${headers} NEEDS ${needs})
  endif()
endfunction()
