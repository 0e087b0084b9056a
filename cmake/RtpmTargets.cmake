# The three kinds of target in this tree: a library of a floor, a program, a test.
include(GNUInstallDirs)

# What RTPM's own sources are compiled with; never part of what an embedder inherits.
add_library(rtpm_build_flags INTERFACE)
if(MSVC)
  # C5030: attributes of GCC.
  target_compile_options(rtpm_build_flags INTERFACE
    /W4 /wd5030 /permissive- /utf-8 /Zc:__cplusplus /Zc:preprocessor /EHsc /bigobj
    $<$<BOOL:${RTPM_WERROR}>:/WX>)
else()
  target_compile_options(rtpm_build_flags INTERFACE
    -Wall -Wextra -Wpedantic -Wshadow
    # Tests for Windows use sockets as on POSIX, whose types are others.
    "$<$<NOT:$<BOOL:$<TARGET_PROPERTY:RTPM_CONVERTS>>>:-Wconversion;-Wsign-conversion>" -Wnon-virtual-dtor
    -Wold-style-cast -Wcast-align -Woverloaded-virtual -Wimplicit-fallthrough
    $<$<BOOL:${RTPM_WERROR}>:-Werror>)
endif()
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 12.3)
  # Optimised, GCC 12 warns of its own std::string (GCC bug 105651).
  target_compile_options(rtpm_build_flags INTERFACE -Wno-restrict)
endif()
if(RTPM_SANITIZE)
  # Instrumented code leads these warnings of GCC astray, in its own <regex> for one (GCC bug 105562).
  target_compile_options(rtpm_build_flags INTERFACE -fsanitize=${RTPM_SANITIZE} -fno-omit-frame-pointer
    "$<$<CXX_COMPILER_ID:GNU>:-Wno-free-nonheap-object;-Wno-maybe-uninitialized;-Wno-stringop-overread>")
  target_link_options(rtpm_build_flags INTERFACE -fsanitize=${RTPM_SANITIZE})
endif()

# Tests are many programs, so the quickest linker there is; optimising across files takes the compiler's own.
find_program(RTPM_MOLD mold)
if(RTPM_MOLD AND NOT CMAKE_CROSSCOMPILING AND PROJECT_IS_TOP_LEVEL AND NOT RTPM_LTO AND NOT RTPM_SANITIZE)
  target_link_options(rtpm_build_flags INTERFACE -fuse-ld=mold)
endif()

if(RTPM_LTO)
  include(CheckIPOSupported)
  check_ipo_supported(RESULT is_lto_supported OUTPUT reason LANGUAGES CXX)
  if(is_lto_supported)
    set(CMAKE_INTERPROCEDURAL_OPTIMIZATION ON)
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # The archives are for people with other compilers, too, so they hold ordinary code besides. For
      # programs it would be made in vain, which takes a third of their time to compile.
      target_compile_options(rtpm_build_flags INTERFACE
        "$<$<NOT:$<STREQUAL:$<TARGET_PROPERTY:TYPE>,EXECUTABLE>>:-ffat-lto-objects>")
    endif()
  else()
    message(WARNING "RTPM_LTO: this compiler can't, so programs are linked without: ${reason}")
  endif()
endif()

if(PROJECT_IS_TOP_LEVEL)
  set(CMAKE_RUNTIME_OUTPUT_DIRECTORY "${CMAKE_BINARY_DIR}/bin")
endif()

