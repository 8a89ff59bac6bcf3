#[[
Finds parts of SuiteSparse. The packages of Debian 12 and Ubuntu 22.04 carry no CMake files.

  find_package(SuiteSparse COMPONENTS CHOLMOD AMD CAMD)

defines for each component the imported target SuiteSparse::<component>, unless it exists already.
Any component works whose library is lib<component in lower case> and whose header is
<component in lower case>.h. Headers are found as <cholmod.h>.
]]

include(FindPackageHandleStandardArgs)

set(_suitesparse_required_variables)
foreach(_component IN LISTS SuiteSparse_FIND_COMPONENTS)
  string(TOLOWER "${_component}" _name)
  find_path(SuiteSparse_${_component}_INCLUDE_DIR NAMES ${_name}.h PATH_SUFFIXES suitesparse)
  find_library(SuiteSparse_${_component}_LIBRARY NAMES ${_name})
  mark_as_advanced(SuiteSparse_${_component}_INCLUDE_DIR SuiteSparse_${_component}_LIBRARY)

  if(SuiteSparse_${_component}_INCLUDE_DIR AND SuiteSparse_${_component}_LIBRARY)
    set(SuiteSparse_${_component}_FOUND TRUE)
    if(NOT TARGET SuiteSparse::${_component})
      add_library(SuiteSparse::${_component} UNKNOWN IMPORTED)
      set_target_properties(
        SuiteSparse::${_component}
        PROPERTIES IMPORTED_LOCATION "${SuiteSparse_${_component}_LIBRARY}"
                   INTERFACE_INCLUDE_DIRECTORIES "${SuiteSparse_${_component}_INCLUDE_DIR}")
    endif()
  else()
    set(SuiteSparse_${_component}_FOUND FALSE)
  endif()
  if(SuiteSparse_FIND_REQUIRED_${_component})
    list(APPEND _suitesparse_required_variables SuiteSparse_${_component}_LIBRARY
         SuiteSparse_${_component}_INCLUDE_DIR)
  endif()
endforeach()

find_package_handle_standard_args(
  SuiteSparse
  REQUIRED_VARS ${_suitesparse_required_variables}
  HANDLE_COMPONENTS
  REASON_FAILURE_MESSAGE "on Debian and Ubuntu: apt install libsuitesparse-dev")
