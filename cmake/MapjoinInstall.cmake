# Install rules: library, headers, program, and what find_package(mapjoin) needs.

include(CMakePackageConfigHelpers)

set(config_dir "${CMAKE_INSTALL_LIBDIR}/cmake/mapjoin")

install(TARGETS mapjoin EXPORT mapjoinTargets INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
if(MAPJOIN_BUILD_PROGRAM)
  # For a shared library, wherever the prefix is moved to.
  set_target_properties(mapjoin_program PROPERTIES INSTALL_RPATH
                                                   "$ORIGIN/../${CMAKE_INSTALL_LIBDIR}")
  install(TARGETS mapjoin_program)
endif()
install(
  DIRECTORY "${PROJECT_SOURCE_DIR}/src/"
  DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}/mapjoin"
  FILES_MATCHING
  PATTERN "*.h"
  PATTERN "cli" EXCLUDE)

install(EXPORT mapjoinTargets NAMESPACE mapjoin:: DESTINATION "${config_dir}")

# A static library hands its private dependencies on to whoever links it; a shared one does not.
get_target_property(type mapjoin TYPE)
string(COMPARE EQUAL "${type}" STATIC_LIBRARY MAPJOIN_IS_STATIC)
configure_package_config_file(
  "${PROJECT_SOURCE_DIR}/cmake/mapjoinConfig.cmake.in"
  "${PROJECT_BINARY_DIR}/mapjoinConfig.cmake"
  INSTALL_DESTINATION "${config_dir}"
  NO_SET_AND_CHECK_MACRO)
write_basic_package_version_file(
  "${PROJECT_BINARY_DIR}/mapjoinConfigVersion.cmake"
  VERSION "${PROJECT_VERSION}"
  COMPATIBILITY SameMinorVersion)
install(
  FILES "${PROJECT_BINARY_DIR}/mapjoinConfig.cmake"
        "${PROJECT_BINARY_DIR}/mapjoinConfigVersion.cmake"
        "${PROJECT_SOURCE_DIR}/cmake/FindSuiteSparse.cmake"
        "${PROJECT_SOURCE_DIR}/cmake/FindMETIS.cmake"
        "${PROJECT_SOURCE_DIR}/cmake/FindMATIO.cmake"
  DESTINATION "${config_dir}")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