# Precompiled headers: what most sources include anyhow, compiled once for libraries and once for tests.
# They hide a missing include, so the sanitizers' presets build without.
function(rtpm_precompile target)
  cmake_parse_arguments(PARSE_ARGV 1 A "" "" "HEADERS;LINK")
  file(WRITE "${CMAKE_BINARY_DIR}/${target}.cpp" "")
  add_library(${target} OBJECT EXCLUDE_FROM_ALL "${CMAKE_BINARY_DIR}/${target}.cpp")
  target_link_libraries(${target} PRIVATE ${A_LINK} rtpm_build_flags)
  target_compile_features(${target} PRIVATE cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_precompile_headers(${target} PRIVATE ${A_HEADERS})
endfunction()
if(RTPM_PRECOMPILED_HEADERS)
  set(rtpm_common_headers <algorithm> <array> <atomic> <charconv> <chrono> <cstdint> <cstring> <functional>
      <map> <memory> <mutex> <optional> <span> <string> <string_view> <utility> <vector>)
  rtpm_precompile(rtpm_library_headers HEADERS ${rtpm_common_headers})
  set_target_properties(rtpm_library_headers PROPERTIES POSITION_INDEPENDENT_CODE ON)
  if(RTPM_BUILD_TESTS)
    rtpm_precompile(rtpm_test_headers LINK GTest::gtest HEADERS ${rtpm_common_headers}
      <filesystem> <fstream> <random> <set> <sstream> <thread> <gtest/gtest.h>)
  endif()
endif()

# rtpm_compile_in_batches(target): with RTPM_UNITY, eight sources at a time, which parses what they include once.
# Not those for Windows, whose header has `interface` and other plain words as macros.
function(rtpm_compile_in_batches target)
  if(RTPM_UNITY)
    get_target_property(own ${target} SOURCES)
    list(FILTER own INCLUDE REGEX "os/windows/")
    set_source_files_properties(${own} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 8)
    # GCC takes a batch's sources for headers, where a type of an anonymous namespace would be a mistake.
    target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
  endif()
endfunction()

# rtpm_program_parts(target headers…): the sources of a program that waits for people, not for cycles.
# The headers, what most of them include of other libraries, are precompiled with the common ones.
option(RTPM_QUICK_PROGRAMS "Compile such programs without optimisation, which takes less time" OFF)
mark_as_advanced(RTPM_QUICK_PROGRAMS)
function(rtpm_program_parts target)
  rtpm_compile_in_batches(${target})
  if(RTPM_QUICK_PROGRAMS)
    target_compile_options(${target} PRIVATE -O0)
  endif()
  if(RTPM_PRECOMPILED_HEADERS)
    target_precompile_headers(${target} PRIVATE ${rtpm_common_headers} ${ARGN})
  endif()
endfunction()

# The folder in os/ of each part whose files are compiled. `portable` keeps to POSIX, for systems without one of
# their own; on Linux it shows what such a system would run.
option(RTPM_PORTABLE "Use nothing of Linux beyond POSIX" OFF)
if(WIN32)
  set(RTPM_SYSTEM windows)
elseif(RTPM_PORTABLE OR NOT CMAKE_SYSTEM_NAME STREQUAL "Linux")
  set(RTPM_SYSTEM portable)  # With some files of `darwin` in their place on macOS.
else()
  set(RTPM_SYSTEM linux)
endif()

# rtpm_library(NAME part [SOURCES …] [LINUX …] [PORTABLE …] [POSIX …] [DARWIN …] [WINDOWS …]
#   [PUBLIC targets…] [PRIVATE targets…] [NOT_INSTALLED])
# Makes rtpm_<part>, alias rtpm::<part>, with include/ public and src/ private. A library without sources is
# header-only. LINUX, PORTABLE and WINDOWS: the further sources for that system; POSIX: those of both LINUX and
# PORTABLE; DARWIN: those that macOS has in place of one of `portable`, of the same name. Where tests are built on
# Linux, rtpm_<part>_portable has those of `portable`, see rtpm_portable_test. NOT_INSTALLED: only programs of this
# tree use it. PUBLIC are the parts whose headers its own headers include: because a target sees only what it
# links, an include that points up a floor does not compile.
function(rtpm_library)
  cmake_parse_arguments(PARSE_ARGV 0 A "NOT_INSTALLED" "NAME"
    "SOURCES;LINUX;PORTABLE;POSIX;DARWIN;WINDOWS;PUBLIC;PRIVATE")
  if(A_UNPARSED_ARGUMENTS OR NOT A_NAME)
    message(FATAL_ERROR "rtpm_library: NAME is required and nothing unknown is taken; got '${ARGV}'")
  endif()
  set(target rtpm_${A_NAME})
  if(A_SOURCES)
    string(TOUPPER ${RTPM_SYSTEM} system)
    if(APPLE)
      foreach(file ${A_DARWIN})
        string(REPLACE /darwin/ /portable/ replaced ${file})
        list(TRANSFORM A_PORTABLE REPLACE "^${replaced}$" "${file}")
      endforeach()
    endif()
    set(own_sources ${A_SOURCES} ${A_${system}})
    if(NOT WIN32)
      list(APPEND own_sources ${A_POSIX})
    endif()
    add_library(${target} ${own_sources})  # Shared with BUILD_SHARED_LIBS.
    set_target_properties(${target} PROPERTIES
      VERSION ${rtpm_VERSION} SOVERSION ${rtpm_VERSION_MAJOR}.${rtpm_VERSION_MINOR})
    set(libraries ${target})
    if(WIN32)  # Headers in `portable` tell what neither system has.
      target_include_directories(${target} PRIVATE src/os/windows src/os/portable)
      # The libraries of others that it needs lie beside it.
      target_link_directories(${target} INTERFACE "$<INSTALL_INTERFACE:$<INSTALL_PREFIX>/${CMAKE_INSTALL_LIBDIR}>")
    else()
      target_include_directories(${target} PRIVATE src/os/${RTPM_SYSTEM} src/os/posix)
    endif()
    if(A_PORTABLE AND RTPM_BUILD_TESTS AND RTPM_SYSTEM STREQUAL "linux")
      add_library(${target}_portable STATIC EXCLUDE_FROM_ALL ${A_SOURCES} ${A_PORTABLE} ${A_POSIX})
      target_include_directories(${target}_portable PRIVATE src/os/portable src/os/posix)
      list(APPEND libraries ${target}_portable)
    endif()
    foreach(library ${libraries})
      target_include_directories(${library} PUBLIC "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
                                                   "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>"
                                            PRIVATE "${CMAKE_CURRENT_SOURCE_DIR}/src")
      target_compile_features(${library} PUBLIC cxx_std_20)
      target_link_libraries(${library} PUBLIC ${A_PUBLIC} PRIVATE ${A_PRIVATE} $<BUILD_INTERFACE:rtpm_build_flags>)
      set_target_properties(${library} PROPERTIES CXX_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)
      rtpm_compile_in_batches(${library})
      if(RTPM_PRECOMPILED_HEADERS)
        target_precompile_headers(${library} REUSE_FROM rtpm_library_headers)
      endif()
    endforeach()
  else()
    add_library(${target} INTERFACE)
    target_include_directories(${target} INTERFACE "$<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>"
                                                   "$<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>")
    target_compile_features(${target} INTERFACE cxx_std_20)
    target_link_libraries(${target} INTERFACE ${A_PUBLIC})
  endif()
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${A_NAME})
  add_library(rtpm::${A_NAME} ALIAS ${target})
  if(A_NOT_INSTALLED)
    return()
  endif()
  rtpm_install_library(${target} INCLUDE "${CMAKE_CURRENT_SOURCE_DIR}/include" NEEDS ${A_PUBLIC} ${A_PRIVATE})
