# RTPM's dependencies for Windows, cross-compiled. Debian has zlib for mingw-w64. FlatBuffers, hidapi, libsodium, LZ4
# and Zstandard are built from the sources of their Debian packages, which `./dev windows` fetches, and GoogleTest from
# /usr/src/googletest. Of the others RTPM uses the headers only. What the users of RTPM's libraries link is installed
# with them, under the names that it has everywhere.
set(RTPM_FLATBUFFERS_SOURCE "" CACHE PATH "A source folder of FlatBuffers")
set(RTPM_HIDAPI_SOURCE "" CACHE PATH "A source folder of hidapi")
set(RTPM_LZ4_SOURCE "" CACHE PATH "A source folder of LZ4")
set(RTPM_SODIUM_SOURCE "" CACHE PATH "A source folder of libsodium")
set(RTPM_ZSTD_SOURCE "" CACHE PATH "A source folder of Zstandard")
set(rtpm_dependencies "${CMAKE_BINARY_DIR}/dependencies")

file(MAKE_DIRECTORY "${rtpm_dependencies}/asio")

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

enable_language(C)
function(rtpm_check_source variable file)
  if(NOT EXISTS "${${variable}}/${file}")
    message(FATAL_ERROR "${variable} is \"${${variable}}\", and there is no ${file} in it. "
                        "Remedy: ./dev windows, which fetches the sources.")
  endif()
endfunction()
rtpm_check_source(RTPM_FLATBUFFERS_SOURCE src/idl_parser.cpp)
rtpm_check_source(RTPM_HIDAPI_SOURCE windows/hid.c)
rtpm_check_source(RTPM_LZ4_SOURCE lib/lz4frame.c)
rtpm_check_source(RTPM_SODIUM_SOURCE src/libsodium/include/sodium.h)
rtpm_check_source(RTPM_ZSTD_SOURCE lib/zstd.h)

# The schema compiler's part of FlatBuffers, behind an imported target, as RTPM's own are exported without it.
add_library(rtpm_flatbuffers_library STATIC EXCLUDE_FROM_ALL
  "${RTPM_FLATBUFFERS_SOURCE}/src/idl_gen_text.cpp" "${RTPM_FLATBUFFERS_SOURCE}/src/idl_parser.cpp"
  "${RTPM_FLATBUFFERS_SOURCE}/src/reflection.cpp" "${RTPM_FLATBUFFERS_SOURCE}/src/util.cpp")
target_link_libraries(rtpm_flatbuffers_library PUBLIC rtpm_flatbuffers)
target_compile_options(rtpm_flatbuffers_library PRIVATE -O2 -w)
set_target_properties(rtpm_flatbuffers_library PROPERTIES OUTPUT_NAME flatbuffers)
add_library(rtpm_flatbuffers_parser INTERFACE IMPORTED GLOBAL)
target_link_libraries(rtpm_flatbuffers_parser INTERFACE rtpm_flatbuffers_library)

# What recordings are compressed by; zlib has the checksums, too.
file(GLOB zstd_sources CONFIGURE_DEPENDS "${RTPM_ZSTD_SOURCE}/lib/common/*.c"
  "${RTPM_ZSTD_SOURCE}/lib/compress/*.c" "${RTPM_ZSTD_SOURCE}/lib/decompress/*.c")
add_library(rtpm_zstd STATIC EXCLUDE_FROM_ALL ${zstd_sources})
target_include_directories(rtpm_zstd SYSTEM PUBLIC "${RTPM_ZSTD_SOURCE}/lib")
target_compile_definitions(rtpm_zstd PRIVATE ZSTD_DISABLE_ASM)
add_library(rtpm_lz4 STATIC EXCLUDE_FROM_ALL "${RTPM_LZ4_SOURCE}/lib/lz4.c"
  "${RTPM_LZ4_SOURCE}/lib/lz4frame.c" "${RTPM_LZ4_SOURCE}/lib/lz4hc.c" "${RTPM_LZ4_SOURCE}/lib/xxhash.c")
target_include_directories(rtpm_lz4 SYSTEM PUBLIC "${RTPM_LZ4_SOURCE}/lib")
# LZ4 has its hash under a name of its own, as Zstandard has one, too.
target_compile_definitions(rtpm_lz4 PRIVATE XXH_NAMESPACE=LZ4_)
add_library(rtpm_compression INTERFACE)
target_link_libraries(rtpm_compression INTERFACE rtpm_zstd rtpm_lz4 z)
add_library(PkgConfig::recording_libraries ALIAS rtpm_compression)
foreach(library zstd lz4)
  target_compile_options(rtpm_${library} PRIVATE -O2 -w)
  set_target_properties(rtpm_${library} PROPERTIES OUTPUT_NAME ${library} UNITY_BUILD OFF)
endforeach()

# libsodium without its own build, which takes autoconf: its C with the instructions of SSE and AES, which it uses
# where the processor has them. AVX2 is left out: GCC aligns no stack for it on Windows (GCC bug 54412).
set(sodium "${RTPM_SODIUM_SOURCE}/src/libsodium")
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
set_target_properties(rtpm_sodium PROPERTIES OUTPUT_NAME sodium UNITY_BUILD OFF)
add_library(PkgConfig::libsodium ALIAS rtpm_sodium)

