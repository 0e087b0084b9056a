# cmake -DPACKAGE=… -DPAGE=… -DSOURCE=… -P page.cmake: puts the web page beside the package rtpm.
if(NOT EXISTS "${PACKAGE}/src")
  message(NOTICE "The web page of the examples is left out: the TypeScript package is not built.")
  return()
endif()
file(REMOVE_RECURSE "${PAGE}")
file(COPY "${PACKAGE}/src" "${PACKAGE}/idl" DESTINATION "${PAGE}/rtpm")
file(COPY "${SOURCE}/web_page.html" "${SOURCE}/web_page.js" DESTINATION "${PAGE}")
file(TOUCH "${PAGE}/built")