endfunction()

# rtpm_program(NAME name SOURCES … LINK targets…): an executable in build/<preset>/bin, which ends with a
# sentence where it gets no memory or can't write its output.
function(rtpm_program)
  cmake_parse_arguments(PARSE_ARGV 0 A "" "NAME" "SOURCES;LINK")
  if(A_UNPARSED_ARGUMENTS OR NOT A_NAME OR NOT A_SOURCES)
    message(FATAL_ERROR "rtpm_program: NAME and SOURCES are required; got '${ARGV}'")
  endif()
  add_executable(${A_NAME} ${A_SOURCES})
  if(WIN32)
    target_sources(${A_NAME} PRIVATE "${PROJECT_SOURCE_DIR}/cmake/windows/program.rc")
  endif()
  target_link_libraries(${A_NAME} PRIVATE ${A_LINK} rtpm_every_program rtpm_build_flags)
  target_compile_features(${A_NAME} PRIVATE cxx_std_20)
  set_target_properties(${A_NAME} PROPERTIES CXX_EXTENSIONS OFF)
  rtpm_install_program(${A_NAME})
endfunction()

# rtpm_compiles_in_idle_time: before the command of a test that compiles. It takes the time that other tests leave,
# most of which wait; RESOURCE_LOCK idle_time: one at a time.
find_program(RTPM_CHRT chrt)
mark_as_advanced(RTPM_CHRT)
set(rtpm_compiles_in_idle_time "")
if(RTPM_CHRT)
  set(rtpm_compiles_in_idle_time "${RTPM_CHRT}" --idle 0)
