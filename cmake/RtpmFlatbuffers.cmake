# FlatBuffers for RTPM's targets, in this tree and where RTPM is installed.
#
# Its exported target names differ between installations: RTPM uses rtpm_flatbuffers (the headers, for
# generated code) and rtpm_flatbuffers_parser (the library, for rtpmc). They are imported targets, so
# that RTPM's own can be exported without them. RTPM_FLATC is FlatBuffers' own compiler.
find_package(FlatBuffers CONFIG NAMES FlatBuffers Flatbuffers flatbuffers QUIET GLOBAL)
find_program(RTPM_FLATC flatc DOC "FlatBuffers' own compiler, which generates the data types")
if(FlatBuffers_FOUND AND NOT TARGET rtpm_flatbuffers)
  add_library(rtpm_flatbuffers INTERFACE IMPORTED GLOBAL)
  add_library(rtpm_flatbuffers_parser INTERFACE IMPORTED GLOBAL)
  foreach(candidate flatbuffers::flatbuffers flatbuffers flatbuffers::flatbuffers_shared flatbuffers_shared)
    if(TARGET ${candidate})
      target_link_libraries(rtpm_flatbuffers_parser INTERFACE ${candidate})
      target_include_directories(rtpm_flatbuffers INTERFACE
        $<TARGET_PROPERTY:${candidate},INTERFACE_INCLUDE_DIRECTORIES>)
      break()
    endif()
  endforeach()
endif()
