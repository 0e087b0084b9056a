# Every package RTPM takes from outside, in one place. A missing one is named with the Debian package that has it.
function(rtpm_require package debian_package)
  find_package(${package} ${ARGN} QUIET GLOBAL)
  if(NOT ${package}_FOUND)
    message(FATAL_ERROR "RTPM needs ${package}, which was not found. Remedy: ./dev setup, "
                        "or install the Debian package ${debian_package}.")
  endif()
endfunction()

find_package(Threads REQUIRED)

if(WIN32 AND CMAKE_CROSSCOMPILING)
  include(RtpmWindowsDependencies)
  return()
endif()

include(RtpmFlatbuffers)
if(RTPM_FLATBUFFERS_PROBLEM)
  message(FATAL_ERROR "${RTPM_FLATBUFFERS_PROBLEM}")
endif()

if(RTPM_BUILD_PROGRAMS)
  rtpm_require(Eigen3 libeigen3-dev NO_MODULE)
endif()
rtpm_require(CLI11 libcli11-dev CONFIG)
rtpm_require(tomlplusplus libtomlplusplus-dev CONFIG)
rtpm_require(nlohmann_json nlohmann-json3-dev CONFIG)
if(RTPM_BUILD_TESTS)
  rtpm_require(GTest libgtest-dev)
endif()
