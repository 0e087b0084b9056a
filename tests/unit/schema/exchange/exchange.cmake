# Compiles generated code without warnings, and exchanges values with C++:
# cmake -DLANGUAGE=java|typescript -DRTPMC= -DEXCHANGE= -DROOT= -DSAMPLES= -DWORK= … -P exchange.cmake
# SAMPLES: the folder with what is generated for the goldens;
# java: -DJAVAC= -DJAVA=; typescript: -DNODE= -DPACKAGE=, the folder of the built npm package.
set(schema "${CMAKE_CURRENT_LIST_DIR}/exchange.fbs")
set(idl "${ROOT}/schema/idl")

function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    message(FATAL_ERROR "${output}\n${ARGV0} failed: ${result}")
  endif()
  message("${output}")
endfunction()

if((LANGUAGE STREQUAL java AND NOT (JAVAC AND JAVA)) OR
   (LANGUAGE STREQUAL typescript AND NOT (NODE AND EXISTS "${PACKAGE}/built")))
  message("[  SKIPPED ] needs openjdk-17-jdk-headless, or nodejs and the npm package of clients/typescript")
  return()
endif()

file(REMOVE_RECURSE "${WORK}")
file(MAKE_DIRECTORY "${WORK}/payloads")
run("${EXCHANGE}" encode "${schema}" "${idl}" "${CMAKE_CURRENT_LIST_DIR}/cases.txt" "${WORK}/payloads")
run("${RTPMC}" --emit "${LANGUAGE}" -o "${WORK}/generated" "${schema}")
file(COPY "${SAMPLES}/" DESTINATION "${WORK}/generated")

if(LANGUAGE STREQUAL java)
  set(client "${ROOT}/clients/java/src/main/java/org/rtpm")
  file(GLOB_RECURSE sources "${WORK}/generated/*.java" "${client}/values/*.java")
  set(quick -XX:TieredStopAtLevel=1 -XX:+UseSerialGC)
  list(TRANSFORM quick PREPEND -J OUTPUT_VARIABLE quick_javac)
  run("${JAVAC}" ${quick_javac} -Xlint:all -Werror --release 17 -encoding UTF-8 -d "${WORK}/classes" ${sources}
    "${client}/CallOptions.java" "${client}/Caller.java" "${CMAKE_CURRENT_LIST_DIR}/ExchangeValues.java")
  run("${JAVA}" ${quick} -cp "${WORK}/classes" ExchangeValues "${WORK}/payloads")
  run("${EXCHANGE}" compare "${schema}" "${idl}" "${WORK}/payloads" .java)
else()
  file(COPY "${CMAKE_CURRENT_LIST_DIR}/exchange_values.ts" DESTINATION "${WORK}/generated")
  file(GLOB sources "${WORK}/generated/*.ts")
  file(WRITE "${WORK}/package.json" "{\"type\": \"module\"}\n")
  file(MAKE_DIRECTORY "${WORK}/node_modules")
  file(CREATE_LINK "${PACKAGE}" "${WORK}/node_modules/rtpm" SYMBOLIC)
  run("${NODE}" "${PACKAGE}/node_modules/typescript/bin/tsc" --strict --skipLibCheck --noImplicitReturns
    --noUnusedLocals --noUnusedParameters --noUncheckedIndexedAccess --exactOptionalPropertyTypes
    --verbatimModuleSyntax --target ES2022 --module NodeNext --types node
    --typeRoots "${PACKAGE}/node_modules/@types" --outDir "${WORK}/compiled"
    ${sources})
  run("${NODE}" "${WORK}/compiled/exchange_values.js" "${WORK}/payloads")
  run("${EXCHANGE}" compare "${schema}" "${idl}" "${WORK}/payloads" .ts)
endif()
