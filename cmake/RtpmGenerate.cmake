# rtpm_generate(TARGET name SCHEMAS a.fbs … [INCLUDE dirs…] [LINK targets…])
#
# Makes the static library <name> from schemas: for each a.fbs, rtpmc generates the stubs and
# skeletons of its rpc_services (a.rtpm.hpp, a.rtpm.cpp) and flatc the data types (a_generated.h).
# Users link <name> and include <a.rtpm.hpp>. Whatever a schema includes is tracked by a dependency
# file, so an edit there regenerates. INCLUDE: further folders for `include` in schemas; RTPM's own
# folder of schemas is always searched. An included schema must itself be among SCHEMAS, or in a
# library that LINK names; RTPM's own, rtpm_idl, is always linked.
cmake_path(SET RTPM_IDL_DIR NORMALIZE "${CMAKE_CURRENT_LIST_DIR}/../schema/idl")
set(RTPM_IDL_DIR "${RTPM_IDL_DIR}" CACHE INTERNAL "RTPM's own schemas")

function(rtpm_generate)
  cmake_parse_arguments(PARSE_ARGV 0 A "" "TARGET" "SCHEMAS;INCLUDE;LINK")
  if(A_UNPARSED_ARGUMENTS OR NOT A_TARGET OR NOT A_SCHEMAS)
    message(FATAL_ERROR "rtpm_generate: TARGET and SCHEMAS are required and nothing unknown is taken; got '${ARGV}'")
  endif()
  set(out "${CMAKE_CURRENT_BINARY_DIR}/${A_TARGET}.rtpm")
  file(MAKE_DIRECTORY "${out}")
  set(include_flags -I "${RTPM_IDL_DIR}")
  foreach(directory IN LISTS A_INCLUDE)
    cmake_path(ABSOLUTE_PATH directory BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    list(APPEND include_flags -I "${directory}")
  endforeach()
  set(generated "")
  foreach(schema IN LISTS A_SCHEMAS)
    cmake_path(ABSOLUTE_PATH schema BASE_DIRECTORY "${CMAKE_CURRENT_SOURCE_DIR}")
    cmake_path(GET schema STEM LAST_ONLY stem)
    set(files "${out}/${stem}.rtpm.hpp" "${out}/${stem}.rtpm.cpp" "${out}/${stem}_generated.h")
    # rtpmc comes first because its errors are the better ones. flatc writes no file for a schema
    # that declares no types of its own: the touch makes the one that CMake was promised.
    add_custom_command(
      OUTPUT ${files}
      COMMAND rtpm::rtpmc ${include_flags} --cpp --depfile "${out}/${stem}.d" -o "${out}" "${schema}"
      COMMAND "${RTPM_FLATC}" --cpp --cpp-std c++17 --scoped-enums --gen-object-api ${include_flags} -o "${out}" "${schema}"
      COMMAND "${CMAKE_COMMAND}" -E touch "${out}/${stem}_generated.h"
      DEPENDS "${schema}" rtpm::rtpmc
      DEPFILE "${out}/${stem}.d"
      COMMENT "rtpmc ${stem}.fbs"
      COMMAND_EXPAND_LISTS VERBATIM)
    list(APPEND generated ${files})
  endforeach()
  add_library(${A_TARGET} STATIC ${generated})
  target_include_directories(${A_TARGET} SYSTEM PUBLIC "$<BUILD_INTERFACE:${out}>")
  target_link_libraries(${A_TARGET} PUBLIC rtpm::rpc ${A_LINK})
  if(NOT A_TARGET STREQUAL "rtpm_idl")
    target_link_libraries(${A_TARGET} PUBLIC rtpm_idl)
  endif()
  set_target_properties(${A_TARGET} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
endfunction()
