# The installation: the libraries of the floors with their headers, rtpmc with its schemas, the programs, the
# CMake package, pkg-config files; for Windows a zip of them. Two components: `development` (all that another
# project builds with) and `programs`. Debian packages are made of it by debian/rules.
include(GNUInstallDirs)
include(RtpmPublicHeaders)
include(CMakePackageConfigHelpers)

set(RTPM_INSTALL_CMAKE_DIR "${CMAKE_INSTALL_LIBDIR}/cmake/rtpm")

# Whether the folder at hand is one whose targets others may use: tests and benchmarks are not.
function(rtpm_is_installed result)
  set(${result} FALSE PARENT_SCOPE)
  if(RTPM_INSTALL)
    file(RELATIVE_PATH folder "${rtpm_SOURCE_DIR}" "${CMAKE_CURRENT_SOURCE_DIR}")
    if(folder MATCHES "^(${ARGN})(/|$)")
      set(${result} TRUE PARENT_SCOPE)
    endif()
  endif()
endfunction()

# rtpm_install_library(target INCLUDE folder NEEDS targets… [HEADERS files…]): a floor's library, its
# headers and its pkg-config file. HEADERS instead of INCLUDE: generated ones.
function(rtpm_install_library target)
  cmake_parse_arguments(PARSE_ARGV 1 A "" "INCLUDE" "NEEDS;HEADERS")
  rtpm_is_installed(is_installed "schema|protocol|runtime|registry|gvd")
  if(NOT is_installed)
    return()
  endif()
  install(TARGETS ${target} EXPORT rtpm-targets
    ARCHIVE DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT development OPTIONAL
    LIBRARY DESTINATION "${CMAKE_INSTALL_LIBDIR}" COMPONENT development OPTIONAL)
  rtpm_is_expected(${target} development)
  set(include_folder "${CMAKE_INSTALL_INCLUDEDIR}")
  if(A_HEADERS)
    string(APPEND include_folder "/rtpm/idl")
    install(FILES ${A_HEADERS} DESTINATION "${include_folder}" COMPONENT development OPTIONAL)
  else()
    foreach(header IN LISTS RTPM_PUBLIC_HEADERS)
      if(EXISTS "${A_INCLUDE}/${header}")
        cmake_path(GET header PARENT_PATH folder)
        install(FILES "${A_INCLUDE}/${header}" DESTINATION "${include_folder}/${folder}" COMPONENT development)
      endif()
    endforeach()
  endif()
  if(NOT WIN32)
    rtpm_install_module(${target} "${include_folder}" ${A_NEEDS})
  endif()
endfunction()

# rtpm_install_module(target include_folder needs…): rtpm_names_idl has rtpm-names-idl.pc.
function(rtpm_install_module target include_folder)
  set(requires "")
  set(other_libraries "")
  set(is_module FALSE)
  foreach(need IN LISTS ARGN)
    if(need MATCHES "^rtpm(::|_)" AND NOT need MATCHES "flatbuffers")
      string(REGEX REPLACE "::|_" "-" need "${need}")
      list(APPEND requires "${need}")
    elseif(need MATCHES "PkgConfig::([A-Za-z0-9_.-]+)")
      # Named as its module, unless it has several: then it has no version.
      if(${CMAKE_MATCH_1}_VERSION)
        list(APPEND requires "${CMAKE_MATCH_1}")
        set(is_module TRUE)
      endif()
    elseif(need MATCHES "INSTALL_INTERFACE:(.+)>$" AND NOT is_module)
      string(REPLACE "$<SEMICOLON>" " -l" need "${CMAKE_MATCH_1}")
      string(APPEND other_libraries " -l${need}")
    elseif(need STREQUAL "rtpm_flatbuffers_parser")
      list(APPEND requires flatbuffers)
    endif()
  endforeach()
  list(JOIN requires ", " requires)
  string(REPLACE "_" "-" module "${target}")
  get_target_property(type ${target} TYPE)
  set(libraries "")
  if(NOT type STREQUAL "INTERFACE_LIBRARY")
    set(libraries "-L\${libdir} -l${target} -pthread${other_libraries}")
  endif()
  # Relative to itself, so that an unpacked package works wherever it lies.
  file(RELATIVE_PATH up "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/prefix")
  file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/${module}.pc"
"prefix=\${pcfiledir}/${up}
libdir=\${prefix}/${CMAKE_INSTALL_LIBDIR}
Name: ${module}
Description: ${rtpm_DESCRIPTION}
Version: ${rtpm_VERSION}
Requires: ${requires}
Libs: ${libraries}
Cflags: -I\${prefix}/${include_folder} -std=c++20
")
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/${module}.pc"
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig" COMPONENT development)
endfunction()

# rtpm_install_program(target): rtpmc, which others build with, and the programs of the upper floors.
function(rtpm_install_program target)
  rtpm_is_installed(is_tool "schema")
  rtpm_is_installed(is_program "registry|devices|clients")
  if(is_tool)
    install(TARGETS ${target} EXPORT rtpm-targets
      RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT development OPTIONAL)
    rtpm_is_expected(${target} development)
  elseif(is_program)
    install(TARGETS ${target}
      RUNTIME DESTINATION "${CMAKE_INSTALL_BINDIR}" COMPONENT programs OPTIONAL)
    rtpm_is_expected(${target} programs)
  endif()
endfunction()

# rtpm_is_expected(target component): of a build that is not complete, an installation says that the
# target is missing, and no package is made.
function(rtpm_is_expected target component)
  get_target_property(type ${target} TYPE)
  if(NOT type STREQUAL "INTERFACE_LIBRARY")
    set_property(GLOBAL APPEND PROPERTY RTPM_EXPECTED_${component} ${target})
  endif()
