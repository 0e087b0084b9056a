# RTPM's dependencies for Windows, cross-compiled. Debian has none of them for mingw-w64, so libsodium is
# built from the sources of its Debian package, which `./dev windows` fetches, and GoogleTest from
# /usr/src/googletest. Of the others RTPM uses the headers only.
set(RTPM_SODIUM_SOURCE "" CACHE PATH "A source folder of libsodium")
set(rtpm_dependencies "${CMAKE_BINARY_DIR}/dependencies")

# The headers of one package, out of /usr/include: with that folder in its path, the compiler would
# take Linux's headers for those of Windows.
function(rtpm_header_only target folder debian_package)
  if(NOT EXISTS "/usr/include/${folder}")
    message(FATAL_ERROR "There is no /usr/include/${folder}. Remedy: install the Debian package ${debian_package}.")
  endif()
  file(MAKE_DIRECTORY "${rtpm_dependencies}/include")
  file(CREATE_LINK "/usr/include/${folder}" "${rtpm_dependencies}/include/${folder}" SYMBOLIC)
  add_library(${target} INTERFACE IMPORTED GLOBAL)
  target_include_directories(${target} INTERFACE "${rtpm_dependencies}/include")
endfunction()
rtpm_header_only(rtpm_flatbuffers flatbuffers libflatbuffers-dev)
rtpm_header_only(nlohmann_json::nlohmann_json nlohmann nlohmann-json3-dev)
rtpm_header_only(CLI11::CLI11 CLI libcli11-dev)
rtpm_header_only(tomlplusplus::tomlplusplus toml++ libtomlplusplus-dev)
rtpm_header_only(Eigen3::Eigen eigen3 libeigen3-dev)
target_include_directories(Eigen3::Eigen INTERFACE "${rtpm_dependencies}/include/eigen3")
find_program(RTPM_FLATC flatc DOC "FlatBuffers' own compiler, which generates the data types")

# libsodium without its own build, which takes autoconf: its C with the instructions of SSE and AES, which it uses
# where the processor has them. AVX2 is left out: GCC aligns no stack for it on Windows (GCC bug 54412).
enable_language(C)
set(sodium "${RTPM_SODIUM_SOURCE}/src/libsodium")
if(NOT EXISTS "${sodium}/include/sodium.h")
  message(FATAL_ERROR "RTPM_SODIUM_SOURCE is \"${RTPM_SODIUM_SOURCE}\", and libsodium's sources are not there. "
                      "Remedy: ./dev windows, which fetches them.")
endif()
file(STRINGS "${RTPM_SODIUM_SOURCE}/configure.ac" numbers REGEX "^(AC_INIT|SODIUM_LIBRARY_VERSION_(MAJOR|MINOR)=)")
string(REGEX MATCH "\\[libsodium\\],\\[([0-9.]+)\\]" VERSION "${numbers}")
set(VERSION "${CMAKE_MATCH_1}")
string(REGEX MATCH "VERSION_MAJOR=([0-9]+)" SODIUM_LIBRARY_VERSION_MAJOR "${numbers}")
set(SODIUM_LIBRARY_VERSION_MAJOR "${CMAKE_MATCH_1}")
string(REGEX MATCH "VERSION_MINOR=([0-9]+)" SODIUM_LIBRARY_VERSION_MINOR "${numbers}")
set(SODIUM_LIBRARY_VERSION_MINOR "${CMAKE_MATCH_1}")
set(SODIUM_LIBRARY_MINIMAL_DEF "")
configure_file("${sodium}/include/sodium/version.h.in" "${rtpm_dependencies}/sodium/sodium/version.h" @ONLY)
# It includes the one beside it.
file(CREATE_LINK "${sodium}/include/sodium/export.h" "${rtpm_dependencies}/sodium/sodium/export.h" SYMBOLIC)
file(GLOB_RECURSE sodium_sources CONFIGURE_DEPENDS "${sodium}/*.c")
add_library(rtpm_sodium STATIC EXCLUDE_FROM_ALL ${sodium_sources})
# Its own sources include its headers without the folder sodium/.
target_include_directories(rtpm_sodium SYSTEM
  PUBLIC "${sodium}/include" "${rtpm_dependencies}/sodium"
  PRIVATE "${sodium}/include/sodium" "${rtpm_dependencies}/sodium/sodium")
target_compile_definitions(rtpm_sodium PUBLIC SODIUM_STATIC PRIVATE CONFIGURED=1 NATIVE_LITTLE_ENDIAN=1
  HAVE_TI_MODE=1 HAVE_CPUID=1 HAVE_EMMINTRIN_H=1 HAVE_TMMINTRIN_H=1 HAVE_SMMINTRIN_H=1 HAVE_WMMINTRIN_H=1)
target_compile_options(rtpm_sodium PRIVATE -O2 -w)
set_target_properties(rtpm_sodium PROPERTIES UNITY_BUILD OFF)
add_library(PkgConfig::libsodium ALIAS rtpm_sodium)

if(RTPM_BUILD_TESTS)
  if(NOT EXISTS /usr/src/googletest/CMakeLists.txt)
    message(FATAL_ERROR "There is no /usr/src/googletest. Remedy: install the Debian package googletest.")
  endif()
  block()
    set(BUILD_GMOCK OFF)
    set(INSTALL_GTEST OFF)
    add_subdirectory(/usr/src/googletest "${rtpm_dependencies}/googletest" EXCLUDE_FROM_ALL SYSTEM)
  endblock()
endif()
