#[[
Finds METIS, the graph partitioner, and defines the imported target METIS::METIS, unless it exists
already. The Debian package carries no CMake files.
]]

include(FindPackageHandleStandardArgs)

find_path(METIS_INCLUDE_DIR NAMES metis.h)
find_library(METIS_LIBRARY_FILE NAMES metis)
mark_as_advanced(METIS_INCLUDE_DIR METIS_LIBRARY_FILE)

find_package_handle_standard_args(
  METIS
  REQUIRED_VARS METIS_LIBRARY_FILE METIS_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "on Debian and Ubuntu: apt install libmetis-dev")

if(METIS_FOUND AND NOT TARGET METIS::METIS)
  add_library(METIS::METIS UNKNOWN IMPORTED)
  set_target_properties(METIS::METIS PROPERTIES IMPORTED_LOCATION "${METIS_LIBRARY_FILE}"
                                                INTERFACE_INCLUDE_DIRECTORIES "${METIS_INCLUDE_DIR}")
endif()