# For rtpm-deviced alone, so it is not installed. It loads the system's hid.dll.
add_library(rtpm_hidapi STATIC EXCLUDE_FROM_ALL "${RTPM_HIDAPI_SOURCE}/windows/hid.c")
target_include_directories(rtpm_hidapi SYSTEM PUBLIC "${RTPM_HIDAPI_SOURCE}" PRIVATE "${RTPM_HIDAPI_SOURCE}/hidapi")
target_compile_options(rtpm_hidapi PRIVATE -O2 -w -UWIN32_LEAN_AND_MEAN)
set_target_properties(rtpm_hidapi PROPERTIES OUTPUT_NAME hidapi)
add_library(PkgConfig::hid_library ALIAS rtpm_hidapi)

if(RTPM_BUILD_TESTS)
  # Both are headers alone; tests find them here.
  foreach(folder asio boost)
    if(EXISTS "/usr/include/${folder}")
      file(CREATE_LINK "/usr/include/${folder}" "${rtpm_dependencies}/asio/${folder}" SYMBOLIC)
    endif()
  endforeach()
  if(NOT EXISTS /usr/src/googletest/CMakeLists.txt)
    message(FATAL_ERROR "There is no /usr/src/googletest. Remedy: install the Debian package googletest.")
  endif()
  block()
    set(BUILD_GMOCK OFF)
    set(INSTALL_GTEST OFF)
    add_subdirectory(/usr/src/googletest "${rtpm_dependencies}/googletest" EXCLUDE_FROM_ALL SYSTEM)
  endblock()
endif()

if(RTPM_INSTALL)
  # FlatBuffers' own compiler, with which a user's schemas become data types.
  file(GLOB flatc_sources CONFIGURE_DEPENDS "${RTPM_FLATBUFFERS_SOURCE}/src/*.cpp"
    "${RTPM_FLATBUFFERS_SOURCE}/grpc/src/compiler/*.cc")
  list(FILTER flatc_sources EXCLUDE REGEX "/(flathash|idl_gen_text|idl_parser|reflection|util)\\.cpp$")
  add_executable(rtpm_flatc ${flatc_sources})
  target_include_directories(rtpm_flatc PRIVATE "${RTPM_FLATBUFFERS_SOURCE}/include" "${RTPM_FLATBUFFERS_SOURCE}/grpc")
  target_compile_options(rtpm_flatc PRIVATE -w)
  target_link_libraries(rtpm_flatc PRIVATE rtpm_flatbuffers_library)
  set_target_properties(rtpm_flatc PROPERTIES OUTPUT_NAME flatc UNITY_BUILD OFF)
  install(TARGETS rtpm_flatc RUNTIME DESTINATION bin COMPONENT development OPTIONAL)
  install(TARGETS rtpm_flatbuffers_library rtpm_zstd rtpm_lz4 rtpm_sodium
    ARCHIVE DESTINATION lib COMPONENT development OPTIONAL)
  foreach(package cli11=libcli11-dev eigen=libeigen3-dev json=nlohmann-json3-dev tomlplusplus=libtomlplusplus-dev
      zlib=libz-mingw-w64-dev mingw=mingw-w64-common gcc=gcc-12-base)
    string(REGEX MATCH "^([^=]+)=(.+)$" matched "${package}")
    install(FILES "/usr/share/doc/${CMAKE_MATCH_2}/copyright" DESTINATION licences RENAME "${CMAKE_MATCH_1}.txt"
      COMPONENT programs OPTIONAL)
  endforeach()
  foreach(source FLATBUFFERS=LICENSE.txt HIDAPI=LICENSE-bsd.txt LZ4=lib/LICENSE SODIUM=LICENSE ZSTD=LICENSE)
    string(REGEX MATCH "^([^=]+)=(.+)$" matched "${source}")
    string(TOLOWER "${CMAKE_MATCH_1}" name)
    install(FILES "${RTPM_${CMAKE_MATCH_1}_SOURCE}/${CMAKE_MATCH_2}" DESTINATION licences RENAME "${name}.txt"
      COMPONENT programs)
  endforeach()
  install(FILES /usr/x86_64-w64-mingw32/lib/libz.a DESTINATION lib COMPONENT development)
  install(DIRECTORY /usr/include/flatbuffers DESTINATION include COMPONENT development)
  file(STRINGS "${RTPM_FLATBUFFERS_SOURCE}/include/flatbuffers/base.h" version
    REGEX "define FLATBUFFERS_VERSION_(MAJOR|MINOR|REVISION) ")
  string(REGEX MATCHALL "[0-9]+" version "${version}")
  list(JOIN version . RTPM_FLATBUFFERS_VERSION)
  include(CMakePackageConfigHelpers)
  write_basic_package_version_file("${rtpm_dependencies}/FlatBuffersConfigVersion.cmake"
    VERSION ${RTPM_FLATBUFFERS_VERSION} COMPATIBILITY ExactVersion)
  install(FILES "${CMAKE_CURRENT_LIST_DIR}/windows/FlatBuffersConfig.cmake"
    "${rtpm_dependencies}/FlatBuffersConfigVersion.cmake" DESTINATION lib/cmake/flatbuffers COMPONENT development)
endif()
