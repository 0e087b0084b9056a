# FlatBuffers as RTPM's zip for Windows has it, with which RTPM's libraries there were built.
include_guard(GLOBAL)
cmake_path(SET prefix NORMALIZE "${CMAKE_CURRENT_LIST_DIR}/../../..")
add_library(flatbuffers::flatbuffers STATIC IMPORTED)
set_target_properties(flatbuffers::flatbuffers PROPERTIES IMPORTED_LOCATION "${prefix}/lib/libflatbuffers.a"
  INTERFACE_INCLUDE_DIRECTORIES "${prefix}/include")
unset(prefix)
