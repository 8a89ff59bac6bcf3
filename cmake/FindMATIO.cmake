#[[
Finds matio, which reads MATLAB files, and defines the imported target MATIO::MATIO, unless it exists
already. The Debian package carries no CMake files.
]]

include(FindPackageHandleStandardArgs)

find_path(MATIO_INCLUDE_DIR NAMES matio.h)
find_library(MATIO_LIBRARY_FILE NAMES matio)
mark_as_advanced(MATIO_INCLUDE_DIR MATIO_LIBRARY_FILE)

find_package_handle_standard_args(
  MATIO
  REQUIRED_VARS MATIO_LIBRARY_FILE MATIO_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "on Debian and Ubuntu: apt install libmatio-dev")

if(MATIO_FOUND AND NOT TARGET MATIO::MATIO)
  add_library(MATIO::MATIO UNKNOWN IMPORTED)
  set_target_properties(MATIO::MATIO PROPERTIES IMPORTED_LOCATION "${MATIO_LIBRARY_FILE}"
                                                INTERFACE_INCLUDE_DIRECTORIES "${MATIO_INCLUDE_DIR}")
endif()
