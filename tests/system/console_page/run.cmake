# Runs the test in the build folder, or says why it can't:
# cmake -DNPM= -DNODE= -DTEST= -DSOURCE= -DWORK= -DINSTALL= -DPROGRAMS= -DSTROKE= -DPAGE=
#   -DTYPESCRIPT= -P run.cmake
cmake_minimum_required(VERSION 3.25)
if(NOT EXISTS "${PAGE}/index.html")
  message(NOTICE "SKIPPED: the page of rtpm-console is not built.")
  return()
endif()
if("${TEST}" STREQUAL "device" AND NOT EXISTS "${TYPESCRIPT}/built")
  message(NOTICE "SKIPPED: the TypeScript package is not built.")
  return()
endif()
find_program(CHROMIUM NAMES chromium chromium-browser google-chrome)
if(NOT CHROMIUM)
  message(NOTICE "SKIPPED: chromium is not installed.")
  return()
endif()
if("${SOURCE}/package-lock.json" IS_NEWER_THAN "${WORK}/installed")
  execute_process(COMMAND ${CMAKE_COMMAND} -DNPM=${NPM} -DSOURCE=${SOURCE} -DWORK=${WORK}
    -DSTEP=install -DFILES=package.json,package-lock.json,.npmrc -P "${INSTALL}")
endif()
if(NOT EXISTS "${WORK}/installed")
  message(NOTICE "SKIPPED: npm can't install playwright-core and axe-core.")
  return()
endif()
file(COPY "${SOURCE}/" DESTINATION "${WORK}" FILES_MATCHING PATTERN "*.mjs"
  PATTERN node_modules EXCLUDE)
file(REMOVE_RECURSE "${WORK}/scratch-${TEST}")
execute_process(COMMAND ${CMAKE_COMMAND} -E env "RTPM_PROGRAM_FOLDER=${PROGRAMS}"
    "RTPM_ARTEFACTS=${WORK}/screenshots" "RTPM_SCRATCH=${WORK}/scratch-${TEST}" "RTPM_STROKE=${STROKE}"
    "RTPM_CHROMIUM=${CHROMIUM}" "RTPM_PAGE=${PAGE}" "RTPM_TYPESCRIPT=${TYPESCRIPT}" "${NODE}" --test --test-reporter=spec ${TEST}.test.mjs
  WORKING_DIRECTORY "${WORK}" RESULT_VARIABLE code)
if(NOT code EQUAL 0)
  message(FATAL_ERROR "The page does not do what it should; see above.")
endif()
