# Everything mapjoin needs. mapjoinConfig.cmake.in repeats this list for users of an installed tree:
# change both together.

# Debian and Ubuntu name the BLAS by its interface (libblas.so.3) and let the administrator choose
# the implementation. Asking for "Generic" takes that choice, which is OpenBLAS once
# scripts/setup.sh has run; the default search would prefer the slower ATLAS that comes with Ceres.
if(NOT DEFINED BLA_VENDOR)
  set(BLA_VENDOR Generic)
  find_package(LAPACK QUIET)
  if(NOT LAPACK_FOUND)
    unset(BLA_VENDOR)
  endif()
endif()
find_package(LAPACK REQUIRED)

find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
find_package(fmt REQUIRED)
# Ceres brings find modules and targets of its own for SuiteSparse and METIS; ours come after it and
# keep the targets that exist.
find_package(Ceres REQUIRED)
find_package(SuiteSparse REQUIRED COMPONENTS CHOLMOD AMD CAMD)
find_package(METIS REQUIRED)

if(MAPJOIN_WITH_TBB)
  find_package(TBB CONFIG QUIET)
  if(NOT TBB_FOUND)
    message(STATUS "mapjoin: oneTBB not found, joining on one thread")
  endif()
endif()

if(MAPJOIN_WITH_MATIO)
  find_package(MATIO REQUIRED)
endif()
