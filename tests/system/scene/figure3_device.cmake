# Builds the device server for Windows in FOLDER, where it is configured.
if(NOT EXISTS "${FOLDER}/build.ninja")
  message("[  SKIPPED ] the build for Windows is not prepared: ./dev test does that")
  return()
endif()
execute_process(COMMAND ${CMAKE_COMMAND} --build "${FOLDER}" --target rtpm-deviced RESULT_VARIABLE result)
if(NOT result EQUAL 0)
  message(FATAL_ERROR "the device does not build for Windows")
endif()
