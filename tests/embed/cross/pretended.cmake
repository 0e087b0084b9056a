# A toolchain file for a machine that is this one, which CMake can't know: it cross-compiles.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR pretended)
