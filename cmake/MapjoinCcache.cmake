# Compiles through ccache when it is there and nobody chose another launcher.

if(NOT MAPJOIN_IS_TOP_LEVEL OR DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
  return()
endif()

find_program(MAPJOIN_CCACHE ccache)
mark_as_advanced(MAPJOIN_CCACHE)
if(NOT MAPJOIN_CCACHE)
  return()
endif()

# Precompiled headers need the sloppiness; without it ccache passes every file on to the compiler.
# The base directory and no hashing of the working directory let two clones share what they built.
set(CMAKE_CXX_COMPILER_LAUNCHER
    "${CMAKE_COMMAND}" -E env
    "CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime"
    "CCACHE_BASEDIR=${PROJECT_SOURCE_DIR}"
    "CCACHE_NOHASHDIR=true"
    "${MAPJOIN_CCACHE}")
