# FlatBuffers for RTPM's targets, in this tree and where RTPM is installed.
#
# However it is found, RTPM uses rtpm_flatbuffers (the headers, for generated code),
# rtpm_flatbuffers_parser (the library, for rtpmc) and RTPM_FLATC (FlatBuffers' own compiler). The two
# are imported targets, so that RTPM's own can be exported without them. RTPM_FLATBUFFERS_PROBLEM is
# empty, or says what is wrong with the FlatBuffers of this machine.
set(RTPM_FLATBUFFERS_SOURCE "" CACHE PATH "A source folder of FlatBuffers, to build instead of using the installed one")
if(RTPM_FLATBUFFERS_SOURCE)
  if(NOT TARGET flatbuffers)
    block()
      set(FLATBUFFERS_BUILD_TESTS OFF)
      set(FLATBUFFERS_INSTALL OFF)
      set(CMAKE_POSITION_INDEPENDENT_CODE ON)
      set(CMAKE_UNITY_BUILD OFF)  # flatc does not compile with it.
      add_subdirectory("${RTPM_FLATBUFFERS_SOURCE}" "${CMAKE_BINARY_DIR}/flatbuffers" EXCLUDE_FROM_ALL SYSTEM)
    endblock()
  endif()
  file(STRINGS "${RTPM_FLATBUFFERS_SOURCE}/include/flatbuffers/base.h" version
    REGEX "define FLATBUFFERS_VERSION_(MAJOR|MINOR|REVISION) ")
  string(REGEX MATCHALL "[0-9]+" version "${version}")
  list(JOIN version . RTPM_FLATBUFFERS_VERSION)
else()
  find_package(FlatBuffers CONFIG NAMES FlatBuffers Flatbuffers flatbuffers QUIET GLOBAL)
  set(RTPM_FLATBUFFERS_VERSION "${FlatBuffers_VERSION}")
endif()
# When cross-compiling, the flatc that was built does not run on this machine.
if(RTPM_FLATBUFFERS_SOURCE AND NOT CMAKE_CROSSCOMPILING)
  set(RTPM_FLATC "$<TARGET_FILE:flatc>" CACHE INTERNAL "FlatBuffers' own compiler")
else()
  if("${RTPM_FLATC}" MATCHES "TARGET_FILE")  # Of an earlier run with a source folder.
    unset(RTPM_FLATC CACHE)
  endif()
  find_program(RTPM_FLATC flatc DOC "FlatBuffers' own compiler, which generates the data types")
endif()

# Releases are numbered by their dates since 22.9; 2.0.8, 23.5.26 and 25.12.19 were tried.
set(RTPM_FLATBUFFERS_PROBLEM "")
if(NOT RTPM_FLATBUFFERS_VERSION VERSION_GREATER_EQUAL 2.0.8 OR NOT RTPM_FLATBUFFERS_VERSION VERSION_LESS 26
   OR NOT RTPM_FLATC)
  set(RTPM_FLATBUFFERS_PROBLEM
    "RTPM needs FlatBuffers from 2.0.8 to 25 with its flatc; found: version '${RTPM_FLATBUFFERS_VERSION}', \
flatc '${RTPM_FLATC}'. Remedy: install the Debian packages libflatbuffers-dev and flatbuffers-compiler, or \
set RTPM_FLATBUFFERS_SOURCE to the folder of FlatBuffers' sources.")
elseif(NOT TARGET rtpm_flatbuffers)
  add_library(rtpm_flatbuffers INTERFACE IMPORTED GLOBAL)
  add_library(rtpm_flatbuffers_parser INTERFACE IMPORTED GLOBAL)
  set(candidates flatbuffers::flatbuffers flatbuffers flatbuffers::flatbuffers_shared flatbuffers_shared)
  if(BUILD_SHARED_LIBS OR RTPM_PYTHON)
    list(REVERSE candidates)  # Debian's static library can't be part of a shared one.
  endif()
  foreach(candidate ${candidates})
    if(TARGET ${candidate})
      target_link_libraries(rtpm_flatbuffers_parser INTERFACE ${candidate})
      target_include_directories(rtpm_flatbuffers INTERFACE
        $<TARGET_PROPERTY:${candidate},INTERFACE_INCLUDE_DIRECTORIES>)
      break()
    endif()
  endforeach()
endif()
