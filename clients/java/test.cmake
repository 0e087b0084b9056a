# Runs the tests of RTPM for Java. MVN, JAVAC, RTPMC: programs, of which RTPMC's folder has RTPM's
# others; WORK: the folder for what Maven builds.
if(NOT MVN OR NOT JAVAC)
  message("[  SKIPPED ] needs the Debian packages maven and openjdk-17-jdk-headless")
  return()
endif()
cmake_path(GET RTPMC PARENT_PATH programs)
set(command "${MVN}" --offline -q -B -f "${CMAKE_CURRENT_LIST_DIR}" "-Drtpm.build=${WORK}"
  "-Drtpm.rtpmc=${RTPMC}" "-Drtpm.programs=${programs}" test)
# Half of the CPU's time is the compilers', which do not run long enough for C2 to pay.
set(ENV{MAVEN_OPTS} "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC")
execute_process(COMMAND ${command} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
if(result EQUAL 0)
  return()
endif()
if(output MATCHES "offline mode|cannot be resolved|could not be resolved")
  message("[  SKIPPED ] Maven lacks packages: ./dev test fetches them")
  return()
endif()
message("${output}")
message(FATAL_ERROR "the tests of RTPM for Java failed")