endfunction()

# Sets `result` to code that sets `missing` to the files of the component that are not built.
function(rtpm_missing_code component result)
  get_property(targets GLOBAL PROPERTY RTPM_EXPECTED_${component})
  set(code "set(missing \"\")\n")
  foreach(target IN LISTS targets)
    string(APPEND code "if(NOT EXISTS \"$<TARGET_FILE:${target}>\")\n"
      "  list(APPEND missing \"$<TARGET_FILE_NAME:${target}>\")\nendif()\n")
  endforeach()
  string(APPEND code "list(JOIN missing \", \" missing)\n")
  set(${result} "${code}" PARENT_SCOPE)
endfunction()

# rtpm.pc: all that a program with generated code needs, and where rtpmc and RTPM's schemas are.
function(rtpm_install_pkg_config)
  file(RELATIVE_PATH up "/prefix/${CMAKE_INSTALL_LIBDIR}/pkgconfig" "/prefix")
  file(WRITE "${CMAKE_CURRENT_BINARY_DIR}/rtpm.pc"
"prefix=\${pcfiledir}/${up}
rtpmc=\${prefix}/${CMAKE_INSTALL_BINDIR}/rtpmc
idldir=\${prefix}/${RTPM_INSTALL_IDL_DIR}
Name: rtpm
Description: ${rtpm_DESCRIPTION}
Version: ${rtpm_VERSION}
Requires: rtpm-events, rtpm-names, rtpm-rpc, rtpm-idl
")
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/rtpm.pc"
    DESTINATION "${CMAKE_INSTALL_LIBDIR}/pkgconfig" COMPONENT development)
endfunction()

# The CMake package, the schemas, and the archive; called once, last.
function(rtpm_install_package)
  set(RTPM_INSTALL_IDL_DIR "${CMAKE_INSTALL_DATADIR}/rtpm/idl")
  if(NOT WIN32)
    rtpm_install_pkg_config()
  endif()
  configure_package_config_file("${rtpm_SOURCE_DIR}/cmake/rtpm-config.cmake.in"
    "${CMAKE_CURRENT_BINARY_DIR}/rtpm-config.cmake"
    INSTALL_DESTINATION "${RTPM_INSTALL_CMAKE_DIR}"
    PATH_VARS RTPM_INSTALL_IDL_DIR)
  # Before 1.0.0 a minor version may break interfaces.
  write_basic_package_version_file("${CMAKE_CURRENT_BINARY_DIR}/rtpm-config-version.cmake"
    COMPATIBILITY SameMinorVersion)
  install(FILES "${CMAKE_CURRENT_BINARY_DIR}/rtpm-config.cmake"
    "${CMAKE_CURRENT_BINARY_DIR}/rtpm-config-version.cmake"
    "${rtpm_SOURCE_DIR}/cmake/RtpmFlatbuffers.cmake" "${rtpm_SOURCE_DIR}/cmake/RtpmGenerate.cmake"
    DESTINATION "${RTPM_INSTALL_CMAKE_DIR}" COMPONENT development)
  install(EXPORT rtpm-targets NAMESPACE rtpm:: DESTINATION "${RTPM_INSTALL_CMAKE_DIR}"
    COMPONENT development)
  file(GLOB schemas "${RTPM_IDL_DIR}/*.fbs")
  install(FILES ${schemas} DESTINATION "${RTPM_INSTALL_IDL_DIR}" COMPONENT development)
  set(package_code "cmake_minimum_required(VERSION 3.25)\n")
  foreach(component development programs)
    rtpm_missing_code(${component} code)
    install(CODE "${code}if(missing)\n  message(WARNING \"not installed, as not built: \${missing}. \"
      \"Remedy: build all, and install again.\")\nendif()" COMPONENT ${component})
    string(APPEND package_code "if(\"${component}\" IN_LIST CPACK_COMPONENTS_ALL)\n${code}if(missing)\n"
      "  message(FATAL_ERROR \"no package ${component} without what is not built: \${missing}. Remedy: build all.\")\n"
      "endif()\nendif()\n")
  endforeach()

  if(NOT PROJECT_IS_TOP_LEVEL)
    return()
  endif()
  # Making a package does not build: what is built is packed.
  set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY TRUE)
  set(CPACK_PACKAGE_NAME rtpm)
  set(CPACK_PACKAGE_VENDOR RTPM)
  set(CPACK_PACKAGE_CONTACT "RTPM <rtpm@localhost>")
  set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "${rtpm_DESCRIPTION}")
  set(CPACK_COMPONENTS_ALL development programs)
  if(WIN32)
    # All in one folder, wherever it is unpacked.
    set(CPACK_GENERATOR ZIP)
    set(CPACK_PACKAGE_FILE_NAME "rtpm-${rtpm_VERSION}-windows-x64")
    set(CPACK_STRIP_FILES ON)
    install(FILES "${rtpm_SOURCE_DIR}/docs/windows.md" DESTINATION . RENAME README.md COMPONENT programs)
    install(FILES "${rtpm_SOURCE_DIR}/LICENSE" DESTINATION . RENAME LICENSE.txt COMPONENT programs)
  else()
    set(CPACK_GENERATOR TGZ)
  endif()
  file(GENERATE OUTPUT "${CMAKE_CURRENT_BINARY_DIR}/rtpm-package-is-whole.cmake"
    CONTENT "${package_code}")
  set(CPACK_PRE_BUILD_SCRIPTS "${CMAKE_CURRENT_BINARY_DIR}/rtpm-package-is-whole.cmake")
  include(CPack)
endfunction()
