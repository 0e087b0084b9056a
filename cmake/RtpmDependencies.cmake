# Every package RTPM takes from outside, in one place. A missing one is named with the Debian package that has it.
function(rtpm_require package debian_package)
  find_package(${package} ${ARGN} QUIET GLOBAL)
  if(NOT ${package}_FOUND)
    message(FATAL_ERROR "RTPM needs ${package}, which was not found. Remedy: ./dev setup, "
                        "or install the Debian package ${debian_package}.")
  endif()
endfunction()

find_package(Threads REQUIRED)

# FlatBuffers' exported target names differ between installations: the rest of the tree uses
# rtpm_flatbuffers (headers, for generated code) and rtpm_flatbuffers_parser (the library, for rtpmc).
rtpm_require(FlatBuffers libflatbuffers-dev CONFIG NAMES FlatBuffers Flatbuffers flatbuffers)
find_program(RTPM_FLATC flatc DOC "FlatBuffers' own compiler, which generates the data types")
if(NOT RTPM_FLATC)
  message(FATAL_ERROR "RTPM needs flatc, which was not found. Remedy: ./dev setup, "
                      "or install the Debian package flatbuffers-compiler.")
endif()
add_library(rtpm_flatbuffers INTERFACE)
add_library(rtpm_flatbuffers_parser INTERFACE)
foreach(candidate flatbuffers::flatbuffers flatbuffers flatbuffers::flatbuffers_shared flatbuffers_shared)
  if(TARGET ${candidate})
    target_link_libraries(rtpm_flatbuffers_parser INTERFACE ${candidate})
    target_include_directories(rtpm_flatbuffers SYSTEM INTERFACE
      $<TARGET_PROPERTY:${candidate},INTERFACE_INCLUDE_DIRECTORIES>)
    break()
  endif()
endforeach()

rtpm_require(Eigen3 libeigen3-dev NO_MODULE)
if(RTPM_BUILD_TESTS)
  rtpm_require(GTest libgtest-dev)
  rtpm_require(nlohmann_json nlohmann-json3-dev CONFIG)
endif()
if(RTPM_BUILD_BENCH)
  rtpm_require(benchmark libbenchmark-dev CONFIG)
endif()