endif()

# rtpm_test(NAME name SOURCES … LINK targets… LABEL unit|conformance|system|… [TIMEOUT seconds] [SERIAL]
#   [PROCESSES] [APART] [ALSO name=variable=value] [EXCEPT patterns…])
# A GoogleTest binary whose cases are each a ctest. SERIAL: cases take the machine for themselves.
# PROCESSES: they start processes, so one such case runs at a time, beside cases without.
# APART: its sources are not compiled in batches, as they use a name for several things.
# ALSO: they run once more, alone, as <name>.<case>, with this environment, behind the fixture <name>.
# EXCEPT: cases that Windows does not run.
function(rtpm_test)
  cmake_parse_arguments(PARSE_ARGV 0 A "SERIAL;PROCESSES;APART" "NAME;LABEL;TIMEOUT;ALSO" "SOURCES;LINK;EXCEPT")
  if(A_UNPARSED_ARGUMENTS OR NOT A_NAME OR NOT A_SOURCES OR NOT A_LABEL)
    message(FATAL_ERROR "rtpm_test: NAME, SOURCES and LABEL are required; got '${ARGV}'")
  endif()
  if(NOT A_TIMEOUT)
    set(A_TIMEOUT 60)
  endif()
  rtpm_program(NAME ${A_NAME} SOURCES ${A_SOURCES} LINK ${A_LINK} GTest::gtest_main)
  if(NOT A_APART)
    rtpm_compile_in_batches(${A_NAME})
  endif()
  if(RTPM_PRECOMPILED_HEADERS)
    target_precompile_headers(${A_NAME} REUSE_FROM rtpm_test_headers)
  endif()
  set(serial "")
  if(A_SERIAL)
    set(serial RUN_SERIAL TRUE)
  elseif(A_PROCESSES)
    # Started first: else many would be left when all others are done.
    set(serial RESOURCE_LOCK processes COST 100)
  endif()
  if(CMAKE_CROSSCOMPILING)
    # One ctest for all cases: a program takes a second to start under wine, and its first one minutes.
    math(EXPR A_TIMEOUT "10 * ${A_TIMEOUT}")
    set_target_properties(${A_NAME} PROPERTIES RTPM_CONVERTS ON)
    list(JOIN A_EXCEPT ":" except)
    add_test(NAME ${A_NAME} COMMAND ${A_NAME} --gtest_brief=1 "--gtest_filter=-${except}")
    set_tests_properties(${A_NAME} PROPERTIES LABELS "wine;${A_LABEL}" TIMEOUT ${A_TIMEOUT}
      ENVIRONMENT "RTPM_KEYS=${CMAKE_CURRENT_BINARY_DIR}/no-keys")
    return()
  endif()
  # An empty folder: no test depends on the keys and grants of the user who runs it.
  set(keys ENVIRONMENT_MODIFICATION "RTPM_KEYS=set:${CMAKE_CURRENT_BINARY_DIR}/no-keys")
  gtest_discover_tests(${A_NAME} TEST_PREFIX "${A_NAME}." DISCOVERY_MODE PRE_TEST
    PROPERTIES LABELS ${A_LABEL} TIMEOUT ${A_TIMEOUT} ${keys}
      SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]" ${serial})
  if(A_ALSO MATCHES "^([^=]+)=(.+)$")
    gtest_discover_tests(${A_NAME} TEST_PREFIX "${CMAKE_MATCH_1}." TEST_LIST "${CMAKE_MATCH_1}"
      DISCOVERY_MODE PRE_TEST PROPERTIES LABELS ${A_LABEL} TIMEOUT ${A_TIMEOUT} ENVIRONMENT "${CMAKE_MATCH_2}"
      FIXTURES_REQUIRED "${CMAKE_MATCH_1}" RUN_SERIAL TRUE ${keys} SKIP_REGULAR_EXPRESSION "\\[  SKIPPED \\]")
  endif()
endfunction()

