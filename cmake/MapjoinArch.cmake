# Turns MAPJOIN_ARCH into MAPJOIN_ARCH_FLAGS.
#
# auto picks one of the named x86-64 levels instead of -march=native, for two reasons. ccache hashes
# the flag, not the processor: "native" objects of one machine would be taken for those of
# another. And a named level says what a binary needs, where "native" is whatever happened to be
# there. Use MAPJOIN_ARCH=none for anything that is to be copied to other machines.

set(MAPJOIN_ARCH_FLAGS "")

if(MAPJOIN_ARCH STREQUAL "auto")
  if(NOT CMAKE_CROSSCOMPILING AND NOT DEFINED CACHE{MAPJOIN_CPU_LEVEL})
    try_run(run_result compiled "${PROJECT_BINARY_DIR}/cpu_level"
            "${CMAKE_CURRENT_LIST_DIR}/cpu_level.cpp")
    if(NOT compiled OR NOT run_result MATCHES "^[34]$")
      set(run_result 1)
    endif()
    set(MAPJOIN_CPU_LEVEL ${run_result} CACHE INTERNAL "x86-64 level of the build machine")
  endif()
  if(MAPJOIN_CPU_LEVEL MATCHES "^[34]$")
    include(CheckCXXCompilerFlag)
    set(flag "-march=x86-64-v${MAPJOIN_CPU_LEVEL}")
    check_cxx_compiler_flag("${flag}" MAPJOIN_COMPILER_KNOWS_CPU_LEVEL)
    if(MAPJOIN_COMPILER_KNOWS_CPU_LEVEL)
      set(MAPJOIN_ARCH_FLAGS "${flag}")
    endif()
  endif()
elseif(NOT MAPJOIN_ARCH STREQUAL "none")
  set(MAPJOIN_ARCH_FLAGS "-march=${MAPJOIN_ARCH}")
endif()

message(STATUS "mapjoin: instruction set flags: '${MAPJOIN_ARCH_FLAGS}'")