# rtpm_portable_test(test [TIMEOUT seconds] [EXCEPT patterns…]): runs the test's cases once more, as portable.<test>,
# over the parts' portable sources in place of Linux's; without those that show what only Linux offers. Its objects
# are the same.
function(rtpm_portable_test test)
  cmake_parse_arguments(PARSE_ARGV 1 A "" "TIMEOUT" "EXCEPT")
  if(NOT RTPM_SYSTEM STREQUAL "linux" OR BUILD_SHARED_LIBS)
    return()
  elseif(CMAKE_VERSION VERSION_LESS 3.24)
    add_test(NAME portable.${test} COMMAND ${CMAKE_COMMAND} -E echo "[  SKIPPED ] needs CMake 3.24")
    set_tests_properties(portable.${test} PROPERTIES LABELS portable SKIP_REGULAR_EXPRESSION "SKIPPED")
    return()
  endif()
  if(NOT A_TIMEOUT)
    set(A_TIMEOUT 120)
  endif()
  add_executable(${test}_portable $<TARGET_OBJECTS:${test}>)
  get_target_property(libraries ${test} LINK_LIBRARIES)
  # First and whole, so that nothing is taken from the libraries that they replace.
  target_link_libraries(${test}_portable PRIVATE
    "$<LINK_LIBRARY:WHOLE_ARCHIVE,rtpm_transport_portable,rtpm_rt_portable>" ${libraries})
  set(filter "")
  if(A_EXCEPT)
    list(JOIN A_EXCEPT ":" filter)
    set(filter "--gtest_filter=-${filter}")
  endif()
  add_test(NAME portable.${test} COMMAND ${test}_portable --gtest_brief=1 ${filter})
  set_tests_properties(portable.${test} PROPERTIES LABELS portable TIMEOUT ${A_TIMEOUT}
    ENVIRONMENT_MODIFICATION "RTPM_KEYS=set:${CMAKE_CURRENT_BINARY_DIR}/no-keys")
endfunction()

# rtpm_python_checks(NAME name SOURCES folder… [TYPED folder…] [MYPY option…])
# Adds the tests name.format and name.lint of the sources, and name.mypy of those of TYPED, else of all.
function(rtpm_python_checks)
  cmake_parse_arguments(PARSE_ARGV 0 A "" "NAME" "SOURCES;TYPED;MYPY")
  if(NOT A_TYPED)
    set(A_TYPED ${A_SOURCES})
  endif()
  add_test(NAME ${A_NAME}.mypy COMMAND ${Python_EXECUTABLE} -B -m mypy --config-file "${rtpm_SOURCE_DIR}/pyproject.toml"
    --cache-dir "${CMAKE_BINARY_DIR}/mypy/${A_NAME}" ${A_MYPY} ${A_TYPED})
  add_test(NAME ${A_NAME}.format COMMAND ${Python_EXECUTABLE} -m ruff format --no-cache --check ${A_SOURCES})
  add_test(NAME ${A_NAME}.lint COMMAND ${Python_EXECUTABLE} -m ruff check --no-cache ${A_SOURCES})
  set_tests_properties(${A_NAME}.mypy ${A_NAME}.format ${A_NAME}.lint PROPERTIES LABELS python TIMEOUT 300)
endfunction()

# rtpm_npm_peer(test): gives a test the code of others in the folder `peer`, whose npm packages it
# installs by rtpm/test/npm_peer.hpp. A changed peer is installed anew.
function(rtpm_npm_peer test)
  set(content "")
  file(GLOB files CONFIGURE_DEPENDS peer/*)
  foreach(file ${files})
    file(SHA256 "${file}" hash)
    string(APPEND content ${hash})
  endforeach()
  string(SHA256 content "${content}")
  string(SUBSTRING ${content} 0 8 version)
  target_link_libraries(${test} PRIVATE rtpm::test_process nlohmann_json::nlohmann_json)
  target_compile_definitions(${test} PRIVATE
    RTPM_PEER_SOURCE="${CMAKE_CURRENT_SOURCE_DIR}/peer"
    RTPM_PEER="${CMAKE_CURRENT_BINARY_DIR}/peer-${version}")
endfunction()

if(RTPM_BUILD_TESTS)
  include(GoogleTest)
endif()
